//! Plays and judges what senders may do in an alarm, on the host or on the simulated chip. The first port speaks grbl's
//! dialect, the second TinyG's.
//!
//! What must hold:
//!
//! - Each line is answered once, by what [`LINES`] or [`ASIDE`] says of it. A line right behind a reset is answered
//!   behind the greeting.
//! - The alarm lasts until something ends it that is accepted: `$X`, `$H`, `{clear:n}`, M2 in TinyG's dialect. No
//!   refused line, no byte and no reset ends it.
//! - Nothing moves in an alarm, except for a homing that is accepted.
//! - The machine shows its state at each `?`, and no block is left in the queue.
#![allow(dead_code, reason = "each test uses a part")]

use kerf::boards::inputs::{A_MIN, DOOR, STOP, X_MIN, Y_MIN, Z_MAX};
use kerf::machine::Alarm;

use crate::side::Side;

/// What brings the machine into an alarm. Lines of G-code wait behind a move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// A limit is touched in the midst of what this line begins; a `!` comes before if `true`.
    Limit(&'static str, bool),
    /// X runs into its limit, which stays closed.
    RunsIntoLimit,
    /// The emergency stop is hit in a move, and released.
    Stop,
    /// The emergency stop is hit in a move, and stays so.
    StopStays,
    /// A target lies beyond the travel.
    SoftLimit,
    /// A probing finds nothing.
    Probing,
    /// A homing finds no switch.
    Homing,
    /// A reset in a move.
    Reset,
    /// A line on the second port, in a move.
    Asked(&'static str),
    /// `$SLP`, at rest.
    Sleep,
}

use Cause::{Asked, Limit, RunsIntoLimit, SoftLimit, Stop, StopStays};

/// All causes but a panic, which never ends.
pub const CAUSES: &[Cause] = &[
    Limit(MOVE, false),
    Limit(MOVE, true),
    Limit("$J=G90X8F600", false),
    Limit("G4P5", false),
    Limit("M0", false),
    Limit("$H", false),
    Limit("G38.2Z-50F60", false),
    Limit("", false),
    RunsIntoLimit,
    Stop,
    StopStays,
    SoftLimit,
    Cause::Probing,
    Cause::Homing,
    Cause::Reset,
    Asked("{alarm:n}"),
    Asked("{shutd:n}"),
    Cause::Sleep,
];

/// A panic.
pub const PANIC: Cause = Asked("{panic:n}");

/// Moves of a second and more, and lines that wait behind them.
const MOVE: &str = "G90G1F600X8\nX2\nG4P0.2\nX8\nM3S1000\nX2";

/// What a line does in an alarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// It is accepted, and changes nothing that concerns the alarm.
    Told,
    /// So is it, unless an open door holds the machine.
    Restores,
    /// It is refused by this number; 0 for that of the alarm.
    Refused(u16),
    /// It ends the alarm.
    Unlocks,
    /// It ends the alarm, and homes.
    Homes,
    /// It turns the motors off.
    Sleeps,
    /// It ends an alarm that the end of a program ends.
    EndsProgram,
}

use Class::{EndsProgram, Homes, Refused, Restores, Sleeps, Told, Unlocks};

/// Lines in grbl's dialect.
pub const LINES: &[(&str, Class)] = &[
    ("", Told),
    ("  ", Told),
    ("$", Told),
    ("$$", Told),
    ("$#", Told),
    ("$G", Told),
    ("$I", Told),
    ("$N", Told),
    ("$110=1200", Told),
    ("$xvm", Told),
    ("$uda0=7", Told),
    ("$RST=#", Told),
    ("$RST=$", Restores),
    ("$RST=*", Restores),
    ("$SLP", Sleeps),
    ("$C", Refused(8)),
    ("$J=G91X1F600", Refused(8)),
    ("$J=X1", Refused(16)),
    ("$N0=G54", Refused(8)),
    ("$HB", Refused(5)),
    ("$HQ", Refused(3)),
    ("$Q", Refused(3)),
    ("$RST=x", Refused(3)),
    ("$999=1", Refused(3)),
    ("G0X1", Refused(0)),
    ("G91G1X1F600", Refused(0)),
    ("X1", Refused(0)),
    ("G2X1Y1I1F600", Refused(0)),
    ("G28", Refused(0)),
    ("G28.2X0", Refused(0)),
    ("G28.3X0", Refused(0)),
    ("G38.2Z-1F60", Refused(0)),
    ("G4P0.1", Refused(0)),
    ("G10L2P1X0", Refused(0)),
    ("G92X0", Refused(0)),
    ("G92.1", Refused(0)),
    ("G21", Refused(0)),
    ("F100", Refused(0)),
    ("S100", Refused(0)),
    ("T1M6", Refused(0)),
    ("M0", Refused(0)),
    ("M2", Refused(0)),
    ("M30", Refused(0)),
    ("M3S1000", Refused(0)),
    ("M5", Refused(0)),
    ("M8", Refused(0)),
    ("M9", Refused(0)),
    ("M112", Refused(0)),
    ("M999", Refused(0)),
    ("garbage", Refused(0)),
    ("%", Told),
    // A line that begins with a brace would select TinyG's dialect: `tests/grbl.rs`.
    ("[clear:n]", Refused(0)),
    ("[home:1]", Refused(0)),
    ("clear:n", Refused(0)),
    ("\"gc\":\"M2\"", Refused(0)),
    ("(M2){clear:n}", Refused(0)),
    ("$X", Unlocks),
    ("$H", Homes),
    ("$HX", Homes),
];

/// Lines in TinyG's dialect, on the second port.
pub const ASIDE: &[(&str, Class)] = &[
    ("{stat:n}", Told),
    ("{xvm:n}", Told),
    ("{md:n}", Told),
    ("{me:n}", Told),
    ("{alarm:n}", Told),
    ("{qf:1}", Restores),
    ("{defa:1}", Restores),
    ("{home:1}", Refused(0)),
    ("{jogx:5}", Refused(0)),
    ("{chk:1}", Refused(0)),
    ("{nothing:1}", Refused(100)),
    ("G0X1", Refused(0)),
    ("G28.2X0", Refused(0)),
    ("G28.3X0", Refused(0)),
    ("M2 (the end)", Refused(0)),
    ("M5", Refused(0)),
    ("{gc:\"G0X1\"}", Refused(0)),
    ("M2", EndsProgram),
    ("{gc:\"M30\"}", EndsProgram),
    ("{clear:n}", Unlocks),
    ("{clr:n}", Unlocks),
];

/// Bytes that act without a line, and bytes that do nothing.
pub const BYTES: &[u8] =
    &[b'!', b'~', b'?', 0x84, 0x85, 0x90, 0x91, 0x95, 0x9A, 0x9E, 0xA0, 0xA1, 0x80, 0xFF];

/// One action.
#[derive(Clone, Debug)]
pub enum Op {
    /// An alarm begins, and this many ms pass. Does nothing if one is on.
    Raise(Cause, u64),
    /// `^x`.
    Reset,
    /// A line of [`LINES`]; right behind a `^x` if `true`.
    Line(usize, bool),
    /// A line of [`ASIDE`].
    Aside(usize),
    /// A byte.
    Byte(u8),
    /// The door is opened or shut.
    Door(bool),
}

type Outcome<T> = Result<T, String>;

/// Longest time of an answer, and of one to a homing, ms.
const ANSWER_MS: u64 = 2_000;
const HOMING_MS: u64 = 60_000;
/// For this long nothing else may come, ms.
const QUIET_MS: u64 = 40;
/// Longest time in which the machine slows down, and all lines from before the alarm are answered, ms.
const SETTLE_MS: u64 = 500;
/// Free blocks of an empty queue, and free bytes.
const FREE: &str = "|Bf:61,254|";
/// Switches, as steps of motors.
const SWITCHES: &[(usize, i64, bool)] =
    &[(X_MIN, -640, false), (Y_MIN, -640, false), (Z_MAX, 640, false), (A_MIN, -640, false)];

/// A machine, and what is known of it.
pub struct Model<S> {
    side: S,
    alarm: Alarm,
    sleeps: bool,
    pressed: bool,
    door: bool,
    /// How long the machine may still move, ms, and how many lines from before the alarm have no answer yet.
    settles: u64,
    in_flight: usize,
    /// What has been heard on each port and not been judged.
    heard: [Vec<String>; 2],
    partial: [String; 2],
    log: Vec<String>,
}

impl<S: Side> Model<S> {
    /// Boots a machine with empty EEPROM.
    pub fn boot(mut side: S) -> Outcome<Self> {
        side.wire(SWITCHES, 0);
        side.run_ms(1_500);
        let (heard, partial, log) = (Default::default(), Default::default(), Vec::new());
        let (alarm, sleeps, pressed, door) = (Alarm::None, false, false, false);
        let (settles, in_flight) = (0, 0);
        let mut model =
            Model { side, alarm, sleeps, pressed, door, settles, in_flight, heard, partial, log };
        model.run(0);
        model.heard = Default::default();
        model.say("$I")?;
        model.set_up()?;
        Ok(model)
    }

    /// Returns all that was done and heard.
    pub fn story(&self) -> String {
        self.log.iter().map(|line| format!("  {line}\n")).collect()
    }

    /// Plays what applies to the state of the machine.
    pub fn play(&mut self, ops: &[Op]) -> Outcome<()> {
        for op in ops {
            let is_on = self.alarm != Alarm::None;
            let resets = matches!(op, Op::Reset | Op::Line(_, true));
            let applies = match op {
                Op::Raise(..) => !is_on,
                _ => is_on && !(resets && self.alarm == Alarm::Panic),
            };
            if !applies {
                continue;
            }
            self.log.push(format!("{op:?}"));
            let before = self.side.steps();
            let rests = self.settles == 0;
            let stays = match op {
                Op::Raise(cause, ms) => {
                    self.raise(*cause, *ms)?;
                    false
                }
                Op::Reset => self.reset(b"")?,
                Op::Line(row, resets) => self.line(*row, *resets)?,
                Op::Aside(row) => self.aside(*row)?,
                Op::Byte(byte) => {
                    self.side.send(&[*byte]);
                    true
                }
                Op::Door(open) => self.set_door(*open),
            };
            self.run(QUIET_MS);
            self.forget()?;
            if rests && stays && before != self.side.steps() {
                return Err("it has moved".to_string());
            }
            self.check()?;
        }
        Ok(())
    }

    /// Ends the alarm, whatever it is. Then the machine has moved nothing that is not known.
    pub fn recover(&mut self) -> Outcome<()> {
        self.log.push("recover".to_string());
        self.side.set_input(STOP, false);
        self.pressed = false;
        self.shut_door();
        self.say("$X")?;
        (self.alarm, self.sleeps) = (Alarm::None, false);
        self.check()?;
        self.log.clear();
        Ok(())
    }

    /// Makes limits, door and emergency stop what they are in this test.
    fn set_up(&mut self) -> Outcome<()> {
        self.say("$21=1")?;
        self.say("$10=3")?;
        self.side.send_aux(b"{est:1,saf:1}\n");
        self.answer(1, ANSWER_MS)?;
        self.run(QUIET_MS);
        if self.pressed {
            self.alarm = self.alarm.max(Alarm::Shutdown);
        }
        Ok(())
    }

    /// Says a line in grbl's dialect, which must be accepted.
    fn say(&mut self, line: &str) -> Outcome<()> {
        self.side.send(format!("{line}\n").as_bytes());
        match self.answer(0, HOMING_MS)?.as_str() {
            "ok" => Ok(()),
            answer => Err(format!("{line}: {answer}")),
        }
    }

    /// Lets time pass, and takes what comes.
    fn run(&mut self, ms: u64) {
        self.side.run_ms(ms);
        self.settles = self.settles.saturating_sub(ms);
        let heard = [self.side.heard(), self.side.heard_aux()];
        for (port, heard) in heard.iter().enumerate() {
            self.partial[port] += &String::from_utf8_lossy(heard);
            while let Some((line, rest)) = self.partial[port].split_once('\n') {
                let line = line.trim_matches('\r').to_string();
                self.partial[port] = rest.to_string();
                self.log.push(format!("    <{port} {line}"));
                self.heard[port].push(line);
            }
        }
    }

    /// Forgets what has come. Its answers must be those to lines that have been in flight since before the alarm.
    fn forget(&mut self) -> Outcome<()> {
        let [late, aside] = core::mem::take(&mut self.heard)
            .map(|heard| heard.iter().filter(|line| is_answer(line)).count());
        if late > self.in_flight || aside > 0 {
            return Err("an answer to nothing".to_string());
        }
        self.in_flight -= late;
        Ok(())
    }

    /// Waits for a line on a port, and takes it and what came before it.
    fn hear(&mut self, port: usize, ms: u64, is: impl Fn(&str) -> bool) -> Outcome<String> {
        for _ in 0..=ms {
            if let Some(at) = self.heard[port].iter().position(|line| is(line)) {
                return Ok(self.heard[port].drain(..=at).next_back().unwrap_or_default());
            }
            self.run(1);
        }
        Err(format!("nothing comes on port {port}"))
    }

    /// Waits for the answer to the line that was sent last on a port.
    fn answer(&mut self, port: usize, ms: u64) -> Outcome<String> {
        while port == 0 && self.in_flight > 0 {
            self.hear(port, ms, is_answer)?;
            self.in_flight -= 1;
        }
        self.hear(port, ms, is_answer)
    }

    /// Checks the state that a report shows.
    fn check(&mut self) -> Outcome<()> {
        self.forget()?;
        self.side.send(b"?");
        self.run(QUIET_MS);
        let report = self.heard[0].iter().find(|line| line.starts_with('<')).cloned();
        let report = report.ok_or("a ? has no answer")?;
        self.forget()?;
        let wanted: &[&str] = match self.alarm {
            _ if self.sleeps => &["<Sleep|"],
            Alarm::None if self.door => &["<Door:1|"],
            Alarm::None => &["<Idle|"],
            _ => &["<Alarm|"],
        };
        if !wanted.iter().any(|state| report.starts_with(state)) {
            return Err(format!("{report} instead of {wanted:?}"));
        }
        let waits = self.settles > 0 || (self.door && self.alarm == Alarm::None);
        if !waits && !report.contains(FREE) {
            return Err(format!("{report}: something is left in the queue"));
        }
        Ok(())
    }

    /// Shuts the door. If an M2 waits for that, a hold remains.
    fn shut_door(&mut self) {
        self.set_door(false);
        self.run(QUIET_MS);
        self.side.send(b"~");
        self.run(QUIET_MS);
    }

    fn set_door(&mut self, open: bool) -> bool {
        self.side.set_input(DOOR, open);
        self.door = open;
        true
    }

    /// Brings the machine into an alarm. It homes first.
    fn raise(&mut self, cause: Cause, ms: u64) -> Outcome<()> {
        self.shut_door();
        self.say("$H")?;
        match cause {
            Limit(line, holds) => {
                self.begin(line);
                if holds {
                    self.side.send(b"!");
                    self.run(200);
                }
                // Y: the limits of an axis that homes do not count.
                self.side.set_input(Y_MIN, true);
                self.run(50);
                self.side.set_input(Y_MIN, false);
                self.alarm = Alarm::Limit;
            }
            RunsIntoLimit => {
                self.begin("G90G1F600X-5");
                self.run(1_000);
                self.alarm = Alarm::Limit;
            }
            Stop | StopStays => {
                self.begin(MOVE);
                self.side.set_input(STOP, true);
                self.run(50);
                self.pressed = cause == StopStays;
                self.side.set_input(STOP, self.pressed);
                self.alarm = Alarm::Shutdown;
            }
            SoftLimit => {
                self.say("$20=1")?;
                self.begin("G90G0X9999");
                self.alarm = Alarm::Alarm;
                self.say("$20=0")?;
            }
            Cause::Probing => {
                self.begin("G38.2Z-1F600");
                self.run(1_000);
                self.alarm = Alarm::Alarm;
            }
            Cause::Homing => {
                self.begin("G90G0X20");
                self.run(3_000);
                self.say("$130=1")?;
                self.begin("$HX");
                self.run(2_000);
                self.alarm = Alarm::Alarm;
                self.say("$130=150")?;
            }
            Cause::Reset => {
                self.begin(MOVE);
                self.alarm = Alarm::Alarm;
                self.reset(b"")?;
            }
            Asked(line) => {
                self.begin(MOVE);
                self.side.send_aux(format!("{line}\n").as_bytes());
                self.answer(1, ANSWER_MS)?;
                self.alarm = match line {
                    "{alarm:n}" => Alarm::Alarm,
                    "{shutd:n}" => Alarm::Shutdown,
                    _ => Alarm::Panic,
                };
            }
            Cause::Sleep => {
                self.begin("$SLP");
                (self.alarm, self.sleeps) = (Alarm::Alarm, true);
            }
        }
        self.settles = SETTLE_MS;
        self.run(ms);
        Ok(())
    }

    /// Sends lines, and lets them begin.
    fn begin(&mut self, lines: &str) {
        self.side.send(format!("{lines}\n").as_bytes());
        self.in_flight += lines.lines().count().max(1);
        self.run(300);
    }

    /// Sends a reset, with bytes behind it, and waits for the greeting.
    fn reset(&mut self, behind: &[u8]) -> Outcome<bool> {
        self.side.send(&[b"\x18", behind].concat());
        self.sleeps = false;
        self.hear(0, ANSWER_MS, |line| line.starts_with("Grbl "))?;
        self.hear(0, ANSWER_MS, |line| line == "[MSG:'$H'|'$X' to unlock]")?;
        self.in_flight = 0;
        Ok(true)
    }

    /// Says a line, and judges its answer. Returns whether the machine must not have moved.
    fn line(&mut self, row: usize, resets: bool) -> Outcome<bool> {
        let (line, class) = LINES[row];
        let bytes = format!("{line}\n");
        if resets {
            self.reset(bytes.as_bytes())?;
        } else {
            self.side.send(bytes.as_bytes());
        }
        let answer = self.answer(0, if class == Homes { HOMING_MS } else { ANSWER_MS })?;
        let locked = self.pressed || self.alarm == Alarm::Panic;
        let wanted: &[u16] = match class {
            Homes if self.door => &[8, 9],
            Restores if self.door => &[8],
            // The defaults would switch the stop's input off.
            Restores if self.pressed => &[9],
            Unlocks | Homes if locked => &[9],
            // The other port may feed the machine as long as the door holds it.
            Refused(0) if self.door => &[8, 9],
            Refused(0) => &[9],
            Refused(number) => &[number],
            _ => &[0],
        };
        let number = if answer == "ok" { 0 } else { number(answer.strip_prefix("error:")) };
        self.judge(line, class, number, wanted)?;
        if number == 0 && line.starts_with("$RST") && line != "$RST=#" {
            self.set_up()?;
        }
        let homes = class == Homes && number == 0;
        if homes {
            self.side.send_aux(b"{homx:n}\n");
            let homed = self.answer(1, ANSWER_MS)?;
            if !homed.contains("\"homx\":1") {
                return Err(format!("{line} has homed nothing: {homed}"));
            }
        }
        Ok(!homes)
    }

    /// Says a line on the second port, and judges its answer.
    fn aside(&mut self, row: usize) -> Outcome<bool> {
        let (line, class) = ASIDE[row];
        self.side.send_aux(format!("{line}\n").as_bytes());
        let answer = self.answer(1, ANSWER_MS)?;
        let is = 201 + self.alarm as u16 + 1;
        let locked = self.pressed || self.alarm == Alarm::Panic;
        let ends = matches!(self.alarm, Alarm::Alarm | Alarm::Limit);
        let is = &[is][..];
        let wanted: &[u16] = match class {
            Restores if self.pressed && line == "{defa:1}" && !self.door => is,
            Restores if self.door => &[0, 15, 106],
            // Its answer begins like the greeting.
            Restores => &[0, 15],
            Unlocks if locked => is,
            Refused(0) | EndsProgram if self.door => &[is[0], 117, 0],
            EndsProgram if !ends => is,
            Refused(0) => is,
            Refused(number) => &[number],
            _ => &[0],
        };
        let status = answer.rsplit("\"f\":[1,").next().and_then(|rest| rest.split(',').next());
        let number = number(status);
        self.judge(line, class, number, wanted)?;
        if number == 15 {
            self.set_up()?;
        }
        Ok(true)
    }

    /// Compares an answer with what it must be, and takes over what it tells of the alarm.
    fn judge(&mut self, line: &str, class: Class, number: u16, wanted: &[u16]) -> Outcome<()> {
        if !wanted.contains(&number) {
            return Err(format!("{line} is answered by {number} instead of {wanted:?}"));
        }
        match class {
            Unlocks | Homes | EndsProgram if number == 0 => {
                (self.alarm, self.sleeps) = (Alarm::None, false);
            }
            Sleeps if number == 0 => self.sleeps = true,
            _ => {}
        }
        Ok(())
    }
}

/// Whether a line answers one, in either dialect.
fn is_answer(line: &str) -> bool {
    line == "ok"
        || line.starts_with("error:")
        || line.starts_with("{\"r\":{") && line.contains("\"f\":")
}

fn number(text: Option<&str>) -> u16 {
    text.and_then(|text| text.parse().ok()).unwrap_or(u16::MAX)
}
