//! What a chip has to have: a trait for each part of it, which says what its functions do, in which units, at which level they may be called, and
//! what they cost.
//!
//! A chip is a folder beside `avr` and `host`, under the name [`imp`]: a module for each trait with the functions of the trait, a type
//! `Chip`, and for an image what `main` calls at start-up. The compiler holds it against the traits: a function that is missing, or of
//! another type, is an error here that names it. Everything outside `hal` calls the functions of the modules below, [`stepper`],
//! [`uart`] and so on; it cannot tell chips apart. Which chip it is, is known when the image is built, so that a call costs what it
//! costs without the trait.
//!
//! Arithmetic is in [`primitives`](super::primitives), memory without power in [`Memory`].
//!
//! Levels are those of [`avr_embassy`]; "exec" is interrupt mode. Costs are cycles of the ATmega2560, and said where a budget of
//! ARCHITECTURE.md hangs on them.

use super::imp;
use super::resets::Cause;
use super::ring::Producer;
use super::serial::{AllEnds, Flow};
use crate::boards::MOTORS;
use crate::dda::{Dda, SEGMENTS, Segment, Ticks};
use crate::drivers::REGISTERS;
use crate::encoder::Pulses;
use crate::realtime::Asked;
use crate::store::Memory;

/// Declares a trait, makes the chip's module have it, and makes a module of functions that call it.
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
    /// The step timer and its interrupt, which has the one [`Dda`] of the machine and takes segments out of a ring.
    ///
    /// The interrupt does at each tick what [`Dda::tick`] does, and waits for nobody. When the ring is empty at the end of a segment the
    /// ticks stop.
    trait Stepper in stepper {
        /// Sets the timer up; the end of the ring is exec's. Start-up, before interrupts are on; `None` after the first time.
        fn start() -> Option<Producer<Segment, SEGMENTS>>;
        /// Starts the ticks if they have stopped. Exec, after it has queued a segment.
        fn go();
        /// Stops the ticks at once and until [`release`](Stepper::release), wherever the motors are. Any level.
        fn stop();
        /// Whether they have been stopped. Any level.
        fn is_stopped() -> bool;
        /// Ticks may come again. Thread mode, when the motors have [settled](Stepper::settle).
        fn release();
        /// Whether ticks are coming. Any level.
        fn running() -> bool;
        /// How long the segment that runs takes yet, in counts of the timer, or more; `u32::MAX` where that is not known. Exec. Cost: 40.
        fn left() -> u32;
        /// Every motor is where its last pulse has put it; nothing is left of the segments, of which `held` would have come first after those
        /// that are queued. What they lack is taken off `position`, in steps. Exec, while no ticks come.
        fn settle(held: Option<Segment>, position: &mut [i32; MOTORS]);
        /// Where the generator is right now, between two ticks, and the slot of its segment. The sampling interrupt, which holds exec off.
        fn moment() -> (Dda, u8);
        /// Which direction pins are inverted: bit m for motor m. Thread mode, while nothing runs.
        fn set_inverted(motors: u8);
        /// How wide a step pulse is, in microseconds, and which step pins rest high (bit m for motor m). Thread mode; a change only while
        /// nothing runs.
        fn set_step_output(pulse_us: u8, inverted: u8);
    }

    /// The serial ports by number, [`USB`](super::serial::USB) first, and their interrupts, which fill and empty the rings of [`super::serial`] and take
    /// real-time characters out.
    trait Uart in uart {
        /// Starts the lines, 8N1: USB at `rate` bits a second, the other at the board's. Start-up, before interrupts are on; `None` after the
        /// first time.
        fn start(rate: u32) -> Option<AllEnds>;
        /// Goes on at `rate` bits a second. A byte on the line meanwhile, in either direction, is spoilt. Thread mode.
        fn set_rate(port: u8, rate: u32);
        /// Sends what the ring holds. Thread mode, or exec on a port that is no bus.
        fn kick(port: u8);
        /// Stops the sender, or lets it go on, in the way they have agreed upon; by a pin the receive interrupt does so too. A character may
        /// wait for the end of a line if it `waits`. Thread mode.
        fn stop_sender(port: u8, flow: Flow, stop: bool, waits: bool);
        /// Whether the sender has been stopped by XOFF, by thread mode or by [`stop_late`](Uart::stop_late). Thread mode.
        fn is_stopped(port: u8) -> bool;
        /// Stops the sender of the second port by XOFF if its ring fills while thread mode has no turn. Exec, which never runs within an interrupt of
        /// a port. Cost: 12.
        fn stop_late();
        /// How the other side may hold it back from now on. Thread mode.
        fn set_flow(port: u8, flow: Flow);
        /// Whether `!`, `~`, `%` and bytes above 0x7F are text, from now on. Thread mode.
        fn set_plain(port: u8, plain: bool);
        /// Sends on what CTS has held back, and XOFF or XON that has waited for long enough. Thread mode, each millisecond.
        fn look();
        /// Queues what has come and had no room. Thread mode, each turn of the main loop on a chip whose first port is its own USB.
        fn go_on();
        /// Whether the chip sees that a program opens the first port: by its own USB. Any level.
        fn sees_opening() -> bool;
        /// Whether a program has opened the first port since the last call, but for the first one, which hears the greeting of the start. It
        /// comes with [`Event::Realtime`](crate::hal::event::Event::Realtime). Thread mode.
        fn take_opened() -> bool;
        /// Whether the program that had the first port open has closed it since the last call, and none has opened it since. It comes with
        /// [`Event::Received`](crate::hal::event::Event::Received). Thread mode.
        fn take_closed() -> bool;
        /// Line ends lost since start-up, modulo 2^16. Thread mode.
        fn lost_ends(port: u8) -> u16;
        /// Bytes that may come before any is lost, at most 254: one less than the receive ring has room for. Thread mode.
        fn room(port: u8) -> u8;
        /// Whether half of the second port's receive ring is full: the other half lasts 3 ms, so that whoever has much to do gives way to the
        /// reader. Thread mode.
        fn presses() -> bool;
        /// Whether the reader is to have its turn before a line that waits is carried out
        /// ([`serial::calls_reader`](crate::hal::serial::calls_reader)); on the second port any byte says so. Thread mode. Cost: 70.
        fn calls_reader() -> bool;
        /// The slot of the receive ring with the byte that came last, if it still waits there. Thread mode.
        fn newest(port: u8) -> Option<u8>;
        /// The slot of the mark that stands for the last `%` or `^d`, if it has not been read. Thread mode. Cost: 12 a byte that waits.
        fn last_cut(port: u8) -> Option<u8>;
        /// Whether an exclamation mark has come that nobody has taken yet, on any port. Any level.
        fn asks_hold() -> bool;
        /// What characters have asked of overrides since the last call. Thread mode.
        fn take_asked(port: u8) -> Asked;
        /// The real-time characters since the last call, as bits (see [`realtime`](crate::realtime)). Thread mode.
        fn take_realtime(port: u8) -> u8;
    }

    /// Outputs: drivers' enables, and what a program switches.
    trait Gpio in gpio {
        /// The motors whose drivers are on, as bits. Thread mode and exec.
        fn powered() -> u8;
        /// Switches the drivers of these motors (bits) on, and the others off as far as the board can: an enable that all drivers share is
        /// on for any of them. Exec, or while it cannot run.
        fn power(motors: u8);
        /// Switches the outputs of M3 to M9, bits of [`outputs`](crate::boards::outputs). The direction of a spindle that is off stays as
        /// it is. Exec, or while it cannot run.
        fn set_outputs(on: u8);
        /// Which outputs are on when they are low, as bits, and which are on. From the first time on the spindle's enable is driven. Thread mode,
        /// while exec cannot run.
        fn set_low(outputs: u8, on: u8);
    }

    /// Switches by their numbers in [`inputs`](crate::boards::inputs), as bits of a word, and the sampling interrupt, which filters them.
    trait Inputs in inputs {
        /// Which inputs are worked when low, and which of them stop the steps. Thread mode.
        fn set_up(low: u16, stops: u16);
        /// The inputs whose pins are an encoder's for now ([`Sensors::set_up`]): they look as if not worked. Thread mode.
        fn left_out() -> u16;
        /// These ends are no limits for now. Thread mode.
        fn spare(ends: u8);
        /// Has the first of the inputs `armed` that comes to be as in `awaited` end the move ([`contact`](crate::dda::contact)); none if `armed`
        /// is 0. Thread mode.
        fn arm(armed: u16, awaited: u16);
        /// The inputs that are worked. Thread mode.
        fn worked() -> u16;
        /// What has stopped the steps since the last call. Thread mode.
        fn take_hits() -> u16;
    }

    /// The sensors of the spindle, whose pulses are counted and timed. See [`crate::encoder`].
    trait Sensors in encoder {
        /// The sensors `lines` are read from now on (bit 0 index, bit 1 sync, bit 2 the second one of sync), whose contacts bounce for so many counts, up to half of 2^16.
        /// Thread mode.
        fn set_up(lines: u8, bounce: u16);
        /// Whether any is read. Any level.
        fn is_set_up() -> bool;
        /// What they have seen so far. At least each 100 ms, or times cannot be told. Thread mode and exec. Cost: 300.
        fn read() -> Pulses;
    }

    /// The pulses whose width says how fast the spindle is to turn.
    trait Pwm in pwm {
        /// Sets the frequency, in thousandths of a Hz. The share has to be set again; until then it is 0. Thread mode.
        fn set_frequency(millihertz: u32);
        /// Sets what part of the period the pin is high, in thousandths. Exec, or while it cannot run.
        fn set_share(share: f32);
    }

    /// Heaters, the sensors of their temperature, and the fan; of boards that have them.
    trait Heaters in heaters {
        /// Begins a [reading](crate::heat::sensor) of a heater's sensor: 0 the hot end, 1 the bed. One that is under way goes on instead: it
        /// takes 4 ms at most. Thread mode. Cost: 30, and 60 cycles of an interrupt each 104 us.
        fn begin(heater: u8);
        /// The reading that has been begun last, if it is complete. Thread mode. Cost: 12.
        fn reading() -> Option<u16>;
        /// What the MAX6675 of a heater sends, where it may have one and no card is spoken to: its reading. Thread mode. Cost: 500.
        fn word(heater: u8) -> Option<u16>;
        /// Gives the hot end, the bed and the fan their power, 255 for all: pulses where [`PULSED`](crate::boards::PULSED) says so, elsewhere
        /// on or, with 0, off. Thread mode. Cost: 60.
        fn drive(power: [u8; 3]);
    }

    /// Stepper drivers that are told by UART; of boards that have them.
    trait Drivers in drivers {
        /// What the registers of a motor's driver, 0 the first, are to be from now on, in the order of [`drivers`](crate::drivers). Each that is
        /// another than before is sent within a millisecond for each that waits before it; all of them again and again. Thread mode.
        fn tell(motor: u8, values: &[u32; REGISTERS]);
    }

    /// The lines of an SD card: SPI, and the pin that selects it. On a chip without one a line that nobody drives is high.
    trait Card in card {
        /// Selects the card: nobody else is spoken to until it is let go. Thread mode.
        fn select();
        /// Lets the card go, with a byte more in which it lets go of the line. Thread mode.
        fn release();
        /// Whether a sensor waits until the card is let go: it has its turn within 40 ms then. Thread mode.
        fn is_wanted() -> bool;
        /// Has the clock be 4 MHz, or, for a card that is new, 250 kHz. Thread mode.
        fn set_fast(fast: bool);
        /// Sends a byte; what came meanwhile. Thread mode. Cost: 60 at 4 MHz, 550 at 250 kHz.
        fn exchange(byte: u8) -> u8;
        /// Reads a block. Thread mode. Cost: 25,000.
        fn read(block: &mut [u8; 512]);
    }

    /// The count of milliseconds.
    trait Time in time {
        /// Milliseconds since start-up, modulo 2^32. Thread mode and exec. Cost: 24.
        fn millis() -> u32;
    }

    /// The watchdog, which resets a machine that has got stuck.
    trait Watchdog in watchdog {
        /// Why the machine has started. Any level.
        fn cause() -> Cause;
        /// All is well. Thread mode and exec.
        fn feed();
    }

    /// The ways to another program.
    trait System in system {
        /// Starts the firmware anew, as if the reset button had been pressed. Does not return, but on the host, where it is noted. Thread
        /// mode.
        fn reset();
        /// Starts the boot loader, if the board has one; else as [`reset`](System::reset). Thread mode.
        fn boot();
    }
}

/// How fast a chip is, figures that are measured on it; and how much its RAM has room for.
pub trait Timing {
    /// What [`Segment::period`] counts, in a second. It need not fit a period in a millisecond.
    const TIMER_HZ: u32;
    /// How long pulses are that [`Timing::TICKS`] are measured with, us.
    const PULSE_US: u8;
    /// By the number of motors that move, less one.
    const TICKS: [Ticks; MOTORS];
    /// Shortest block with steps, s: twice what exec takes for it while the step interrupt is busy. 1/1,024 at most.
    const BLOCK_S_MIN: f32 = 0.000_75;
    /// Blocks that can wait at once: what RAM has room for.
    const LOOK_AHEAD: usize = if cfg!(feature = "sd") && !cfg!(feature = "std") { 38 } else { 61 };
    /// Lines that can wait on a port: at most 9, for brief answers tell by one digit how many more may come.
    const LINES: usize = 8;
    /// Bytes for all lines of USB together, and of the other port.
    const LINE_BYTES: [usize; 2] = [412, 96];
}

/// [`Timing::TIMER_HZ`] of the chip of this image.
pub const TIMER_HZ: u32 = <imp::Chip as Timing>::TIMER_HZ;
/// [`Timing::PULSE_US`] of the chip of this image.
pub const PULSE_US: u8 = <imp::Chip as Timing>::PULSE_US;
/// [`Timing::BLOCK_S_MIN`] of the chip of this image.
pub const BLOCK_S_MIN: f32 = <imp::Chip as Timing>::BLOCK_S_MIN;
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
    /// Access from thread mode. One task at most is to write each part.
    fn take() -> Self;
}

impl Keeps for imp::eeprom::Eeprom {
    fn take() -> Self {
        imp::eeprom::Eeprom::take()
    }
}

/// Memory that keeps its bytes without power: see [`Keeps`].
pub mod eeprom {
    pub use super::imp::eeprom::Eeprom;
}
