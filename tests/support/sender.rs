//! A sender on a port that counts lines and answers.

use crate::side::Side;

/// What an answer begins with.
const ANSWER: &str = "{\"r\":{";
/// What comes without having been asked for begins with one of these, or is a banner.
const UNASKED: [&str; 7] =
    ["{\"r\":{\"prb\":", "{\"sr\":", "{\"qr\":", "{\"er\":", "{\"rx\":", "{\"jog\":", "{\"ack\":"];

/// What holds a sender back that heeds it.
const XOFF: char = '\x13';
const XON: char = '\x11';
/// How a banner ends.
const BANNER: &str = "\"SYSTEM READY\"},\"f\":[1,0,0]}";

/// What an answer to a line tells of.
#[derive(Clone, PartialEq, Debug)]
enum Want {
    /// It is to tell of this first.
    Name(String),
    /// It is to tell of nothing, as that to G-code does.
    Nothing,
    /// Of whatever: a line that is broken up by real-time characters may be dropped, or be several.
    Anything,
}

impl Want {
    /// Of a line.
    fn of(line: &[u8]) -> Want {
        let line = String::from_utf8_lossy(line);
        let is_plain = |c: char| c == ' ' || u8::try_from(c).is_ok_and(|byte| is_text(&byte));
        if !line.chars().all(is_plain) {
            return Want::Anything;
        }
        let name = line.strip_prefix('{').and_then(|rest| rest.split(':').next());
        match name.map(|name| name.trim_matches('"')) {
            None => Want::Nothing,
            // If it is dropped, its answer repeats it.
            Some("gc") => Want::Anything,
            Some(name) => Want::Name(name.to_string()),
        }
    }
}

/// What is sent and heard on a port.
pub struct Sender {
    port: usize,
    /// The text that has not come to its end.
    partial: String,
    /// All lines since [`Sender::forget`].
    pub heard: Vec<String>,
    /// What lines that have been sent want to hear.
    wanted: Vec<Want>,
    /// Banners.
    pub banners: usize,
    /// Jogs that were taken, less those that have ended.
    pub jogs: isize,
}

impl Sender {
    /// On a port: 0 or 1.
    pub fn new(port: usize) -> Self {
        Self {
            port,
            partial: String::new(),
            heard: Vec::new(),
            wanted: Vec::new(),
            banners: 0,
            jogs: 0,
        }
    }

    /// Lines that wait for their answers.
    pub fn in_flight(&self) -> usize {
        self.wanted.len()
    }

    /// Sends bytes, of which the lines want answers.
    pub fn send(&mut self, side: &mut impl Side, bytes: &[u8]) {
        self.wanted.extend(wants(bytes));
        match self.port {
            0 => side.send(bytes),
            _ => side.send_aux(bytes),
        }
    }

    /// Takes what has come. The error is what may not come.
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

    /// Looks at the line that was heard last.
    fn judge(&mut self) -> Result<(), String> {
        let Some(line) = self.heard.last() else { return Ok(()) };
        if line.ends_with(BANNER) {
            self.banners += 1;
            return if self.banners > 1 { Err("it has started anew".to_string()) } else { Ok(()) };
        }
        if self.banners == 0 {
            // A reset has broken it off.
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

    /// The line that was heard last answers one of those that have been sent.
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
        Ok(())
    }

    /// The machine has been reset: nothing will be answered any more.
    pub fn reset(&mut self) {
        (self.banners, self.jogs) = (0, 0);
        self.wanted.clear();
        self.partial.clear();
    }

    /// Whether the answer that came last tells of `name`.
    pub fn told(&self, name: &str) -> Option<&str> {
        let start = format!("{ANSWER}\"{name}\":");
        self.heard.iter().rev().find(|line| line.starts_with(ANSWER))?.strip_prefix(&start)
    }
}

/// Whether a line is one object with all its ends; what stands in quotes is of no account.
fn is_whole(line: &str) -> bool {
    let bare: String = line.split('"').step_by(2).collect();
    let ends = |open: char, close: char| bare.matches(open).count() == bare.matches(close).count();
    let plain = line.is_ascii() && line.starts_with('{') && line.ends_with('}');
    plain && ends('{', '}') && ends('[', ']')
}

/// What answers the lines in these bytes: real-time characters are no text, and an empty line is none.
fn wants(bytes: &[u8]) -> Vec<Want> {
    let mut pieces: Vec<_> = bytes.split(|byte| *byte == b'\n').collect();
    // What has no end is no line yet.
    pieces.pop();
    pieces.into_iter().filter(|piece| piece.iter().any(is_text)).map(Want::of).collect()
}

fn is_text(byte: &u8) -> bool {
    byte.is_ascii_graphic() && !b"!~%".contains(byte)
}
