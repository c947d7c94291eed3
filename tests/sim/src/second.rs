//! A board on the second simulator of AVR: avr8js with additions (`tests/avr/emulator`).
//!
//! The firmware runs there as in [`Machine`](crate::Machine), with nothing in common but the world outside: another
//! program executes the instructions, and other timers, serial ports, pins and EEPROM are around it. Where the two
//! differ, one of them contradicts the data sheet.
//!
//! The program answers each request, a line of JSON, with a line of JSON: see its `bridge.mjs`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use kerf::boards::{Board, MOTORS, Pin};
use serde::{Deserialize, Serialize};

use crate::emulated::process::{Answers, Lent};
use crate::emulated::{is_emulated, packed, unpacked};
use crate::runs::Runs;

/// Path of the program where `cargo xtask` has put it, beside the folder of the images.
const PROGRAM: &str = "avr-emulator/bridge.mjs";
/// Bytes of EEPROM.
const CELLS: usize = 4_096;
/// Lines of a board: those of its ports.
const LINES: usize = 2;

/// A request to the program.
#[derive(Serialize, Default, Debug)]
struct Request {
    #[serde(skip_serializing_if = "Option::is_none")]
    board: Option<PowerUp>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cells: Option<String>,
    send: Vec<(usize, String)>,
    now: Vec<(usize, u8)>,
    baud: Vec<(usize, u32)>,
    drive: Vec<(u8, bool)>,
    #[serde(skip_serializing_if = "Option::is_none")]
    wire: Option<Vec<Worked>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    spindle: Option<Sensors>,
    #[serde(skip_serializing_if = "Option::is_none")]
    turn: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cut: Option<u8>,
    record: bool,
    until: u64,
    line: bool,
}

/// The board that is to be powered up: its image, and the step pin and the direction pin of each motor.
#[derive(Serialize, Debug)]
struct PowerUp {
    elf: PathBuf,
    motors: Vec<(u8, u8)>,
}

/// A switch at a pin, as the program knows it.
#[derive(Serialize, Debug)]
struct Worked {
    pin: u8,
    motor: usize,
    step: i64,
    above: bool,
    opens: bool,
}

/// The sensors of a spindle.
#[derive(Serialize, Debug)]
struct Sensors {
    index: u8,
    sync: u8,
    pulses: u32,
}

/// A switch that a motor works.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    /// Number of the input.
    pub input: usize,
    /// The motor, from 0.
    pub motor: usize,
    /// Step from which on the switch is worked.
    pub step: i64,
    /// Whether "from which on" means upwards.
    pub above: bool,
    /// Whether the switch opens there instead of closing.
    pub opens: bool,
}

/// The state of the board after a request.
#[derive(Deserialize, Clone, Default, Debug)]
#[serde(default)]
struct Answer {
    fault: Option<String>,
    cycle: u64,
    heard: Vec<String>,
    steps: Vec<i64>,
    totals: Vec<u64>,
    last: u64,
    lost: u64,
    resets: u64,
    times: Option<Vec<Vec<u64>>>,
    cells: Option<String>,
}

impl Answers for Answer {
    fn fault(&self) -> Option<&str> {
        self.fault.as_deref()
    }
}

/// A board on the second simulator.
pub struct Second {
    board: &'static Board,
    process: Lent,
    request: Request,
    answer: Answer,
    heard: [Vec<u8>; LINES],
}

/// The number of a pin: eight times its port, and its bit.
fn number(pin: Pin) -> u8 {
    let port = "ABCDEFGHJKL".find(pin.port.letter()).unwrap_or(0);
    8 * port as u8 + pin.bit
}

impl Second {
    /// Powers a board up with the image in `elf`. All its switches are open.
    pub fn load(elf: &Path, board: &'static Board) -> Result<Self> {
        Self::load_with(elf, board, None)
    }

    /// As [`Second::load`], with these contents of the EEPROM.
    pub fn load_with(
        elf: &Path,
        board: &'static Board,
        cells: Option<&[u8; CELLS]>,
    ) -> Result<Self> {
        ensure!(!is_emulated(board), "the board {} has another chip", board.name);
        let folder = elf.parent().and_then(Path::parent).unwrap_or(Path::new("."));
        let program = folder.join(PROGRAM);
        ensure!(program.exists(), "no {}: `cargo xtask test` puts it there", program.display());
        let pins = board.motors.iter().map(|motor| (number(motor.step), number(motor.dir)));
        let power_up = PowerUp { elf: elf.to_owned(), motors: pins.collect() };
        let inputs = board.inputs.iter().flatten();
        let mut board = Second {
            board,
            process: Lent::take(program)?,
            request: Request {
                board: Some(power_up),
                cells: cells.map(|cells| packed(cells)),
                drive: inputs.map(|pin| (number(*pin), true)).collect(),
                ..Request::default()
            },
            answer: Answer::default(),
            heard: Default::default(),
        };
        board.run(0, false)?;
        Ok(board)
    }

    /// Sends the request that was collected, and takes the answer.
    fn run(&mut self, until: u64, line: bool) -> Result<()> {
        (self.request.until, self.request.line) = (until, line);
        self.answer = self.process.ask(&std::mem::take(&mut self.request))?;
        for (heard, hex) in self.heard.iter_mut().zip(&self.answer.heard) {
            heard.extend(unpacked(hex));
        }
        Ok(())
    }

    /// Runs for a time.
    pub fn run_for_ms(&mut self, ms: u64) -> Result<()> {
        self.run(self.cycle() + self.cycles(ms), false)
    }

    /// Closes or opens the switch of an input.
    pub fn close(&mut self, input: usize, closed: bool) {
        if let Some(pin) = self.board.inputs[input] {
            self.request.drive.push((number(pin), !closed));
        }
    }

    /// Puts switches at the inputs, which the motors work.
    pub fn wire(&mut self, switches: &[Near]) {
        let worked = |near: &Near| {
            let Near { motor, step, above, opens, .. } = *near;
            let pin = number(self.board.inputs[near.input]?);
            Some(Worked { pin, motor, step, above, opens })
        };
        self.request.wire = Some(switches.iter().filter_map(worked).collect());
    }

    /// Puts a spindle with this many marks at the pins of its sensors. The spindle stands still.
    pub fn fit_spindle(&mut self, pulses: u32) -> Result<()> {
        let encoder = self.board.encoder.context("the board has no pins for sensors")?;
        let (index, sync) = (number(encoder.index), number(encoder.sync));
        self.request.spindle = Some(Sensors { index, sync, pulses });
        Ok(())
    }

    /// Sets the speed of the spindle, turns a minute.
    pub fn turn_spindle(&mut self, rpm: f64) {
        self.request.turn = Some(rpm);
    }

    /// Returns the cycles of the steps of each motor since the last call, none the first time.
    pub fn times(&mut self) -> Result<Vec<Vec<u64>>> {
        self.request.record = true;
        self.run(self.cycle(), false)?;
        Ok(self.answer.times.take().unwrap_or_default())
    }

    /// Returns what the EEPROM holds if the supply fails now. A byte that is being programmed is the old one (0),
    /// erased (1), wrong (2) or the new one (3).
    pub fn cut(&mut self, byte: u8) -> Result<[u8; CELLS]> {
        self.request.cut = Some(byte);
        self.run(self.cycle(), false)?;
        let cells = unpacked(self.answer.cells.as_deref().unwrap_or_default());
        cells.try_into().ok().context("not 4,096 bytes")
    }

    /// Steps up minus steps down of each motor. A low direction pin means up.
    pub fn steps(&self) -> [i64; MOTORS] {
        std::array::from_fn(|m| self.answer.steps.get(m).copied().unwrap_or(0))
    }

    /// Steps of each motor in both directions together.
    pub fn totals(&self) -> [u64; MOTORS] {
        std::array::from_fn(|m| self.answer.totals.get(m).copied().unwrap_or(0))
    }

    /// Bytes that a receiver has lost.
    pub fn lost(&self) -> u64 {
        self.answer.lost
    }

    /// Number of resets by the watchdog.
    pub fn resets(&self) -> u64 {
        self.answer.resets
    }
}

impl Runs for Second {
    fn cycle(&self) -> u64 {
        self.answer.cycle
    }

    fn cycles(&self, ms: u64) -> u64 {
        ms * u64::from(self.board.clock_hz) / 1_000
    }

    fn run_until_line(&mut self, cycle: u64) -> Result<()> {
        self.run(cycle, true)
    }

    fn send(&mut self, bytes: &[u8]) {
        self.request.send.push((0, packed(bytes)));
    }

    fn send_now(&mut self, byte: u8) {
        self.request.now.push((0, byte));
    }

    fn receive(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.heard[0])
    }

    fn set_baud(&mut self, baud: u32) {
        self.request.baud.push((0, baud));
    }

    fn garbled(&self) -> u64 {
        0
    }

    fn last_step(&self) -> Option<u64> {
        (self.answer.last > 0).then_some(self.answer.last)
    }
}

#[cfg(test)]
mod tests {
    use kerf::boards::{MEGA2560_GRBL, Port, pin};

    use super::*;

    #[test]
    fn pins_have_their_numbers() {
        assert_eq!(number(pin(Port::A, 2)), 2);
        assert_eq!(number(pin(Port::K, 7)), 79);
        assert_eq!(MEGA2560_GRBL.motors.len(), MOTORS);
    }
}
