//! A board whose chip is emulated by a program in JavaScript: the RP2040, by rp2040js with additions
//! (`tests/rp2040/emulator`).
//!
//! The program answers each request, a line of JSON, with a line of JSON: see its `bridge.mjs`. Bytes sent and pins
//! driven here are collected, and passed with the next request to run.

mod card;
pub mod even;
pub mod heat;
pub mod job;
pub(crate) mod process;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use kerf::boards::{Board, Encoder, MOTORS, Pin, Port, ShiftRegister, Usart};
use process::{Answers, Lent};
use serde::{Deserialize, Serialize};

use crate::runs::Runs;
use crate::track::Steps;

/// Path of the program where `cargo xtask` has put it, beside the folder of the images.
const PROGRAM: &str = "rp2040-emulator/bridge.mjs";

/// A request to the emulator.
#[derive(Serialize, Default, Debug)]
struct Request {
    #[serde(skip_serializing_if = "Option::is_none")]
    board: Option<PowerUp>,
    cut: bool,
    stick: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    panic: Option<String>,
    crash: Option<String>,
    reset: bool,
    loaded: bool,
    unmasked: bool,
    sense: Vec<(u8, u16)>,
    send: Vec<(usize, String)>,
    now: Vec<(usize, u8)>,
    #[serde(skip_serializing_if = "Option::is_none")]
    usb: Option<Talks>,
    faults: Vec<(&'static str, u64, u64)>,
    ask: Vec<[u8; 8]>,
    baud: Vec<(usize, u32)>,
    drive: Vec<(u8, bool)>,
    #[serde(skip_serializing_if = "Option::is_none")]
    wire: Option<Vec<Near>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    drivers: Option<Vec<Driver>>,
    ails: Vec<Ails>,
    #[serde(skip_serializing_if = "Option::is_none")]
    spindle: Option<Sensors>,
    #[serde(skip_serializing_if = "Option::is_none")]
    marks: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    turn: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    noise: Option<Noise>,
    #[serde(skip_serializing_if = "Option::is_none")]
    card: Option<card::Card>,
    #[serde(skip_serializing_if = "Option::is_none")]
    slot: Option<card::Slot>,
    #[serde(skip_serializing_if = "Option::is_none")]
    record: Option<bool>,
    until: u64,
    line: bool,
}

/// Noise at a pin.
#[derive(Serialize, Debug)]
struct Noise {
    gpio: u8,
    /// Cycles of the CPU; 0 ends the noise.
    period: u32,
}

/// The board that is to be powered up.
#[derive(Serialize, Debug)]
struct PowerUp {
    /// The ELF file for its flash.
    elf: PathBuf,
    /// The step pin and the direction pin of each motor.
    motors: Vec<(u8, u8)>,
    /// The address of each motor's driver, if the board has them.
    drivers: Vec<u8>,
    /// The shift registers of steps and of other outputs.
    registers: Vec<Chain>,
}

/// A chain of shift registers at pins of the chip.
#[derive(Serialize, Debug)]
struct Chain {
    data: u8,
    clock: u8,
    latch: u8,
    outputs: u8,
}

impl Chain {
    fn of(register: ShiftRegister) -> Self {
        let ShiftRegister { data, clock, latch, outputs } = register;
        Self { data: data.bit, clock: clock.bit, latch: latch.bit, outputs }
    }
}

/// What is in a chain of shift registers.
#[derive(Deserialize, Clone, Default, Debug)]
struct Latched {
    /// The levels of its outputs, as bits.
    held: u32,
    /// The shortest of the times that a register asks for, cycles.
    least: Option<u64>,
}

/// The state of the program at the other end of USB.
#[derive(Serialize, Clone, Copy, Debug)]
pub struct Talks {
    /// Whether it has the port open.
    pub open: bool,
    /// Whether it reads what comes.
    pub reads: bool,
}

/// A fault of USB: at the bus, at its packets, or at the computer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The computer sleeps for so many ms.
    Sleep(u64),
    /// No frames come for so many ms.
    Skip(u64),
    /// The cable is out for so many ms.
    Unplug(u64),
    /// The computer resets the bus.
    Reset,
    /// The computer gives a request up, and resets the bus.
    Abort,
    /// The controller hangs by erratum E15 at the next packet that it sends.
    Hang,
    /// So many packets are damaged, in the way that the emulator's `DAMAGES` name.
    Damage(&'static str, u64),
    /// From now on one packet in so many is damaged, by a seed; none with 0.
    Noise {
        /// The seed.
        seed: u64,
        /// See [`Fault::Noise`].
        one_in: u64,
    },
}

impl Fault {
    /// The fault for the emulator.
    fn told(self) -> (&'static str, u64, u64) {
        match self {
            Fault::Sleep(ms) => ("sleep", ms, 0),
            Fault::Skip(ms) => ("skip", ms, 0),
            Fault::Unplug(ms) => ("unplug", ms, 0),
            Fault::Reset => ("reset", 0, 0),
            Fault::Abort => ("abort", 0, 0),
            Fault::Hang => ("hang", 1, 0),
            Fault::Damage(kind, count) => (kind, count, 0),
            Fault::Noise { seed, one_in } => ("noise", seed, one_in),
        }
    }
}

/// What the computer at the other end of USB knows.
#[derive(Deserialize, Clone, Default, Debug)]
pub struct Bus {
    /// Whether the port can be talked to.
    pub ready: bool,
    /// How often the computer has found the device.
    pub attached: u64,
    /// Bytes of its program that were dropped, because the device was gone.
    pub lost: u64,
    /// How often the controller has hung since the chip was reset.
    pub hangs: u64,
    /// What came of the requests since the last answer: hexadecimal digits, or `stall`.
    pub answered: Vec<String>,
    /// The configuration descriptor, hexadecimal digits.
    pub descriptors: String,
}

/// The number by which a pin selects its UART (RP2040 data sheet, 2.19.2).
const UART: u8 = 2;
/// Number of lines that the emulator has: two UARTs, and USB.
const LINES: usize = 3;
/// The line at which the drivers of a board listen: UART1.
pub const DRIVERS: usize = 1;

/// Returns the emulator's number of a pin: outputs of registers follow those of the chip.
fn number(pin: Pin) -> u8 {
    match pin.port {
        Port::Steps => 32 + pin.bit,
        Port::Outputs => 64 + pin.bit,
        _ => pin.bit,
    }
}

/// Returns the emulator's line of a board's port.
fn line(board: &Board, port: usize) -> usize {
    match board.serial.get(port).map(|serial| serial.usart) {
        Some(Usart::Usb) => 2,
        Some(Usart::Uart1) => 1,
        _ => 0,
    }
}

/// A switch at a pin, closed while a motor is at or beyond a step; or open there if it `opens`.
#[derive(Serialize, Clone, Copy, Debug)]
pub struct Near {
    /// Pin of the switch.
    pub gpio: u8,
    /// The motor, from 0.
    pub motor: usize,
    /// Step from which on the switch is worked.
    pub step: i64,
    /// Whether "beyond" means above the step.
    pub above: bool,
    /// Hysteresis: the switch lets go this many steps back.
    pub back: u32,
    /// Whether the switch opens there instead of closing.
    pub opens: bool,
}

/// A TMC2209 on the line of drivers, its motor, and the hard stop that blocks the motor.
#[derive(Serialize, Clone, Copy, Debug)]
pub struct Driver {
    /// Address of the driver.
    pub address: u8,
    /// The motor, from 0.
    pub motor: usize,
    /// The pin that the driver's DIAG output leads to.
    pub gpio: u8,
    /// Position of the stop, full steps.
    pub stop: i64,
    /// Whether the motor comes to the stop from below.
    pub above: bool,
    /// Whether the driver has power.
    pub powered: bool,
}

/// What becomes of a driver; of all of them without an address.
#[derive(Serialize, Clone, Copy, Default, Debug)]
pub struct Ails {
    /// Address of the driver.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub address: Option<u8>,
    /// Whether it has motor power from now on. Without, it forgets everything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub powered: Option<bool>,
    /// Whether its UART is dead from now on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deaf: Option<bool>,
    /// Whether it resets.
    pub reset: bool,
    /// DRV_STATUS from now on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub status: Option<u32>,
    /// Bits of GSTAT that become set.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub global: Option<u32>,
}

/// The sensors of a spindle, which pull their pins low.
#[derive(Serialize, Clone, Copy, Debug)]
struct Sensors {
    index: u8,
    sync: u8,
    /// Marks that the sync sensor sees in a turn.
    pulses: u32,
}

/// The state of the board after a request.
#[derive(Deserialize, Clone, Default, Debug)]
struct Answer {
    #[serde(default)]
    fault: Option<String>,
    #[serde(default)]
    cycle: u64,
    #[serde(default)]
    heard: Vec<String>,
    #[serde(default)]
    steps: Vec<i64>,
    #[serde(default)]
    totals: Vec<u64>,
    #[serde(default)]
    gaps: Vec<Option<f64>>,
    #[serde(default)]
    last: f64,
    #[serde(default)]
    rotors: Vec<f64>,
    #[serde(default)]
    levels: u32,
    #[serde(default)]
    registers: Vec<Latched>,
    #[serde(default)]
    shares: Vec<(u8, f64)>,
    #[serde(default)]
    units: Vec<u8>,
    #[serde(default)]
    floated: u32,
    #[serde(default)]
    strong: u32,
    #[serde(default)]
    asleep: f64,
    #[serde(default)]
    masked: f64,
    #[serde(default)]
    waited: f64,
    #[serde(default)]
    stack: usize,
    #[serde(default)]
    spent: Vec<f64>,
    #[serde(default)]
    runs: Vec<f64>,
    #[serde(default)]
    longest: Vec<f64>,
    #[serde(default)]
    resets: u64,
    #[serde(default)]
    waiting: usize,
    #[serde(default)]
    bus: Bus,
    #[serde(default)]
    loads: bool,
    #[serde(default)]
    recorded: Option<Recorded>,
}

impl Answers for Answer {
    fn fault(&self) -> Option<&str> {
        self.fault.as_deref()
    }
}

/// Recorded edges of steps.
#[derive(Deserialize, Clone, Default, Debug)]
pub struct Recorded {
    /// The cycles at which each motor's step pulses rise.
    #[serde(default)]
    pub times: Vec<Vec<u64>>,
    /// The directions of these steps: 1 where the direction pin is low, else -1.
    #[serde(default)]
    pub signs: Vec<Vec<i8>>,
    /// Edges of the outputs behind a register that are no steps: which output, whether it rises, and the cycle.
    #[serde(default)]
    pub edges: Vec<(u8, bool, u64)>,
    /// The shortest pulse, cycles.
    #[serde(default)]
    pub shortest: Option<f64>,
    /// The shortest time from the end of a pulse to a change of the motor's direction, cycles.
    #[serde(default)]
    pub hold: Option<f64>,
    /// The shortest time from such a change to the motor's next pulse, cycles.
    #[serde(default)]
    pub setup: Option<f64>,
}

impl Recorded {
    /// Returns the steps of each motor, on a board whose clock has so many cycles in a second.
    pub fn steps(&self, clock_hz: f64) -> Steps {
        let mut steps = Steps::default();
        for ((steps, times), signs) in steps.iter_mut().zip(&self.times).zip(&self.signs) {
            let both = times.iter().zip(signs);
            steps.extend(both.map(|(cycle, sign)| (*cycle as f64 / clock_hz, *sign > 0)));
        }
        steps
    }
}

/// An emulated board.
pub struct Emulated {
    board: &'static Board,
    process: Lent,
    request: Request,
    answer: Answer,
    heard: [Vec<u8>; LINES],
}

/// Whether a board's chip is emulated, not simulated.
pub fn is_emulated(board: &Board) -> bool {
    board.motors[0].step.port.is_of_rp2040()
}

/// Returns the path of the emulator that belongs to an image.
fn program(elf: &Path) -> PathBuf {
    let folder = elf.parent().and_then(Path::parent).unwrap_or(Path::new("."));
    folder.join(PROGRAM)
}

impl Emulated {
    /// Powers a board up with this image.
    pub fn load(elf: &Path, board: &'static Board) -> Result<Self> {
        ensure!(is_emulated(board), "the board {} is simulated, not emulated", board.name);
        let program = program(elf);
        ensure!(
            program.exists(),
            "no {}: `cargo xtask sim --board pico` puts it there",
            program.display()
        );
        let pins = board.motors.iter().map(|motor| (number(motor.step), number(motor.dir)));
        let registers = board.registers.iter().flat_map(|both| [both.steps, both.outputs]);
        let drivers = board.drivers.map_or(vec![], |drivers| drivers.addresses.to_vec());
        let power_up = PowerUp {
            elf: elf.to_owned(),
            motors: pins.collect(),
            drivers,
            registers: registers.map(Chain::of).collect(),
        };
        let mut board = Emulated {
            board,
            process: Lent::take(program)?,
            request: Request { board: Some(power_up), ..Request::default() },
            answer: Answer::default(),
            heard: Default::default(),
        };
        board.run(0, false)?;
        Ok(board)
    }

    /// Returns the description of the board.
    pub fn board(&self) -> &'static Board {
        self.board
    }

    /// Sends the request that was collected, and takes the answer.
    fn run(&mut self, until: u64, line: bool) -> Result<()> {
        (self.request.until, self.request.line) = (until, line);
        self.answer = self.process.ask(&std::mem::take(&mut self.request))?;
        for (line, hex) in self.answer.heard.iter().enumerate().take(LINES) {
            self.heard[line].extend(unpacked(hex));
        }
        Ok(())
    }

    /// Runs for a time.
    pub fn run_for_ms(&mut self, ms: u64) -> Result<()> {
        self.run(self.cycle() + self.cycles(ms), false)
    }

    /// As [`Emulated::run_for_ms`], in microseconds.
    pub fn run_for_us(&mut self, us: u64) -> Result<()> {
        self.run(self.cycle() + self.cycles(us) / 1_000, false)
    }

    /// Puts bytes on the line of a port.
    pub fn send_to(&mut self, port: usize, bytes: &[u8]) {
        self.request.send.push((line(self.board, port), packed(bytes)));
    }

    /// Takes the bytes that the board has sent on a port.
    pub fn receive_from(&mut self, port: usize) -> Vec<u8> {
        self.receive_line(line(self.board, port))
    }

    /// As [`Emulated::receive_from`], for a line that need not belong to a port.
    pub fn receive_line(&mut self, line: usize) -> Vec<u8> {
        std::mem::take(&mut self.heard[line])
    }

    /// Sets what the program at the other end of USB does from now on.
    pub fn session(&mut self, talks: Talks) {
        self.request.usb = Some(talks);
    }

    /// Has something go wrong at USB.
    pub fn trouble(&mut self, fault: Fault) {
        self.request.faults.push(fault.told());
    }

    /// Has the computer make a request of USB, and returns what came of it within `ms` milliseconds: hexadecimal digits,
    /// or `stall`.
    pub fn request(&mut self, packet: [u8; 8], ms: u64) -> Result<Option<String>> {
        self.request.ask.push(packet);
        self.run_for_ms(ms)?;
        Ok(self.answer.bus.answered.pop())
    }

    /// What the computer at the other end of USB knows.
    pub fn bus(&self) -> &Bus {
        &self.answer.bus
    }

    /// Whether the boot loader in ROM has been started.
    pub fn loads(&self) -> bool {
        self.answer.loads
    }

    /// Cuts the supply and restores it.
    pub fn cut_power(&mut self) {
        self.request.cut = true;
    }

    /// Makes the CPU hang with interrupts off.
    pub fn stick(&mut self) {
        self.request.stick = true;
    }

    /// Makes the CPU read where nothing is: at an address far from memory, or, for `"stack"`, where there is no place
    /// for the frame of the fault either.
    pub fn crash(&mut self, where_: &str) {
        self.request.crash = Some(where_.to_string());
    }

    /// Makes the firmware panic: a cell is borrowed twice, in a file of this name.
    pub fn panic(&mut self, file: &str) {
        self.request.panic = Some(file.to_string());
    }

    /// Presses the reset button.
    pub fn reset(&mut self) {
        self.request.reset = true;
    }

    /// Starts a new image as the boot ROM does.
    pub fn start_loaded(&mut self) {
        self.request.loaded = true;
    }

    /// Sets the reading of a channel of the converter, 0 to 4,095.
    pub fn sense(&mut self, channel: u8, value: u16) {
        self.request.sense.push((channel, value));
    }

    /// Drives an input pin.
    pub fn drive(&mut self, pin: Pin, high: bool) {
        self.request.drive.push((pin.bit, high));
    }

    /// Puts switches at pins, which the motors work.
    pub fn wire(&mut self, switches: &[Near]) {
        self.request.wire = Some(switches.to_vec());
    }

    /// Puts drivers on their line, with their registers in the state after power-up.
    pub fn drivers(&mut self, drivers: &[Driver]) {
        self.request.drivers = Some(drivers.to_vec());
    }

    /// Lets something become of a driver.
    pub fn ail(&mut self, ails: Ails) {
        self.request.ails.push(ails);
    }

    /// Positions of the drivers' motors, full steps from where they were put.
    pub fn rotors(&self) -> &[f64] {
        &self.answer.rotors
    }

    /// Puts a spindle with this many marks at the pins of its sensors. The spindle stands still.
    pub fn fit_spindle(&mut self, pulses: u32) -> Result<()> {
        let encoder =
            self.board.encoder.context("the board has no pins for a spindle's sensors")?;
        let Encoder { index, sync, .. } = encoder;
        self.request.spindle = Some(Sensors { index: index.bit, sync: sync.bit, pulses });
        Ok(())
    }

    /// Gives the spindle this many sync marks from now on.
    pub fn set_marks(&mut self, pulses: u32) {
        self.request.marks = Some(pulses);
    }

    /// Sets the speed of the spindle, turns a minute.
    pub fn turn_spindle(&mut self, rpm: f64) {
        self.request.turn = Some(rpm);
    }

    /// Has an input change its level with this period, in cycles of the CPU. 0 ends that.
    pub fn disturb(&mut self, gpio: u8, period: u32) {
        self.request.noise = Some(Noise { gpio, period });
    }

    /// Records the edges of steps in the next milliseconds.
    pub fn record_for_ms(&mut self, ms: u64) -> Result<Recorded> {
        self.begin_recording();
        self.run_for_ms(ms)?;
        self.end_recording()
    }

    /// Records the edges of steps from the next run on.
    pub fn begin_recording(&mut self) {
        self.request.record = Some(true);
    }

    /// Returns what has been recorded, and ends the recording.
    pub fn end_recording(&mut self) -> Result<Recorded> {
        self.request.record = Some(false);
        self.run_for_ms(0)?;
        Ok(self.answer.recorded.take().unwrap_or_default())
    }

    /// Steps up minus steps down of each motor. A low direction pin means up.
    pub fn steps(&self) -> [i64; MOTORS] {
        std::array::from_fn(|m| self.answer.steps.get(m).copied().unwrap_or(0))
    }

    /// As [`Emulated::steps`], for a board with any number of motors.
    pub fn positions(&self) -> &[i64] {
        &self.answer.steps
    }

    /// Steps of each motor in both directions together.
    pub fn totals(&self) -> [u64; MOTORS] {
        std::array::from_fn(|m| self.answer.totals.get(m).copied().unwrap_or(0))
    }

    /// The shortest time between two steps of each motor, s.
    pub fn gaps(&self) -> [Option<f64>; MOTORS] {
        let hz = f64::from(self.board.clock_hz);
        std::array::from_fn(|m| Some(self.answer.gaps.get(m).copied()?? / hz))
    }

    /// Whether an output is high.
    pub fn is_high(&self, pin: Pin) -> bool {
        let levels = match pin.port {
            Port::Steps | Port::Outputs => self.latched(pin.port).held,
            _ => self.answer.levels,
        };
        levels >> pin.bit & 1 != 0
    }

    fn latched(&self, port: Port) -> Latched {
        let which = usize::from(port == Port::Outputs);
        self.answer.registers.get(which).cloned().unwrap_or_default()
    }

    /// The shortest of all times that the shift register of a port asks for, since power-up: data before the clock, the
    /// clock high and low, the clock before the latch, and the latch high. Cycles; `None` if nothing was sent.
    pub fn register_time(&self, port: Port) -> Option<u64> {
        self.latched(port).least
    }

    /// Whether the line of a UART is at a pin.
    pub fn is_serial(&self, pin: Pin) -> bool {
        self.answer.units.get(usize::from(pin.bit)) == Some(&UART)
    }

    /// Whether a pin has been neither driven nor pulled since the chip started.
    pub fn floated(&self, pin: Pin) -> bool {
        self.answer.floated >> pin.bit & 1 != 0
    }

    /// Whether an output may drive 12 mA.
    pub fn is_strong(&self, pin: Pin) -> bool {
        self.answer.strong >> pin.bit & 1 != 0
    }

    /// Duty cycle of a pin that pulses: the share of its period in which it is high.
    pub fn share(&self, pin: Pin) -> f64 {
        let found = self.answer.shares.iter().find(|(gpio, _)| *gpio == pin.bit);
        found.map_or(f64::from(u8::from(self.is_high(pin))), |(_, share)| *share)
    }

    /// Cycles that the CPU has slept.
    pub fn asleep(&self) -> f64 {
        self.answer.asleep
    }

    /// The longest time for which interrupts were off since [`Emulated::forget_masked`], cycles.
    pub fn masked(&self) -> f64 {
        self.answer.masked
    }

    /// Cycles that the CPU has waited for flash.
    pub fn waited(&self) -> f64 {
        self.answer.waited
    }

    /// Bytes of the stack that have been used since power-up.
    pub fn stack(&self) -> usize {
        self.answer.stack
    }

    /// How often an exception's handler has run.
    pub fn runs(&self, exception: usize) -> f64 {
        self.answer.runs.get(exception).copied().unwrap_or(0.0)
    }

    /// Cycles of the longest run of an exception's handler since [`Emulated::forget_masked`], without the handlers
    /// that interrupt it.
    pub fn longest(&self, exception: usize) -> f64 {
        self.answer.longest.get(exception).copied().unwrap_or(0.0)
    }

    /// Forgets how long interrupts were off, and how long handlers ran.
    pub fn forget_masked(&mut self) {
        self.request.unmasked = true;
    }

    /// Cycles of an exception's handler, without the handlers that interrupt it. Exception 0 is thread mode, 16 the
    /// first interrupt.
    pub fn spent(&self, exception: usize) -> f64 {
        self.answer.spent.get(exception).copied().unwrap_or(0.0)
    }

    /// Bytes sent over USB that the board has not taken yet.
    pub fn waiting(&self) -> usize {
        self.answer.waiting
    }

    /// Number of resets by the watchdog.
    pub fn resets(&self) -> u64 {
        self.answer.resets
    }
}

impl Runs for Emulated {
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
        self.send_to(0, bytes);
    }

    fn send_now(&mut self, byte: u8) {
        self.request.now.push((line(self.board, 0), byte));
    }

    fn receive(&mut self) -> Vec<u8> {
        self.receive_from(0)
    }

    fn set_baud(&mut self, baud: u32) {
        self.request.baud.push((line(self.board, 0), baud));
    }

    fn garbled(&self) -> u64 {
        0
    }

    fn last_step(&self) -> Option<u64> {
        (self.answer.last > 0.0).then_some(self.answer.last as u64)
    }
}

/// Encodes bytes as hexadecimal digits.
pub(crate) fn packed(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Decodes hexadecimal digits to bytes.
pub(crate) fn unpacked(hex: &str) -> Vec<u8> {
    let digits = |at: usize| u8::from_str_radix(hex.get(at..at + 2)?, 16).ok();
    (0..hex.len()).step_by(2).filter_map(digits).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_read() {
        assert_eq!(unpacked("00ff7b0a"), [0, 0xFF, 0x7B, 0x0A]);
        assert_eq!(unpacked(""), [0; 0]);
    }

    #[test]
    fn the_emulator_lies_beside_the_images() {
        let program = program(Path::new("target/firmware/pico.elf"));
        assert_eq!(program, Path::new("target/rp2040-emulator/bridge.mjs"));
    }
}
