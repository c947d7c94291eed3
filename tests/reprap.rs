//! The RepRap dialect with a printing host. Each line is executed once, whatever happens to it on the way.

use std::thread;

use kerf::hal::imp::{Machine, eeprom};
use kerf::heat::sensor::{Kind, reading};

use crate::seeds::seeds;

/// A host that has one line in flight, like printcore.
pub struct Host {
    pub machine: Machine,
    heard: String,
    lines: Vec<String>,
    seed: u32,
    /// One in this many lines is damaged on its way; 0 for none.
    damages: u32,
    resent: usize,
}

impl Host {
    /// Returns a host that damages one in `damages` lines on their way; none for 0.
    pub fn boot(damages: u32) -> Self {
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        let mut host =
            Self { machine, heard: String::new(), lines: Vec::new(), seed: 7, damages, resent: 0 };
        host.machine.run_ms(100);
        host.machine.received();
        host.machine.send(b"M105\n");
        host.hear();
        // Extrusion is allowed although nothing is hot.
        assert_eq!(host.ask("M302 P1"), "ok\n");
        host
    }

    fn random(&mut self, below: u32) -> u32 {
        self.seed = self.seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.seed >> 16) % below
    }

    /// Returns what is heard up to the next `ok`.
    fn hear(&mut self) -> String {
        let mut all = String::new();
        for _ in 0..600_000 {
            while let Some((line, rest)) = self.heard.split_once('\n') {
                let (line, rest) = (line.to_string(), rest.to_string());
                self.heard = rest;
                all += &format!("{line}\n");
                if line.starts_with("ok") {
                    return all;
                }
            }
            self.machine.run_ms(1);
            self.heard += &String::from_utf8(self.machine.received()).unwrap();
        }
        panic!("no answer, but {all:?}");
    }

    /// Sends a line without number or checksum, and returns the answer.
    pub fn ask(&mut self, line: &str) -> String {
        self.machine.send(format!("{line}\n").as_bytes());
        self.hear()
    }

    /// Prints lines, the first with the number 0, and sends a line again when the machine asks for it.
    fn print(&mut self, lines: &[String]) {
        self.lines = lines.to_vec();
        assert_eq!(self.send(-1, "M110 N-1"), "ok\n");
        let mut next = 0;
        while let Some(line) = self.lines.get(next).cloned() {
            let answer = self.send(next as i32, &line);
            next = match answer.split("Resend: ").nth(1) {
                Some(number) => {
                    self.resent += 1;
                    number.lines().next().unwrap().parse().unwrap()
                }
                None => {
                    assert_eq!(answer, "ok\n", "{line}");
                    next + 1
                }
            };
        }
    }

    /// Sends a line with number and checksum, and returns the answer.
    pub fn send(&mut self, number: i32, block: &str) -> String {
        let line = format!("N{number} {block}");
        let sum = line.bytes().fold(0, |sum, byte| sum ^ byte);
        let mut bytes = format!("{line}*{sum}").into_bytes();
        if self.damages != 0 && number >= 0 && self.random(self.damages) == 0 {
            self.damage(&mut bytes);
        }
        bytes.push(b'\n');
        self.machine.send(&bytes);
        self.hear()
    }

    /// Removes a byte, doubles it, or changes it to another that ends no line.
    fn damage(&mut self, bytes: &mut Vec<u8>) {
        let at = self.random(bytes.len() as u32) as usize;
        match self.random(4) {
            0 => {
                bytes.remove(at);
            }
            1 => bytes.insert(at, bytes[at]),
            2 => bytes[at] ^= 1 << self.random(8),
            _ => bytes[at] = self.random(256) as u8,
        }
        if matches!(bytes[at.min(bytes.len() - 1)], b'\n' | b'\r') {
            let last = bytes.len() - 1;
            bytes[at.min(last)] = b'?';
        }
    }

    /// Returns the positions of motors 1 to 4.
    pub fn steps(&mut self) -> [i64; 4] {
        assert!(self.ask("M400").ends_with("ok\n"));
        let at = self.machine.emitted().position;
        [at[0], at[1], at[2], at[3]].map(i64::from)
    }
}

/// A job of relative moves: a line that is left out or executed twice shows in the end position.
fn job(lines: usize) -> (Vec<String>, [f64; 4]) {
    let mut job = vec!["G21".to_string(), "G91".to_string(), "M83".to_string()];
    let mut end = [0.0; 4];
    let mut seed = 99u32;
    for n in 0..lines {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let x = f64::from((seed >> 20) % 21) / 10.0 - 1.0;
        let y = f64::from((seed >> 10) % 21) / 10.0 - 1.0;
        job.push(format!("G1 X{x:.1} Y{y:.1} E0.05 F6000"));
        if n == 0 {
            job.push("M117 Printing! 100% ~".to_string());
        }
        end = [end[0] + x, end[1] + y, 0.0, end[3] + 0.05];
    }
    (job, end)
}

#[test]
fn damaged_lines_are_carried_out_once() {
    let run = |damages: u32, lines: usize| {
        thread::spawn(move || {
            let mut host = Host::boot(damages);
            let (lines, end) = job(lines);
            host.print(&lines);
            (host.steps(), host.ask("M114"), host.resent, end)
        })
        .join()
        .unwrap()
    };
    let (clean, place, none, end) = run(0, 2_000);
    let (damaged, same, resent, _) = run(100, 2_000);
    assert_eq!(none, 0);
    assert!(resent >= 10, "{resent} lines were sent again");
    assert_eq!((clean, &place), (damaged, &same));
    let expected = format!("X:{:.3} Y:{:.3} Z:0.000 E:{:.3} Count X:", end[0], end[1], end[3]);
    assert!(
        place.replace("-0.000", "0.000").starts_with(&expected.replace("-0.000", "0.000")),
        "{place} {expected}"
    );
}

#[test]
fn every_other_line_is_damaged() {
    let mut host = Host::boot(2);
    let (lines, end) = job(300);
    host.print(&lines);
    let place = host.ask("M114");
    assert!(host.resent > 80, "{}", host.resent);
    host.steps();
    let place_e = place.split("E:").nth(1).unwrap().split(' ').next().unwrap().to_string();
    let _ = place_e;
    let settled = host.ask("M114");
    assert!(settled.contains(&format!("E:{:.3}", end[3])), "{settled}");
}

#[test]
fn ten_kilometres_of_filament() {
    let mut host = Host::boot(0);
    for line in ["M83", "M92 E1", "M203 E15000", "M201 E50000"] {
        assert_eq!(host.ask(line), "ok\n", "{line}");
    }
    let before = host.steps();
    for _ in 0..100 {
        for _ in 0..2 {
            assert!(host.ask("G1 E50000 F900000").ends_with("ok\n"));
        }
    }
    let after = host.steps();
    assert_eq!(after[3] - before[3], 100 * 2 * 50_000, "{before:?} {after:?}");
}

#[test]
fn a_stop_of_the_program_waits_for_m108() {
    let mut host = Host::boot(0);
    assert_eq!(host.ask("G1 X1 F3000"), "ok\n");
    host.machine.send(b"M0 Change the filament\nG1 X2\n");
    host.machine.run_ms(5_000);
    let heard = String::from_utf8(host.machine.received()).unwrap();
    assert!(heard.contains("//action:paused\necho:busy: paused for user\n"), "{heard}");
    assert!(heard.contains("echo:busy: processing\n") && !heard.contains("ok"), "{heard}");
    // The answer to M108 itself comes first, then those of the stop and the move.
    assert_eq!(host.ask("M108"), "//action:resumed\nok\n");
    assert_eq!(host.hear(), "ok\n");
    assert_eq!(host.hear(), "ok\n");
    assert_eq!(host.steps()[0], 2 * 1_280);
}

#[test]
fn polls_overtake_a_full_queue() {
    let host = Host::boot(0);
    for n in 1..=70 {
        host.machine.send(format!("G1 X{} F600\n", n * 20).as_bytes());
        host.machine.run_ms(5);
    }
    let heard = String::from_utf8(host.machine.received()).unwrap();
    assert!(heard.lines().count() < 68, "lines wait");
    host.machine.send(b"M105\n");
    host.machine.run_ms(20);
    let heard = String::from_utf8(host.machine.received()).unwrap();
    assert!(heard.starts_with("ok T:") && heard.lines().count() == 1, "{heard}");
    host.machine.send(b"N9 M112*");
    let sum = b"N9 M112".iter().fold(0, |sum, byte| sum ^ byte);
    host.machine.send(format!("{sum}\n").as_bytes());
    host.machine.run_ms(100);
    let heard = String::from_utf8(host.machine.received()).unwrap();
    assert!(heard.contains("Error:stopped"), "{heard}");
    let at = host.machine.emitted().position[0];
    host.machine.run_ms(1_000);
    assert_eq!(host.machine.emitted().position[0], at);
}

/// What happens to a line on its way: one byte of it, the line end too, is lost, doubled or changed.
fn spoil(host: &mut Host, bytes: &mut Vec<u8>) {
    let at = host.random(bytes.len() as u32) as usize;
    match host.random(5) {
        0 => drop(bytes.remove(at)),
        1 => bytes.insert(at, bytes[at]),
        2 => bytes[at] ^= 1 << host.random(8),
        3 => bytes[at] = host.random(256) as u8,
        // The line end of the last line: nothing comes behind it for a while.
        _ => drop(bytes.pop()),
    }
}

impl Host {
    /// Returns what is heard until nothing comes for 20 ms.
    pub fn quiet(&mut self) -> String {
        let mut silent = 0;
        let mut heard = std::mem::take(&mut self.heard);
        while silent < 20 {
            self.machine.run_ms(2);
            let more = String::from_utf8_lossy(&self.machine.received()).into_owned();
            silent = if more.is_empty() { silent + 2 } else { 0 };
            heard += &more;
        }
        heard
    }

    /// Sends lines in bursts of up to four, and begins again where the machine asks for it. One line in `spoils` is
    /// spoilt.
    fn burst(&mut self, lines: &[String], spoils: u32) {
        assert!(self.send(-1, "M110 N-1").ends_with("ok\n"));
        let (mut next, mut ended, mut rounds) = (0, false, 0);
        while !ended {
            rounds += 1;
            assert!(rounds < 1_000, "the session does not end: {lines:?}");
            let sent = (1 + self.random(4) as usize).min(lines.len() - next);
            for (n, block) in lines.iter().enumerate().skip(next).take(sent) {
                let line = format!("N{n} {block}");
                let sum = line.bytes().fold(0, |sum, byte| sum ^ byte);
                let mut bytes = format!("{line}*{sum}\n").into_bytes();
                // The number of a line that is too long is not protected.
                if self.random(spoils) == 0 && bytes.len() < 250 {
                    spoil(self, &mut bytes);
                }
                self.machine.send(&bytes);
            }
            next += sent;
            ended = next == lines.len();
            let mut heard = self.quiet();
            let answered = heard.lines().filter(|line| line.starts_with("ok")).count();
            let polls = usize::from(ended || answered < sent);
            if polls > 0 {
                // What a host does that waits for an answer.
                let poll: &[u8] = if self.random(2) == 0 { b"\n" } else { b"M105\n" };
                self.machine.send(poll);
                heard += &self.quiet();
            }
            let answered = heard.lines().filter(|line| line.starts_with("ok")).count();
            if answered < sent + polls {
                // Lines without an answer are sent again.
                (next, ended) = (next - sent, false);
            }
            if let Some(again) =
                heard.rsplit("Resend: ").next().filter(|_| heard.contains("Resend"))
            {
                next = again.lines().next().unwrap().parse().unwrap();
                ended = false;
                self.resent += 1;
            }
        }
    }
}

/// Returns a text that may look like the end of one line and the beginning of another.
fn remark(host: &mut Host) -> String {
    let words = ["a", "*", "5", "N5", " ", "*17N6 G1 X9", "2*3", "N", "*0"];
    let mut remark = String::new();
    for _ in 0..host.random(7) {
        remark += words[host.random(words.len() as u32) as usize];
    }
    remark
}

/// Each line runs once, whatever byte of it is lost, doubled or changed, its end too, and whatever has happened to the
/// lines beside it. The moves of a session differ so much that no other set of them ends at the same place.
#[test]
fn each_line_runs_once_whatever_byte_is_lost() {
    let mut host = Host::boot(0);
    host.ask("G91");
    let seeds = seeds(200);
    let count = seeds.end - seeds.start;
    for seed in seeds {
        host.seed = (seed as u32).wrapping_mul(2_654_435_761);
        host.ask("M400");
        host.ask("G92 X0 Y0 Z0");
        let mut lines = Vec::new();
        let mut end = [0; 3];
        for n in 0..12 {
            let by = 3i32.pow(n / 3);
            end[n as usize % 3] += by;
            let axis = ["X", "Y", "Z"][n as usize % 3];
            let remark = remark(&mut host);
            lines.push(match host.random(4) {
                0 => format!("G1 {axis}{:.2} F6000 ; {remark}", f64::from(by) / 100.0),
                1 => format!("G1 {axis}{:.2}", f64::from(by) / 100.0),
                _ => format!("G1 {axis}{:.2} F6000", f64::from(by) / 100.0),
            });
            if host.random(8) == 0 {
                // Beyond the longest line, where only its beginning is kept.
                let rest = if host.random(4) == 0 { "x".repeat(250) } else { String::new() };
                lines.push(format!("M117 {remark}{rest}"));
            }
        }
        host.burst(&lines, 3);
        host.ask("M400");
        let place = host.ask("M114");
        let [x, y, z] = end.map(|end| f64::from(end) / 100.0);
        let expected = format!("X:{x:.3} Y:{y:.3} Z:{z:.3} ");
        assert!(
            place.starts_with(&expected),
            "seed {seed}: {place} instead of {expected}: {lines:?}"
        );
    }
    println!("{count} sessions, {} lines asked for again", host.resent);
    assert!(host.resent as u64 > count);
}

/// Lines whose ends are lost match a checksum by chance or by repetition.
#[test]
fn lines_without_ends_are_asked_for_again() {
    let mut host = Host::boot(0);
    let (mut matches, line) = (0, |n: u32, block: &str| {
        let line = format!("N{n} {block}");
        let sum = line.bytes().fold(0, |sum, byte| sum ^ byte);
        format!("{line}*{sum}")
    });
    host.ask("G91");
    let again = "Error:checksum mismatch, Last Line: 0\nResend: 1\nok\n";
    for x in 0..600 {
        // A line that comes again and again is taken in the end.
        assert_eq!(host.ask(&line(0, "M110 N0")), "ok\n");
        let one = line(1, &format!("G1 X{x}"));
        assert_eq!(host.ask(&format!("{one}{one}{one}")), again);
        let [two, other] = [2, 3].map(|n| line(n, &format!("G1 X{}", x * n)));
        for joined in [format!("{one}{two}"), format!("{one}{two}{other}")] {
            let (text, stated) = joined.rsplit_once('*').unwrap();
            matches +=
                u32::from(text.bytes().fold(0, |sum, byte| sum ^ byte).to_string() == stated);
            assert_eq!(host.ask(&joined), again, "{joined}");
        }
        let long = line(1, &format!("G1 X{x} {}", "Y1".repeat(20))).repeat(6);
        assert_eq!(host.ask(&long), again, "{long}");
    }
    assert!(matches > 0, "no line has matched by chance");
    assert_eq!(host.steps(), [0; 4]);
}

/// Plays lines on a machine that finds `kept` in its EEPROM, and returns the last answer and what is left.
fn play(kept: Vec<u8>, lines: &'static [&'static str]) -> (String, Vec<u8>) {
    let play = move || {
        if !kept.is_empty() {
            eeprom::put(&kept);
        }
        let mut host = Host::boot(0);
        let mut last = String::new();
        for line in lines {
            match line.strip_prefix("2 ") {
                Some(line) => host.machine.send_aux(format!("{line}\n").as_bytes()),
                None => last = host.ask(line),
            }
            host.machine.run_ms(1_500);
        }
        (last, eeprom::contents())
    };
    thread::spawn(play).join().unwrap()
}

/// M92, M201, M203, M205 and M206 of a file last until the restart, unless M500 follows. What another sender sets
/// meanwhile is kept.
#[test]
fn what_a_file_sets_is_kept_by_m500_alone() {
    let (defaults, _) = play(Vec::new(), &["M503"]);
    let (set, kept) = play(
        Vec::new(),
        &[
            "M92 X123 E95",
            "M201 X900",
            "M203 Y2",
            "M205 J0.07",
            "M206 X1.5 Z2",
            "2 {zjm:77}",
            "M503",
        ],
    );
    for part in ["M92 X123.000 ", " E95.000", "M201 X900.0", "J0.070", "M206 X1.500 Y0.000 Z2.000"]
    {
        assert!(set.contains(part), "{part}: {set}");
    }
    assert_eq!(play(kept.clone(), &["M503"]).0, defaults);
    // Not even what is set besides stores it, and M501 brings the stored values back.
    let (back, kept) = play(
        kept,
        &["M203 Y2", "M92 X123", "M206 X3", "2 {ych:n}", "2 {yam:1}", "2 {1mi:4}", "M501", "M503"],
    );
    assert!(back.contains("M206 X0.000") && !back.contains("X123.000"), "{back}");
    let (aux, kept) = play(
        kept,
        &["M206 X1.5", "G92 X0", "M92 X123", "M201 X900", "M203 Y2", "M500", "M114", "M503"],
    );
    let (again, _) = play(kept, &["M503"]);
    assert_eq!(aux, again);
    assert!(again.contains("M92 X123.000") && again.contains("M206 X1.500"), "{again}");
}

/// M501 sets the origin back at once.
#[test]
fn m501_brings_the_origin_back() {
    let mut host = Host::boot(0);
    host.ask("M206 X1.5");
    assert!(host.ask("M114").starts_with("X:-1.500 "));
    assert_eq!(host.ask("M501"), "ok\n");
    assert!(host.ask("M114").starts_with("X:0.000 "));
}

/// G10 with P is a temperature in the dialect of Duet's firmware.
#[test]
fn g10_with_p_is_a_temperature() {
    let mut host = Host::boot(0);
    host.machine.set_sensor(0, reading(Kind::Semitec, 25.0) as u16);
    host.machine.run_ms(1_000);
    assert_eq!(host.ask("M207 S5"), "ok\n");
    for (line, target) in
        [("G10 P0 S205", 205), ("G10 P0 R100", 205), ("G10 P0 S120 R100", 120), ("g10 p0 s0", 0)]
    {
        assert_eq!(host.ask(line), "ok\n", "{line}");
        host.machine.run_ms(100);
        let heat = host.ask("M105");
        assert!(heat.contains(&format!(" /{target}.00 B:")), "{line}: {heat}");
    }
    for (line, answer) in [
        ("G10 P1 S205", "echo:no such extruder\nok\n"),
        ("G10 L2 P1 X5", "Error:a word belongs to no code\nok\n"),
        ("G10 L20 X5", "Error:a word belongs to no code\nok\n"),
    ] {
        assert_eq!(host.ask(line), answer, "{line}");
    }
    assert_eq!(host.steps(), [0; 4]);
    host.ask("G10");
    assert_ne!(host.steps()[3], 0);
}
