//! Boards as data: which pin does what, and which timer belongs to whom.
//!
//! A board is one constant in one file under `boards/`. The image is built for [`ACTIVE`];
//! host tools see them all through [`by_name`]. A pin or a timer that is used twice fails the
//! build (see [`Board::check`]).

#[path = "../boards/mega2560-grbl.rs"]
mod mega2560_grbl;
#[path = "../boards/mega2560-grbl-lathe.rs"]
mod mega2560_grbl_lathe;
#[path = "../boards/mega2560-lathe.rs"]
mod mega2560_lathe;
#[path = "../boards/pico-cnc.rs"]
mod pico_cnc;
#[path = "../boards/pico-cnc6.rs"]
mod pico_cnc6;
#[path = "../boards/ramps14.rs"]
mod ramps14;
#[path = "../boards/ramps14-sd.rs"]
mod ramps14_sd;
#[path = "../boards/skr-pico.rs"]
mod skr_pico;

pub use mega2560_grbl::MEGA2560_GRBL;
pub use mega2560_grbl_lathe::MEGA2560_GRBL_LATHE;
pub use mega2560_lathe::MEGA2560_LATHE;
pub use pico_cnc::PICO_CNC;
pub use pico_cnc6::PICO_CNC6;
pub use ramps14::RAMPS14;
pub use ramps14_sd::RAMPS14_SD;
pub use skr_pico::SKR_PICO;

/// Motors that the board of this image drives.
pub const MOTORS: usize = ACTIVE.motors.len();

/// The timer of the looks at the switches, on the ATmega2560. Of a printer timer 2 drives heaters.
pub const LOOKS: Timer = if cfg!(feature = "printer") { Timer::T3 } else { Timer::T2 };

/// Whether the chip itself makes the pulses of the hot end, the bed and the fan: those on pins of timer 2.
pub const PULSED: [bool; 3] = match ACTIVE.heaters {
    Some(Heaters { heaters: [hot_end, bed], fan }) => {
        [hot_end.pin.channel().is_some(), bed.pin.channel().is_some(), fan.channel().is_some()]
    }
    None => [false; 3],
};

/// Most motors of a board that an image can be built for.
const MOST_MOTORS: usize = 6;

/// Whether steps are made by a unit of the chip which takes entries from memory: pulses take no time of the CPU then.
pub const STEPS_BY_UNIT: bool = matches!(ACTIVE.step_timer, Timer::Pio);

/// The shortest step pulse, us. 0 stands for half a microsecond.
pub const SHORTEST_PULSE_US: i32 = if STEPS_BY_UNIT { 0 } else { 1 };

/// Does the same for each motor with its number as a constant: what is found by it is found when the image is
/// built, which is worth its flash where each segment goes and where pins become single instructions.
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

/// Calls a macro with what it is given and the numbers of all motors.
#[cfg(not(feature = "board-pico-cnc6"))]
macro_rules! motor_numbers {
    ($call:ident, $($given:tt)*) => {
        $call!($($given)*; 0 1 2 3)
    };
}
#[cfg(feature = "board-pico-cnc6")]
macro_rules! motor_numbers {
    ($call:ident, $($given:tt)*) => {
        $call!($($given)*; 0 1 2 3 4 5)
    };
}

pub(crate) use motor_numbers;

/// [`each_motor`] has an arm for each motor that an image may have.
const _: () = {
    let mut motors = 0;
    each_motor!(M => if M == motors { motors += 1 });
    assert!(motors == MOTORS, "`motor_numbers` has as many as the board");
};

/// An I/O port of the ATmega2560, by its letter; or the only one of the RP2040.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(missing_docs)]
pub enum Port {
    A,
    B,
    C,
    D,
    E,
    F,
    G,
    H,
    J,
    K,
    L,
    /// The pins GP0 to GP29 of the RP2040; the number of a pin is its bit.
    Gpio,
}

impl Port {
    /// The letter the data sheet uses.
    pub const fn letter(self) -> char {
        match self {
            Port::A => 'A',
            Port::B => 'B',
            Port::C => 'C',
            Port::D => 'D',
            Port::E => 'E',
            Port::F => 'F',
            Port::G => 'G',
            Port::H => 'H',
            Port::J => 'J',
            Port::K => 'K',
            Port::L => 'L',
            Port::Gpio => 'P',
        }
    }

    /// Data-space address of the PORT register; PIN is two below it and DDR one below
    /// (ATmega2560 data sheet, register summary). The RP2040's port has none.
    pub const fn address(self) -> usize {
        match self {
            Port::Gpio => 0,
            Port::A => 0x22,
            Port::B => 0x25,
            Port::C => 0x28,
            Port::D => 0x2B,
            Port::E => 0x2E,
            Port::F => 0x31,
            Port::G => 0x34,
            Port::H => 0x102,
            Port::J => 0x105,
            Port::K => 0x108,
            Port::L => 0x10B,
        }
    }
}

/// A pin of the chip.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Pin {
    /// The port of the pin.
    pub port: Port,
    /// The bit of the pin in its port, 0 to 7; on the RP2040 0 to 29.
    pub bit: u8,
}

/// Shorthand that board files use.
pub const fn pin(port: Port, bit: u8) -> Pin {
    Pin { port, bit }
}

/// Shorthand for a pin of the RP2040, by its number.
pub const fn gp(number: u8) -> Pin {
    pin(Port::Gpio, number)
}

/// The interrupt that an edge on a pin raises.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Interrupt {
    /// An external one by its number: INT0 to INT7, each with a vector of its own.
    External(u8),
    /// A pin change by its number: PCINT0 to PCINT23, of which eight share a vector.
    PinChange(u8),
    /// The interrupt of a pin of the RP2040, by the pin's number; each pin is told apart.
    Gpio(u8),
}

impl Pin {
    /// Whether it is the same pin.
    pub const fn is(self, other: Pin) -> bool {
        self.port as u8 == other.port as u8 && self.bit == other.bit
    }

    /// The output of timer 2 that it is: 0 for A, 1 for B (ATmega2560 data sheet, pin configurations).
    pub const fn channel(self) -> Option<u8> {
        match (self.port, self.bit) {
            (Port::B, 4) => Some(0),
            (Port::H, 6) => Some(1),
            _ => None,
        }
    }

    /// The interrupt that an edge on it raises; `None` on ports A, C, F, G, H, L and some pins more.
    pub const fn interrupt(self) -> Option<Interrupt> {
        match (self.port, self.bit) {
            (Port::B, bit) => Some(Interrupt::PinChange(bit)),
            (Port::D, bit @ 0..4) | (Port::E, bit @ 4..8) => Some(Interrupt::External(bit)),
            (Port::E, 0) => Some(Interrupt::PinChange(8)),
            (Port::J, bit @ 0..7) => Some(Interrupt::PinChange(9 + bit)),
            (Port::K, bit) => Some(Interrupt::PinChange(16 + bit)),
            (Port::Gpio, bit) => Some(Interrupt::Gpio(bit)),
            _ => None,
        }
    }
}

/// The pins of one stepper driver.
#[derive(Clone, Copy, Debug)]
pub struct MotorPins {
    /// Steps on the rising edge.
    pub step: Pin,
    /// Low is the positive direction unless the motor's polarity setting inverts it.
    pub dir: Pin,
    /// Active low; `None` when the driver has no enable of its own.
    pub enable: Option<Pin>,
}

/// A 16-bit or 8-bit timer of the ATmega2560, or what stands for one on the RP2040.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(missing_docs)]
pub enum Timer {
    T0,
    T1,
    T2,
    T3,
    T4,
    T5,
    /// A state machine of the RP2040's PIO.
    Pio,
    /// The timer of the RP2040's core.
    SysTick,
    /// The RP2040's slices of pulse-width outputs.
    Slices,
}

/// An output of a 16-bit timer that drives a pin by pulses of some width.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Pwm {
    /// The timer of the output: 3, 4 or 5; [`Timer::Slices`] on the RP2040.
    pub timer: Timer,
    /// The channel of the timer, 0 to 2 for A to C; on the RP2040 the number of the pin.
    pub channel: u8,
}

impl Pwm {
    /// The pin (ATmega2560 data sheet, pin configurations).
    pub const fn pin(self) -> Pin {
        let (port, first) = match self.timer {
            Timer::Slices => (Port::Gpio, 0),
            Timer::T4 => (Port::H, 3),
            Timer::T5 => (Port::L, 3),
            _ => (Port::E, 3),
        };
        pin(port, first + self.channel)
    }

    /// Data-space address of the timer's first register, TCCRnA (ATmega2560 data sheet, register summary).
    pub const fn address(self) -> usize {
        match self.timer {
            Timer::T4 => 0xA0,
            Timer::T5 => 0x120,
            _ => 0x90,
        }
    }
}

/// A USART of the ATmega2560, of which the third, USART2, is the firmware's own (`avr_embassy::interrupt`); or a UART of the RP2040, or its USB.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(missing_docs)]
pub enum Usart {
    U0,
    U1,
    U3,
    Uart0,
    Uart1,
    Usb,
}

impl Usart {
    /// Data-space address of its first register, UCSRnA (ATmega2560 data sheet, register summary). Those of the RP2040 have none.
    pub const fn address(self) -> usize {
        match self {
            Usart::U0 => 0xC0,
            Usart::U1 => 0xC8,
            Usart::U3 => 0x130,
            Usart::Uart0 | Usart::Uart1 | Usart::Usb => 0,
        }
    }

    /// The pins of receiver and transmitter. USB has pins of its own.
    pub const fn pins(self) -> Option<[Pin; 2]> {
        Some(match self {
            Usart::U0 => [pin(Port::E, 0), pin(Port::E, 1)],
            Usart::U1 => [pin(Port::D, 2), pin(Port::D, 3)],
            Usart::U3 => [pin(Port::J, 0), pin(Port::J, 1)],
            Usart::Uart0 => [gp(1), gp(0)],
            Usart::Uart1 => [gp(21), gp(20)],
            Usart::Usb => return None,
        })
    }
}

/// Flow control by pins, for `{ex:2}`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Handshake {
    /// Driven high when the sender is to stop; to its CTS.
    pub rts: Pin,
    /// High when Kerf is to stop; from the other side's RTS.
    pub cts: Pin,
}

/// A serial port. Its pins beside the USART's are on ports A to G, where they are one instruction each.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Serial {
    /// The USART behind it.
    pub usart: Usart,
    /// The rate at power-up, bits a second. The rate of USB can be changed (`{baud:n}`).
    pub rate: u32,
    /// The pins for flow control.
    pub handshake: Option<Handshake>,
    /// High while Kerf sends, for a transceiver of RS-485 (tie its /RE to this pin too). On a port that has
    /// it Kerf only answers, for others share the line.
    pub driver_enable: Option<Pin>,
}

/// The first port of every board with an ATmega2560: USART0, which is USB on most.
pub const USB: Serial =
    Serial { usart: Usart::U0, rate: 115_200, handshake: None, driver_enable: None };

/// The first port of every board with an RP2040: its USB, which has no rate.
pub const NATIVE_USB: Serial = Serial { usart: Usart::Usb, ..USB };

/// Outputs that a program switches, as bits; of [`Board::outputs`] the index is the number of the bit.
#[allow(missing_docs)]
pub mod outputs {
    pub const SPINDLE: u8 = 1;
    pub const COUNTERCLOCKWISE: u8 = 2;
    pub const MIST: u8 = 4;
    pub const FLOOD: u8 = 8;
    /// How many there are.
    pub const COUNT: usize = 4;
}

/// Switches that the machine has, by their number in [`Board::inputs`] and as bits of a set.
#[allow(missing_docs)]
pub mod inputs {
    pub const X_MIN: usize = 0;
    pub const X_MAX: usize = 1;
    pub const Y_MIN: usize = 2;
    pub const Y_MAX: usize = 3;
    pub const Z_MIN: usize = 4;
    pub const Z_MAX: usize = 5;
    pub const A_MIN: usize = 6;
    pub const A_MAX: usize = 7;
    /// Inputs below this number are ends of axes: two for each axis, the lower end first.
    pub const ENDS: usize = 8;
    pub const PROBE: usize = 8;
    pub const DOOR: usize = 9;
    pub const STOP: usize = 10;
    /// How many there are.
    pub const COUNT: usize = 11;
}

/// The sensors of a spindle, which pull their pins low: see [`encoder`](crate::encoder). A pin that is an input as well is no input while
/// the encoder is set up. Each must be able to interrupt, by a vector of its own.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Encoder {
    /// Once a turn.
    pub index: Pin,
    /// The pin of the sensor that pulses several times a turn.
    pub sync: Pin,
    /// A quarter of the way to the next mark behind `sync`, where the board has a pin for it; on an AVR one of the same port.
    pub second: Option<Pin>,
}

impl Encoder {
    /// The vectors of its pins, index first.
    pub const fn vectors(self) -> [u8; 2] {
        [vector(self.index), vector(self.sync)]
    }
}

/// The number of the vector of a pin's interrupt, 0 for none (ATmega2560 data sheet, interrupt vectors).
const fn vector(pin: Pin) -> u8 {
    match pin.interrupt() {
        Some(Interrupt::External(n)) => n + 1,
        Some(Interrupt::PinChange(n)) => n / 8 + 9,
        Some(Interrupt::Gpio(n)) => n + 1,
        None => 0,
    }
}

/// TMC2209 drivers on one line, with sense resistors of 0.11 ohms. What they are told is in [`drivers`](crate::drivers).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Tmc2209 {
    /// Where the UART sends and, over the same line, receives.
    pub tx: Pin,
    /// See `tx`.
    pub rx: Pin,
    /// The address of each motor's driver, motor 1 first.
    pub addresses: &'static [u8],
}

/// A heater: its pin, high for on, which is a hazard; and the channel of the converter that its sensor is on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Heater {
    /// Switches its transistor.
    pub pin: Pin,
    /// 0 to 15: A0 to A15; of the RP2040 0 to 2, GP26 to GP28.
    pub channel: u8,
    /// Selects the MAX6675 that its sensor may be instead, on the SPI of the ATmega2560; low for selected.
    pub select: Option<Pin>,
}

/// Heaters and fan of a printer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Heaters {
    /// The hot end and the bed.
    pub heaters: [Heater; 2],
    /// The fan for what has been printed. A hazard.
    pub fan: Pin,
}

/// A board.
#[derive(Clone, Copy, Debug)]
pub struct Board {
    /// The name that `--board` takes.
    pub name: &'static str,
    /// The Cargo features that its image has: dialects and [capabilities](crate::capability::Capability). `cargo xtask` reads them in
    /// the board's file.
    pub features: &'static [&'static str],
    /// In which dialect its ports begin by default: the default of the setting `dia`. With 0 what is said first decides.
    pub dialect: u8,
    /// CPU clock, Hz.
    pub clock_hz: u32,
    /// The stepper drivers, motor 1 first: four, on an RP2040 up to six.
    pub motors: &'static [MotorPins],
    /// An enable shared by all drivers, active low.
    pub enable_all: Option<Pin>,
    /// Outputs that the panic handler drives low: spindles, heaters, fans.
    pub hazards: &'static [Pin],
    /// What M3 to M9 switch: see [`outputs`]. Hazards, all of them.
    pub outputs: [Option<Pin>; outputs::COUNT],
    /// Says how fast the spindle is to turn. Its pin is a hazard.
    pub pwm: Option<Pwm>,
    /// The serial ports: [`USB`], and a second one if there is room for it.
    pub serial: &'static [Serial],
    /// Switches between a pin and ground: see [`inputs`]. One pin may serve both ends of an axis. Each
    /// must be able to interrupt: see [`Pin::interrupt`].
    pub inputs: [Option<Pin>; inputs::COUNT],
    /// The sensors of the spindle. Timer 5 tells the time of their pulses.
    pub encoder: Option<Encoder>,
    /// Drivers that are told their current and microsteps by UART1 of the RP2040.
    pub drivers: Option<Tmc2209>,
    /// The heaters, for an image that can print.
    pub heaters: Option<Heaters>,
    /// Selects an SD card, on the SPI of the ATmega2560; its SS may do that. Low for selected.
    pub card: Option<Pin>,
    /// Timer of the step interrupt (16 bit).
    pub step_timer: Timer,
    /// Timer of the 1 kHz tick.
    pub tick_timer: Timer,
}

/// A pin that the firmware itself uses on every board: the transmitter of USART2, which is driven high for
/// the sake of its interrupt (`avr_embassy::interrupt`).
const OWN_PIN: Pin = pin(Port::H, 1);

/// Ports a board may have, and pins of a port.
const MAX_PORTS: usize = 2;
const SERIAL_PINS: usize = 5;

/// SS, SCK, MOSI, MISO of the ATmega2560. SS is an output, or its SPI is no master.
pub(crate) const SPI: [Pin; 4] =
    [pin(Port::B, 0), pin(Port::B, 1), pin(Port::B, 2), pin(Port::B, 3)];

/// Beside those of motors and ports: of enables, hazards, the firmware, inputs, drivers, and SPI with what it selects.
const OTHER_PINS: usize = 1 + 8 + 1 + inputs::COUNT + 2 + SPI.len() + 3;
const MAX_PINS: usize = 3 * MOST_MOTORS + MAX_PORTS * SERIAL_PINS + OTHER_PINS;

impl Serial {
    const fn pins(&self) -> [Option<Pin>; SERIAL_PINS] {
        let (rx, tx) = match self.usart.pins() {
            Some([rx, tx]) => (Some(rx), Some(tx)),
            None => (None, None),
        };
        let (rts, cts) = match self.handshake {
            Some(Handshake { rts, cts }) => (Some(rts), Some(cts)),
            None => (None, None),
        };
        [rx, tx, self.driver_enable, rts, cts]
    }

    /// Panics if one of its own pins is not where one instruction reaches it.
    const fn check(&self) {
        let pins = self.pins();
        let mut i = 2;
        while i < SERIAL_PINS {
            if let Some(pin) = pins[i] {
                assert!(pin.port as u8 <= Port::G as u8, "a pin of a serial port is beyond port G");
            }
            i += 1;
        }
    }
}

impl Board {
    /// The motors whose drivers are on (bits) when those of `wanted` are to be: all of them where they
    /// share one enable, and always where there is none.
    pub fn powered(&self, wanted: u8) -> u8 {
        let shared = self.enable_all.is_none() || wanted != 0;
        self.motors.iter().enumerate().fold(0, |bits, (m, motor)| {
            let own = motor.enable.is_none() || wanted & 1 << m != 0;
            bits | u8::from(shared && own) << m
        })
    }

    /// Panics, so fails the build when evaluated in a constant, if a pin or a timer has two users.
    pub const fn check(&self) {
        let mut pins = [None; MAX_PINS];
        let mut n = 0;
        let mut m = 0;
        assert!(self.motors.len() >= 4, "a board has four motors at least");
        while m < self.motors.len() {
            pins[n] = Some(self.motors[m].step);
            pins[n + 1] = Some(self.motors[m].dir);
            pins[n + 2] = self.motors[m].enable;
            n += 3;
            m += 1;
        }
        pins[n] = self.enable_all;
        n += 1;
        let mut h = 0;
        while h < self.hazards.len() {
            pins[n] = Some(self.hazards[h]);
            n += 1;
            h += 1;
        }
        pins[n] = Some(OWN_PIN);
        n += 1;
        if let Some(drivers) = self.drivers {
            (pins[n], pins[n + 1]) = (Some(drivers.tx), Some(drivers.rx));
            n += 2;
            assert!(drivers.addresses.len() == self.motors.len(), "a driver for each motor");
        }
        if let Some(Heaters { heaters: [hot_end, bed], .. }) = self.heaters {
            (pins[n], pins[n + 1]) = (hot_end.select, bed.select);
            n += 2;
        }
        if let Some(card) = self.card
            && !card.is(SPI[0])
        {
            pins[n] = Some(card);
            n += 1;
        }
        let mut s = 0;
        while s < SPI.len() && self.has_spi() {
            pins[n] = Some(SPI[s]);
            n += 1;
            s += 1;
        }
        let mut s = 0;
        while s < self.serial.len() {
            self.serial[s].check();
            let own = self.serial[s].pins();
            let mut o = 0;
            while o < SERIAL_PINS {
                pins[n] = own[o];
                n += 1;
                o += 1;
            }
            s += 1;
        }
        let mut s = 0;
        while s < inputs::COUNT {
            pins[n] = if self.is_shared_end(s) { None } else { self.inputs[s] };
            n += 1;
            s += 1;
        }
        let mut i = 0;
        while i < n {
            let mut j = i + 1;
            while j < n {
                if let (Some(a), Some(b)) = (pins[i], pins[j]) {
                    assert!(!a.is(b), "a pin of this board is used twice");
                }
                j += 1;
            }
            i += 1;
        }
        assert!(
            self.step_timer as u8 != self.tick_timer as u8,
            "a timer of this board is used twice"
        );
        let first =
            !self.serial.is_empty() && matches!(self.serial[0].usart, Usart::U0 | Usart::Usb);
        assert!(first, "the first serial port of this board is not USART0, or its chip's USB");
        self.check_pwm();
        self.check_encoder();
        self.check_outputs();
        self.check_heaters();
        let mut s = 0;
        while s < inputs::COUNT {
            if let Some(pin) = self.inputs[s] {
                assert!(pin.interrupt().is_some(), "a switch of this board cannot interrupt");
            }
            s += 1;
        }
    }

    /// The inputs that share a pin with the sensors `lines` of the encoder (bit 0 index, bit 1 sync), as bits.
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

    /// Whether this input is the upper end of an axis on the pin of the lower one.
    const fn is_shared_end(&self, input: usize) -> bool {
        if input >= inputs::ENDS || input.is_multiple_of(2) {
            return false;
        }
        match (self.inputs[input - 1], self.inputs[input]) {
            (Some(min), Some(max)) => min.is(max),
            _ => false,
        }
    }

    /// Whether something on it is spoken to over SPI.
    pub const fn has_spi(&self) -> bool {
        self.card.is_some() || self.has_max6675(0) || self.has_max6675(1)
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

    /// Panics if the spindle's timer is another's, or has no such output.
    const fn check_pwm(&self) {
        let Some(pwm) = self.pwm else { return };
        let wide = matches!(pwm.timer, Timer::T3 | Timer::T4 | Timer::T5);
        let has_output = (wide && pwm.channel < 3) || matches!(pwm.timer, Timer::Slices);
        assert!(has_output, "a timer of this board has no such output");
        assert!(
            pwm.timer as u8 != self.step_timer as u8 && pwm.timer as u8 != self.tick_timer as u8,
            "a timer of this board is used twice"
        );
    }

    /// Panics if a sensor of the spindle has no vector of its own, or another's pin, or if its timer is another's.
    const fn check_encoder(&self) {
        let Some(encoder) = self.encoder else { return };
        let [index, sync] = encoder.vectors();
        assert!(index != 0 && sync != 0, "a sensor of this board cannot interrupt");
        assert!(index != sync, "the sensors of this board share a vector");
        if let Some(second) = encoder.second {
            assert!(
                second.port as u8 == encoder.sync.port as u8,
                "the level of a sensor is on another port"
            );
        }
        let pwm = matches!(self.pwm, Some(Pwm { timer: Timer::T5, .. }));
        let taken = matches!(self.step_timer, Timer::T5) || matches!(self.tick_timer, Timer::T5);
        assert!(!pwm && !taken, "the timer of the encoder is used twice");
        let mut h = 0;
        while h < self.hazards.len() {
            let hazard = self.hazards[h];
            assert!(!hazard.is(encoder.index) && !hazard.is(encoder.sync), "a sensor is an output");
            h += 1;
        }
    }

    /// Panics if a heater would stay on after a panic, is an output of M3 to M9, or its sensor is not on a pin of the converter, or on one of
    /// another's.
    const fn check_heaters(&self) {
        let Some(Heaters { heaters: [hot_end, bed], fan }) = self.heaters else { return };
        let pins = [hot_end.pin, bed.pin, fan];
        let mut p = 0;
        while p < pins.len() {
            assert!(self.is_hazard(pins[p]), "a heater of this board is not among its hazards");
            let mut o = 0;
            while o < outputs::COUNT {
                if let Some(output) = self.outputs[o] {
                    assert!(!output.is(pins[p]), "a heater of this board is an output");
                }
                o += 1;
            }
            p += 1;
        }
        assert!(hot_end.channel < 16 && bed.channel < 16, "a sensor is on no channel");
        assert!(hot_end.channel != bed.channel, "two sensors of this board share a channel");
        self.check_channel(hot_end.channel);
        self.check_channel(bed.channel);
    }

    const fn is_hazard(&self, pin: Pin) -> bool {
        let mut h = 0;
        while h < self.hazards.len() {
            if self.hazards[h].is(pin) {
                return true;
            }
            h += 1;
        }
        false
    }

    /// Panics if the pin of a channel is a switch.
    const fn check_channel(&self, channel: u8) {
        let is_rp2040 = matches!(self.motors[0].step.port, Port::Gpio);
        let pin = match channel {
            0..3 if is_rp2040 => gp(26 + channel),
            _ if is_rp2040 => panic!("a sensor is on no channel"),
            ..8 => pin(Port::F, channel),
            _ => pin(Port::K, channel - 8),
        };
        let mut i = 0;
        while i < inputs::COUNT {
            if let Some(input) = self.inputs[i] {
                assert!(!input.is(pin), "a sensor of this board is a switch");
            }
            i += 1;
        }
    }

    /// Panics if an output would stay on after a panic, or is switched by two codes.
    const fn check_outputs(&self) {
        let mut seen = 0u8;
        let mut o = 0;
        while o <= outputs::COUNT {
            let output = match self.pwm {
                Some(pwm) if o == outputs::COUNT => Some(pwm.pin()),
                None if o == outputs::COUNT => None,
                _ => self.outputs[o],
            };
            let mut found = output.is_none();
            let mut h = 0;
            while h < self.hazards.len() {
                let hazard = self.hazards[h];
                if let Some(pin) = output
                    && pin.is(hazard)
                {
                    assert!(seen & 1 << h == 0, "an output of this board is used twice");
                    seen |= 1 << h;
                    found = true;
                }
                h += 1;
            }
            assert!(found, "an output of this board is not among its hazards");
            o += 1;
        }
    }
}

/// Every board Kerf knows.
pub const ALL: [&Board; 8] = [
    &MEGA2560_GRBL,
    &MEGA2560_GRBL_LATHE,
    &MEGA2560_LATHE,
    &PICO_CNC,
    &PICO_CNC6,
    &RAMPS14,
    &RAMPS14_SD,
    &SKR_PICO,
];

const _: () = {
    let mut i = 0;
    while i < ALL.len() {
        ALL[i].check();
        i += 1;
    }
};

/// The board with this name.
pub fn by_name(name: &str) -> Option<&'static Board> {
    ALL.into_iter().find(|b| b.name == name)
}

/// The board that this image is built for.
#[cfg(feature = "board-ramps14")]
pub const ACTIVE: &Board = &RAMPS14;
/// The board that this image is built for.
#[cfg(feature = "board-ramps14-sd")]
pub const ACTIVE: &Board = &RAMPS14_SD;
/// The board that this image is built for.
#[cfg(feature = "board-mega2560-grbl-lathe")]
pub const ACTIVE: &Board = &MEGA2560_GRBL_LATHE;
/// The board that this image is built for.
#[cfg(feature = "board-mega2560-lathe")]
pub const ACTIVE: &Board = &MEGA2560_LATHE;
/// The board that this image is built for.
#[cfg(feature = "board-pico-cnc")]
pub const ACTIVE: &Board = &PICO_CNC;
/// The board that this image is built for.
#[cfg(feature = "board-pico-cnc6")]
pub const ACTIVE: &Board = &PICO_CNC6;
/// The board that this image is built for.
#[cfg(feature = "board-skr-pico")]
pub const ACTIVE: &Board = &SKR_PICO;
/// The board that this image is built for.
#[cfg(not(any(
    feature = "board-ramps14",
    feature = "board-ramps14-sd",
    feature = "board-mega2560-grbl-lathe",
    feature = "board-mega2560-lathe",
    feature = "board-pico-cnc",
    feature = "board-pico-cnc6",
    feature = "board-skr-pico"
)))]
pub const ACTIVE: &Board = &MEGA2560_GRBL;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boards_are_found_by_name() {
        assert!(by_name("ramps14").is_some_and(|b| b.motors[2].step == pin(Port::L, 3)));
        assert!(by_name("nothing").is_none());
    }

    #[test]
    fn a_shared_enable_powers_all() {
        let powered = |board: &Board| [0, 0b0010, 0b1111].map(|wanted| board.powered(wanted));
        assert_eq!(powered(&MEGA2560_GRBL), [0, 0b1111, 0b1111]);
        assert_eq!(powered(&RAMPS14), [0, 0b0010, 0b1111]);
        let both = Board { enable_all: Some(pin(Port::G, 0)), ..RAMPS14 };
        assert_eq!(powered(&both), [0, 0b0010, 0b1111]);
        let neither = Board { enable_all: None, ..MEGA2560_GRBL };
        assert_eq!(powered(&neither), [0b1111; 3]);
    }

    #[test]
    #[should_panic(expected = "pin of this board is used twice")]
    fn a_pin_that_is_used_twice_is_refused() {
        let mut board = MEGA2560_GRBL;
        board.enable_all = Some(board.motors[1].step);
        board.check();
    }

    #[test]
    #[should_panic(expected = "pin of this board is used twice")]
    fn the_serial_line_is_taken() {
        const TAKEN: &[Pin] = &[pin(Port::E, 1)];
        Board { hazards: TAKEN, ..MEGA2560_GRBL }.check();
    }

    #[test]
    #[should_panic(expected = "pin of this board is used twice")]
    fn two_ports_on_one_usart_are_refused() {
        Board { serial: &[USB, USB], ..MEGA2560_GRBL }.check();
    }

    #[test]
    #[should_panic(expected = "beyond port G")]
    fn pins_of_ports_are_within_reach() {
        const FAR: Serial = Serial { driver_enable: Some(pin(Port::K, 7)), ..USB };
        Board { serial: &[FAR], ..MEGA2560_GRBL }.check();
    }

    #[test]
    #[should_panic(expected = "not among its hazards")]
    fn outputs_are_hazards() {
        Board { hazards: &[], ..MEGA2560_GRBL }.check();
    }

    #[test]
    #[should_panic(expected = "output of this board is used twice")]
    fn an_output_that_is_used_twice_is_refused() {
        let mut board = MEGA2560_GRBL;
        board.outputs[1] = board.outputs[0];
        board.check();
    }

    #[test]
    fn both_ends_of_an_axis_may_share_a_pin() {
        let mut board = RAMPS14;
        board.inputs[inputs::Y_MAX] = board.inputs[inputs::Y_MIN];
        board.check();
    }

    #[test]
    #[should_panic(expected = "pin of this board is used twice")]
    fn ends_of_two_axes_may_not() {
        let mut board = RAMPS14;
        board.inputs[inputs::Y_MIN] = board.inputs[inputs::X_MAX];
        board.check();
    }

    #[test]
    #[should_panic(expected = "switch of this board cannot interrupt")]
    fn a_switch_must_interrupt() {
        let mut board = RAMPS14;
        board.inputs[inputs::A_MIN] = Some(pin(Port::C, 0));
        board.check();
    }

    #[test]
    #[should_panic(expected = "the sensors of this board share a vector")]
    fn sensors_have_a_vector_each() {
        let encoder = Some(Encoder { index: pin(Port::K, 1), sync: pin(Port::K, 7), second: None });
        Board { encoder, ..MEGA2560_GRBL }.check();
    }

    #[test]
    #[should_panic(expected = "a sensor of this board cannot interrupt")]
    fn sensors_interrupt() {
        let encoder = Some(Encoder { index: pin(Port::L, 1), sync: pin(Port::K, 7), second: None });
        Board { encoder, ..MEGA2560_GRBL }.check();
    }

    #[test]
    #[should_panic(expected = "timer of this board is used twice")]
    fn the_spindle_has_a_timer_to_itself() {
        let pwm = Some(Pwm { timer: Timer::T4, channel: 1 });
        Board { step_timer: Timer::T4, pwm, ..MEGA2560_GRBL }.check();
    }

    #[test]
    #[should_panic(expected = "output of this board is used twice")]
    fn the_pin_of_the_pulses_is_nobody_elses() {
        Board { pwm: Some(Pwm { timer: Timer::T4, channel: 2 }), ..MEGA2560_GRBL }.check();
    }

    #[test]
    #[should_panic(expected = "timer of this board is used twice")]
    fn a_timer_that_is_used_twice_is_refused() {
        Board { tick_timer: Timer::T1, ..MEGA2560_GRBL }.check();
    }
}
