//! The simulated machine that Kerf is tested on.
//!
//! The firmware's ELF runs on simavr's CPU core, with peripherals of our own around it. They behave like the chip's
//! where that matters here: serial frames, FIFO depth and overruns, timer flags, the cost of entering an interrupt,
//! software interrupts. Time is counted in CPU cycles and is exactly repeatable.
//!
//! [`Machine`] is a [chip] on its board, and [`mechanics`] is what is built around the board. [`Host`] is a sender on
//! the serial line, [`oracle`] an independent reading of the same G-code, and [`job`] puts them all together.

pub mod bench;
mod bus;
pub mod by_name;
pub mod card;
pub mod chip;
mod counts;
mod cpu;
mod eeprom;
pub mod emulated;
mod flash;
mod host;
mod image;
pub mod job;
pub mod kinetics;
pub mod limits;
pub mod loader;
mod machine;
pub mod mechanics;
mod meters;
pub mod oracle;
pub mod pauses;
mod pins;
pub mod plot;
pub mod print;
pub mod protocol;
pub mod pty;
mod pulses;
mod recorder;
pub mod report;
mod runs;
#[path = "../../support/sd_image.rs"]
pub mod sd_image;
pub mod second;
mod speech;
pub mod spi;
mod stopwatch;
mod stuck;
mod summary;
pub mod thermal;
pub mod threads;
mod timer;
mod trace;
pub mod track;
mod uart;
#[path = "../../../web/src/windows.rs"]
mod windows;
mod wire;

pub use host::{Answered, Host, LINES_IN_FLIGHT};
pub use image::Image;
pub use loader::Loader;
pub use machine::{AUX, Fault, Machine, USB};
pub use meters::{Meters, Service, Window};
pub use pulses::Pulses;
pub use recorder::{Motor, Recorder, Step, Sums};
pub use runs::Runs;
pub use speech::Speech;
pub use stopwatch::{Cost, Stopwatch};
pub use trace::Trace;
pub use uart::Uart;
pub use wire::Wire;
