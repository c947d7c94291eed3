//! Files of an SD card in all dialects: listed, run, written, deleted. Another program has formatted the card, and
//! reads what Kerf has written.

use std::thread;

use fatfs::FatType;
use kerf::hal::imp::{Machine, card::Blocks};

use crate::heat_patterns::Random;
use crate::sd_image::{BLOCK, image, lost, names, text};
use crate::seeds::seeds;

/// The names that a dialect has for what is done with files.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Dialect {
    Tinyg,
    Grbl,
    RepRap,
}

const ALL: [Dialect; 3] = [Dialect::Tinyg, Dialect::Grbl, Dialect::RepRap];

impl Dialect {
    fn mount(self) -> &'static str {
        match self {
            Self::Tinyg => "{sdu:n}",
            Self::Grbl => "$FM",
            Self::RepRap => "M21",
        }
    }

    fn write(self, name: &str) -> String {
        match self {
            Self::Tinyg => format!("{{sdw:\"{name}\"}}"),
            Self::Grbl => format!("$FW={name}"),
            Self::RepRap => format!("M28 {name}"),
        }
    }

    fn finish(self) -> &'static str {
        match self {
            Self::Tinyg => "{sdw:t}",
            Self::Grbl => "$FW",
            Self::RepRap => "M29",
        }
    }

    fn run(self, name: &str) -> String {
        match self {
            Self::Tinyg => format!("{{sdr:\"{name}\"}}"),
            Self::Grbl => format!("$F={name}"),
            Self::RepRap => format!("M32 {name}"),
        }
    }

    fn delete(self, name: &str) -> String {
        match self {
            Self::Tinyg => format!("{{sdd:\"{name}\"}}"),
            Self::Grbl => format!("$FD={name}"),
            Self::RepRap => format!("M30 {name}"),
        }
    }

    fn list(self) -> &'static str {
        match self {
            Self::Tinyg => "{sdl:n}",
            Self::Grbl => "$F",
            Self::RepRap => "M20",
        }
    }

    /// Whether this line ends an answer.
    fn ends(self, line: &str) -> bool {
        match self {
            Self::Tinyg => line.starts_with("{\"r\""),
            Self::Grbl => line == "ok" || line.starts_with("error:"),
            Self::RepRap => line.starts_with("ok"),
        }
    }

    fn is_good(self, answer: &str) -> bool {
        match self {
            Self::Tinyg => answer.contains("\"f\":[1,0,"),
            Self::Grbl => answer.ends_with("ok\r\n"),
            Self::RepRap => !["echo:", "Error:", "failed"].iter().any(|bad| answer.contains(bad)),
        }
    }
}

struct Session {
    machine: Machine,
    dialect: Dialect,
    heard: String,
    said: Vec<String>,
}

fn blocks(image: &[u8]) -> Blocks {
    let blocks =
        (0..).zip(image.chunks_exact(BLOCK)).filter(|(_, block)| block.iter().any(|b| *b != 0));
    blocks.map(|(number, block)| (number, block.try_into().unwrap())).collect()
}

impl Session {
    /// Starts a machine with this card in its slot.
    fn start(dialect: Dialect, card: &[u8]) -> Self {
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        machine.insert_card(Some(blocks(card)));
        machine.run_ms(100);
        machine.received();
        let mut session = Self { machine, dialect, heard: String::new(), said: Vec::new() };
        match dialect {
            Dialect::Tinyg => _ = session.ask("{jv:5}"),
            Dialect::Grbl => _ = session.ask("$I"),
            Dialect::RepRap => {
                session.ask("M105");
                session.ask("M302 P1");
                session.ask("M21");
            }
        }
        session
    }

    fn run(&mut self, ms: u64) {
        self.machine.run_ms(ms);
        self.heard += &String::from_utf8_lossy(&self.machine.received());
    }

    /// Returns what is heard up to the end of an answer.
    fn answer(&mut self, line: &str) -> String {
        for _ in 0..20_000 {
            self.run(1);
            let whole = self.heard.ends_with('\n');
            if whole && self.heard.lines().any(|line| self.dialect.ends(line)) {
                return std::mem::take(&mut self.heard);
            }
        }
        panic!("no answer to {line}, but {:?} behind {:?}", self.heard, self.said);
    }

    fn ask(&mut self, line: &str) -> String {
        self.said.push(line.into());
        self.heard.clear();
        self.machine.send(format!("{line}\n").as_bytes());
        self.answer(line)
    }

    /// Sends a line that must be carried out.
    fn say(&mut self, line: &str) -> String {
        let answer = self.ask(line);
        assert!(self.dialect.is_good(&answer), "{:?}: {line}: {answer}", self.dialect);
        answer
    }

    fn write(&mut self, name: &str, text: &str) {
        self.say(&self.dialect.write(name));
        text.lines().for_each(|line| _ = self.say(line));
        self.say(self.dialect.finish());
    }

    /// Returns what is on the card.
    fn card(&self, like: &[u8]) -> Vec<u8> {
        let mut image = vec![0; like.len()];
        for (number, block) in self.machine.card().expect("a card") {
            let at = number as usize * BLOCK;
            image[at..at + BLOCK].copy_from_slice(&block);
        }
        image
    }

    /// The positions of X and Y, steps.
    fn steps(&self) -> [i64; 2] {
        let position = self.machine.emitted().position;
        [position[0], position[1]]
    }
}

/// Calls `test` for each dialect and kind of card, each on a machine of its own.
fn for_all(files: &'static [(&'static str, &'static str)], test: fn(Session, Vec<u8>)) {
    for dialect in ALL {
        for fat in [FatType::Fat16, FatType::Fat32] {
            let files: Vec<_> =
                files.iter().map(|(name, text)| (*name, String::from(*text))).collect();
            let card = image(fat, &files);
            thread::spawn(move || test(Session::start(dialect, &card), card)).join().unwrap();
        }
    }
}

/// A program of `lines` lines that ends 1 mm farther on X and Y.
fn program(lines: usize) -> String {
    let mut text = String::from("G91\nG1 F6000\n");
    for n in 0..lines {
        text += &format!("G1 X{} Y0.01 (line {n})\n", if n % 2 == 0 { "0.1" } else { "-0.1" });
    }
    text + "G1 X1 Y1\n"
}

#[test]
fn a_file_is_written_listed_run_and_deleted() {
    for_all(&[("OTHER.NC", "G0 X5\n")], |mut session, card| {
        let dialect = session.dialect;
        let file = program(100);
        let before = session.steps();
        session.write("part.nc", &file);
        assert_eq!(session.steps(), before, "{dialect:?}: nothing moves while it is written");
        let now = session.card(&card);
        assert_eq!(text(&now, "PART.NC").as_deref(), Some(&*file), "{dialect:?}");
        assert_eq!(text(&now, "OTHER.NC").as_deref(), Some("G0 X5\n"));
        assert_eq!(lost(&now), 0);
        let list = session.say(dialect.list());
        let entry = match dialect {
            Dialect::Tinyg => format!("\"sdl\":\"OTHER.NC 6\\nPART.NC {}\"", file.len()),
            Dialect::Grbl => {
                format!("[FILE:/OTHER.NC|SIZE:6]\r\n[FILE:/PART.NC|SIZE:{}]", file.len())
            }
            Dialect::RepRap => format!("OTHER.NC 6\nPART.NC {}\n", file.len()),
        };
        assert!(list.contains(&entry), "{list}");
        session.say(&dialect.run("PART.NC"));
        session.run(20_000);
        let end = match dialect {
            Dialect::Tinyg => "\"msg\":\"End of file\"",
            Dialect::Grbl => "[MSG:Pgm End]",
            Dialect::RepRap => "Done printing file",
        };
        assert!(session.heard.contains(end), "{dialect:?}: {}", session.heard);
        assert!(!session.heard.lines().any(|line| dialect.ends(line)), "{}", session.heard);
        let after = session.steps();
        assert!(after[0] > before[0] && after[1] > before[1], "{dialect:?}: {after:?}");
        session.say(&dialect.delete("PART.NC"));
        let now = session.card(&card);
        assert!(!names(&now).contains(&String::from("PART.NC")));
        assert_eq!(lost(&now), 0, "{dialect:?}");
    });
}

/// Files of any length, over and over: each is on the card as it was sent, and no cluster is lost.
#[test]
fn files_of_any_length_are_replaced_and_lose_nothing() {
    for seed in seeds(4) {
        let mut random = Random::new(seed);
        let mut below = move |most| random.below(most);
        let dialect = ALL[below(3)];
        let fat = if below(2) == 0 { FatType::Fat16 } else { FatType::Fat32 };
        let card = image(fat, &[("A.NC", program(30)), ("KEEP.NC", program(200))]);
        let work = move || {
            let mut session = Session::start(dialect, &card);
            for _ in 0..8 {
                let name = ["A.NC", "B.NC", "LONGNAME.TXT", "C"][below(4)];
                let mut file = String::new();
                for _ in 0..below(120) {
                    file += &format!("G1 X{} F{}\n", below(1_000), "1".repeat(1 + below(6)));
                }
                session.write(name, &file);
                let now = session.card(&card);
                assert_eq!(text(&now, name).as_deref(), Some(&*file), "seed {seed}: {name}");
                assert_eq!(text(&now, "KEEP.NC"), Some(program(200)), "seed {seed}");
                assert_eq!(lost(&now), 0, "seed {seed}: {name}");
                if below(4) == 0 {
                    session.say(&dialect.delete(name));
                    assert_eq!(lost(&session.card(&card)), 0, "seed {seed}: {name} deleted");
                }
            }
        };
        thread::spawn(work).join().unwrap();
    }
}

/// Wherever the power is cut while a file is replaced, the card has the old file or the new one.
#[test]
fn a_power_cut_leaves_the_old_file_or_the_new_one() {
    for_all(&[("A.NC", "G0 X1\nG0 X2\n")], |mut session, card| {
        let (old, new) = (String::from("G0 X1\nG0 X2\n"), program(60));
        session.say(&session.dialect.write("A.NC"));
        let lines = new.lines().chain([session.dialect.finish()]);
        let mut seen = [false; 2];
        let mut before = session.machine.card();
        for line in lines.map(String::from).collect::<Vec<_>>() {
            session.heard.clear();
            session.machine.send(format!("{line}\n").as_bytes());
            loop {
                session.run(1);
                let now = session.machine.card();
                if now == before && !session.heard.ends_with('\n') {
                    continue;
                }
                before = now;
                let found = text(&session.card(&card), "A.NC");
                assert!(found == Some(old.clone()) || found == Some(new.clone()), "{found:?}");
                seen[usize::from(found == Some(new.clone()))] = true;
                if session.heard.lines().any(|line| session.dialect.ends(line)) {
                    break;
                }
            }
        }
        assert_eq!(seen, [true; 2]);
    });
}

/// Lines of a file that cannot be completed never run.
#[test]
fn lines_of_a_file_that_is_spoilt_do_not_run() {
    for_all(&[("A.NC", "G0 X1\n")], |mut session, card| {
        let dialect = session.dialect;
        let before = session.steps();
        session.say(&dialect.write("B.NC"));
        (0..40).for_each(|_| _ = session.say("G1 X10 F6000 (a line of the file)"));
        // The card is pulled.
        session.machine.insert_card(None);
        let refused = (0..40)
            .filter(|_| !dialect.is_good(&session.ask("G1 X10 F6000 (a line of the file)")))
            .count();
        assert!(refused > 20, "{dialect:?}: {refused}");
        assert!(!dialect.is_good(&session.ask(dialect.finish())), "{dialect:?}");
        session.run(3_000);
        assert_eq!(session.steps(), before, "{dialect:?}");
        // Behind its end everything works again.
        session.machine.insert_card(Some(blocks(&card)));
        if dialect == Dialect::RepRap {
            session.ask("M21");
        }
        session.write("B.NC", "G0 X3\n");
        let now = session.card(&card);
        assert_eq!(text(&now, "B.NC").as_deref(), Some("G0 X3\n"));
        session.say("G1 X1 F6000");
        session.run(3_000);
        assert!(session.steps() != before);
    });
}

/// A card without a free cluster.
#[test]
fn a_full_card_is_told() {
    for dialect in ALL {
        let card = image(FatType::Fat16, &[("BIG", "x".repeat(19_000 * BLOCK))]);
        thread::spawn(move || fill(Session::start(dialect, &card), &card)).join().unwrap();
    }
}

fn fill(mut session: Session, card: &[u8]) {
    let dialect = session.dialect;
    session.say(&dialect.write("B.NC"));
    let line = format!("G1 X10 F6000 ({})", "y".repeat(60));
    let full_at = (0..20_000).find(|_| !dialect.is_good(&session.ask(&line)));
    assert!(full_at.is_some_and(|at| at > 1_000), "{dialect:?}: {full_at:?}");
    assert!(!dialect.is_good(&session.ask(&line)), "{dialect:?}");
    let told = session.ask(dialect.finish());
    assert!(told.contains("SD card is full") || told.contains(":[1,63,"), "{dialect:?}: {told}");
    let now = session.card(card);
    assert_eq!(names(&now), names(card));
    // What the file had taken belongs to nobody, as after a power cut.
    assert!(lost(&now) > 0);
}

/// What a sender may do with files, in any order.
#[derive(Clone, Copy, Debug)]
enum Op {
    Write,
    Line,
    Finish,
    Drop,
    Run,
    Hold,
    GoOn,
    Delete,
    List,
    Alarm,
    Clear,
    Reset,
    Pull,
    Insert,
    OtherPort,
    Wait,
}

const OPS: [Op; 16] = [
    Op::Write,
    Op::Line,
    Op::Finish,
    Op::Drop,
    Op::Run,
    Op::Hold,
    Op::GoOn,
    Op::Delete,
    Op::List,
    Op::Alarm,
    Op::Clear,
    Op::Reset,
    Op::Pull,
    Op::Insert,
    Op::OtherPort,
    Op::Wait,
];

impl Session {
    /// Does what `op` says, and waits for the answer if there is one.
    fn act(&mut self, op: Op, name: &str, card: &mut Option<Blocks>) {
        let dialect = self.dialect;
        let clear = match dialect {
            Dialect::Tinyg => "{clear:n}",
            Dialect::Grbl => "$X",
            Dialect::RepRap => "M999",
        };
        match op {
            Op::Write => _ = self.ask(&dialect.write(name)),
            Op::Line => _ = self.ask("G91 G1 X0.5 F3000"),
            Op::Finish => _ = self.ask(dialect.finish()),
            Op::Drop => {
                _ = self.ask(match dialect {
                    Dialect::Tinyg => "{sdx:t}",
                    Dialect::Grbl => "$FX",
                    Dialect::RepRap => "M27",
                })
            }
            Op::Run => _ = self.ask(&dialect.run(name)),
            Op::Hold if dialect != Dialect::RepRap => self.machine.send(b"!"),
            Op::GoOn if dialect != Dialect::RepRap => self.machine.send(b"~"),
            // Without a file that prints, M25 pauses the program, and whatever comes behind it.
            Op::Hold => {
                self.machine.send(b"M25\n");
                self.run(8_000);
                self.machine.send(b"M108\n");
                self.run(200);
            }
            Op::GoOn => _ = self.ask("M108"),
            Op::Delete => _ = self.ask(&dialect.delete(name)),
            Op::List => _ = self.ask(dialect.list()),
            Op::Alarm => match dialect {
                Dialect::Tinyg => _ = self.ask("{alarm:n}"),
                Dialect::Grbl => self.machine.send(b"\x85"),
                Dialect::RepRap => _ = self.ask("M112"),
            },
            Op::Clear => _ = self.ask(clear),
            Op::Reset if dialect == Dialect::Grbl => {
                self.machine.send(b"\x18");
                self.run(300);
            }
            Op::Pull => {
                *card = self.machine.card().or(card.take());
                self.machine.insert_card(None);
            }
            Op::Insert => {
                if let Some(blocks) = card.take() {
                    self.machine.insert_card(Some(blocks));
                }
                if dialect == Dialect::RepRap {
                    self.ask("M21");
                }
            }
            Op::OtherPort => self.machine.send_aux(b"G91 G1 X9 F6000\n"),
            Op::Reset | Op::Wait => self.run(300),
        }
    }
}

/// Whatever is done in whatever order: each line is answered, files that are not touched stay whole, another program can
/// read the card, and in the end everything works.
#[test]
fn files_in_any_order() {
    for seed in seeds(12) {
        let mut random = Random::new(seed);
        let mut below = move |most| random.below(most);
        let dialect = ALL[seed as usize % 3];
        let fat = if below(2) == 0 { FatType::Fat16 } else { FatType::Fat32 };
        let keep = program(40);
        let image = image(fat, &[("KEEP.NC", keep.clone()), ("A.NC", program(3))]);
        let work = move || {
            let mut session = Session::start(dialect, &image);
            let mut pulled = None;
            let mut done = Vec::new();
            for _ in 0..60 {
                let lines = below(3) > 0;
                let op = if lines { Op::Line } else { OPS[below(OPS.len())] };
                let name = ["A.NC", "B.NC", "KEEPS.NC"][below(3)];
                done.push(op);

                session.act(op, name, &mut pulled);
            }
            session.machine.send(b"~");
            for op in [Op::Insert, Op::GoOn, Op::Clear, Op::Finish, Op::Drop, Op::Wait, Op::Clear] {
                session.act(op, "A.NC", &mut pulled);
            }
            session.run(8_000);
            session.act(Op::Clear, "", &mut pulled);
            let before = session.steps()[0];
            session.say("G91");
            session.say("G1 X1 F3000");
            session.run(3_000);
            assert_eq!(session.steps()[0] - before, 1_280, "seed {seed}: {done:?}");
            let now = session.card(&image);
            assert_eq!(text(&now, "KEEP.NC"), Some(keep), "seed {seed}: {done:?}");
            let files = names(&now).into_iter().filter(|name| name.ends_with(".NC"));
            files.for_each(|name| _ = text(&now, &name));
            lost(&now);
        };
        thread::spawn(work).join().unwrap();
    }
}

/// A percent sign is a character that acts at once in two dialects, and the first line of many files.
#[test]
fn a_percent_sign_spoils_no_upload() {
    for_all(&[], |mut session, card| {
        let dialect = session.dialect;
        session.say(&dialect.write("B.NC"));
        session.machine.send(b"%\n");
        session.run(200);
        session.heard.clear();
        session.say("G1 X1 F600");
        session.machine.send(b"%\n");
        session.run(200);
        session.heard.clear();
        session.say(dialect.finish());
        let found = text(&session.card(&card), "B.NC").unwrap();
        assert!(found.contains("G1 X1 F600\n"), "{dialect:?}: {found}");
    });
}

/// All lines of an upload come in one packet, and nothing of it runs.
#[test]
fn an_upload_in_one_packet_keeps_its_order() {
    for_all(&[], |mut session, card| {
        let dialect = session.dialect;
        let all = format!("{}\nG1 X5 F600\nG1 X6\n{}\n", dialect.write("B.NC"), dialect.finish());
        session.machine.send(all.as_bytes());
        session.run(3_000);
        assert_eq!(session.steps(), [0, 0], "{dialect:?}: {}", session.heard);
        let found = text(&session.card(&card), "B.NC");
        assert_eq!(found.as_deref(), Some("G1 X5 F600\nG1 X6\n"), "{dialect:?}: {}", session.heard);
        // What comes before an upload runs, and what comes behind it.
        let all = format!(
            "G91 G1 X1 F600\n{}\nG1 X6\n{}\nG1 X1\n",
            dialect.write("B.NC"),
            dialect.finish()
        );
        session.machine.send(all.as_bytes());
        session.run(5_000);
        let found = text(&session.card(&card), "B.NC").unwrap_or_default();
        assert!(["G1 X6\n", "G1 X5 F600\nG1 X6\n"].contains(&&*found), "{dialect:?}: {found}");
    });
}

/// A line that is too long is missing in the file, so there is none.
#[test]
fn a_line_that_is_too_long_spoils_an_upload() {
    for_all(&[], |mut session, card| {
        let dialect = session.dialect;
        session.say(&dialect.write("B.NC"));
        session.say("G1 X1 F600");
        assert!(!dialect.is_good(&session.ask(&format!("G1 X2 ({})", "x".repeat(300)))));
        if dialect != Dialect::RepRap {
            assert!(!dialect.is_good(&session.ask(dialect.finish())), "{dialect:?}");
            assert!(!names(&session.card(&card)).contains(&String::from("B.NC")));
        }
        if dialect == Dialect::Tinyg {
            assert!(!dialect.is_good(&session.ask("{sdw:\"\"}")), "an empty name");
        }
        assert_eq!(session.steps(), [0, 0]);
    });
}

/// While one port uploads, G-code of the other is refused.
#[test]
fn another_port_does_not_write_into_the_file() {
    for_all(&[], |mut session, card| {
        let dialect = session.dialect;
        session.say(&dialect.write("B.NC"));
        session.say("G1 X1 F600");
        session.machine.send_aux(b"G1 X9 F600\n");
        session.run(300);
        let told = String::from_utf8_lossy(&session.machine.received_aux()).into_owned();
        session.say("G1 X2 F600");
        session.say(dialect.finish());
        let found = text(&session.card(&card), "B.NC");
        assert_eq!(found.as_deref(), Some("G1 X1 F600\nG1 X2 F600\n"), "{dialect:?}: {told}");
        assert_eq!(session.steps(), [0, 0], "{dialect:?}: {told}");
    });
}

/// A refused line ends a file of a machine tool, and is named.
#[test]
fn a_refused_line_ends_the_file() {
    for_all(&[("A.NC", "%\nG91\n\nG1 X1 F6000\nG1 X1 G2 (wrong)\nG1 X5\n")], |mut session, _| {
        let dialect = session.dialect;
        let heard = session.ask(&dialect.run("A.NC"));
        session.run(3_000);
        session.heard.insert_str(0, &heard);
        let (told, x) = match dialect {
            Dialect::Tinyg => ("\"line\":5", 1),
            Dialect::Grbl => ("in line 5 of the file]", 1),
            // A printer goes on.
            Dialect::RepRap => ("Error:", 6),
        };
        assert!(session.heard.contains(told), "{dialect:?}: {}", session.heard);
        let place = session.steps()[0];
        session.say("G91");
        session.say("G1 X1 F6000");
        session.run(3_000);
        let step = session.steps()[0] - place;
        assert_eq!(place, step * x, "{dialect:?}: {}", session.heard);
    });
}

/// What stands behind the end of the program is not run.
#[test]
fn a_program_ends_at_its_end() {
    for_all(&[("A.NC", "G91\nG1 X1 F6000\nM30\nG1 X5\n")], |mut session, _| {
        let dialect = session.dialect;
        if dialect == Dialect::RepRap {
            return;
        }
        session.say(&dialect.run("A.NC"));
        session.run(3_000);
        let place = session.steps()[0];
        session.say("G91");
        session.say("G1 X1 F6000");
        session.run(3_000);
        assert_eq!(place, session.steps()[0] - place, "{dialect:?}: {}", session.heard);
    });
}

/// A hold holds a file, and it goes on behind it; a reset ends it.
#[test]
fn a_file_is_held_resumed_and_ended() {
    for_all(&[("A.NC", "G91\nG1 X1 F600\nG1 X1\nG1 X1\nG1 X1\nG1 X1\n")], |mut session, _| {
        let dialect = session.dialect;
        if dialect == Dialect::RepRap {
            return;
        }
        for ends in [false, true] {
            let before = session.steps()[0];
            session.say(&dialect.run("A.NC"));
            session.run(150);
            session.machine.send(b"!");
            session.run(500);
            let held = session.steps()[0];
            session.run(2_000);
            assert!(held > before && session.steps()[0] == held, "{dialect:?}");
            if !ends {
                session.machine.send(b"~");
                session.run(5_000);
                let whole = session.steps()[0] - before;
                assert!(held - before < whole, "{dialect:?}");
                session.say("G1 X5 F6000");
                session.run(5_000);
                assert_eq!(session.steps()[0] - before, 2 * whole, "{dialect:?}");
                continue;
            }
            let report = if dialect == Dialect::Grbl { "?" } else { "{sdu:n}\n" };
            session.heard.clear();
            session.machine.send(report.as_bytes());
            session.run(100);
            let told = if dialect == Dialect::Grbl { "|SD:" } else { "\"sdu\":2" };
            assert!(session.heard.contains(told), "{dialect:?}: {}", session.heard);
            session.machine.send(if dialect == Dialect::Grbl { b"\x18" } else { b"\x04" });
            session.run(3_000);
            assert_eq!(session.steps()[0], held, "{dialect:?}");
            session.heard.clear();
            session.machine.send(report.as_bytes());
            session.run(100);
            assert!(!session.heard.contains(told), "{dialect:?}: {}", session.heard);
        }
    });
}

/// A program that closes its port in the middle of an upload leaves no file, and its lines do not run.
#[test]
fn an_upload_whose_program_goes_away_is_given_up() {
    for_all(&[], |mut session, card| {
        let dialect = session.dialect;
        session.machine.open_usb();
        session.run(200);
        session.ask(if dialect == Dialect::RepRap { "M105" } else { dialect.mount() });
        let before = session.steps();
        session.say(&dialect.write("B.NC"));
        (0..20).for_each(|_| _ = session.say("G1 X10 F6000"));
        session.machine.send(b"G1 X10 F6000\nG1 X20 F6000\nG1 X3");
        session.run(50);
        session.machine.close_usb();
        session.run(1_000);
        session.machine.open_usb();
        session.run(1_000);
        assert_eq!(session.steps(), before, "{dialect:?}");
        session.ask(if dialect == Dialect::RepRap { "M105" } else { dialect.mount() });
        session.say("G1 X1 F6000");
        session.run(2_000);
        assert!(session.steps() != before, "{dialect:?}");
        assert!(!names(&session.card(&card)).contains(&String::from("B.NC")));
    });
}

/// An alarm in the middle of an upload: its lines do not run, and there is no file.
#[test]
fn an_alarm_spoils_an_upload() {
    for_all(&[], |mut session, card| {
        let dialect = session.dialect;
        let before = session.steps();
        session.say(&dialect.write("B.NC"));
        (0..5).for_each(|_| _ = session.say("G1 X10 F6000"));
        let (alarm, clear) = match dialect {
            Dialect::Tinyg => ("{alarm:n}", "{clear:n}"),
            Dialect::Grbl => ("{alarm:n}", "$X"),
            Dialect::RepRap => ("M112", "M999"),
        };
        if dialect == Dialect::Grbl {
            session.machine.send(b"\x84");
            session.run(100);
            return;
        }
        session.ask(alarm);
        session.run(200);
        assert!(!dialect.is_good(&session.ask("G1 X10 F6000")), "{dialect:?}");
        session.ask(clear);
        session.run(200);
        assert!(!dialect.is_good(&session.ask("G1 X10 F6000")), "{dialect:?}");
        assert!(!dialect.is_good(&session.ask(dialect.finish())), "{dialect:?}");
        session.run(1_000);
        assert_eq!(session.steps(), before, "{dialect:?}");
        assert!(!names(&session.card(&card)).contains(&String::from("B.NC")));
    });
}
