//! The RP2040, on `embassy-rp`: its clocks, time driver and critical section; registers by its `pac` where pins are data of the board, or where
//! an interrupt has to act before any task could.
//!
//! # Levels
//!
//! | priority | interrupt | file | does |
//! |---|---|---|---|
//! | - | PIO0, DMA channels 0 and 1 | `stepper` | step and direction pins, from words in RAM: no CPU |
//! | 0 | IO_IRQ_BANK0, TIMER_IRQ_1 | `inputs`, `encoder` | looks at the switches when one moves; takes the time of a pulse |
//! | 1 | UART0_IRQ, UART1_IRQ | `uart` | bytes between the line and the rings |
//! | 1 | SysTick | `time` | counts milliseconds |
//! | 2 | DMA_IRQ_0, PIO0_IRQ_0 | `stepper` | the feeder: runs the step generator ahead of time, and writes words |
//! | 2 | SWI_IRQ_2, USBCTRL_IRQ | `usb` | the tasks of USB: packets between the bus and the rings |
//! | 2 | TIMER_IRQ_0 | `embassy-rp` | wakes tasks whose time has come |
//! | 3 | SWI_IRQ_1 | [`avr_embassy::interrupt`] | polls the exec executor |
//! | thread | | [`avr_embassy::Executor`] | everything else |
//!
//! A critical section masks all of them for some microseconds: it may wake a task from any. Steps do not notice.
//!
//! # When full or late
//!
//! - **Words** last for half a millisecond to one. A feeder that comes later than that is a pause of all motors between two words: no step is lost, and
//!   none is doubled.
//! - **A byte** that is not taken within the time of the next one is lost, and marked ([`serial`](super::serial)).
//! - **What a stop finds** in buffers is counted, not made: see [`stepper::settle`].

#[path = "../host/arithmetic.rs"]
pub mod arithmetic;
#[path = "../host/card.rs"]
pub mod card;
pub mod drivers;
pub mod eeprom;
pub mod encoder;
#[path = "../host/flash.rs"]
pub mod flash;
pub mod float;
pub mod gpio;
pub mod heaters;
pub mod inputs;
mod last_words;
pub mod panic;
pub mod pwm;
pub mod stepper;
#[path = "../host/text.rs"]
pub mod text;
pub mod time;
mod timing;
pub mod uart;
mod usb;
mod vectors;
pub mod watchdog;

pub use avr_embassy::mask;

use embassy_rp::clocks::{ClockConfig, clk_sys_freq};
use embassy_rp::interrupt::{InterruptExt, Priority, SWI_IRQ_1, TIMER_IRQ_0};

use crate::boards::ACTIVE;
pub use crate::hal::{exec, flags};

/// This chip, for the [contract](super::contract).
pub struct Chip;

/// Functions of [`System`](super::contract::System).
pub mod system {
    pub use super::watchdog::{boot, reset};
}

/// Functions of [`Text`](super::primitives::Text).
pub mod text_functions {
    pub use super::text::copy_printing;
}

/// Clocks, time and pins. First thing at start-up.
pub fn begin() {
    watchdog::begin();
    let mut config = embassy_rp::config::Config::default();
    if let Ok(clocks) = ClockConfig::system_freq(ACTIVE.clock_hz) {
        config.clocks = clocks;
    }
    // Of these the flash alone is taken: pins and units are the board's data.
    let peripherals = embassy_rp::init(config);
    if clk_sys_freq() != ACTIVE.clock_hz {
        panic::halt();
    }
    vectors::move_to_ram();
    SWI_IRQ_1.set_priority(Priority::P3);
    TIMER_IRQ_0.set_priority(Priority::P2);
    gpio::start();
    inputs::start();
    heaters::start();
    drivers::start();
    eeprom::start(peripherals.FLASH);
}

/// Starts what counts time. Interrupts are off.
pub fn start() {
    time::start();
    watchdog::start();
}
