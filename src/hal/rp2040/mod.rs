//! The RP2040, on `embassy-rp`: its clocks, its time driver and its critical section. Registers are used through its
//! `pac` where pins are data of the board, or where an interrupt has to act before a task could.
//!
//! # Levels
//!
//! | priority | interrupt | file | does |
//! |---|---|---|---|
//! | - | PIO0, DMA channels 0 and 1 | `stepper` | step and direction pins, from words in RAM, without the CPU |
//! | - | PIO1 | `register` | outputs behind shift registers |
//! | 0 | IO_IRQ_BANK0, TIMER_IRQ_1 | `inputs`, `encoder` | samples the switches when one moves; takes the time of a pulse |
//! | 1 | UART0_IRQ, UART1_IRQ | `uart` | bytes between the line and the rings |
//! | 1 | SysTick | `time` | counts milliseconds |
//! | 2 | DMA_IRQ_0, PIO0_IRQ_0 | `stepper` | the feeder: runs the step generator ahead of time, and writes words |
//! | 2 | SWI_IRQ_2, USBCTRL_IRQ | `usb` | the tasks of USB: packets between the bus and the rings; a restart of its controller |
//! | 2 | TIMER_IRQ_0 | `embassy-rp` | wakes tasks whose time has come |
//! | 3 | SWI_IRQ_1 | [`avr_embassy::interrupt`] | polls the exec executor |
//! | thread | | [`avr_embassy::Executor`] | everything else |
//!
//! A critical section masks all these interrupts for some microseconds, because any of them may wake a task. Steps
//! are not affected.
//!
//! # When full or late
//!
//! - **Words** last for half a millisecond to one. If the feeder is later than that, all motors pause between two
//!   words; no step is lost or made twice.
//! - **A byte** that is not taken before the next one has come is lost, and marked ([`serial`](super::serial)).
//! - **Entries in buffers** at a stop are counted, not made into steps: see [`stepper::settle`].

#[path = "../host/arithmetic.rs"]
pub mod arithmetic;
pub mod card;
pub mod drivers;
mod early;
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
mod pieces;
pub mod pwm;
mod register;
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
use crate::hal::Boot;
pub use crate::hal::{exec, flags};

/// This chip, for the [contract](super::contract).
pub struct Chip;

/// Whether lines are blended.
pub fn blends() -> bool {
    true
}

/// Functions of [`System`](super::contract::System).
pub mod system {
    pub use super::blends;
    pub use super::usb::set_rests;
    pub use super::watchdog::{boot, reset};
}

/// Functions of [`Text`](super::primitives::Text).
pub mod text_functions {
    pub use super::text::copy_printing;
}

/// Sets up clocks, time and pins. First thing at start-up.
pub fn begin(boot: &Boot) {
    watchdog::begin(boot);
    let mut config = embassy_rp::config::Config::default();
    if let Ok(clocks) = ClockConfig::system_freq(ACTIVE.clock_hz) {
        config.clocks = clocks;
    }
    // Only the flash is taken from the peripherals, because pins and units are data of the board.
    let peripherals = embassy_rp::init(config);
    if clk_sys_freq() != ACTIVE.clock_hz {
        panic::halt();
    }
    vectors::move_to_ram(boot);
    SWI_IRQ_1.set_priority(Priority::P3);
    TIMER_IRQ_0.set_priority(Priority::P2);
    gpio::start(boot);
    card::start(boot);
    inputs::start(boot);
    heaters::start(boot);
    drivers::start(boot);
    eeprom::start(boot, peripherals.FLASH);
}

/// Starts the tick and the watchdog.
pub fn start(boot: &Boot) {
    time::start(boot);
    watchdog::start();
}
