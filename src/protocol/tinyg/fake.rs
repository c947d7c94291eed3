//! A machine for tests, and the caller that steps requests for it.

use super::{Mode, Request};
use crate::config::{Setting, Settings};
use crate::gcode::overrides::{Change, Overrides};
use crate::gcode::tables::TableRow;
use crate::heat::Standing;
use crate::machine::{Alarm, Cycle, Doing};
use crate::motion::snapshot::Program;
use crate::protocol::{
    Answers, CHUNK, Checksum, Hold, Machine, Memory, Next, Out, Remembers, Store, Value, Warning,
};
use crate::status::Status;
use crate::units::Length;
use std::collections::HashMap;
use std::string::String;
use std::vec::Vec;

pub struct Fake {
    pub settings: Settings,
    pub memory: Memory,
    pub mode: Mode,
    pub inches: bool,
    pub position: i32,
    pub line: i32,
    pub powered: [bool; 4],
    pub overrides: Overrides,
    pub doing: Doing,
    pub rest: Program,
    /// Values of the interpreter's tables.
    pub rows: HashMap<(u8, u8), i32>,
    /// Lengths of the tool, by axis.
    pub tool_lengths: HashMap<u8, i32>,
    /// Settings that are in EEPROM only.
    pub cold: HashMap<u8, i32>,
    /// The stored program.
    pub program: Vec<u8>,
    waits: bool,
    /// The status that G-code blocks return, and the blocks that were run.
    pub outcome: Status,
    pub blocks: Vec<String>,
}

impl Fake {
    pub fn new() -> Fake {
        let mut memory = Memory::new();
        memory.restore();
        Fake {
            settings: Settings::new(),
            memory,
            mode: Mode::Json,
            inches: false,
            position: 0,
            line: 0,
            powered: [false; 4],
            overrides: Overrides::NONE,
            doing: Doing::Rests,
            rest: Program::Ready,
            rows: HashMap::new(),
            tool_lengths: HashMap::new(),
            cold: HashMap::new(),
            program: Vec::new(),
            waits: false,
            outcome: Status::Ok,
            blocks: Vec::new(),
        }
    }

    /// Sends a line and returns the answer of the machine.
    pub fn send(&mut self, line: &[u8]) -> Vec<u8> {
        let mut mode = self.mode;
        let length = line.len() as u16 + 1;
        let request = Request::begin(line, length, &mut mode, &self.settings);
        self.mode = mode;
        let Some(mut request) = request else { return Vec::new() };
        let mut answer = Vec::new();
        let mut sum = None;
        for _ in 0..1000 {
            let mut chunk = Chunk { bytes: Vec::new(), sum };
            let next = request.step(line, self, &mut chunk);
            sum = chunk.sum;
            answer.extend(chunk.bytes);
            match next {
                Next::More => {}
                Next::Wait => assert!(self.waits),
                Next::Gcode { start, end } => {
                    assert!(answer.is_empty(), "a response has begun before its block has run");
                    let block = &line[usize::from(start)..usize::from(end)];
                    self.blocks.push(String::from_utf8_lossy(block).into_owned());
                    request.ran(self.outcome, line.iter().any(|byte| matches!(byte, b'(' | b';')));
                }
                Next::Done(_) => return answer,
            }
        }
        panic!("no end to {line:?}");
    }

    /// Sends a line and returns the answer as text, without the last line feed.
    pub fn ask(&mut self, line: &str) -> String {
        let answer = String::from_utf8(self.send(line.as_bytes())).unwrap();
        String::from(answer.strip_suffix('\n').unwrap_or(&answer))
    }
}

/// An output that enforces the limit of bytes per step.
#[derive(Default)]
pub struct Chunk {
    pub bytes: Vec<u8>,
    pub sum: Option<Checksum>,
}

impl Out for Chunk {
    fn put(&mut self, byte: u8) {
        self.bytes.push(byte);
        assert!(self.bytes.len() <= CHUNK, "a step puts too much");
        if let Some(sum) = &mut self.sum {
            sum.add(byte);
        }
    }

    fn begin_sum(&mut self) {
        self.sum = Some(Checksum::default());
    }

    fn take_sum(&mut self) -> u16 {
        self.sum.take().unwrap_or_default().value()
    }
}

impl Machine for Fake {
    fn settings(&self) -> &Settings {
        &self.settings
    }

    fn change_override(&mut self, change: Change) {
        self.overrides.change(change);
    }

    fn cold(&mut self, setting: Setting) -> i32 {
        self.cold.get(&setting.number()).copied().unwrap_or_else(|| setting.default_value())
    }

    fn set(&mut self, setting: Setting, value: i32) -> Result<Warning, Status> {
        if setting.is_cold() {
            self.cold.insert(setting.number(), value);
        }
        self.settings.store(setting, value);
        let lowered = self.settings.limit_velocity(setting, |_| 40_000);
        Ok(if lowered { Warning::Velocity } else { Warning::None })
    }

    fn set_tool_length(&mut self, axis: u8, length: Length) -> Result<(), Status> {
        self.tool_lengths.insert(axis, length.0);
        Ok(())
    }

    fn set_row(&mut self, row: TableRow, axis: u8, value: Length) -> Result<(), Status> {
        // Refuses every other call, as if another row were still being stored.
        self.waits = !self.waits;
        if self.waits {
            return Err(Status::Again);
        }
        self.rows.insert((row.number(), axis), value.0);
        Ok(())
    }

    fn value(&mut self, value: Value) -> i32 {
        match value {
            Value::Override(which) => self.overrides.factor(which).into(),
            Value::OverrideOn(which) => self.overrides.is_on(which).into(),
            Value::TableRow(row, axis) => {
                self.rows.get(&(row.number(), axis)).copied().unwrap_or_default()
            }
            Value::Units => i32::from(!self.inches),
            Value::Coordinates | Value::FeedMode => 1,
            Value::MotionMode => 4,
            Value::QueueFree => 32,
            Value::SlotsFree | Value::BytesFree | Value::BytesInAll => 7,
            Value::BlockLine | Value::FinishedLine => self.line,
            Value::Position(0) => self.position,
            Value::MachinePosition(_) => i32::MIN,
            Value::Powered(motor) => self.powered[usize::from(motor)].into(),
            _ => 0,
        }
    }

    fn programmed(&mut self, value: Value) -> i32 {
        self.value(value)
    }

    fn moment(&mut self, _first: bool) {}

    fn memory(&mut self) -> &mut Memory {
        &mut self.memory
    }

    fn doing(&mut self) -> Doing {
        self.doing
    }

    fn cycle(&mut self) -> Cycle {
        Cycle::Lines
    }

    fn hold(&mut self) -> Hold {
        Hold::None
    }

    fn rest(&mut self) -> Program {
        self.rest
    }

    fn restore(&mut self, _offsets: bool) -> Status {
        if self.doing == Doing::Runs {
            return Status::NotAccepted;
        }
        self.settings.set_defaults();
        self.cold.clear();
        self.memory.restore();
        Status::Ok
    }

    fn alarm(&mut self, _alarm: Alarm, _reason: Status) {}

    fn clear(&mut self) -> Status {
        Status::Ok
    }

    fn flush(&mut self) -> Status {
        if self.doing == Doing::Runs { Status::NotAccepted } else { Status::Ok }
    }

    fn start_job(&mut self, number: u8) -> Status {
        if number < 20 { Status::Ok } else { Status::Error }
    }

    fn home(&mut self, _axes: u8, _ends_alarm: bool) -> Status {
        Status::HomingSwitches
    }

    fn check(&mut self, on: bool) -> Status {
        if on { Status::Ok } else { Status::NotAccepted }
    }

    fn heater(&mut self, _heater: u8) -> Option<Standing> {
        None
    }

    fn waits_for_heat(&mut self) -> bool {
        false
    }

    fn skip_wait(&mut self) {}
    fn unlock_heaters(&mut self) {}
    fn hold_back(&mut self) {}
    fn start_over(&mut self) {}
    fn startup(&mut self, _line: u8, _at: u8) -> Option<u8> {
        None
    }
    fn jog(&mut self, axis: u8, _place: Length) -> Status {
        if axis < 3 { Status::Ok } else { Status::AxisDisabled }
    }

    fn store(&mut self, what: Store<'_>) -> Result<(), Status> {
        self.waits = !self.waits;
        match what {
            _ if self.waits => return Err(Status::Again),
            Store::Begin => self.program.clear(),
            Store::Line(line) => self.program.extend([line, b"\n"].concat()),
            Store::Startup(..) => {}
            Store::End => {}
        }
        Ok(())
    }

    fn program(&mut self, at: u16) -> Option<u8> {
        self.program.get(usize::from(at)).copied()
    }

    fn restart(&mut self, boot: bool) -> Status {
        if boot && self.doing == Doing::Runs { Status::NotAccepted } else { Status::Ok }
    }

    fn energize(&mut self, motor: Option<u8>, on: bool) -> Status {
        match motor {
            Some(motor) => self.powered[usize::from(motor)] = on,
            None => self.powered = [on; 4],
        }
        Status::Ok
    }
}
