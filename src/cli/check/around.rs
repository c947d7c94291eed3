//! The machine of a dry run, and what is around it: a spindle that turns as it is switched, and strong heaters that come
//! to the temperature that is asked for.

use kerf::boards::outputs::{COUNTERCLOCKWISE, SPINDLE};
use kerf::hal::imp::{Machine, gpio, pwm, was_reset};
use kerf::heat::sensor::{Kind, reading};

use super::dialect::{Dialect, status};

/// The rate of the serial line for which the job is timed, bits a second.
const BAUD: u32 = 115_200;
/// Longest wait for the answer to a setting or a question, ms.
const ASK_MS: u64 = 60_000;
/// Time for the answer to the line that selects the dialect, ms.
const OPEN_MS: u64 = 200;
/// Time between two looks at the targets of the heaters, ms.
const HEAT_MS: u64 = 50;
/// Time in which the spindle comes 63 % of the way to another speed, ms.
const SPINDLE_MS: f64 = 500.0;
/// How far the temperature of hot end and bed changes between two looks, degrees. The firmware takes a faster rise for
/// a fault.
const HEAT_BY: [f64; 2] = [0.5, 0.1];
/// Temperature of a heater that is off, degrees.
const ROOM: f64 = 22.0;
const MOTORS: usize = 4;
/// The axes whose travel is checked.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// A port of the machine.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Port {
    Usb,
    Aux,
}

/// The motor of an axis.
#[derive(Clone, Copy)]
struct Motor {
    index: usize,
    /// The length of a step, mm.
    step: f64,
}

/// An axis: its motor, its travel, and how far it went.
#[derive(Clone, Copy, Default)]
pub struct Axis {
    motor: Option<Motor>,
    /// The travel that is allowed, mm.
    pub travel: (f64, f64),
    /// The position after homing, mm.
    pub homed: f64,
    /// The machine position at which the motor has made no steps, mm.
    base: f64,
    /// How far the axis went, in machine coordinates, mm.
    went: Option<(f64, f64)>,
}

/// The range of speeds of a direction of the spindle, and of the duty cycles that stand for them.
#[derive(Clone, Copy, Default)]
struct Drive {
    speed: (f64, f64),
    share: (f64, f64),
}

/// The machine and its surroundings.
pub struct Around {
    machine: Machine,
    /// The port that takes settings: that of the job in TinyG's dialect, else the second one.
    port: Port,
    heard: [String; 2],
    /// The machine's time, ms, and how much of it passed without a step.
    pub ms: u64,
    pub still_ms: u64,
    pub axes: [Axis; AXES.len()],
    lowest: [i64; MOTORS],
    highest: [i64; MOTORS],
    drives: [Drive; 2],
    /// Pulses of the spindle encoder in a turn; 0 without an encoder.
    pulses: u16,
    rpm: f64,
    /// Whether the spindle needs time to change its speed. A tap needs that: without a sensor of direction, the
    /// firmware sees the reversal by it.
    inert: bool,
    /// The sensors of hot end and bed, if the machine prints.
    sensors: Option<[Kind; 2]>,
    /// The temperatures of hot end and bed.
    degrees: [f64; 2],
}

impl Around {
    /// Boots a machine. Its first port is to speak `dialect`.
    pub fn boot(dialect: Dialect) -> Option<Self> {
        let port = if dialect == Dialect::TinyG { Port::Usb } else { Port::Aux };
        Some(Self {
            machine: Machine::boot(BAUD)?,
            port,
            heard: Default::default(),
            ms: 0,
            still_ms: 0,
            axes: Default::default(),
            lowest: [0; MOTORS],
            highest: [0; MOTORS],
            drives: Default::default(),
            pulses: 0,
            rpm: 0.0,
            inert: false,
            sensors: None,
            degrees: [ROOM; 2],
        })
    }

    /// Lets a millisecond pass.
    pub fn pass(&mut self) {
        let steps = self.steps();
        let (machine, lowest, highest) = (&self.machine, &mut self.lowest, &mut self.highest);
        machine.run_until(1, || {
            let position = machine.emitted().position;
            for m in 0..MOTORS {
                lowest[m] = lowest[m].min(position[m]);
                highest[m] = highest[m].max(position[m]);
            }
            false
        });
        self.ms += 1;
        self.still_ms += u64::from(self.steps() == steps);
        self.turn();
        if self.sensors.is_some() && self.ms.is_multiple_of(HEAT_MS) {
            self.machine.send_aux(b"{he1s:n}\n{he3s:n}\n");
        }
        self.heard[0] += &String::from_utf8_lossy(&self.machine.received());
        self.heard[1] += &String::from_utf8_lossy(&self.machine.received_aux());
    }

    /// Turns the spindle as outputs and PWM say.
    fn turn(&mut self) {
        let outputs = gpio::outputs();
        let reversed = outputs & COUNTERCLOCKWISE != 0;
        let drive = self.drives[usize::from(reversed)];
        let (from, to) = drive.share;
        let part = (f64::from(pwm::output().1) / 1e3 - from) / (to - from);
        let rpm = match outputs & SPINDLE != 0 && part.is_finite() {
            true => drive.speed.0 + part * (drive.speed.1 - drive.speed.0),
            false => 0.0,
        };
        let rpm = if reversed { -rpm } else { rpm };
        let lacks = rpm - self.rpm;
        if self.pulses > 0 && lacks != 0.0 {
            // The last part of the way is a jump, so that the speed settles.
            let part = if self.inert && lacks.abs() >= 1.0 { 1.0 / SPINDLE_MS } else { 1.0 };
            self.rpm += lacks * part;
            self.machine.turn_spindle(self.rpm, self.pulses);
        }
    }

    /// Sends bytes to the port of the job.
    pub fn send(&self, bytes: &[u8]) {
        self.machine.send(bytes);
    }

    /// Returns the next line that the port of the job has sent.
    pub fn line(&mut self) -> Option<String> {
        next(&mut self.heard[0])
    }

    /// Sends a setting, or a block before the job begins, and returns its answer.
    pub fn set(&mut self, line: &str) -> Result<String, String> {
        self.ask_on(self.port, line)
    }

    /// Asks the second port, and returns the answer. Lines of the port of the job are kept.
    pub fn ask(&mut self, line: &str) -> Result<String, String> {
        self.ask_on(Port::Aux, line)
    }

    fn ask_on(&mut self, port: Port, line: &str) -> Result<String, String> {
        let bytes = format!("{line}\n");
        match port {
            Port::Usb => self.machine.send(bytes.as_bytes()),
            Port::Aux => self.machine.send_aux(bytes.as_bytes()),
        }
        for _ in 0..ASK_MS {
            while let Some(heard) = next(&mut self.heard[port as usize]) {
                if self.heats(&heard) {
                    continue;
                }
                match status(&heard) {
                    Some(0) => return Ok(heard),
                    Some(_) => return Err(format!("{line}: {heard}")),
                    None => {}
                }
            }
            self.pass();
        }
        Err(format!("no answer to {line}"))
    }

    /// Brings a heater nearer to its target, if the line tells one. Returns whether it does.
    fn heats(&mut self, heard: &str) -> bool {
        let Some(sensors) = self.sensors else { return false };
        for (heater, name) in ["he1s", "he3s"].into_iter().enumerate() {
            if let Ok(target) = value(heard, name) {
                let lacks = if target > 0.0 { target } else { ROOM } - self.degrees[heater];
                self.degrees[heater] += lacks.clamp(-HEAT_BY[heater], HEAT_BY[heater]);
                let read = reading(sensors[heater], self.degrees[heater]);
                self.machine.set_sensor(heater, read as u16);
                return true;
            }
        }
        false
    }

    /// Reads what is around from the settings: motors, travel, spindle, and with `prints` the heaters.
    pub fn learn(&mut self, prints: bool) -> Result<(), String> {
        let begun = self.axes.map(|axis| axis.motor.is_some().then(|| self.position(&axis)));
        self.fold();
        for (n, axis) in AXES.into_iter().enumerate() {
            let heard = self.ask(&format!("{{{axis}:n}}"))?;
            let of = |name| value(&heard, name);
            let axis = &mut self.axes[n];
            axis.travel = (of("tn")?, of("tm")?);
            axis.homed = if matches!(of("sx")? as u8, 1 | 3) { of("tm")? } else { of("tn")? };
            axis.motor = None;
        }
        for index in 0..MOTORS {
            let heard = self.ask(&format!("{{{}:n}}", index + 1))?;
            let of = |name| value(&heard, name);
            // Steps are counted before pins are inverted, so the motor's direction does not matter.
            let step = of("tr")? * of("sa")? / 360.0 / of("mi")?;
            if let Some(axis) = self.axes.get_mut(of("ma")? as usize) {
                axis.motor = axis.motor.or(Some(Motor { index, step }));
            }
        }
        for (n, begun) in begun.into_iter().enumerate() {
            self.place(n, begun.unwrap_or(self.axes[n].homed));
        }
        self.learn_spindle()?;
        if prints && self.sensors.is_none() {
            let kind = |heard: String, name| Ok::<_, String>(Kind::of(value(&heard, name)? as u8));
            let sensors =
                [kind(self.ask("{he1k:n}")?, "he1k")?, kind(self.ask("{he3k:n}")?, "he3k")?];
            self.sensors = Some(sensors);
            for (heater, kind) in sensors.into_iter().enumerate() {
                self.machine.set_sensor(heater, reading(kind, ROOM) as u16);
            }
        }
        Ok(())
    }

    fn learn_spindle(&mut self) -> Result<(), String> {
        for (n, way) in ["c", "w"].into_iter().enumerate() {
            let mut of = |name: &str| {
                let name = format!("p1{way}{name}");
                let heard = self.ask(&format!("{{{name}:n}}"))?;
                value(&heard, &name)
            };
            self.drives[n] = Drive { speed: (of("sl")?, of("sh")?), share: (of("pl")?, of("ph")?) };
        }
        let heard = self.ask("{spn:n}")?;
        self.pulses = value(&heard, "spn")? as u16;
        Ok(())
    }

    /// Takes the present position of an axis for `mm` in machine coordinates.
    pub fn place(&mut self, n: usize, mm: f64) {
        self.fold();
        let axis = self.axes[n];
        self.axes[n].base += mm - self.position(&axis);
    }

    /// Returns how far an axis is from its position after homing, mm.
    pub fn off_home(&self, n: usize) -> f64 {
        (self.position(&self.axes[n]) - self.axes[n].homed).abs()
    }

    fn position(&self, axis: &Axis) -> f64 {
        let steps = |motor: Motor| self.machine.emitted().position[motor.index] as f64 * motor.step;
        axis.base + axis.motor.map_or(0.0, steps)
    }

    /// Adds how far the motors went to how far the axes went.
    fn fold(&mut self) {
        for axis in &mut self.axes {
            let Some(Motor { index, step }) = axis.motor else { continue };
            let ends = [self.lowest[index], self.highest[index]];
            let [a, b] = ends.map(|steps| axis.base + steps as f64 * step);
            let (low, high) = axis.went.unwrap_or((f64::INFINITY, f64::NEG_INFINITY));
            axis.went = Some((low.min(a).min(b), high.max(a).max(b)));
        }
        self.forget_travel();
    }

    fn forget_travel(&mut self) {
        let position = self.machine.emitted().position;
        (self.lowest, self.highest) = (position, position);
    }

    /// Makes the port of the job speak its dialect.
    pub fn open(&mut self, dialect: Dialect) {
        self.send(format!("{}\n", dialect.opening()).as_bytes());
        (0..OPEN_MS).for_each(|_| self.pass());
        self.heard[0].clear();
    }

    /// Makes the spindle need time to change its speed.
    pub fn make_inert(&mut self) {
        self.inert = true;
    }

    /// Counts travel and time from here.
    pub fn begin(&mut self) -> u64 {
        self.forget_travel();
        self.axes.iter_mut().for_each(|axis| axis.went = None);
        self.ms
    }

    /// Returns how far an axis went, in machine coordinates; `None` if no motor drives it alone.
    pub fn went(&mut self, n: usize) -> Option<(f64, f64)> {
        self.fold();
        self.axes[n].went
    }

    /// Returns the number of steps so far, of all motors together.
    pub fn steps(&self) -> u64 {
        self.machine.emitted().steps.iter().sum()
    }

    /// Returns the machine state, `stat` of TinyG's dialect.
    pub fn state(&mut self) -> Result<u8, String> {
        let heard = self.ask("{stat:n}")?;
        Ok(value(&heard, "stat")? as u8)
    }

    /// Whether the firmware has asked for a reset.
    pub fn was_reset(&self) -> bool {
        was_reset()
    }
}

/// Takes a line from what has been heard.
fn next(heard: &mut String) -> Option<String> {
    let (line, rest) = heard.split_once('\n')?;
    let (line, rest) = (line.trim_end().to_string(), rest.to_string());
    *heard = rest;
    Some(line)
}

/// Returns the number behind a name in an answer.
pub fn value(heard: &str, name: &str) -> Result<f64, String> {
    let after = heard.split_once(&format!("\"{name}\":")).map(|(_, rest)| rest);
    let digits = after.and_then(|rest| rest.split([',', '}']).next());
    digits.and_then(|d| d.parse().ok()).ok_or_else(|| format!("no {name} in {heard}"))
}
