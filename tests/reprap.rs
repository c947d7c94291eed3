//! The RepRap dialect with a printing host. Each line is executed once, whatever happens to it on the way.

use std::thread;

use kerf::hal::imp::Machine;

/// A host that has one line in flight, like printcore.
struct Host {
    machine: Machine,
    heard: String,
    lines: Vec<String>,
    seed: u32,
    /// One in this many lines is damaged on its way; 0 for none.
    damages: u32,
    resent: usize,
}

impl Host {
    fn boot(damages: u32) -> Self {
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
    fn ask(&mut self, line: &str) -> String {
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

    fn send(&mut self, number: i32, block: &str) -> String {
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
    fn steps(&mut self) -> [i64; 4] {
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
    assert!(heard.contains("echo:busy: paused for user\n"), "{heard}");
    assert!(heard.contains("echo:busy: processing\n") && !heard.contains("ok"), "{heard}");
    // The answer to M108 itself comes first, then those of the stop and the move.
    assert_eq!(host.ask("M108"), "ok\n");
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
