//! The chips: the addresses of their registers, and the vectors that the runtime takes. Nothing else differs between
//! chips.
//!
//! A chip is one file with these names:
//!
//! | name | what it is |
//! |---|---|
//! | `FLAGS` | I/O address (as `sbi` and `in` count) of the register of the event bits; below 0x20, so that `sbi` reaches it |
//! | `PEND` | data address of the register with which the software interrupt is raised and withdrawn |
//! | `PENDED`, `WITHDRAWN` | the values of that register for the two |
//! | `SMCR`, `SLEEP_IDLE` | data address of the sleep register, and its value for idle sleep, enabled |
//! | `TCCRA`, `TCCRB`, `OCRA`, `TIMSK` | data addresses of the 8-bit timer of the tick |
//! | `PRESCALERS` | the codes of the timer's clock select, each with the cycles of a count, rising |
//! | `handlers!` | makes the handlers, by the numbers of their vectors: those of the tick and of the software interrupt |

/// Gives the runtime's two handlers the names that the start-up code's vector table refers to.
macro_rules! handlers {
    (tick: $tick:ident, software: $software:ident) => {
        #[unsafe(no_mangle)]
        extern "C" fn $tick() -> ! {
            // SAFETY: the hardware calls it.
            unsafe { crate::time::handler() }
        }

        #[unsafe(no_mangle)]
        extern "C" fn $software() -> ! {
            // SAFETY: the hardware calls it.
            unsafe { crate::interrupt::handler() }
        }

        /// Does nothing. The code that starts the tick or the interrupt executor calls it, so that a linker without LTO
        /// links the handlers, which are in the object file of this function. With LTO the call vanishes.
        #[inline(never)]
        pub fn link() {}
    };
}
#[cfg(feature = "atmega2560")]
mod atmega2560;
#[cfg(feature = "atmega2560")]
pub use atmega2560::*;

#[cfg(all(feature = "atmega1284p", not(feature = "atmega2560")))]
mod atmega1284p;
#[cfg(all(feature = "atmega1284p", not(feature = "atmega2560")))]
pub use atmega1284p::*;

#[cfg(not(feature = "_chip"))]
compile_error!(
    "avr-embassy does not know the chip: enable one of its features, such as `atmega2560`"
);
#[cfg(all(feature = "atmega1284p", feature = "atmega2560"))]
compile_error!("avr-embassy is for one chip: enable one of its features for chips, not several");
