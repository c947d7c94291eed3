//! The AVR image. On the host it only says what it is.
#![cfg_attr(target_arch = "avr", no_std, no_main)]
#![cfg_attr(target_arch = "avr", feature(abi_avr_interrupt))]

#[cfg(not(target_arch = "avr"))]
fn main() {
    println!("kerf {}: build the firmware with `cargo xtask build`", env!("CARGO_PKG_VERSION"));
}
