//! The serial line on the host machine: how it starts, senders that count characters, and noise.

use std::collections::BTreeMap;

use kerf::hal::imp::{Machine, eeprom};
use kerf::protocol::Checksum;

/// Sends a text, and returns what the machine sends within some milliseconds.
fn ask(machine: &Machine, text: &str, ms: u64) -> String {
    machine.send(text.as_bytes());
    machine.run_ms(ms);
    String::from_utf8(machine.received()).expect("ASCII")
}

/// The greeting of grbl's dialect.
const GRBL: &str = "\r\nGrbl 1.1h ['$' for help]\r\n";

/// Returns the EEPROM contents after a machine was sent some lines.
fn kept_after(lines: &'static str) -> Vec<u8> {
    let told = std::thread::spawn(move || {
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        ask(&machine, lines, 3_000);
        eeprom::contents()
    });
    told.join().expect("no panic")
}

/// Returns what a machine with these EEPROM contents sends, before its first report.
fn greeting_with(contents: Vec<u8>) -> String {
    let greeted = std::thread::spawn(move || {
        eeprom::put(&contents);
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        let mut greeting = ask(&machine, "", 300);
        // The greeting of grbl's dialect comes last while no dialect is settled.
        let ends = [GRBL, "{\"sr\"", "posx:"];
        let end = ends.iter().find_map(|text| greeting.find(text)).expect("an end");
        greeting.truncate(end);
        greeting
    });
    greeted.join().expect("no panic")
}

const WHO: &str = "{\"r\":{\"fv\":0.970,\"fb\":440.20,\"hp\":1,\"hv\":8,\"id\":\"0000-KERF\"";

/// Returns the greeting of a machine that is ready, from its version on to `end`.
fn ready(end: &str) -> String {
    format!(",\"kerf\":\"{}\",\"msg\":\"SYSTEM READY\"}},\"f\":[1,0,{end}", kerf::config::VERSION)
}

#[test]
fn the_machine_says_who_it_is_as_the_settings_want() {
    let mut sum = Checksum::default();
    format!("{WHO}{}", ready("0")).bytes().for_each(|byte| sum.add(byte));
    for (lines, end) in [
        ("", "0]}\n"),
        ("{ej:0}\n", "0]}\ntinyg [mm] ok> \n"),
        ("{ej:0,gun:0}\n", "0]}\ntinyg [inch] ok> \n"),
        ("{ej:0,tv:0}\n", "0]}\n"),
        ("{jv:1}\n", "0]}\n"),
        ("{ec:1}\n", "0]}\n\r"),
        ("{rxm:0}\n", &format!("0,{}]}}\n", sum.value())),
    ] {
        let greeting = format!("{WHO}{}", ready(end));
        assert_eq!(greeting_with(kept_after(lines)), greeting, "{lines}");
    }
    assert_eq!(greeting_with(kept_after("{jv:0}\n")), "");
    let who = "{\"r\":{\"fv\":0.990,\"fb\":101.03,\"hp\":3,\"hv\":0,\"id\":\"0000-KERF\"";
    let g2core = format!("{who}{}", ready("1]}\n"));
    assert_eq!(greeting_with(kept_after("{dia:1}\n")), g2core);
    assert_eq!(greeting_with(kept_after("{dia:1,ej:0}\n")), format!("{g2core}g2core[mm] ok> \n"));
}

#[test]
fn a_memory_full_of_rubbish_is_told() {
    let ready = ready("0]}\n");
    let told = "[MSG:'$H'|'$X' to unlock]\r\n[MSG:Settings unreadable - defaults in force]\r\n";
    for rubbish in [vec![0; 4_096], b"something else".repeat(100)] {
        let greeting = std::thread::spawn(move || {
            eeprom::put(&rubbish);
            ask(&Machine::boot(115_200).expect("one machine for each thread"), "", 300)
        });
        assert_eq!(greeting.join().expect("no panic"), format!("{WHO}{ready}{GRBL}{told}"));
    }
    assert_eq!(greeting_with(vec![0xFF; 4_096]), format!("{WHO}{ready}"));
}

/// Pseudo-random numbers that do not depend on the computer: xorshift64*.
struct Dice(u64);

impl Dice {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as usize % end
    }
}

/// Returns the length in the footer of a response; `None` for other lines.
fn length(response: &str) -> Option<usize> {
    response.starts_with("{\"r\":").then(|| {
        let footer = response.rsplit_once("\"f\":[").expect("a footer").1;
        footer.split(',').nth(2).expect("a length").parse().expect("a number")
    })
}

/// A sender that counts characters fills the window of 254 as far as it can, and waits for nothing else. It loses
/// nothing, whatever its lines look like, and `rx` never promises more room than there is.
#[test]
fn a_sender_that_counts_characters_never_overruns_the_machine() {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    // Without XON/XOFF, counting must be enough.
    ask(&machine, "{ex:0}\n{rxm:0}\n{sv:0}\n", 200);
    let mut dice = Dice(1);
    let (mut sent, mut told, mut answered) = (0, 0, 0);
    let (mut heard, mut most) = (String::new(), 0);
    const LINES: usize = 1_500;
    for number in 0..LINES {
        let line = match dice.below(8) {
            0 => "g0\n".to_string(),
            1 => "\n  \n g1f800x0\n".to_string(),
            2 => format!("g1 f800 x{} (a comment of some length)\r\n", dice.below(3)),
            3 => "{rx:n}\n".to_string(),
            4 => format!("({})\n", "x".repeat(dice.below(250))),
            5 => "nonsense\r\n".to_string(),
            _ => format!("g1f800x{}.{}\n", number % 2, dice.below(10)),
        };
        while sent - told + line.len() > 254 {
            machine.run_ms(1);
            heard += &String::from_utf8(machine.received()).expect("ASCII");
            while let Some((response, rest)) = heard.split_once('\n') {
                if let Some(room) = response.strip_prefix("{\"r\":{\"rx\":") {
                    let room: usize = room.split('}').next().unwrap().parse().unwrap();
                    assert!(room + (sent - told) >= 254, "{response}");
                }
                assert!(!response.starts_with("{\"er\""), "{response}");
                answered += usize::from(length(response).is_some());
                told += length(response).unwrap_or(0);
                heard = rest.to_string();
            }
            assert!(told <= sent);
        }
        machine.send(line.as_bytes());
        sent += line.len();
        most = most.max(sent - told);
    }
    let rest = heard + &ask(&machine, "", 300_000);
    told += rest.lines().filter_map(length).sum::<usize>();
    answered += rest.lines().filter_map(length).count();
    assert!(!rest.contains("\"er\""), "{rest}");
    assert_eq!(answered, LINES);
    // A line feed behind the last return counts with the next line.
    assert!(sent - told <= 1, "{sent} bytes were sent and {told} told");
    assert!(most > 250, "{most} bytes at once");
}

/// Returns every setting, by groups.
fn all_settings(machine: &Machine) -> BTreeMap<&'static str, String> {
    let groups = ["sys", "1", "2", "3", "4", "x", "y", "z", "a", "b", "c", "ofs", "tof"];
    groups.map(|group| (group, ask(machine, &format!("{{{group}:n}}\n"), 200))).into()
}

/// Bytes of noise: half of them have any value, half are characters that requests are made of.
///
/// Bytes that might mean something are changed, so that nothing is requested by chance. G is left out, so that no
/// line moves anything, because no motion mode is in force at first. M is left out because of outputs. In a line that
/// begins with a brace or a dollar sign nothing that reads as a value follows a separator, so that nothing is set.
/// Characters that act at once (`!`, `~`, `%`, ^d, ^x, XOFF, overrides, the end of a jog) are tested on their own. No
/// line is empty, so that each must be answered in either mode: the second byte of a line end, and a line end behind
/// nothing but blanks, are left out.
struct Noise {
    dice: Dice,
    /// The line so far: its first byte, and its last byte that is not blank.
    first: Option<u8>,
    last: u8,
    /// The last byte, blank or not.
    before: u8,
    /// Number of question marks with another line directly behind them.
    asked: usize,
}

impl Noise {
    fn byte(&mut self) -> u8 {
        loop {
            const REQUESTS: &[u8] =
                b"{}{}\"\":,,[]$$??hHnntfNxyzabc0123456789.-+ \t=|/()*;smjvqrpioue\\\r\n";
            let byte = match self.dice.below(2) {
                0 => self.dice.below(256) as u8,
                _ => REQUESTS[self.dice.below(REQUESTS.len())],
            };
            if !self.may_come(byte) {
                continue;
            }
            match byte {
                b'\r' | b'\n' => (self.first, self.last) = (None, 0),
                // Blanks, and bytes that never become part of a line.
                b' ' | b'\t' | 0x05 | 0x11 => {}
                _ => {
                    if self.first == Some(b'?') {
                        self.asked += 1;
                        self.first = Some(byte);
                    }
                    self.first = self.first.or(Some(byte));
                    self.last = byte;
                }
            }
            self.before = byte;
            return byte;
        }
    }

    fn may_come(&self, byte: u8) -> bool {
        let request = matches!(self.first, Some(b'{' | b'$'));
        let blank = matches!(self.before, b' ' | b'\t');
        let dollar = self.first == Some(b'$') && blank;
        let separator = matches!(self.last, b':' | b'=' | b'|' | b'"' | b'-' | b',') || dollar;
        match byte {
            b'!' | b'~' | b'%' | 0x85 | 0x04 | 0x13 | 0x18 | 0x90..=0x9D => false,
            b'g' | b'G' | b'm' | b'M' => self.first == Some(b'{') || self.first == Some(b'$'),
            b'\n' | b'\r' => self.first.is_some(),
            b'0'..=b'9' | b'-' | b'.' | b't' | b'T' | b'f' | b'F' => !(request && separator),
            _ => true,
        }
    }
}

/// A megabyte of noise. `KERF_NOISE` selects another seed.
#[test]
fn noise_is_answered_and_changes_nothing() {
    const BYTES: usize = 1 << 20;
    let seed = std::env::var("KERF_NOISE").map_or(7, |seed| seed.parse().expect("a number"));
    println!("KERF_NOISE={seed}");
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    let before = {
        ask(&machine, "{}\n", 100);
        all_settings(&machine)
    };
    let mut noise = Noise { dice: Dice(seed), first: None, last: 0, before: 0, asked: 0 };
    let (mut bytes, mut lines, mut answers, mut enquiries) = (0, 0, 0, 0);
    let mut heard = Vec::new();
    while bytes < BYTES || noise.first.is_some() {
        // A line at a time, so that no line is lost.
        let mut line = Vec::new();
        loop {
            line.push(noise.byte());
            if matches!(line.last(), Some(b'\r' | b'\n')) {
                break;
            }
        }
        let acks = line.iter().filter(|byte| **byte == 0x05).count();
        machine.send(&line);
        bytes += line.len();
        lines += 1;
        enquiries += usize::from(acks > 0);
        // Time for the bytes and for the answer.
        let mut left = 3_000;
        while answers < lines + noise.asked && left > 0 {
            machine.run_ms(2);
            heard.extend(machine.received());
            while let Some(end) = heard.iter().position(|byte| *byte == b'\n') {
                let answer: Vec<u8> = heard.drain(..=end).collect();
                let prompt = answer.starts_with(b"tinyg [");
                answers += usize::from(prompt || answer.starts_with(b"{\"r\":"));
            }
            left -= 2;
        }
        let shown = String::from_utf8_lossy(&line).into_owned();
        assert_eq!(answers, lines + noise.asked, "seed {seed}, byte {bytes}: {shown:?}");
    }
    ask(&machine, "{}\n", 500);
    assert_eq!(all_settings(&machine), before, "seed {seed}");
    assert_eq!(machine.emitted().steps, [0; 4], "seed {seed}");
    assert!(!kerf::hal::imp::was_reset());
    assert!(lines > 5_000 && enquiries > 100, "{lines} lines, {enquiries} enquiries");
}
