//! Every setting at the limits of its range, and what the motors must do then.

use kerf::boards::MOTORS;
use kerf::config::table::{CLAMP, JERK, Kind, MODE};
use kerf::config::{Owner, Setting};

use crate::side::Side;

/// Most steps of a move here, and the longest time of a move, ms.
const STEPS: f64 = 100_000.0;
const PATIENCE_MS: u64 = 20_000;
/// Longest time of an answer, ms: a killed move may come to rest slowly.
const ANSWER_MS: u64 = 60_000;
/// Steps per unit above which no move is accepted.
const FINEST: f64 = 163_840_000.0;
/// The largest coordinate.
const FARTHEST: f64 = 214_748.0;
/// Distances of the moves, mm or degrees.
const WAYS: [f64; 4] = [0.0002, 0.013, 1.0, -0.7132];
const AXES: [&str; 6] = ["x", "y", "z", "a", "b", "c"];

/// A setting and a value for it.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    pub setting: Setting,
    /// The value, scaled as it is stored. It may be one beyond the range.
    pub value: i64,
}

/// Returns all settings that have a range, each with the ends of the range and the values beyond the ends.
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for setting in (0..Setting::NUMBERS).filter_map(Setting::from_number) {
        let row = setting.row();
        if matches!(row.kind, Kind::Constant | Kind::Text | Kind::Data | Kind::Job) {
            continue;
        }
        let (min, max) = (i64::from(row.min), i64::from(row.max));
        cases.extend([min - 1, min, max, max + 1].map(|value| Case { setting, value }));
    }
    cases
}

/// How a motor turns a distance into steps.
#[derive(Clone, Copy, Debug, Default)]
struct Motor {
    axis: i64,
    angle: f64,
    travel: f64,
    micro: f64,
    /// Whether the direction may be inverted. The host counts steps before pins are inverted, but the chip's pins show
    /// the inverted direction.
    turned: bool,
}

/// The effect of the settings on the motors.
#[derive(Clone, Debug)]
struct Motion {
    motors: [Motor; MOTORS],
    /// For each axis: its mode and its radius.
    axes: [(i64, f64); AXES.len()],
    /// The backlash of each axis.
    backlash: [f64; AXES.len()],
}

impl Motion {
    /// The settings of a machine.
    fn of(machine: u8) -> Self {
        let mut motion = Self {
            motors: Default::default(),
            axes: [(0, 0.0); AXES.len()],
            backlash: [0.0; AXES.len()],
        };
        for setting in (0..Setting::NUMBERS).filter_map(Setting::from_number) {
            if matches!(setting.owner(), Owner::Motor(_) | Owner::Axis(_)) {
                motion.set(setting, setting.value_on(machine).into());
            }
        }
        motion
    }

    fn set(&mut self, setting: Setting, kept: i64) {
        let row = setting.row();
        let value = kept as f64 / 10f64.powi(row.stored.into());
        let token = row.token;
        match setting.owner() {
            Owner::Motor(motor) => {
                let motor = &mut self.motors[usize::from(motor)];
                match &token[..2] {
                    b"ma" => motor.axis = kept,
                    b"sa" => motor.angle = value,
                    b"tr" => motor.travel = value,
                    b"mi" => motor.micro = value,
                    b"po" => motor.turned = kept == 1,
                    _ => {}
                }
            }
            Owner::Axis(axis) => {
                if &token[..2] == b"bl" {
                    self.backlash[usize::from(axis)] = value;
                }
                let axis = &mut self.axes[usize::from(axis)];
                match &token[..2] {
                    b"am" => axis.0 = kept,
                    b"ra" => axis.1 = value,
                    _ => {}
                }
            }
            Owner::System if setting.is_machine() => *self = Self::of(kept as u8),
            _ => {}
        }
    }

    /// Returns the steps of a motor in a unit.
    fn ratio(&self, motor: usize) -> f64 {
        let Motor { angle, travel, micro, .. } = self.motors[motor];
        360.0 / angle * micro / travel
    }

    /// Returns how far an axis moves if its word is `way`.
    fn way(&self, axis: usize, way: f64) -> f64 {
        let (mode, radius) = self.axes[axis];
        match mode {
            1 => way,
            3 => way / (std::f64::consts::TAU * radius) * 360.0,
            _ => 0.0,
        }
    }

    /// Returns the steps that a motor makes if the word of an axis is `way`.
    fn steps(&self, motor: usize, axis: usize, way: f64) -> f64 {
        let way = self.way(axis, way);
        if self.motors[motor].axis == axis as i64 { self.ratio(motor) * way } else { 0.0 }
    }

    /// Returns the steps that a motor makes in addition where an axis turns round; at most 4,095.
    fn backlash(&self, motor: usize, axis: usize, way: f64) -> f64 {
        if self.motors[motor].axis != axis as i64 {
            return 0.0;
        }
        (self.ratio(motor) * self.backlash[axis]).abs().min(4_095.0).copysign(way)
    }

    /// Returns the largest coordinate: smaller if some motor has several steps in 0.0001, and 0 if it has too many. A
    /// motor counts even if it moves no axis.
    fn reach(&self) -> f64 {
        let finest = (0..MOTORS).map(|motor| self.ratio(motor)).fold(0.0, f64::max);
        let octaves = (finest * 1e-4).log2().ceil().max(0.0);
        if finest > FINEST { 0.0 } else { FARTHEST / octaves.exp2() }
    }
}

/// A machine, and its settings.
pub struct Bench<S> {
    side: S,
    motion: Motion,
    heard: String,
    /// Whether a move has been killed, so that the machine may stand between two multiples of 0.0001.
    between: bool,
}

type Outcome<T> = Result<T, String>;

impl<S: Side> Bench<S> {
    pub fn new(mut side: S) -> Outcome<Self> {
        side.wire(&[], 0);
        let mut bench = Self { side, motion: Motion::of(0), heard: String::new(), between: false };
        bench.pass(100);
        let settings = "{sv:0,xsn:0,xsx:0,ysn:0,ysx:0,zsn:0,zsx:0,asn:0,asx:0}";
        bench.ask(settings).map(|_| bench)
    }

    fn pass(&mut self, ms: u64) {
        self.side.run_ms(ms);
        let heard = self.side.heard();
        self.heard += &String::from_utf8_lossy(&heard).replace(['\x11', '\x13'], "");
    }

    /// Sends a line. Returns its status and its answer.
    fn ask(&mut self, line: &str) -> Outcome<(u16, String)> {
        self.heard.clear();
        self.side.send(format!("{line}\n").as_bytes());
        for _ in 0..ANSWER_MS {
            self.pass(1);
            let answer = self.heard.lines().find_map(|line| {
                let (_, footer) =
                    line.split_once("f\":[1,").or_else(|| line.split_once("f:[1,"))?;
                let status = footer.split(',').next()?.parse().ok()?;
                Some((status, line.to_string()))
            });
            if let Some(answer) = answer.filter(|_| self.heard.ends_with(['\n', '\r'])) {
                return Ok(answer);
            }
        }
        Err(format!("{line} is not answered: {:?}", self.heard))
    }

    /// Sets a setting to a value. Returns whether the machine accepted the value; an error if that is wrong.
    pub fn set(&mut self, case: &Case) -> Outcome<bool> {
        let Case { setting, value } = *case;
        let row = setting.row();
        let name = String::from_utf8(setting.name().bytes().to_vec()).expect("ASCII");
        let scale = 10i64.pow(row.stored.into());
        let sign = if value < 0 { "-" } else { "" };
        let (whole, part) = (value.abs() / scale, value.abs() % scale);
        let number = match row.stored {
            0 => format!("{value}"),
            stored => format!("{sign}{whole}.{part:0width$}", width = usize::from(stored)),
        };
        let line = format!("{{{name}:{number}}}");
        let silent = name == "jv" && value == 0;
        let (status, answer) = match self.ask(&line) {
            Err(_) if silent => (0, String::new()),
            answered => answered?,
        };
        let within = (i64::from(row.min)..=i64::from(row.max)).contains(&value);
        // These may refuse values within the range: the radius mode on a linear axis, and a rate that the line cannot
        // have. A jerk is divided.
        let may_be_refused = row.is(MODE) || setting.is_baud();
        match (within, status) {
            (true, 0) => self.motion.set(setting, value),
            (true, 108..=110) if may_be_refused => return Ok(false),
            (false, 0) if row.is(CLAMP) || row.is(JERK) && value > 0 => {}
            (false, 102 | 104 | 108..=110) => return Ok(false),
            _ => return Err(format!("{line} is answered {answer}")),
        }
        if setting.is_baud() {
            let codes = [9_600, 19_200, 38_400, 57_600, 115_200, 230_400];
            let rate = codes.get(value as usize - 1).copied().unwrap_or(value as u32);
            self.pass(20);
            self.side.set_baud(rate);
        }
        Ok(true)
    }

    /// Moves an axis forth and back, and compares the steps with the distances.
    pub fn move_axis(&mut self, axis: usize) -> Outcome<()> {
        for way in WAYS {
            for code in ["g0", "g1 f1000"] {
                let most =
                    (0..MOTORS).map(|m| self.motion.steps(m, axis, way).abs()).fold(0.0, f64::max);
                if most <= STEPS {
                    self.go(axis, way, code)?;
                }
            }
        }
        Ok(())
    }

    fn go(&mut self, axis: usize, way: f64, code: &str) -> Outcome<()> {
        let from = self.side.steps();
        let line = format!("g91 {code} {}{way:.4}", AXES[axis]);
        let (status, answer) = self.ask(&line)?;
        let between = std::mem::take(&mut self.between);
        if status == 0 && !self.comes_to_rest()? {
            self.between = true;
            return Ok(());
        }
        let to = self.side.steps();
        let refused = match status {
            0 => false,
            // A move may have been made before it.
            110 => 2.1 * self.motion.way(axis, way).abs() >= self.motion.reach(),
            137 => self.motion.axes[axis].0 == 0,
            _ => false,
        };
        if status != 0 && !refused {
            return Err(format!("{line} is answered {answer}"));
        }
        for motor in 0..MOTORS {
            let made = (to[motor] - from[motor]) as f64;
            let due = if refused { 0.0 } else { self.motion.steps(motor, axis, way) };
            let due = if self.motion.motors[motor].turned { due.copysign(made) } else { due };
            // Both ends are rounded, to steps and to 0.0001 of a unit.
            let close = 1.01 + due.abs() * 1e-6 + self.rounding(motor, axis, between);
            // The direction may be that of the move before.
            let more = if refused { 0.0 } else { self.motion.backlash(motor, axis, due) };
            if (made - due).abs() > close && (made - due - more).abs() > close {
                return Err(format!("{line}: motor {} makes {made} steps of {due}", motor + 1));
            }
        }
        Ok(())
    }

    /// Returns the steps in 0.0001 of a unit if the words of the axis are not degrees or the last move was killed;
    /// else 0.
    fn rounding(&self, motor: usize, axis: usize, between: bool) -> f64 {
        let turns = between
            || self.motion.axes[axis].0 == 3 && self.motion.motors[motor].axis == axis as i64;
        if turns { self.ratio_of(motor) * 1e-4 } else { 0.0 }
    }

    fn ratio_of(&self, motor: usize) -> f64 {
        self.motion.ratio(motor).abs()
    }

    /// Whether the machine comes to rest in time. A move that takes longer is dropped.
    fn comes_to_rest(&mut self) -> Outcome<bool> {
        let mut waited = 0;
        while waited < PATIENCE_MS {
            self.pass(20 + waited / 4);
            waited += 20 + waited / 4;
            let (_, told) = self.ask("{stat:n}")?;
            if !told.contains("stat\":5") && !told.contains("stat:5") {
                return Ok(true);
            }
        }
        self.side.send(b"\x04");
        self.pass(5_000);
        Ok(false)
    }
}

/// Sets a setting on a machine that has just booted, and makes the moves that the setting is about.
pub fn play<S: Side>(side: S, cases: &[Case]) -> Outcome<()> {
    let mut bench = Bench::new(side)?;
    let mut axes = vec![0];
    for Case { setting, value } in cases {
        match setting.owner() {
            Owner::Motor(motor) => axes.push(motor.into()),
            Owner::Axis(axis) => axes.push(axis.into()),
            _ => {}
        }
        bench.set(&Case { setting: *setting, value: *value })?;
    }
    axes.sort_unstable();
    axes.dedup();
    axes.into_iter().try_for_each(|axis| bench.move_axis(axis))
}
