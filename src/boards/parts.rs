//! The parts of a board: drivers, timers, serial ports, inputs and outputs, sensors, heaters.

use super::SPI;
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

/// The pins of an SD card.
#[derive(Clone, Copy, Debug)]
pub struct SdCard {
    /// Selects the card, active low. On an ATmega2560 the SS pin of the SPI may serve as it.
    pub select: Pin,
    /// Clock, data to the card, data from it: those of the ATmega2560's SPI, or three of one SPI of the RP2040.
    pub bus: [Pin; 3],
}

impl SdCard {
    /// Returns a card on the SPI of the ATmega2560.
    pub const fn on_spi(select: Pin) -> Self {
        Self { select, bus: [SPI[1], SPI[2], SPI[3]] }
    }

    /// Whether the card is on the SPI of the ATmega2560.
    pub const fn is_on_spi(&self) -> bool {
        self.bus[0].is(SPI[1])
    }

    /// Checks that the pins are those of one SPI (RP2040 data sheet, 2.19.2): of each four, data from the card, a
    /// select, the clock, data to the card; SPI1 has every other eight.
    pub(super) const fn check(&self) {
        if self.is_on_spi() {
            return;
        }
        let [clock, to, from] = self.bus;
        assert!(clock.bit % 4 == 2 && to.bit % 4 == 3 && from.bit % 4 == 0, "pins of an SPI");
        let unit = clock.bit / 8 % 2;
        assert!(to.bit / 8 % 2 == unit && from.bit / 8 % 2 == unit, "pins of one SPI");
    }
}

/// A chain of 74HC595 shift registers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ShiftRegister {
    /// The data of the first register of the chain.
    pub data: Pin,
    /// The shift clock of all.
    pub clock: Pin,
    /// The latch of all. It is the pin behind that of the clock.
    pub latch: Pin,
    /// The number of outputs: 8 for each register. Output 0 is QA of the first one.
    pub outputs: u8,
}

/// The shift registers of a board with an RP2040.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Registers {
    /// Steps and directions: the pins of [`Port::Steps`].
    pub steps: ShiftRegister,
    /// Enables and other outputs: the pins of [`Port::Outputs`].
    pub outputs: ShiftRegister,
}

/// A 16-bit or 8-bit timer of the ATmega2560, or its counterpart on the RP2040.
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
    /// The PWM slices of the RP2040.
    Slices,
}

/// A PWM output of a 16-bit timer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Pwm {
    /// The timer of the output: 3, 4 or 5; [`Timer::Slices`] on the RP2040.
    pub timer: Timer,
    /// The channel of the timer, 0 to 2 for A to C; on the RP2040 the number of the pin.
    pub channel: u8,
    /// Whether a transistor of the board inverts the pulses. The pin then drives the opposite, on the RP2040.
    pub inverted: bool,
}

impl Pwm {
    /// Returns the pin of the output (ATmega2560 data sheet, pin configurations).
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

/// A USART of the ATmega2560, or a UART or the USB of the RP2040. The third USART of the ATmega2560, USART2, is
/// missing here because the firmware itself uses it (`avr_embassy::interrupt`).
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
    /// Data-space address of the USART's first register, UCSRnA (ATmega2560 data sheet, register summary). 0 on the
    /// RP2040, which does not use it.
    pub const fn address(self) -> usize {
        match self {
            Usart::U0 => 0xC0,
            Usart::U1 => 0xC8,
            Usart::U3 => 0x130,
            Usart::Uart0 | Usart::Uart1 | Usart::Usb => 0,
        }
    }

    /// Returns the usual pins of receiver and transmitter. `None` for USB, which has dedicated pins.
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

/// Hardware flow control, for `{ex:2}`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Handshake {
    /// Driven high to stop the sender. Connect it to the sender's CTS.
    pub rts: Pin,
    /// Read high when Kerf is to stop. Connect it to the sender's RTS.
    pub cts: Pin,
}

/// A serial port. Its pins beside the USART's are on ports A to G, so that one instruction sets or clears them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Serial {
    /// The USART behind it.
    pub usart: Usart,
    /// Its receiver and its transmitter, where they are not on the usual pins ([`Usart::pins`]): on the RP2040.
    pub pins: Option<[Pin; 2]>,
    /// The rate at power-up, in bits a second. On the port to USB it can be changed (`{baud:n}`).
    pub rate: u32,
    /// The pins for flow control.
    pub handshake: Option<Handshake>,
    /// High while Kerf sends, for an RS-485 transceiver (tie its /RE to this pin too). On a port with this pin Kerf
    /// only answers and never sends on its own, because others share the line.
    pub driver_enable: Option<Pin>,
}

impl Serial {
    /// Returns the pins of receiver and transmitter. `None` for USB.
    pub const fn line(&self) -> Option<[Pin; 2]> {
        match self.pins {
            None => self.usart.pins(),
            own => own,
        }
    }
}

/// The first port of every board with an ATmega2560: USART0, which is USB on most.
pub const USB: Serial =
    Serial { usart: Usart::U0, pins: None, rate: 115_200, handshake: None, driver_enable: None };

/// The first port of every board with an RP2040: its USB, which has no bit rate.
pub const NATIVE_USB: Serial = Serial { usart: Usart::Usb, ..USB };

/// Outputs that a program switches, as bits. The bit number is the index in
/// [`Board::outputs`](super::Board::outputs).
#[allow(missing_docs)]
pub mod outputs {
    pub const SPINDLE: u8 = 1;
    pub const COUNTERCLOCKWISE: u8 = 2;
    pub const MIST: u8 = 4;
    pub const FLOOD: u8 = 8;
    /// The number of outputs.
    pub const COUNT: usize = 4;
}

/// Switches of the machine. Each constant is an index in [`Board::inputs`](super::Board::inputs), and a bit number in
/// sets of inputs.
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
    /// The number of inputs.
    pub const COUNT: usize = 11;
}

/// The sensors of a spindle, which pull their pins low: see [`encoder`](crate::encoder). A pin that is an input as
/// well is not used as an input while the encoder is set up. Index and sync each need an interrupt vector of their
/// own.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Encoder {
    /// The sensor that pulses once per turn.
    pub index: Pin,
    /// The sensor that pulses several times per turn.
    pub sync: Pin,
    /// The second track of the encoder, a quarter of a period behind `sync`; `None` if the board has no pin for it.
    /// On an AVR the pin is on the same port as `sync`.
    pub second: Option<Pin>,
}

impl Encoder {
    /// Returns the interrupt vectors of index and sync.
    pub const fn vectors(self) -> [u8; 2] {
        [vector(self.index), vector(self.sync)]
    }
}

/// Returns the number of the vector of a pin's interrupt; 0 for none (ATmega2560 data sheet, interrupt vectors).
const fn vector(pin: Pin) -> u8 {
    match pin.interrupt() {
        Some(Interrupt::External(n)) => n + 1,
        Some(Interrupt::PinChange(n)) => n / 8 + 9,
        Some(Interrupt::Gpio(n)) => n + 1,
        None => 0,
    }
}

/// TMC2209 drivers on one UART line, with sense resistors of 0.11 ohms. Their configuration is in
/// [`drivers`](crate::drivers).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Tmc2209 {
    /// The pin on which the UART sends. Sent bytes return on `rx`, because both share one line.
    pub tx: Pin,
    /// The pin on which the UART receives: see `tx`.
    pub rx: Pin,
    /// The address of each motor's driver, motor 1 first.
    pub addresses: &'static [u8],
}

/// A heater. Its pin is a hazard, and high turns it on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Heater {
    /// The pin that switches the heater's transistor.
    pub pin: Pin,
    /// The channel of the converter for the sensor. 0 to 15 are A0 to A15; on the RP2040 0 to 2 are GP26 to GP28.
    pub channel: u8,
    /// The select pin, active low, of a MAX6675 that may replace the sensor. It is on the SPI of the ATmega2560.
    pub select: Option<Pin>,
}

/// The heaters and the fans of a printer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Heaters {
    /// The hot end and the bed.
    pub heaters: [Heater; 2],
    /// The part-cooling fan. Its pin is a hazard.
    pub fan: Pin,
    /// The fan of the hot end's heatbreak, on an RP2040. Its pin is no hazard: after a panic the fan turns, because
    /// the hot end may be hot.
    pub cooler: Option<Pin>,
}
