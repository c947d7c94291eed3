//! Two senders at once, each in any dialect: lines that an alarm allows are carried out whatever the other sender asks,
//! and each of them hears of each alarm, in the form of its dialect.

use kerf::boards::inputs::{STOP, X_MIN, Y_MIN, Z_MAX};
use kerf::boards::outputs;
use kerf::hal::imp::{self, Machine};

use crate::apart::apart;
use crate::seeds::try_all;
use crate::side::Side;

/// The dialect of a port.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Tongue {
    TinyG,
    Grbl,
    RepRap,
}

use Tongue::{Grbl, RepRap, TinyG};

const TONGUES: [Tongue; 3] = [TinyG, Grbl, RepRap];

impl Tongue {
    /// Lines that change nothing and are accepted in every state.
    fn asks(self) -> &'static [&'static str] {
        match self {
            TinyG => &["{stat:n}", "{xvm:n}", "{posx:n}", "{sys:n}"],
            Grbl => &["$#", "$G", "$I", "$N", "$$", "$", ""],
            RepRap => &["M105", "M114", "M115", "M119", "M118 text"],
        }
    }

    /// Lines that end an alarm.
    fn ends(self) -> &'static [&'static str] {
        match self {
            TinyG => &["{clear:n}", "{clr:n}", "M2", "{gc:\"M30\"}"],
            Grbl => &["$X", "$x"],
            RepRap => &["M999"],
        }
    }

    /// Whether a line that was heard is an answer, and which status it tells; 0 if the line was accepted.
    fn answer(self, line: &str) -> Option<String> {
        let status = match self {
            TinyG => {
                let behind = line.rsplit_once("\"f\":[1,").filter(|_| line.starts_with("{\"r\""));
                behind?.1.split(',').next()?
            }
            Grbl if line == "ok" => "0",
            Grbl => line.strip_prefix("error:")?,
            RepRap if line.starts_with("ok") => "0",
            RepRap => return None,
        };
        Some(status.to_string())
    }

    /// Whether a line tells of an alarm.
    fn is_alarm(self, line: &str) -> bool {
        match self {
            TinyG => line.starts_with("{\"er\":"),
            Grbl => line.starts_with("ALARM:"),
            RepRap => line.starts_with("Error:"),
        }
    }
}

/// A machine with two senders.
struct Two {
    machine: Machine,
    tongues: [Tongue; 2],
    partial: [String; 2],
    heard: [Vec<String>; 2],
    story: String,
    seed: u64,
}

impl Two {
    /// Boots a machine whose limits, emergency stop and homing work.
    fn boot(tongues: [Tongue; 2], seed: u64) -> Self {
        // Half of the machines blend.
        imp::set_blends(seed % 2 == 1);
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        for (input, step, opens) in
            [(X_MIN, -640, false), (Y_MIN, -640, false), (Z_MAX, 640, false)]
        {
            machine.set_near(input, step, opens);
        }
        let (partial, heard) = (Default::default(), Default::default());
        let seed = seed * 2 + 1;
        let mut two = Self { machine, tongues, partial, heard, story: String::new(), seed };
        two.run(100);
        for (port, tongue) in tongues.into_iter().enumerate() {
            // The first line that is in one dialect alone decides.
            two.send(
                port,
                match tongue {
                    TinyG => "{stat:n}",
                    Grbl => "$I",
                    RepRap => "M115",
                },
            );
            two.run(100);
            for setting in ["est", "xsn", "ysn", "zsx"] {
                let value = if setting == "est" { 1 } else { 3 };
                two.send(
                    port,
                    &match tongue {
                        TinyG => format!("{{{setting}:{value}}}"),
                        _ => format!("${setting}={value}"),
                    },
                );
                two.run(20);
            }
            two.run(100);
        }
        two.heard = Default::default();
        two
    }

    fn random(&mut self, below: usize) -> usize {
        self.seed = self.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_041);
        (self.seed >> 33) as usize % below
    }

    fn one<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.random(of.len())]
    }

    fn send(&mut self, port: usize, line: &str) {
        self.bytes(port, format!("{line}\n").as_bytes());
    }

    fn bytes(&mut self, port: usize, bytes: &[u8]) {
        self.story += &format!("  {port}> {:?}\n", String::from_utf8_lossy(bytes));
        match port {
            0 => self.machine.send(bytes),
            _ => self.machine.send_aux(bytes),
        }
    }

    fn run(&mut self, ms: u64) {
        self.machine.run_ms(ms);
        let heard = [self.machine.received(), self.machine.received_aux()];
        for (port, heard) in heard.iter().enumerate() {
            self.partial[port] += &String::from_utf8_lossy(heard).replace('\r', "");
            while let Some((line, rest)) = self.partial[port].split_once('\n') {
                let line = line.to_string();
                self.partial[port] = rest.to_string();
                self.story += &format!("    {port}< {line}\n");
                self.heard[port].push(line);
            }
        }
    }

    /// Whether a port has room for a line after so many: not all are answered. Waits for it for a second.
    fn has_room(&mut self, port: usize, sent: usize) -> bool {
        let room = [8, 3][port];
        (0..100).any(|_| {
            let tongue = self.tongues[port];
            let answered = self.heard[port].iter().filter_map(|line| tongue.answer(line)).count();
            let has = sent < answered + room;
            if !has {
                self.run(10);
            }
            has
        })
    }

    /// Takes what a port has heard: the statuses of answers, and how often it was told of an alarm.
    fn take(&mut self, port: usize) -> (Vec<String>, usize) {
        let (tongue, heard) = (self.tongues[port], core::mem::take(&mut self.heard[port]));
        let told = heard.iter().filter(|line| tongue.is_alarm(line)).count();
        (heard.iter().filter_map(|line| tongue.answer(line)).collect(), told)
    }

    /// Returns how many lines have been accepted since the last call, up to the first that was not, or to an alarm: a
    /// printing host gets `ok` for a line that an alarm refuses, too.
    fn accepted(&mut self, port: usize) -> usize {
        let (tongue, heard) = (self.tongues[port], core::mem::take(&mut self.heard[port]));
        let before = heard.iter().take_while(|line| tongue != RepRap || !tongue.is_alarm(line));
        before.filter_map(|line| tongue.answer(line)).take_while(|status| status == "0").count()
    }

    fn fails(&self, why: &str) -> Result<(), String> {
        Err(format!("{:?}: {why}\n{}", self.tongues, self.story))
    }

    /// Ends an alarm, and checks that it has ended.
    fn recover(&mut self) {
        self.machine.set_input(STOP, false);
        self.run(100);
        let end = self.tongues[0].ends()[0];
        self.send(0, end);
        self.run(300);
        self.heard = Default::default();
    }
}

fn pair(seed: u64) -> [Tongue; 2] {
    [TONGUES[seed as usize % 3], TONGUES[seed as usize / 3 % 3]]
}

/// Sends lines that an alarm allows on one port, and questions on the other within the next milliseconds. All are
/// accepted.
fn ask_beside(two: &mut Two) -> Result<(), String> {
    let port = two.random(2);
    let (tongue, other) = (two.tongues[port], two.tongues[1 - port]);
    match two.random(3) {
        0 => two.machine.set_input(Y_MIN, true),
        1 => two.machine.set_input(STOP, true),
        _ => two.machine.set_input(X_MIN, true),
    }
    two.run(30);
    for input in [Y_MIN, STOP, X_MIN] {
        two.machine.set_input(input, false);
    }
    two.run(300);
    two.heard = Default::default();
    let mut lines = Vec::new();
    // The second port holds fewer bytes.
    for _ in 0..1 + two.random(if port == 0 { 12 } else { 3 }) {
        lines.push(two.one(tongue.asks()).to_string());
    }
    // A shutdown ends by no M2.
    let ends = tongue.ends();
    let usual = if tongue == TinyG { 2 } else { ends.len() };
    lines.push(two.one(&ends[..usual]).to_string());
    for _ in 0..two.random(4) {
        lines.push(two.one(tongue.asks()).to_string());
    }
    let (count, mut asked) = (lines.len(), 0);
    let mut waits = two.random(12) as u64;
    let text: Vec<u8> = lines.iter().flat_map(|line| format!("{line}\n").into_bytes()).collect();
    two.bytes(port, &text);
    for _ in 0..two.random(6) {
        two.run(waits);
        waits = two.random(6) as u64;
        let line = two.one(other.asks());
        two.send(1 - port, line);
        asked += 1;
    }
    two.run(2_500);
    for (port, count) in [(port, count), (1 - port, asked)] {
        let (answers, _) = two.take(port);
        if answers.iter().any(|status| status != "0") {
            return two.fails(&format!("port {port} is refused a line: {answers:?}"));
        }
        if answers.len() != count {
            return two
                .fails(&format!("{} answers to {count} lines on port {port}", answers.len()));
        }
    }
    two.recover();
    Ok(())
}

#[test]
fn a_line_that_an_alarm_allows_is_not_refused_because_of_the_other_port() {
    try_all(90, |seed| {
        apart(move || {
            let mut two = Two::boot(pair(seed), seed);
            (0..6).try_for_each(|_| {
                two.story.clear();
                ask_beside(&mut two)
            })
        })
    });
}

/// Lines of G-code that have come in an alarm do not run when the other sender ends it.
#[test]
fn what_came_in_an_alarm_does_not_run_when_the_other_port_ends_it() {
    try_all(36, |seed| {
        apart(move || {
            let mut two = Two::boot(pair(seed), seed);
            let port = two.random(2);
            let (tongue, other) = (two.tongues[port], two.tongues[1 - port]);
            two.machine.set_input(Y_MIN, true);
            two.run(30);
            two.machine.set_input(Y_MIN, false);
            two.run(300);
            two.heard = Default::default();
            let before = two.machine.emitted().position;
            let asks = two.random(9);
            let mut text = String::new();
            for _ in 0..asks {
                text += two.one(tongue.asks());
                text += "\n";
            }
            let moves = 1 + two.random(12);
            for n in 0..moves {
                text += &format!("G1F600X{}\n", n + 1);
            }
            two.bytes(port, text.as_bytes());
            // All bytes have come by then.
            let ms = text.len() as u64 * 10_000 / 115_200 + 2;
            let ms = ms + two.random(3) as u64;
            two.run(ms);
            two.send(1 - port, other.ends()[0]);
            two.run(3_000);
            if two.machine.emitted().position != before {
                return two.fails("it moves");
            }
            Ok(())
        })
    });
}

/// What brings the machine into an alarm, and the port that does so, if one does.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Cause {
    Limit,
    Stop,
    Line(&'static str),
    /// `$SLP` tells its own port no alarm.
    Sleep,
    SoftLimit,
    Probing,
    Reset,
    /// `^d` in `$H`.
    KillsHoming,
    /// `^d` while `$H` may wait for the other port. What has not begun ends without an alarm.
    KillsEarly,
}

/// Brings the machine into a random alarm. Returns the cause, and the port that has sent it.
fn raise(two: &mut Two) -> (Cause, Option<usize>) {
    use Cause::{KillsEarly, KillsHoming, Limit, Line, Probing, Reset, Sleep, SoftLimit, Stop};
    let port = two.random(2);
    let of: &[Cause] = match two.tongues[port] {
        TinyG => &[Line("{alarm:n}"), Line("{shutd:n}"), Probing, Limit, Stop],
        Grbl => &[Sleep, SoftLimit, Probing, Reset, KillsHoming, Limit, Stop],
        RepRap => &[Line("M112"), Limit, Stop],
    };
    let cause = two.one(of);
    match cause {
        Limit => {
            two.machine.set_input(Y_MIN, true);
            two.run(50);
            two.machine.set_input(Y_MIN, false);
            return (cause, None);
        }
        Stop => {
            two.machine.set_input(STOP, true);
            two.run(50);
            two.machine.set_input(STOP, false);
            return (cause, None);
        }
        Line(line) => two.send(port, line),
        Sleep => two.send(port, "$SLP"),
        SoftLimit => {
            for line in ["G28.3X0Y0Z0", "$20=1", "G90G0X9999"] {
                two.send(port, line);
            }
        }
        Probing => two.send(port, "G91G38.2Z-1F600"),
        Reset => {
            two.send(port, "G91G1X20F600");
            two.run(300);
            two.bytes(port, b"\x18");
        }
        KillsHoming | KillsEarly => {
            // No switch is near.
            two.send(port, "$130=1");
            two.run(100);
            two.send(port, "$HX");
            let at = two.machine.emitted().position;
            let ms = two.random(200) as u64;
            two.run(ms);
            let by = if two.tongues[1 - port] == RepRap { port } else { two.random(2) };
            two.bytes(by, b"\x04");
            if two.machine.emitted().position == at {
                return (KillsEarly, Some(port));
            }
        }
    }
    (cause, Some(port))
}

#[test]
fn each_port_hears_of_each_alarm() {
    try_all(90, |seed| {
        apart(move || {
            let mut two = Two::boot(pair(seed), seed);
            // No switch is near.
            two.machine.set_near(X_MIN, -10_000_000, false);
            for _ in 0..5 {
                two.story.clear();
                // Something is told meanwhile.
                for _ in 0..two.random(6) {
                    let port = two.random(2);
                    let line = two.one(two.tongues[port].asks());
                    two.send(port, line);
                }
                // The other port feeds the machine until its lines are answered.
                two.run(700);
                two.heard = Default::default();
                let (cause, by) = raise(&mut two);
                two.run(2_500);
                for port in 0..2 {
                    let (_, told) = two.take(port);
                    let is_own = by == Some(port);
                    // A host hears of the alarm in the answer, too. What is killed is told as well.
                    let kills = matches!(cause, Cause::KillsHoming | Cause::KillsEarly);
                    let most = if is_own || kills { 2 } else { 1 };
                    let may_be_silent =
                        cause == Cause::KillsEarly || is_own && cause == Cause::Sleep;
                    let least = usize::from(!may_be_silent);
                    if !(least..=most).contains(&told) {
                        return two
                            .fails(&format!("{cause:?} is told {told} times on port {port}"));
                    }
                }
                two.recover();
                if let (Cause::SoftLimit | Cause::KillsHoming | Cause::KillsEarly, Some(by)) =
                    (cause, by)
                {
                    two.send(by, "$20=0");
                    two.send(by, "$130=150");
                    two.run(200);
                }
            }
            Ok(())
        })
    });
}

/// A reset is an alarm only if it comes in motion.
#[test]
fn a_reset_at_rest_is_no_alarm() {
    try_all(60, |seed| {
        apart(move || {
            let mut two = Two::boot([Grbl, TONGUES[seed as usize % 3]], seed);
            let mut text = "G91\n".to_string();
            for _ in 0..1 + two.random(3) {
                text += two.one(&["G4P0.3\n", "G4P0.5\n", "G1X1F600\n", "G1X0.5F300\n"]);
            }
            two.bytes(0, text.as_bytes());
            let ms = two.random(900) as u64;
            two.run(ms);
            let before = two.machine.emitted().position;
            two.run(40);
            let at = two.machine.emitted().position;
            two.heard = Default::default();
            two.bytes(0, b"\x18");
            two.run(40);
            let after = two.machine.emitted().position;
            two.run(1_000);
            let alarm = two.heard[0].iter().any(|line| line == "ALARM:3");
            let rests = before == at && at == after && two.machine.emitted().position == at;
            let moves = before != at && at != after;
            if (rests && alarm) || (moves && !alarm) {
                return two.fails(&format!("alarm {alarm} after {ms} ms"));
            }
            // What a reset at rest has dropped can be sent again at once.
            two.heard = Default::default();
            two.send(0, "G91G1X1F6000");
            two.run(300);
            let wanted = if alarm { "error:9" } else { "ok" };
            match two.heard[0].iter().any(|line| line == wanted) {
                true => Ok(()),
                false => two.fails(&format!("no {wanted}")),
            }
        })
    });
}

/// Whoever restores the defaults would switch off the emergency stop that is pressed.
#[test]
fn nothing_restores_the_defaults_while_the_stop_is_pressed() {
    try_all(9, |seed| {
        apart(move || {
            let mut two = Two::boot(pair(seed), seed);
            two.machine.set_input(STOP, true);
            two.run(300);
            for port in 0..2 {
                let (lines, refused): (&[&str], _) = match two.tongues[port] {
                    TinyG => (&["{defa:1}", "{mch:1}", "{clear:n}"], "205"),
                    Grbl => (&["$RST=$", "$RST=*", "$mch=1", "$X", "$H"], "9"),
                    RepRap => (&["M502", "M999"], ""),
                };
                for line in lines {
                    two.heard = Default::default();
                    two.send(port, line);
                    two.run(500);
                    let (heard, (answers, told)) = (two.heard[port].clone(), two.take(port));
                    let is = heard.iter().any(|line| line.starts_with("Error:")) || told > 0;
                    let is = if refused.is_empty() { is } else { answers == [refused] };
                    if !is {
                        return two.fails(&format!("{line} is not refused: {answers:?}"));
                    }
                }
            }
            two.machine.set_input(STOP, false);
            two.run(100);
            let (port, line) = match two.tongues {
                [TinyG, _] => (0, "{defa:1}"),
                [Grbl, _] => (0, "$RST=*"),
                _ => (0, "M502"),
            };
            two.send(port, line);
            two.run(4_000);
            let refused = two.heard[port].iter().any(|line| line.contains("rror:"));
            if refused { two.fails("the defaults are refused when it is released") } else { Ok(()) }
        })
    });
}

/// How lines are dropped.
const DROPS: [(Tongue, &[u8]); 7] = [
    (TinyG, b"!%"),
    (TinyG, b"\x04"),
    (TinyG, b"{alarm:n}\n"),
    (Grbl, b"\x18"),
    (Grbl, b"\x04"),
    (RepRap, b"M112\n"),
    // A limit.
    (Grbl, b""),
];

/// Makes a program of moves with modal words among them.
fn program(two: &mut Two, tongue: Tongue) -> Vec<String> {
    let mut lines = Vec::new();
    let mut x = 0;
    for _ in 0..40 {
        let n = 1 + two.random(9);
        lines.push(match two.random(if tongue == RepRap { 6 } else { 22 }) {
            0 | 1 | 6..=9 => {
                x += 1;
                format!("G1 X{} F{}", x % 2, 200 + 10 * n)
            }
            2 => format!("G92 Y{n}"),
            3 => format!("F{}", 300 + n),
            4 => format!("G0 X{}", x % 2),
            5 => format!("G92 Z{n}"),
            10 => format!("S{n}00"),
            11 => format!("M3 S{n}00"),
            12 => format!("M4 S{n}00"),
            13 => "M5".to_string(),
            14 => two.one(&["M7", "M8", "M9"]).to_string(),
            15 => format!("T{n}"),
            16 => format!("G{}", 54 + n % 6),
            17 => format!("G43.1 Z{n}"),
            18 => two.one(&["G17", "G18", "G19"]).to_string(),
            19 => two.one(&["G90", "G91"]).to_string(),
            20 => format!("G10 L2 P{} X{n}", 1 + n % 6),
            _ => two.one(&["G61", "G64", "G61.1", "G80", "G49"]).to_string(),
        });
    }
    lines
}

/// Returns the modal state as `$G` has it on the second port, the offsets, and what `{sps:n}` tells.
fn modes(two: &mut Two) -> (Vec<String>, Vec<String>) {
    two.heard = Default::default();
    two.send(1, "$G");
    two.run(60);
    two.send(1, "$#");
    two.run(120);
    let heard = &two.heard[1];
    let gc = heard.iter().find_map(|line| line.strip_prefix("[GC:")).unwrap_or_default();
    let modes = gc.trim_end_matches(']').split(' ').map(str::to_string).collect();
    let is_offset = |line: &&String| {
        line.starts_with("[G") && !line.starts_with("[GC") || line.starts_with("[TLO")
    };
    (modes, heard.iter().filter(is_offset).cloned().collect())
}

/// Whether a word tells what an output does.
fn is_output(word: &str) -> bool {
    matches!(word, "M3" | "M4" | "M5" | "M7" | "M8" | "M9") || word.starts_with('S')
}

/// What is dropped leaves its words in force, but for the outputs: they are told as they are.
#[test]
fn what_is_dropped_leaves_its_words() {
    try_all(70, |seed| {
        apart(move || {
            let (tongue, drop) = DROPS[seed as usize % DROPS.len()];
            let mut two = Two::boot([tongue, Grbl], seed);
            let lines = program(&mut two, tongue);
            two.heard = Default::default();
            let (mut sent, mut answers) = (0, 0);
            let end = 300 + two.random(2_500) as u64;
            for _ in 0..end {
                while sent < lines.len() && sent < answers + 4 {
                    two.send(0, &lines[sent]);
                    sent += 1;
                }
                two.run(1);
                answers += two.take(0).0.len();
            }
            if drop.is_empty() {
                two.machine.set_input(Y_MIN, true);
            } else {
                two.bytes(0, drop);
            }
            two.run(1_000);
            two.machine.set_input(Y_MIN, false);
            answers += two.accepted(0);
            let kills = matches!(drop, b"\x04" | b"\x18");
            let ends = two.tongues[0].ends()[0];
            if !matches!(drop, b"!%" | b"\x04") {
                two.send(0, ends);
                two.run(200);
            }
            let is = modes(&mut two);
            let (now, _) = two.machine.outputs();
            let told: Vec<_> = is.0.iter().filter(|word| is_output(word)).cloned().collect();
            let bits = [(outputs::MIST, "M7"), (outputs::FLOOD, "M8")];
            let mut wanted = vec![match now & outputs::SPINDLE != 0 {
                false => "M5",
                true if now & outputs::COUNTERCLOCKWISE != 0 => "M4",
                true => "M3",
            }];
            wanted.extend(bits.iter().filter(|(bit, _)| now & bit != 0).map(|(_, word)| *word));
            if wanted.len() == 1 {
                wanted.push("M9");
            }
            if told[..told.len() - 1] != wanted {
                return two.fails(&format!("{told:?} instead of {wanted:?}"));
            }
            // S is that of the spindle while it turns.
            two.bytes(1, b"?");
            two.run(50);
            let turns = two.heard[1].iter().rev().find_map(|line| line.split_once("|FS:"));
            let turns =
                turns.and_then(|(_, fs)| fs.split([',', '|', '>']).nth(1)).map(str::to_string);
            let mut fits = |answers: usize| {
                let last = lines[..answers.min(lines.len())]
                    .iter()
                    .rev()
                    .find_map(|line| line.split_once('S'));
                let wanted = match now & outputs::SPINDLE != 0 {
                    true => turns.clone().unwrap_or_default(),
                    false if drop == b"\x18" => "0".to_string(),
                    false => last.map_or("0", |(_, s)| s).to_string(),
                };
                let s = told.last().cloned().unwrap_or_default();
                if s != format!("S{wanted}") {
                    return two.fails(&format!("{s} instead of {wanted}"));
                }
                if tongue == TinyG {
                    two.heard = Default::default();
                    two.send(0, "{sps:n}");
                    two.run(50);
                    if !two.heard[0]
                        .iter()
                        .any(|line| line.contains(&format!("\"sps\":{wanted}}}")))
                    {
                        return two.fails(&format!("sps is not {wanted}"));
                    }
                }
                // The lines that were answered go to a second machine, which drops no line.
                let program = lines[..answers.min(lines.len())].to_vec();
                let rest = |words: Vec<String>| -> Vec<_> {
                    words.into_iter().filter(|word| !is_output(word)).collect()
                };
                let usual = apart(move || {
                    let mut two = Two::boot([tongue, Grbl], seed);
                    for line in &program {
                        two.send(0, line);
                        two.run(200);
                    }
                    two.run(4_000);
                    if kills {
                        two.send(0, "M2");
                        two.run(200);
                    }
                    modes(&mut two)
                });
                let (mut is, mut usual) =
                    ((rest(is.0.clone()), is.1.clone()), (rest(usual.0), usual.1));
                if drop == b"\x18" {
                    // A reset selects no tool and no tool length.
                    for (words, offsets) in [&mut is, &mut usual] {
                        words.retain(|word| !word.starts_with('T') && !word.starts_with('G'));
                        offsets.retain(|line| !line.starts_with("[TLO"));
                    }
                }
                if is != usual {
                    return two.fails(&format!("{is:?} instead of {usual:?}"));
                }
                Ok(())
            };
            match fits(answers) {
                // The ok of M112 may come before the alarm is told.
                Err(_) if drop == b"M112\n" && answers > 0 => fits(answers - 1),
                other => other,
            }
        })
    });
}

/// Random lines and characters on both ports, in random alarms: each line is answered once, and in the end the machine
/// goes on.
#[test]
fn each_line_is_answered_whatever_both_ports_do() {
    try_all(90, |seed| {
        apart(move || {
            let mut two = Two::boot(pair(seed), seed);
            let mut sent = [0, 0];
            for _ in 0..60 {
                let port = two.random(2);
                let tongue = two.tongues[port];
                let more: &[&str] = match tongue {
                    TinyG => {
                        &["{alarm:n}", "{shutd:n}", "{clear:n}", "{qf:1}", "M2", "{gc:\"G0X1\"}"]
                    }
                    Grbl => &["$X", "$SLP", "$J=G91X1F600", "$RST=#", "$N0=", "garbage"],
                    RepRap => &["M112", "M999", "M400", "M108", "M302 P1"],
                };
                let line = match two.random(12) {
                    0..=3 => two.one(tongue.asks()),
                    4 | 5 => two.one(more),
                    6..=8 => two.one(&[
                        "G91G1X1F600",
                        "G90G1X0Y1F900",
                        "G4P0.1",
                        "G0X2",
                        "G92X0",
                        "M3S500",
                        "M5",
                    ]),
                    9 => {
                        let byte = two.one(&[b'!', b'~', 0x04]);
                        two.bytes(port, &[byte]);
                        continue;
                    }
                    10 => {
                        let (input, on) = (two.one(&[Y_MIN, STOP, X_MIN]), two.random(3) == 0);
                        two.machine.set_input(input, on);
                        continue;
                    }
                    _ => {
                        let ms = two.random(400) as u64;
                        two.run(ms);
                        continue;
                    }
                };
                if two.has_room(port, sent[port]) {
                    two.send(port, line);
                    sent[port] += 1;
                }
                let ms = two.random(12) as u64;
                two.run(ms);
            }
            [Y_MIN, STOP, X_MIN].iter().for_each(|input| two.machine.set_input(*input, false));
            two.run(100);
            for (port, sent) in sent.iter_mut().enumerate() {
                two.bytes(port, b"~");
                two.run(300);
                let end = two.tongues[port].ends()[0];
                two.send(port, end);
                *sent += 1;
                two.run(5_000);
            }
            for (port, sent) in sent.into_iter().enumerate() {
                let (answers, _) = two.take(port);
                if answers.len() != sent {
                    let count = answers.len();
                    return two.fails(&format!("{count} answers to {sent} lines on port {port}"));
                }
            }
            for port in 0..2 {
                two.send(port, "G1F600X0.1");
                // The move may be a few mm long.
                two.run(2_000);
                let (answers, _) = two.take(port);
                if answers != ["0"] {
                    return two.fails(&format!("port {port} does not go on: {answers:?}"));
                }
            }
            Ok(())
        })
    });
}
