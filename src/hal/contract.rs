//! What a chip has to provide: one trait for each of its parts. The traits say what each function does, in which
//! units, from which levels it may be called, and what it costs.
//!
//! Each chip is a folder beside `avr` and `host`, compiled under the name [`imp`]. The folder holds a module for each
//! trait with the functions of that trait, a type `Chip`, and, for an image, what `main` calls at start-up. The
//! compiler checks `Chip` against the traits: a function that is missing or has another type is an error here that
//! names the function. Everything outside `hal` calls the functions of the modules below ([`stepper`], [`uart`] and
//! so on) and cannot tell chips apart. The chip is fixed when the image is built, so a call through these modules
//! costs no more than a direct call.
//!
//! Arithmetic is in [`primitives`](super::primitives), memory that keeps its bytes without power in [`Keeps`] and
//! [`Memory`].
//!
//! Levels are those of [`avr_embassy`]; "exec" is interrupt mode. A function that belongs to a level takes its token:
//!
//! ```compile_fail,E0308
//! fn from_exec(exec: kerf::hal::Interrupt) {
//!     kerf::hal::uart::set_rate(exec, 0, 115_200);
//! }
//! ```
//!
//! ```compile_fail,E0308
//! fn from_thread_mode(thread: kerf::hal::Thread) {
//!     kerf::hal::stepper::go(thread);
//! }
//! ```
//!
//! Costs are cycles of the ATmega2560, given where a budget of ARCHITECTURE.md depends on them.

use super::imp;
use super::resets::Cause;
use super::segments::Segments;
use super::serial::{AllEnds, Flow};
use crate::boards::MOTORS;
use crate::dda::{Segment, Ticks};
use crate::drivers::REGISTERS;
use crate::drivers::watch::Watch;
use crate::encoder::Pulses;
use crate::hal::{Boot, Exclusive, Interrupt, Level, Thread};
use crate::realtime::Asked;
use crate::store::Memory;

/// Declares a trait, implements it for the chip by calling the chip's module, and declares a module of functions that
/// call the trait.
macro_rules! contract {
    ($(
        $(#[$about:meta])*
        trait $trait:ident in $module:ident {$(
            $(#[$says:meta])*
            fn $name:ident($($arg:ident: $type:ty),*) $(-> $result:ty)?;
        )+}
    )+) => {$(
        $(#[$about])*
        pub trait $trait {$(
            $(#[$says])*
            fn $name($($arg: $type),*) $(-> $result)?;
        )+}

        impl $trait for imp::Chip {$(
            #[inline(always)]
            fn $name($($arg: $type),*) $(-> $result)? {
                imp::$module::$name($($arg),*)
            }
        )+}

        $(#[$about])*
        pub mod $module {
            #[allow(unused_imports)]
            use super::*;
            $(
                $(#[$says])*
                #[inline(always)]
                pub fn $name($($arg: $type),*) $(-> $result)? {
                    <imp::Chip as $trait>::$name($($arg),*)
                }
            )+
        }
    )+};
}
pub(super) use contract;

contract! {
    /// The step timer and its interrupt, which owns the machine's only [`Dda`] and takes segments out of a ring.
    ///
    /// At each tick the interrupt does what [`Dda::tick`] does, without waiting. The ticks stop when a segment
    /// ends and the ring is empty.
    ///
    /// [`Dda`]: crate::dda::Dda
    /// [`Dda::tick`]: crate::dda::Dda::tick
    trait Stepper in stepper {
        /// Sets the timer up and returns the filling end of the segment ring, which belongs to exec. `None` after the
        /// first time.
        fn start(boot: &Boot) -> Option<Segments>;
        /// Starts the ticks if they have stopped. Exec calls it after it has queued a segment.
        fn go(exec: Interrupt);
        /// Stops the ticks at once, wherever the motors are; they stay stopped until [`release`](Stepper::release).
        /// Any level.
        fn stop();
        /// Whether [`stop`](Stepper::stop) has stopped the ticks and nothing has released them. Any level.
        fn is_stopped() -> bool;
        /// Allows ticks again after a stop. Call it when the motors have [settled](Stepper::settle).
        fn release(thread: Thread);
        /// Whether ticks are coming. Any level.
        fn running() -> bool;
        /// Returns how long the running segment still takes, in counts of the timer. May be more than that; `u32::MAX`
        /// if unknown. Cost: 40.
        fn left(exec: Interrupt) -> u32;
        /// Drops the rest of all segments after a stop, so that every motor stands where its last pulse has put it.
        /// `held` is the segment that would have come next after the queued ones. Subtracts the steps that were not
        /// made from `position`, in steps. Call it while no ticks come.
        fn settle(exec: Interrupt, held: Option<Segment>, position: &mut [i32; MOTORS]);
        /// Sets which direction pins are inverted: bit m for motor m. Call it while nothing runs.
        fn set_inverted(thread: Thread, motors: u8);
        /// Sets the width of a step pulse, in microseconds, and which step pins rest high (bit m for motor m). The
        /// values may change only while nothing runs.
        fn set_step_output(thread: Thread, pulse_us: u8, inverted: u8);
    }

    /// The serial ports by number, [`USB`](super::serial::USB) first, and their interrupts. The interrupts fill and
    /// empty the rings of [`super::serial`] and take real-time characters out of the stream.
    trait Uart in uart {
        /// Starts the lines, 8N1: USB at `rate` bits a second, the second port at the board's rate. `None` after the
        /// first time.
        fn start(thread: Thread, boot: &Boot, rate: u32) -> Option<AllEnds>;
        /// Changes the rate to `rate` bits a second. A byte that is on the line at that moment, in either direction,
        /// is spoilt.
        fn set_rate(thread: Thread, port: u8, rate: u32);
        /// Starts sending what the transmit ring holds. Exec calls it only on a port that is no bus.
        fn kick(level: Level, port: u8);
        /// Stops the sender or lets it go on, by the flow control that the two sides have agreed on. With `Flow::Pins`
        /// the receive interrupt also stops the sender. If `waits`, XOFF or XON may wait for the end of the line that
        /// is being sent.
        fn stop_sender(thread: Thread, port: u8, flow: Flow, stop: bool, waits: bool);
        /// Whether XOFF has stopped the sender, sent by thread mode or by [`stop_late`](Uart::stop_late).
        fn is_stopped(thread: Thread, port: u8) -> bool;
        /// Stops the sender of the second port by XOFF if its receive ring fills while thread mode has no turn. Exec
        /// never runs within an interrupt of a port. Cost: 12.
        fn stop_late(exec: Interrupt);
        /// Sets how the other side may stop this port's transmitter from now on.
        fn set_flow(thread: Thread, port: u8, flow: Flow);
        /// Sets whether `!`, `~`, `%` and bytes above 0x7F are plain text from now on.
        fn set_plain(thread: Thread, port: u8, plain: bool);
        /// Sends what CTS has held back if CTS allows it now, and XOFF or XON that has waited long enough. Called each
        /// millisecond.
        fn look(thread: Thread);
        /// Queues received bytes that found no room in the ring before. Called in each turn of the main loop, on a
        /// chip whose first port is its own USB.
        fn go_on(thread: Thread);
        /// Whether the chip notices when a program opens the first port. Only a chip with its own USB does. Any level.
        fn sees_opening() -> bool;
        /// Whether a program has opened the first port since the last call. The first opening after start-up does not
        /// count: that program reads the greeting of the start.
        /// [`Event::Realtime`](crate::hal::event::Event::Realtime) announces it.
        fn take_opened(thread: Thread) -> bool;
        /// Returns how often the first port's USB has been restarted since the start, because it hung; 255 for more.
        fn restarts(thread: Thread) -> u8;
        /// Returns in how many milliseconds USB has seen errors of its bus since the start, modulo 2^16.
        fn bus_errors(thread: Thread) -> u16;
        /// Returns how many line ends have been lost since start-up, modulo 2^16.
        fn lost_ends(thread: Thread, port: u8) -> u16;
        /// Returns how many bytes may come before one is lost, at most 254: one less than the receive ring has room
        /// for.
        fn room(thread: Thread, port: u8) -> u8;
        /// Whether half of the second port's receive ring is full. The other half lasts 3 ms, so a task with much to
        /// do then gives way to the reader.
        fn presses(thread: Thread) -> bool;
        /// Whether the reader has to have its turn before the next waiting line is carried out: see
        /// [`serial::calls_reader`](crate::hal::serial::calls_reader). On the second port any waiting byte is a
        /// reason. Cost: 70.
        fn calls_reader(thread: Thread) -> bool;
        /// Returns the slot of the receive ring that holds the newest byte; `None` if that byte has been read.
        fn newest(thread: Thread, port: u8) -> Option<u8>;
        /// Returns the slot of the mark that stands for the last `%` or `^d`; `None` if no such mark waits. Cost: 12
        /// for each byte that waits.
        fn last_cut(thread: Thread, port: u8) -> Option<u8>;
        /// Whether a `!` has come, on any port, that has not been taken yet. Any level.
        fn asks_hold() -> bool;
        /// Takes the override requests that characters have made since the last call.
        fn take_asked(thread: Thread, port: u8) -> Asked;
        /// Takes the real-time characters since the last call, as bits (see [`realtime`](crate::realtime)).
        fn take_realtime(thread: Thread, port: u8) -> u8;
    }

    /// Outputs: the enables of the drivers, and the outputs that a program switches.
    trait Gpio in gpio {
        /// Returns the motors whose drivers are on, as bits. Any level.
        fn powered() -> u8;
        /// Switches the drivers of these motors (bits) on and the others off, as far as the board can: an enable that
        /// all drivers share is on as soon as one of them is wanted.
        fn power(alone: Exclusive<'_>, motors: u8);
        /// Switches the outputs of M3 to M9, bits of [`outputs`](crate::boards::outputs). While the spindle is off,
        /// its direction pin keeps its level.
        fn set_outputs(alone: Exclusive<'_>, on: u8);
        /// Sets which outputs are active low, as bits, and switches to the outputs `on`. The first call also begins to
        /// drive the enable of the spindle.
        fn set_low(alone: Exclusive<'_>, outputs: u8, on: u8);
    }

    /// The switches, as bits of a word by their numbers in [`inputs`](crate::boards::inputs), and the sampling
    /// interrupt, which filters them.
    trait Inputs in inputs {
        /// Sets which inputs are active low, and which inputs stop the steps.
        fn set_up(thread: Thread, low: u16, stops: u16);
        /// Returns the inputs whose pins an encoder uses now ([`Sensors::set_up`]). They read as not active. Any
        /// level.
        fn left_out() -> u16;
        /// Sets the ends of axes that are not limits for now.
        fn spare(thread: Thread, ends: u8);
        /// Arms the end of a move: the first input of `armed` whose state becomes that in `awaited` ends the move
        /// ([`contact`](crate::dda::contact)). 0 disarms.
        fn arm(thread: Thread, armed: u16, awaited: u16);
        /// Returns the inputs that are active.
        fn worked(level: Level) -> u16;
        /// Takes the inputs that have stopped the steps since the last call.
        fn take_hits(thread: Thread) -> u16;
    }

    /// The sensors of the spindle, whose pulses are counted and timed. See [`crate::encoder`].
    trait Sensors in encoder {
        /// Sets which sensors are read from now on (bit 0 index, bit 1 sync, bit 2 the second sensor of sync), and for
        /// how many counts their contacts bounce: up to half of 2^16.
        fn set_up(thread: Thread, lines: u8, bounce: u16);
        /// Returns which sensors are read, as bits of [`Sensors::set_up`]; 0 without an encoder. Any level.
        fn in_use() -> u8;
        /// Returns the pulses counted and timed so far. Has to be called at least each 100 ms, or times become
        /// ambiguous. Any level. Cost: 300.
        fn read() -> Pulses;
        /// Returns the pulses at the pin of a counter that the firmware does not use itself, since the start, modulo
        /// 2^16. It counts in hardware, so it shows what comes out of a step pin that is connected with it. 0 on chips
        /// and images without one.
        fn at_counter(thread: Thread) -> u16;
    }

    /// The PWM output that controls the speed of the spindle.
    trait Pwm in pwm {
        /// Sets the frequency, in thousandths of a Hz. The duty cycle becomes 0 and has to be set again.
        fn set_frequency(alone: Exclusive<'_>, millihertz: u32);
        /// Sets the duty cycle, the part of the period for which the pin is high, in thousandths.
        fn set_share(alone: Exclusive<'_>, share: f32);
    }

    /// Heaters, their temperature sensors, and the fan, of boards that have them.
    trait Heaters in heaters {
        /// Begins a [reading](crate::heat::sensor) of a heater's sensor: 0 the hot end, 1 the bed. If a reading is
        /// already under way, it continues and none begins; it takes 4 ms at most. Cost: 30, and 60 cycles of an
        /// interrupt each 104 us.
        fn begin(thread: Thread, heater: u8);
        /// Returns the reading that was begun last; `None` until it is complete. Cost: 12.
        fn reading(thread: Thread) -> Option<u16>;
        /// Reads the word of a heater's MAX6675. `None` if the heater cannot have one, or while the SD card is
        /// selected. Cost: 500.
        fn word(thread: Thread, heater: u8) -> Option<u16>;
        /// Sets the power of the hot end, the bed and the fan; 255 is full power. Outputs that
        /// [`PULSED`](crate::boards::PULSED) names have pulses; the others are off at 0, else on. Cost: 60.
        fn drive(thread: Thread, power: [u8; 3]);
        /// Switches the fan of the heatbreak, on boards that have one.
        fn cool(thread: Thread, on: bool);
    }

    /// Stepper drivers that are set up by UART, of boards that have them.
    trait Drivers in drivers {
        /// Sets the registers of a motor's driver (0 is the first motor), in the order of [`drivers`](crate::drivers).
        /// A register whose value has changed is sent within 1 ms for each changed register before it; all registers
        /// are repeated in turn, for ever.
        fn tell(thread: Thread, motor: u8, values: &[u32; REGISTERS]);
        /// Returns what is known of a motor's driver.
        fn watch(thread: Thread, motor: u8) -> Watch;
        /// Takes the worst of the [news](crate::drivers::watch::news) of a motor's driver since the last call.
        fn take_news(thread: Thread, motor: u8) -> u8;
    }

    /// The lines of an SD card: SPI, and the pin that selects the card. On a chip without a card the input line reads
    /// high.
    trait Card in card {
        /// Selects the card. Nobody else uses SPI until [`release`](Card::release).
        fn select(thread: Thread);
        /// Deselects the card, then sends one more byte, during which the card releases the line.
        fn release(thread: Thread);
        /// Whether a sensor waits until the card is released. The sensor then gets its turn within 40 ms.
        fn is_wanted(thread: Thread) -> bool;
        /// Sets the clock: 4 MHz or more if `fast`, else 250 kHz, for a card that has not been initialized.
        fn set_fast(thread: Thread, fast: bool);
        /// Sends a byte and returns the byte received meanwhile. Cost: 60 at 4 MHz, 550 at 250 kHz.
        fn exchange(thread: Thread, byte: u8) -> u8;
        /// Reads a block. Cost: 25,000 (0.4 ms on the RP2040).
        fn read(thread: Thread, block: &mut [u8; 512]);
    }

    /// The count of milliseconds.
    trait Time in time {
        /// Returns the milliseconds since start-up, modulo 2^32. Any level. Cost: 24.
        fn millis() -> u32;
    }

    /// The watchdog, which resets a machine that hangs.
    trait Watchdog in watchdog {
        /// Returns why the machine has started. Any level.
        fn cause() -> Cause;
        /// Restarts the timeout of the watchdog. Any level.
        fn feed();
    }

    /// Restart and boot loader.
    trait System in system {
        /// Restarts the firmware, as if the reset button had been pressed. Does not return, except on the host, which
        /// only records it.
        fn reset(thread: Thread);
        /// Starts the boot loader, if the board has one; else acts as [`reset`](System::reset).
        fn boot(thread: Thread);
        /// Tells whether the machine rests. Only then a computer may restart it by a request of USB. Called every 20
        /// ms.
        fn set_rests(thread: Thread, rests: bool);
        /// Whether a chip that [can](Timing::STAGE) blends. On the host tests choose. Any level.
        fn blends() -> bool;
    }
}

/// Measured speeds of a chip, and sizes that its RAM has room for.
pub trait Timing {
    /// Counts of [`Segment::period`] in a second. A millisecond may be longer than the longest period.
    const TIMER_HZ: u32;
    /// Width of the step pulses with which [`Timing::TICKS`] is measured, us.
    const PULSE_US: u8;
    /// Tick times by the number of motors that move, less one.
    const TICKS: [Ticks; MOTORS];
    /// Shortest block with steps, s: twice the time that exec takes for it while the step interrupt is busy. At most
    /// 1/1,024.
    const BLOCK_S_MIN: f32 = 0.000_75;
    /// How long a sample of motion is, ms: see [`smooth`](crate::motion::smooth). 1, 2 or 4.
    const SAMPLE_MS: u8 = 4;
    /// The share of the step rate that chords and short blocks may use, because exec has much more to do there than in a
    /// long line: five eighths, or 1.
    const SHORT_SHARE: f32 = 0.625;
    /// Blocks that can wait to be [blended](crate::motion::blend) before they are queued: a power of two, or 0 for a chip
    /// that does not blend.
    const STAGE: usize = if cfg!(feature = "std") { 32 } else { 0 };
    /// The least time of a line that is blended, s.
    const BLEND_S_MIN: f32 = 0.0;
    /// Blocks that can wait at once, limited by RAM.
    const LOOK_AHEAD: usize = if cfg!(feature = "sd") && !cfg!(feature = "std") { 38 } else { 61 };
    /// Lines that can wait on a port. At most 9, because brief answers report with one digit how many more may come.
    const LINES: usize = 8;
    /// Bytes for all waiting lines: of USB, and of the second port.
    const LINE_BYTES: [usize; 2] = [412, 96];
}

/// [`Timing::TIMER_HZ`] of the chip of this image.
pub const TIMER_HZ: u32 = <imp::Chip as Timing>::TIMER_HZ;
/// [`Timing::PULSE_US`] of the chip of this image.
pub const PULSE_US: u8 = <imp::Chip as Timing>::PULSE_US;
/// [`Timing::BLOCK_S_MIN`] of the chip of this image.
pub const BLOCK_S_MIN: f32 = <imp::Chip as Timing>::BLOCK_S_MIN;
/// [`Timing::SAMPLE_MS`] of the chip of this image.
pub const SAMPLE_MS: u8 = <imp::Chip as Timing>::SAMPLE_MS;
/// [`Timing::SHORT_SHARE`] of the chip of this image.
pub const SHORT_SHARE: f32 = <imp::Chip as Timing>::SHORT_SHARE;
/// [`Timing::STAGE`] of the chip of this image.
pub const STAGE: usize = <imp::Chip as Timing>::STAGE;
/// [`Timing::BLEND_S_MIN`] of the chip of this image.
pub const BLEND_S_MIN: f32 = <imp::Chip as Timing>::BLEND_S_MIN;
/// [`Timing::LOOK_AHEAD`] of the chip of this image.
pub const LOOK_AHEAD: usize = <imp::Chip as Timing>::LOOK_AHEAD;
/// [`Timing::LINES`] of the chip of this image.
pub const LINES: usize = <imp::Chip as Timing>::LINES;
/// [`Timing::LINE_BYTES`] of the chip of this image.
pub const LINE_BYTES: [usize; 2] = <imp::Chip as Timing>::LINE_BYTES;
/// [`Timing::TICKS`] of the chip of this image. Index it in constants only: as a table it would take RAM.
pub const TICKS: [Ticks; MOTORS] = <imp::Chip as Timing>::TICKS;

/// Memory that keeps its bytes without power.
pub trait Keeps: Memory {
    /// Returns access. At most one task may write each part.
    fn of(thread: Thread) -> Self;
}

impl Keeps for imp::eeprom::Eeprom {
    fn of(thread: Thread) -> Self {
        imp::eeprom::Eeprom::of(thread)
    }
}

/// Memory that keeps its bytes without power: see [`Keeps`].
pub mod eeprom {
    pub use super::imp::eeprom::Eeprom;
}
