//! The machine on the simulated chip.

use kerf::boards::Pin;
use kerf::boards::inputs::PROBE;
use kerf_sim::mechanics::{Build, Sensors, Switch, Wiring};
use kerf_sim::{AUX, Machine};

use crate::side::Side;

/// Position of the carriages at power-up, in steps from a hard end.
const START: f64 = 1e8;

impl Side for Machine {
    fn send(&mut self, bytes: &[u8]) {
        Machine::send(self, bytes);
    }

    fn send_aux(&mut self, bytes: &[u8]) {
        Machine::send_to(self, AUX, bytes);
    }

    fn first_dialect(&self) -> &'static str {
        self.board().features[0]
    }

    fn set_aux_cts(&mut self, stop: bool) {
        self.set_cts(AUX, stop);
    }

    fn stops_aux(&self) -> bool {
        let pins = self.board().serial.get(AUX).and_then(|port| port.handshake);
        pins.is_some_and(|pins| self.is_high(pins.rts))
    }

    fn heard_aux(&mut self) -> Vec<u8> {
        if self.board().serial.len() > AUX { self.receive_from(AUX) } else { Vec::new() }
    }

    fn set_baud(&mut self, baud: u32) {
        Machine::set_baud(self, baud);
    }

    fn run_ms(&mut self, ms: u64) {
        self.run_for_ms(ms).unwrap();
    }

    fn heard(&mut self) -> Vec<u8> {
        self.receive()
    }

    fn set_input(&mut self, input: usize, closed: bool) {
        if self.mechanics().is_some() {
            return self.tamper(|mechanics, now| mechanics.close(input, closed, now));
        }
        let pin = self.board().inputs[input].expect("a pin");
        self.drive_pin(pin.port.letter(), pin.bit, !closed);
    }

    fn wire(&mut self, switches: &[(usize, i64, bool)], pulses: u32) {
        if switches.is_empty() && pulses == 0 {
            return;
        }
        // Lengths are in steps, and the carriages stand far from any hard end.
        let mut build = Build::of(self.board());
        for axis in &mut build.axes {
            (axis.steps_per_mm, axis.travel, axis.start) = (1.0, f64::INFINITY, START);
            (axis.min, axis.max) = (None, None);
        }
        for (input, step, opens) in switches {
            let at = START + *step as f64;
            let wiring = if *opens { Wiring::NormallyClosed } else { Wiring::NormallyOpen };
            let switch = Some(Switch { at, hysteresis: 0.0, wiring });
            match (input / 2, input % 2) {
                _ if *input == PROBE => (build.plate, build.probe) = (Some(at), wiring),
                (axis, 0) => build.axes[axis].min = switch,
                (axis, _) => build.axes[axis].max = switch,
            }
        }
        if pulses > 0 {
            build.spindle.sensors = Sensors::of(self.board(), pulses);
            if let Some(sensors) = build.spindle.sensors.as_mut().filter(|_| pulses == 1) {
                // With a single pulse there is only the index, as on the host.
                sensors.sync = None;
            }
            // Only `turn_spindle` turns the spindle.
            build.spindle.rpm = 0.0;
        }
        self.build(&build);
    }

    fn turn_spindle(&mut self, rpm: f64, pulses: u32) {
        self.tamper(|mechanics, now| {
            if let Some(encoder) = mechanics.encoder().filter(|_| pulses > 0) {
                encoder.set_marks(pulses);
            }
            mechanics.force_spindle(rpm, now);
        });
    }

    fn steps(&self) -> [i64; 4] {
        self.recorder().motors().each_ref().map(|motor| motor.position)
    }

    fn outputs(&self) -> (u8, f64) {
        let pins = self.board().outputs.iter().enumerate();
        let high = |(bit, pin): (usize, &Option<Pin>)| {
            u8::from(pin.is_some_and(|pin| self.is_high(pin))) << bit
        };
        (pins.map(high).sum(), self.pulses().share)
    }
}
