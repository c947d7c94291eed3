//! A sender on a port that counts lines and answers.

use crate::side::Side;

/// What an answer begins with.
const ANSWER: &str = "{\"r\":{";
/// An unsolicited line begins with one of these, or is a banner.
const UNASKED: [&str; 7] =
    ["{\"r\":{\"prb\":", "{\"sr\":", "{\"qr\":", "{\"er\":", "{\"rx\":", "{\"jog\":", "{\"ack\":"];

/// The characters that stop and release a sender that heeds them.
const XOFF: char = '\x13';
const XON: char = '\x11';
/// How a banner ends.
const BANNER: &str = "\"SYSTEM READY\"},\"f\":[1,0,0]}";
/// The greeting of grbl's dialect, which comes behind the banner while no dialect is settled.
const GRBL: [&str; 2] = ["", "Grbl 1.1h ['$' for help]"];

/// What the answer to a line must report.
#[derive(Clone, PartialEq, Debug)]
enum Want {
    /// The answer must report this name first.
    Name(String),
    /// The answer must have an empty body, as the answer to G-code has.
    Nothing,
    /// Any answer: a line that is broken up by real-time characters may be dropped, or become several lines.
    Anything,
}

impl Want {
    /// Returns what the answer to a line must report.
    fn of(line: &[u8]) -> Want {
        let line = String::from_utf8_lossy(line);
        let is_plain = |c: char| c == ' ' || u8::try_from(c).is_ok_and(|byte| is_text(&byte));
        if !line.chars().all(is_plain) {
            return Want::Anything;
        }
        let name = line.strip_prefix('{').and_then(|rest| rest.split(':').next());
        match name.map(|name| name.trim_matches('"')) {
            None => Want::Nothing,
            // If the line is dropped, its answer repeats it.
            Some("gc") => Want::Anything,
            Some(name) => Want::Name(name.to_string()),
        }
    }
}

/// The state of a sender on a port.
pub struct Sender {
    port: usize,
    /// The text of a line that has not come to its end.
    partial: String,
    /// All lines since [`Sender::forget`].
    pub heard: Vec<String>,
    /// What the answers to the lines in flight must report.
    wanted: Vec<Want>,
    /// Banners since the last reset.
    pub banners: usize,
    /// Whether the port has answered since the last reset, so that its dialect is settled.
    settled: bool,
    /// Jogs that were accepted, minus jogs that have ended.
    pub jogs: isize,
}

impl Sender {
    /// A sender on port 0 or 1.
    pub fn new(port: usize) -> Self {
        Self {
            port,
            partial: String::new(),
            heard: Vec::new(),
            wanted: Vec::new(),
            banners: 0,
            settled: false,
            jogs: 0,
        }
    }

    /// Number of lines that wait for their answers.
    pub fn in_flight(&self) -> usize {
        self.wanted.len()
    }

    /// Sends bytes. The lines in them are then expected to be answered.
    pub fn send(&mut self, side: &mut impl Side, bytes: &[u8]) {
        self.wanted.extend(wants(bytes));
        match self.port {
            0 => side.send(bytes),
            _ => side.send_aux(bytes),
        }
    }

    /// Takes what has come. The error is a line that must not come.
    pub fn hear(&mut self, side: &mut impl Side) -> Result<(), String> {
        let bytes = if self.port == 0 { side.heard() } else { side.heard_aux() };
        self.partial += &String::from_utf8_lossy(&bytes).replace([XON, XOFF], "");
        while let Some((line, rest)) = self.partial.split_once('\n') {
            let line = line.trim_matches('\r').to_string();
            self.partial = rest.to_string();
            self.heard.push(line);
            self.judge()?;
        }
        Ok(())
    }

    /// Judges the line that was heard last.
    fn judge(&mut self) -> Result<(), String> {
        let Some(line) = self.heard.last() else { return Ok(()) };
        if line.ends_with(BANNER) {
            self.banners += 1;
            return if self.banners > 1 { Err("it has started anew".to_string()) } else { Ok(()) };
        }
        if self.banners == 0 {
            // A reset has broken the line off.
            return Ok(());
        }
        if !self.settled && GRBL.contains(&line.as_str()) {
            return Ok(());
        }
        if !is_whole(line) {
            return Err(format!("heard {line}, which is no line"));
        }
        if line.starts_with("{\"jog\":") {
            self.jogs -= 1;
        } else if UNASKED.iter().all(|start| !line.starts_with(start)) {
            if !line.starts_with(ANSWER) {
                return Err(format!("heard {line}, which nobody says"));
            }
            return self.answer();
        }
        Ok(())
    }

    /// Takes the line that was heard last as the answer to a line in flight.
    fn answer(&mut self) -> Result<(), String> {
        let Some(line) = self.heard.last() else { return Ok(()) };
        let name = line.strip_prefix("{\"r\":{\"").and_then(|rest| rest.split('"').next());
        let fits = |want: &Want| match want {
            Want::Name(wanted) => name == Some(wanted),
            Want::Nothing => name.is_none(),
            Want::Anything => false,
        };
        let anything = || self.wanted.iter().position(|want| *want == Want::Anything);
        let at = self.wanted.iter().position(fits).or_else(anything);
        let at = at.ok_or_else(|| format!("{line} answers none of {:?}", self.wanted))?;
        self.jogs +=
            isize::from(name.is_some_and(|n| n.starts_with("jog")) && line.contains("\"f\":[1,0,"));
        self.wanted.remove(at);
        self.settled = true;
        Ok(())
    }

    /// Takes note of a reset: no line in flight will be answered any more.
    pub fn reset(&mut self) {
        (self.banners, self.jogs, self.settled) = (0, 0, false);
        self.wanted.clear();
        self.partial.clear();
    }

    /// Returns what the answer that came last reports for `name`, if it does.
    pub fn told(&self, name: &str) -> Option<&str> {
        let start = format!("{ANSWER}\"{name}\":");
        self.heard.iter().rev().find(|line| line.starts_with(ANSWER))?.strip_prefix(&start)
    }
}

/// Whether a line is one complete object. Text in quotes is ignored.
fn is_whole(line: &str) -> bool {
    let bare: String = line.split('"').step_by(2).collect();
    let ends = |open: char, close: char| bare.matches(open).count() == bare.matches(close).count();
    let plain = line.is_ascii() && line.starts_with('{') && line.ends_with('}');
    plain && ends('{', '}') && ends('[', ']')
}

/// Returns what the answers to the lines in these bytes must report. Real-time characters are no text, and an empty
/// line has no answer.
fn wants(bytes: &[u8]) -> Vec<Want> {
    let mut pieces: Vec<_> = bytes.split(|byte| *byte == b'\n').collect();
    // Text without an end is no line yet.
    pieces.pop();
    pieces.into_iter().filter(|piece| piece.iter().any(is_text)).map(Want::of).collect()
}

fn is_text(byte: &u8) -> bool {
    byte.is_ascii_graphic() && !b"!~%".contains(byte)
}
