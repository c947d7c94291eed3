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

/// What is sent and heard on a port.
pub struct Sender {
    port: usize,
    /// The text that has not come to its end.
    partial: String,
    /// All lines since [`Sender::forget`].
    pub heard: Vec<String>,
    /// Lines that want an answer.
    pub sent: usize,
    /// Answers.
    pub answered: usize,
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
            sent: 0,
            answered: 0,
            banners: 0,
            jogs: 0,
        }
    }

    /// Lines that wait for their answers.
    pub fn in_flight(&self) -> usize {
        self.sent.saturating_sub(self.answered)
    }

    /// Sends bytes, of which the lines want answers.
    pub fn send(&mut self, side: &mut impl Side, bytes: &[u8]) {
        self.sent += lines_of(bytes);
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
            self.answered += 1;
            if line.starts_with("{\"r\":{\"jog") && line.contains("\"f\":[1,0,") {
                self.jogs += 1;
            }
        }
        match self.answered > self.sent {
            true => Err(format!("{} lines and {} answers", self.sent, self.answered)),
            false => Ok(()),
        }
    }

    /// The machine has been reset: nothing will be answered any more.
    pub fn reset(&mut self) {
        (self.sent, self.answered, self.banners, self.jogs) = (0, 0, 0, 0);
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

/// How many lines are in these bytes that are answered: real-time characters are no text, and an empty line is none.
fn lines_of(bytes: &[u8]) -> usize {
    let is_text = |byte: &&u8| byte.is_ascii_graphic() && !b"!~%".contains(byte);
    let mut pieces: Vec<_> = bytes.split(|byte| *byte == b'\n').collect();
    // What has no end is no line yet.
    pieces.pop();
    pieces.iter().filter(|piece| piece.iter().any(|byte| is_text(&byte))).count()
}
