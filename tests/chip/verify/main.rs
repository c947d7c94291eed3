//! An image that tests a chip which nobody has tried yet, for `cargo xtask verify`. A host flashes it through the boot
//! loader and talks to it over USB; then it flashes Kerf. `cargo xtask examples` builds it, `tests/sim/tests/verify_chip.rs`
//! tries it on simulated boards.
//!
//! It runs on an ATmega2560 at 16 MHz. It polls, without interrupts, and all pins but the serial line's stay inputs, but for a second in `duty`. It
//! owns the whole chip: no task, no level, no ring. The serial line is USART0, 115,200 baud, 8N1. A command is a line
//! of at most 40 characters, ended by a line feed (carriage returns are ignored). Each answer is one line of words and
//! decimal numbers. A line that is too long, or is no command, is answered `?`, an empty one too. Numbers have at most
//! seven digits. While a command is carried out, the host must be silent, or bytes are lost.
//!
//! | command | answer | does |
//! |---|---|---|
//! | (after start) | `kerf-chip 1 atmega2560` | |
//! | `hello` | `kerf-chip 1 atmega2560` | |
//! | `ram` | `ram TESTED BAD FIRST` | tests RAM: `image/ram.rs` |
//! | `paint` | `paint COUNT` | fills with 0xC5 what `ram` tests, but initialised statics |
//! | `stack FROM` | `stack COUNT` | counts the bytes from an address on that still hold 0xC5 |
//! | `cells FROM COUNT` | `cells FROM COUNT BAD FIRST` | tests at most 64 cells of EEPROM: `image/cells.rs` |
//! | `count` | `count T0 T1 T2 T3 T4 T5` | counts with all timers until the next byte: `image/count.rs` |
//! | `rate BITS COUNT` | `rate DIVISOR`, `echo RECEIVED FRAMING OVERRUNS` | echoes at another rate: `image/echo.rs` |
//! | `volt` | `volt READING` | converts the reference of 1.1 V against the supply: `image/converter.rs` |
//! | `duty CHANNEL` | `duty R R R` | makes pulses of a quarter, a half, three quarters, and converts A5: `image/duty.rs` |
//! | `hang` | `hang` | hangs, so that the watchdog resets the chip in 250 ms |
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_arch = "avr")]
mod image;

#[cfg(not(target_arch = "avr"))]
fn main() {}
