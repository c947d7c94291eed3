//! What a board is made of: drivers, timers, serial ports, inputs and outputs, sensors, heaters.

use super::pins::{Interrupt, Pin, Port, gp, pin};

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

/// Outputs that a program switches, as bits; of [`Board::outputs`](super::Board::outputs) the index is the number of the bit.
#[allow(missing_docs)]
pub mod outputs {
    pub const SPINDLE: u8 = 1;
    pub const COUNTERCLOCKWISE: u8 = 2;
    pub const MIST: u8 = 4;
    pub const FLOOD: u8 = 8;
    /// How many there are.
    pub const COUNT: usize = 4;
}

/// Switches that the machine has, by their number in [`Board::inputs`](super::Board::inputs) and as bits of a set.
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
