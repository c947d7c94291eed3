//! Parses what the machine sends on a port, a line at a time.

use super::json::{Value, parse};

/// The name of an unsolicited line is one of these.
const UNASKED: [&str; 6] = ["sr", "qr", "er", "rx", "jog", "ack"];

/// A line from the machine.
#[derive(Debug)]
pub enum Heard {
    /// The answer to a line.
    Answer(Answer),
    /// The answer to an enquiry whether anybody is there.
    Ack,
    /// An exception, with this status.
    Exception(u16),
    /// It has started.
    Banner,
    /// Another report.
    Report,
}

/// The answer to a line.
#[derive(Debug)]
pub struct Answer {
    pub body: Value,
    pub status: u16,
    /// The length in the footer.
    pub told: f64,
    /// The number of the line that it answers, if it has one.
    pub id: Option<u32>,
}

impl Answer {
    /// Returns the value of this name in the body.
    pub fn told(&self, name: &str) -> Option<&Value> {
        self.body.get(name)
    }
}

/// Parses a line; `sums` says whether footers have a checksum. The error says what is wrong with the line.
pub fn read(line: &str, sums: bool) -> Result<Heard, String> {
    let wrong = |why: &str| format!("heard {line:?}: {why}");
    let value = parse(line).ok_or_else(|| wrong("no JSON"))?;
    let Some(body) = value.get("r") else {
        let Value::Object(pairs) = &value else { return Err(wrong("no object")) };
        let name = pairs.first().map_or("", |(name, _)| name);
        return match name {
            "ack" => Ok(Heard::Ack),
            "er" => {
                let status = pairs[0].1.get("st").and_then(Value::number);
                Ok(Heard::Exception(status.ok_or_else(|| wrong("no status"))? as u16))
            }
            name if UNASKED.contains(&name) => Ok(Heard::Report),
            _ => Err(wrong("nobody says that")),
        };
    };
    if body.get("msg").and_then(Value::text) == Some("SYSTEM READY") {
        return Ok(Heard::Banner);
    }
    let Some(Value::List(footer)) = value.get("f") else { return Err(wrong("no footer")) };
    let footer: Option<Vec<f64>> = footer.iter().map(Value::number).collect();
    let footer = footer.ok_or_else(|| wrong("a footer without numbers"))?;
    let fits = footer.len() == if sums { 4 } else { 3 };
    if !fits || footer[0] != 1.0 {
        return Err(wrong("another footer"));
    }
    if sums && footer[3] != f64::from(checksum(line)) {
        return Err(wrong("another checksum"));
    }
    let answer =
        Answer { id: id(body), status: footer[1] as u16, told: footer[2], body: body.clone() };
    Ok(Heard::Answer(answer))
}

/// Returns the checksum of the text up to the comma before the checksum.
fn checksum(line: &str) -> u32 {
    let summed = line.rfind(',').map_or("", |comma| &line[..comma]);
    summed.bytes().fold(0u32, |sum, b| sum.wrapping_mul(31).wrapping_add(b.into())) % 9_999
}

/// Returns the number of the line: its `tid`, its N word, or one of both in the repeated text.
fn id(body: &Value) -> Option<u32> {
    let named = |name| body.get(name).and_then(Value::number).map(|id| id as u32);
    let digits = |text: &str| {
        let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
        text[..end].parse().ok()
    };
    let back = || {
        let err = body.get("err")?.text()?.replace('"', "");
        match err.split_once("tid:") {
            Some((_, rest)) => digits(rest.trim_start()),
            None => digits(err.strip_prefix('N')?),
        }
    };
    named("tid").or_else(|| named("n")).or_else(back)
}
