//! The simulated machine: its ports, clock, switches and spindle.
//!
//! Time passes in whole milliseconds, and only in [`Bench::run`]. The output of the firmware is kept until the page
//! takes it. The page takes it after each run, so it stays below what the line transmits in that time.

use kerf::boards::{MOTORS, inputs};
use kerf::hal::imp::{Machine, eeprom, gpio, inputs as pins, now, pwm, was_reset, watchdog};
use kerf::hal::resets::Cause;

use crate::samples::Samples;

/// The rate of the serial line at start-up, bits a second.
const BAUD: u32 = 115_200;
/// Clock cycles in a millisecond.
const CYCLES_PER_MS: u64 = kerf::boards::ACTIVE.clock_hz as u64 / 1_000;

/// The lowest, the highest and the present position of a motor, in steps.
#[derive(Clone, Copy, Default)]
struct Range {
    lowest: i64,
    highest: i64,
    now: i64,
    /// The number of steps made before the samples began.
    before: u64,
}

/// A machine, and its recorded output and motion.
pub struct Bench {
    machine: Machine,
    heard: [Vec<u8>; 2],
    samples: Option<Samples>,
    /// The cycle at which the samples began.
    began: u64,
    ranges: [Range; MOTORS],
}

impl Bench {
    /// Boots the firmware with these EEPROM contents. `asked` says that the firmware has asked for the reset. `None`
    /// for a second machine in a thread.
    pub fn boot(contents: &[u8], asked: bool) -> Option<Self> {
        eeprom::put(contents);
        watchdog::set_cause(if asked { Cause::Asked } else { Cause::PowerOn });
        let machine = Machine::boot(BAUD)?;
        machine.insert_card(Some(crate::card::empty()));
        let (heard, ranges) = Default::default();
        Some(Self { machine, heard, samples: None, began: 0, ranges })
    }

    /// Puts bytes on the line of a port. Bytes for any other port than 0 and 1 are dropped.
    pub fn send(&self, port: u32, bytes: &[u8]) {
        match port {
            0 => self.machine.send(bytes),
            1 => self.machine.send_aux(bytes),
            _ => {}
        }
    }

    /// Returns what the firmware has sent on a port since the last call.
    pub fn heard(&mut self, port: u32) -> Vec<u8> {
        self.listen();
        self.heard.get_mut(port as usize).map(std::mem::take).unwrap_or_default()
    }

    fn listen(&mut self) -> bool {
        let (usb, aux) = (self.machine.received(), self.machine.received_aux());
        let ended = usb.contains(&b'\n');
        self.heard[0].extend(usb);
        self.heard[1].extend(aux);
        ended
    }

    /// Runs for `ms` milliseconds. If `stops`, the run ends earlier when the firmware ends a line on the first port. A
    /// reset ends it in any case. Returns the milliseconds that have passed.
    pub fn run(&mut self, ms: u32, stops: bool) -> u32 {
        for passed in 0..ms {
            if was_reset() {
                return passed;
            }
            self.pass();
            if stops && self.listen() {
                return passed + 1;
            }
        }
        ms
    }

    /// Lets a millisecond pass.
    fn pass(&mut self) {
        let Self { machine, ranges, samples, began, .. } = self;
        machine.run_until(1, || {
            let position = machine.emitted().position;
            for (motor, (range, at)) in ranges.iter_mut().zip(position).enumerate() {
                if range.now == at {
                    continue;
                }
                range.now = at;
                range.lowest = range.lowest.min(at);
                range.highest = range.highest.max(at);
                if let Some(samples) = samples {
                    samples.step(motor, at, (now() - *began) as f64 / CYCLES_PER_MS as f64);
                }
            }
            false
        });
        if let Some(samples) = samples {
            samples.tick();
        }
    }

    /// Returns, in this order: the time in ms; the steps of each motor; the outputs that are on, as bits of
    /// [`kerf::boards::outputs`]; the duty cycle of the spindle's PWM, in thousandths; the powered motors, as bits; the
    /// actuated inputs, as bits; 1 if the firmware has asked for a reset.
    pub fn state(&self) -> Vec<f64> {
        let position = self.machine.emitted().position;
        let mut state = vec![(now() / CYCLES_PER_MS) as f64];
        state.extend(position.map(|steps| steps as f64));
        let pulse = f64::from(pwm::output().1);
        let [outputs, powered] = [gpio::outputs(), gpio::powered()].map(f64::from);
        state.extend([
            outputs,
            pulse,
            powered,
            pins::worked(self.machine.thread().level()).into(),
            was_reset().into(),
        ]);
        state
    }

    /// Returns the EEPROM contents.
    pub fn eeprom(&self) -> Vec<u8> {
        eeprom::contents()
    }

    /// Closes or opens the contact at an input of [`inputs`]. Does nothing if there is no such input.
    pub fn press(&self, input: usize, closed: bool) {
        if input < inputs::COUNT {
            self.machine.set_input(input, closed);
        }
    }

    /// From now on the contact at an input is closed while the motor of its axis is at this step or beyond. The contact
    /// of the probe is closed while the third motor is at this step or below.
    pub fn near(&self, input: usize, step: i64) {
        if input <= inputs::PROBE {
            self.machine.set_near(input, step, false);
        }
    }

    /// See [`Machine::turn_spindle`].
    pub fn turn_spindle(&self, rpm: f64, per_turn: u16) {
        self.machine.turn_spindle(rpm, per_turn);
    }

    /// Begins to keep samples. The first one is the present position.
    pub fn begin_samples(&mut self) {
        let emitted = self.machine.emitted();
        self.samples = Some(Samples::from(emitted.position));
        self.began = now();
        for (range, motor) in self.ranges.iter_mut().zip(0..MOTORS) {
            let at = emitted.position[motor];
            *range = Range { lowest: at, highest: at, now: at, before: emitted.steps[motor] };
        }
    }

    /// Returns the samples; none if [`Self::begin_samples`] has not been called.
    pub fn samples(&self) -> &Samples {
        static NONE: Samples = Samples::NONE;
        self.samples.as_ref().unwrap_or(&NONE)
    }

    /// Returns the lowest and the highest position and the number of steps of each motor since the samples began.
    pub fn extremes(&self) -> Vec<f64> {
        let steps = self.machine.emitted().steps;
        let of = |(range, steps): (&Range, u64)| {
            [range.lowest as f64, range.highest as f64, (steps - range.before) as f64]
        };
        self.ranges.iter().zip(steps).flat_map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on_a_bench<R: Send>(act: impl FnOnce(Bench) -> R + Send) -> R {
        std::thread::scope(|scope| {
            scope.spawn(|| act(Bench::boot(&[], false).unwrap())).join().unwrap()
        })
    }

    fn hears(bench: &mut Bench, line: &str) -> String {
        bench.send(0, line.as_bytes());
        bench.run(60, false);
        String::from_utf8(bench.heard(0)).unwrap()
    }

    #[test]
    fn a_line_ends_a_run_and_moves_are_sampled() {
        on_a_bench(|mut bench| {
            assert!(bench.run(2_000, true) < 100, "the greeting");
            assert!(hears(&mut bench, "{fv:n}\n").contains("\"fv\":"));
            bench.begin_samples();
            hears(&mut bench, "g1 x1 f600\n");
            bench.run(1_000, false);
            assert_eq!(bench.state()[1], 1_280.0);
            assert_eq!(bench.extremes()[..3], [0.0, 1_280.0, 1_280.0]);
            let samples = bench.samples();
            assert_eq!(samples.len(), 1 + (60 + 1_000) / samples.interval_ms() as usize);
        });
    }

    #[test]
    fn settings_survive_a_reset_and_a_reset_ends_a_run() {
        let kept = on_a_bench(|mut bench| {
            bench.run(100, false);
            hears(&mut bench, "{xvm:1200}\n");
            bench.run(1_000, false);
            bench.send(0, b"\x18");
            assert!(bench.run(1_000, false) < 100);
            assert_eq!(bench.state()[9], 1.0);
            bench.eeprom()
        });
        let heard = std::thread::spawn(move || {
            let mut bench = Bench::boot(&kept, true).unwrap();
            bench.run(100, false);
            hears(&mut bench, "{xvm:n}\n{rst:n}\n")
        });
        let heard = heard.join().unwrap();
        assert!(heard.contains("\"xvm\":1200") && heard.contains("\"rst\":4"), "{heard}");
    }

    #[test]
    fn an_encoder_measures_the_spindle_until_it_stalls() {
        on_a_bench(|mut bench| {
            bench.run(100, false);
            hears(&mut bench, "{spn:16}\n");
            bench.turn_spindle(600.0, 16);
            bench.run(2_000, false);
            assert!(hears(&mut bench, "{sps:n}\n").contains("\"sps\":600}"));
            bench.turn_spindle(0.0, 16);
            bench.run(1_000, false);
            assert!(hears(&mut bench, "{sps:n}\n").contains("\"sps\":0}"));
        });
    }

    #[test]
    fn rubbish_is_dropped() {
        on_a_bench(|mut bench| {
            bench.send(7, b"x");
            assert!(bench.heard(7).is_empty());
            bench.press(99, true);
            bench.near(99, 0);
            assert!(Bench::boot(&[], false).is_none(), "a second machine");
        });
    }
}
