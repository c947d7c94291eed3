//! Build-time check of a board: the build fails if a pin or a timer has two users, or cannot do what it is used for.

use super::parts::{
    Handshake, Heaters, Pwm, Registers, Serial, ShiftRegister, Timer, Usart, inputs, outputs,
};
use super::pins::{Pin, Port, gp, pin};
use super::{Board, SPI};

/// The most motors of any board that an image can be built for.
const MOST_MOTORS: usize = 6;

/// The pin that the firmware itself uses on every board: the transmitter of USART2. The data-register-empty interrupt
/// of USART2 is the software interrupt, and the enabled transmitter drives the pin high (`avr_embassy::interrupt`).
const OWN_PIN: Pin = pin(Port::H, 1);

/// The most serial ports of a board, and the pins of one port.
const MAX_PORTS: usize = 2;
const SERIAL_PINS: usize = 5;

/// Pins beside those of motors and serial ports: `enable_all`, hazards, the firmware's own, inputs, drivers, and SPI
/// with its select pins, the fan of the heatbreak, and two shift registers.
const OTHER_PINS: usize = 1 + 8 + 1 + inputs::COUNT + 2 + SPI.len() + 3 + 1 + 6;
const MAX_PINS: usize = 3 * MOST_MOTORS + MAX_PORTS * SERIAL_PINS + OTHER_PINS;

impl Serial {
    const fn all_pins(&self) -> [Option<Pin>; SERIAL_PINS] {
        let (rx, tx) = match self.line() {
            Some([rx, tx]) => (Some(rx), Some(tx)),
            None => (None, None),
        };
        let (rts, cts) = match self.handshake {
            Some(Handshake { rts, cts }) => (Some(rts), Some(cts)),
            None => (None, None),
        };
        [rx, tx, self.driver_enable, rts, cts]
    }

    /// Panics if the driver-enable, RTS or CTS pin is on a port that single-bit instructions cannot reach, or if the UART
    /// is not on its pins (RP2040 data sheet, 2.19.2): it receives on each fourth pin from GP1, and sends on the pin
    /// before that one.
    const fn check(&self) {
        if let Some([rx, tx]) = self.pins {
            let number = match self.usart {
                Usart::Uart0 => 0,
                Usart::Uart1 => 1,
                _ => panic!("the pins of this serial port are fixed"),
            };
            let is_its = (tx.bit + 4) / 8 % 2 == number && tx.bit.is_multiple_of(4);
            assert!(is_its && rx.bit == tx.bit + 1, "a serial port is not on pins of its UART");
        }
        let pins = self.all_pins();
        let mut i = 2;
        while i < SERIAL_PINS {
            if let Some(pin) = pins[i] {
                assert!(pin.port as u8 <= Port::G as u8, "a pin of a serial port is beyond port G");
            }
            i += 1;
        }
    }
}

impl ShiftRegister {
    /// Returns the number of outputs. Panics unless the latch is behind the clock, on pins of an RP2040, and the outputs
    /// are those of one, two or three registers.
    const fn check(&self) -> u8 {
        let is_rp2040 =
            matches!(self.data.port, Port::Gpio) && matches!(self.clock.port, Port::Gpio);
        let follows = self.latch.is(gp(self.clock.bit + 1));
        assert!(is_rp2040 && follows, "a register of this board has its pins elsewhere");
        assert!(matches!(self.outputs, 8 | 16 | 24), "a register of this board has other outputs");
        self.outputs
    }
}

impl Board {
    /// Panics if a pin or a timer has two users. In a constant, the panic fails the build.
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
        if let Some(Heaters { heaters: [hot_end, bed], cooler, .. }) = self.heaters {
            (pins[n], pins[n + 1], pins[n + 2]) = (hot_end.select, bed.select, cooler);
            n += 3;
        }
        if let Some(Registers { steps, outputs }) = self.registers {
            let own =
                [steps.data, steps.clock, steps.latch, outputs.data, outputs.clock, outputs.latch];
            let mut r = 0;
            while r < own.len() {
                pins[n] = Some(own[r]);
                n += 1;
                r += 1;
            }
        }
        if let Some(card) = self.card {
            card.check();
            if !card.select.is(SPI[0]) {
                pins[n] = Some(card.select);
                n += 1;
            }
            if !card.is_on_spi() {
                let [clock, to, from] = card.bus;
                (pins[n], pins[n + 1], pins[n + 2]) = (Some(clock), Some(to), Some(from));
                n += 3;
            }
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
            let own = self.serial[s].all_pins();
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
            pins[n] = if self.shares_earlier_end(s) { None } else { self.inputs[s] };
            n += 1;
            s += 1;
        }
        let mut i = 0;
        while i < n {
            if let Some(pin) = pins[i] {
                self.check_register(pin);
            }
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

    /// Whether this input is an end of an axis and shares the pin of an end before it: of the lower end of its axis, or,
    /// on an RP2040, of another axis.
    const fn shares_earlier_end(&self, input: usize) -> bool {
        if input >= inputs::ENDS {
            return false;
        }
        let Some(pin) = self.inputs[input] else { return false };
        let is_rp2040 = matches!(pin.port, Port::Gpio);
        let mut end = if is_rp2040 { 0 } else { input - input % 2 };
        while end < input {
            if let Some(other) = self.inputs[end]
                && other.is(pin)
            {
                return true;
            }
            end += 1;
        }
        false
    }

    /// Panics if a pin is behind a shift register that the board does not have, or is none of its outputs.
    const fn check_register(&self, pin: Pin) {
        let outputs = match (pin.port, self.registers) {
            (Port::Steps, Some(Registers { steps, .. })) => {
                assert!(steps.outputs == 8, "the register of steps has not eight outputs");
                steps.check()
            }
            (Port::Outputs, Some(Registers { outputs, .. })) => outputs.check(),
            (Port::Steps | Port::Outputs, None) => 0,
            _ => return,
        };
        assert!(pin.bit < outputs, "a pin of this board is no output of its register");
    }

    /// Panics if the timer of the spindle's PWM has another user, or has no such output.
    const fn check_pwm(&self) {
        let Some(pwm) = self.pwm else { return };
        let wide = matches!(pwm.timer, Timer::T3 | Timer::T4 | Timer::T5);
        let has_output = (wide && pwm.channel < 3) || matches!(pwm.timer, Timer::Slices);
        assert!(has_output, "a timer of this board has no such output");
        assert!(!wide || !pwm.inverted, "a timer of this board does not invert its output");
        assert!(
            pwm.timer as u8 != self.step_timer as u8 && pwm.timer as u8 != self.tick_timer as u8,
            "a timer of this board is used twice"
        );
    }

    /// Panics if a sensor of the spindle has no interrupt vector of its own, or is a hazard, or if the encoder's timer
    /// has another user. Also panics if the second sync sensor is not on the port of the first.
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

    /// Panics if a heater is not among the hazards (so a panic would leave it on), or is an output of M3 to M9. Also
    /// panics if a sensor is on no channel of the converter, shares its channel, or is on the pin of an input.
    const fn check_heaters(&self) {
        let Some(Heaters { heaters: [hot_end, bed], fan, .. }) = self.heaters else { return };
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

    /// Panics if the pin of a converter channel is an input.
    const fn check_channel(&self, channel: u8) {
        let is_rp2040 = self.motors[0].step.port.is_of_rp2040();
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

    /// Panics if an output is not among the hazards (so a panic would leave it on), or has two functions.
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
