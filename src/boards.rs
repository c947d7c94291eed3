//! Boards as data: what each pin does, and what each timer is used for.
//!
//! A board is one constant in one file under `boards/`. The image is built for [`ACTIVE`];
//! host tools reach all boards through [`by_name`]. A pin or a timer that is used twice fails the
//! build (see [`Board::check`]).

mod check;
mod parts;
mod pins;

#[path = "../boards/mega2560-grbl.rs"]
mod mega2560_grbl;
#[path = "../boards/mega2560-grbl-lathe.rs"]
mod mega2560_grbl_lathe;
#[path = "../boards/mega2560-lathe.rs"]
mod mega2560_lathe;
#[path = "../boards/pico.rs"]
mod pico;
#[path = "../boards/pico6.rs"]
mod pico6;
#[path = "../boards/picobob.rs"]
mod picobob;
#[path = "../boards/picocnc.rs"]
mod picocnc;
#[path = "../boards/picohal.rs"]
mod picohal;
#[path = "../boards/ramps14.rs"]
mod ramps14;
#[path = "../boards/ramps14-cnc.rs"]
mod ramps14_cnc;
#[path = "../boards/skr-pico.rs"]
mod skr_pico;

pub use parts::{
    Encoder, Handshake, Heater, Heaters, MotorPins, NATIVE_USB, Pwm, Registers, SdCard, Serial,
    ShiftRegister, Timer, Tmc2209, USB, Usart, inputs, outputs,
};
pub use pins::{Interrupt, Pin, Port, gp, pin};

pub use mega2560_grbl::MEGA2560_GRBL;
pub use mega2560_grbl_lathe::MEGA2560_GRBL_LATHE;
pub use mega2560_lathe::MEGA2560_LATHE;
pub use pico::PICO;
pub use pico6::PICO6;
pub use picobob::PICOBOB;
pub use picocnc::PICOCNC;
pub use picohal::PICOHAL;
pub use ramps14::RAMPS14;
pub use ramps14_cnc::RAMPS14_CNC;
pub use skr_pico::SKR_PICO;

/// The number of motors that the board of this image drives.
pub const MOTORS: usize = ACTIVE.motors.len();

/// The timer that samples the switches, on the ATmega2560. On a printer, timer 2 drives heaters and timer 3 samples.
pub const LOOKS: Timer = if cfg!(feature = "printer") { Timer::T3 } else { Timer::T2 };

/// Whether a timer produces the pulses of the hot end, the bed and the fan, in this order. It does so for pins that are
/// outputs of timer 2.
pub const PULSED: [bool; 3] = match ACTIVE.heaters {
    Some(Heaters { heaters: [hot_end, bed], fan, .. }) => {
        [hot_end.pin.channel().is_some(), bed.pin.channel().is_some(), fan.channel().is_some()]
    }
    None => [false; 3],
};

/// Whether the board has a fan for the heatbreak of its hot end.
pub const COOLS: bool = matches!(ACTIVE.heaters, Some(Heaters { cooler: Some(_), .. }));

/// Whether a unit of the chip produces the step pulses from entries in memory (the PIO of the RP2040). Pulses then take
/// no CPU time.
pub const STEPS_BY_UNIT: bool = matches!(ACTIVE.step_timer, Timer::Pio);

/// The shortest step pulse that the settings allow, us. 0 stands for half a microsecond.
pub const SHORTEST_PULSE_US: i32 = if STEPS_BY_UNIT { 0 } else { 1 };

/// Repeats an expression for each motor, with the motor's number as a constant. The compiler then resolves every
/// look-up by that number. This is worth its flash in code that runs for each segment, and where a pin access becomes a
/// single instruction.
macro_rules! each_motor {
    ($m:ident => $body:expr) => {
        $crate::boards::motor_numbers!(each_motor, $m => $body)
    };
    ($m:ident => $body:expr; $($i:literal)+) => {{$({
        const $m: usize = $i;
        $body
    })+}};
}

pub(crate) use each_motor;

/// Calls the macro `$call` with the tokens that follow and the numbers of all motors.
#[cfg(not(any(feature = "motors-5", feature = "motors-6")))]
macro_rules! motor_numbers {
    ($call:ident, $($given:tt)*) => {
        $call!($($given)*; 0 1 2 3)
    };
}
#[cfg(feature = "motors-5")]
macro_rules! motor_numbers {
    ($call:ident, $($given:tt)*) => {
        $call!($($given)*; 0 1 2 3 4)
    };
}
#[cfg(feature = "motors-6")]
macro_rules! motor_numbers {
    ($call:ident, $($given:tt)*) => {
        $call!($($given)*; 0 1 2 3 4 5)
    };
}

pub(crate) use motor_numbers;

/// Checks that [`motor_numbers`] lists as many motors as the board has.
const _: () = {
    let mut motors = 0;
    each_motor!(M => if M == motors { motors += 1 });
    assert!(motors == MOTORS, "`motor_numbers` has as many as the board");
};

/// A board.
#[derive(Clone, Copy, Debug)]
pub struct Board {
    /// The name that `--board` takes.
    pub name: &'static str,
    /// The Cargo features that its image has: dialects and [capabilities](crate::capability::Capability). `cargo xtask`
    /// reads them in the board's file.
    pub features: &'static [&'static str],
    /// The default of the setting `dia`: the dialect in which the ports begin. With 0 the first lines that arrive
    /// decide.
    pub dialect: u8,
    /// CPU clock, Hz.
    pub clock_hz: u32,
    /// The stepper drivers, motor 1 first: four, on an RP2040 up to six.
    pub motors: &'static [MotorPins],
    /// An enable shared by all drivers, active low.
    pub enable_all: Option<Pin>,
    /// Outputs that the panic handler drives low: spindles, heaters, fans.
    pub hazards: &'static [Pin],
    /// The pins that M3 to M9 switch, indexed as in [`outputs`]. All of them are hazards.
    pub outputs: [Option<Pin>; outputs::COUNT],
    /// The output that controls the speed of the spindle. Its pin is a hazard.
    pub pwm: Option<Pwm>,
    /// The serial ports: [`USB`], and a second one if there is room for it.
    pub serial: &'static [Serial],
    /// Switches between a pin and ground, indexed as in [`inputs`]. One pin may serve both ends of an axis, and on an
    /// RP2040 those of several axes. Each pin must be able to interrupt: see [`Pin::interrupt`].
    pub inputs: [Option<Pin>; inputs::COUNT],
    /// The sensors of the spindle. Timer 5 takes the time of their pulses.
    pub encoder: Option<Encoder>,
    /// Drivers that receive their current and microsteps over UART1 of the RP2040.
    pub drivers: Option<Tmc2209>,
    /// The shift registers behind which pins are, on an RP2040.
    pub registers: Option<Registers>,
    /// The heaters, for an image that can print.
    pub heaters: Option<Heaters>,
    /// The pins of an SD card.
    pub card: Option<SdCard>,
    /// Timer of the step interrupt (16 bit).
    pub step_timer: Timer,
    /// Timer of the 1 kHz tick.
    pub tick_timer: Timer,
}

/// SS, SCK, MOSI, MISO of the ATmega2560. SS has to be an output, because the SPI is a master only then.
pub(crate) const SPI: [Pin; 4] =
    [pin(Port::B, 0), pin(Port::B, 1), pin(Port::B, 2), pin(Port::B, 3)];

impl Board {
    /// Returns the motors whose drivers are on, as bits, when the motors in `wanted` are to be on. Drivers that share
    /// one enable are on together. A driver without any enable is always on.
    pub fn powered(&self, wanted: u8) -> u8 {
        let shared = self.enable_all.is_none() || wanted != 0;
        self.motors.iter().enumerate().fold(0, |bits, (m, motor)| {
            let own = motor.enable.is_none() || wanted & 1 << m != 0;
            bits | u8::from(shared && own) << m
        })
    }

    /// Returns the inputs, as bits, that share a pin with the sensors `lines` of the encoder (bit 0 index, bit 1 sync).
    pub const fn shared_inputs(&self, lines: u8) -> u16 {
        let Some(encoder) = self.encoder else { return 0 };
        let (mut bits, mut i) = (0, 0);
        while i < inputs::COUNT {
            if let Some(pin) = self.inputs[i] {
                let index = lines & 1 != 0 && pin.is(encoder.index);
                let sync = lines & 2 != 0 && pin.is(encoder.sync);
                if index || sync {
                    bits |= 1 << i;
                }
            }
            i += 1;
        }
        bits
    }

    /// Returns the ends of axes, as bits, that are at the pins of the ends `of`. Cost: 64 comparisons.
    pub fn ends_beside(&self, of: u8) -> u8 {
        let ends = || self.inputs.iter().take(inputs::ENDS).enumerate();
        let asked = |(end, _): &(usize, &Option<Pin>)| of & 1 << *end != 0;
        let is_there =
            |pin: &Option<Pin>| pin.is_some() && ends().filter(asked).any(|(_, p)| p == pin);
        ends().fold(of, |bits, (end, pin)| bits | u8::from(is_there(pin)) << end)
    }

    /// Whether the board has a device on the SPI of the ATmega2560.
    pub const fn has_spi(&self) -> bool {
        let has_card = match self.card {
            Some(card) => card.is_on_spi(),
            None => false,
        };
        has_card || self.has_max6675(0) || self.has_max6675(1)
    }

    /// Whether a heater (0 hot end, 1 bed) may have a MAX6675.
    pub const fn has_max6675(&self, heater: usize) -> bool {
        match self.heaters {
            Some(Heaters { heaters, .. }) => heaters[heater].select.is_some(),
            None => false,
        }
    }

    /// Whether some port has the pins that `{ex:2}` needs.
    pub const fn has_handshake(&self) -> bool {
        let mut any = false;
        let mut s = 0;
        while s < self.serial.len() {
            any |= self.serial[s].handshake.is_some();
            s += 1;
        }
        any
    }
}

/// Every board that Kerf supports.
pub const ALL: [&Board; 11] = [
    &MEGA2560_GRBL,
    &MEGA2560_GRBL_LATHE,
    &MEGA2560_LATHE,
    &PICO,
    &PICO6,
    &PICOBOB,
    &PICOCNC,
    &PICOHAL,
    &RAMPS14,
    &RAMPS14_CNC,
    &SKR_PICO,
];

const _: () = {
    let mut i = 0;
    while i < ALL.len() {
        ALL[i].check();
        i += 1;
    }
};

/// Returns the board with this name, or `None`.
pub fn by_name(name: &str) -> Option<&'static Board> {
    ALL.into_iter().find(|b| b.name == name)
}

/// The board that this image is built for.
#[cfg(feature = "board-ramps14")]
pub const ACTIVE: &Board = &RAMPS14;
/// The board that this image is built for.
#[cfg(feature = "board-ramps14-cnc")]
pub const ACTIVE: &Board = &RAMPS14_CNC;
/// The board that this image is built for.
#[cfg(feature = "board-mega2560-grbl-lathe")]
pub const ACTIVE: &Board = &MEGA2560_GRBL_LATHE;
/// The board that this image is built for.
#[cfg(feature = "board-mega2560-lathe")]
pub const ACTIVE: &Board = &MEGA2560_LATHE;
/// The board that this image is built for.
#[cfg(feature = "board-pico")]
pub const ACTIVE: &Board = &PICO;
/// The board that this image is built for.
#[cfg(feature = "board-pico6")]
pub const ACTIVE: &Board = &PICO6;
/// The board that this image is built for.
#[cfg(feature = "board-picobob")]
pub const ACTIVE: &Board = &PICOBOB;
/// The board that this image is built for.
#[cfg(feature = "board-picocnc")]
pub const ACTIVE: &Board = &PICOCNC;
/// The board that this image is built for.
#[cfg(feature = "board-picohal")]
pub const ACTIVE: &Board = &PICOHAL;
/// The board that this image is built for.
#[cfg(feature = "board-skr-pico")]
pub const ACTIVE: &Board = &SKR_PICO;
/// The board that this image is built for.
#[cfg(not(any(
    feature = "board-ramps14",
    feature = "board-ramps14-cnc",
    feature = "board-mega2560-grbl-lathe",
    feature = "board-mega2560-lathe",
    feature = "board-pico",
    feature = "board-pico6",
    feature = "board-picobob",
    feature = "board-picocnc",
    feature = "board-picohal",
    feature = "board-skr-pico"
)))]
pub const ACTIVE: &Board = &MEGA2560_GRBL;

#[cfg(test)]
mod tests;
