//! Classifies the lines that the firmware sends.

use serde_json::Value;

/// A line from the firmware.
#[derive(Clone, PartialEq, Debug)]
pub enum Incoming {
    /// The banner after a reset.
    Banner,
    /// The answer to a line.
    Response(Response),
    /// An unsolicited report: `sr`, `qr`, `er` and so on.
    Report(Value),
    /// A greeting in another dialect, which comes where no dialect is settled yet, or a message for people.
    OtherGreeting,
    /// A message that steps came late.
    Late,
    /// Anything else.
    Other(String),
}

/// The answer to a line.
#[derive(Clone, PartialEq, Debug)]
pub struct Response {
    /// The line as it came.
    pub raw: String,
    /// The value under `r`.
    pub body: Value,
    /// Status code; 0 means success.
    pub status: i64,
    /// Free line slots.
    pub free: i64,
}

/// The greetings in grbl's dialect and in that of printing hosts.
const OTHER_GREETINGS: [&str; 2] = ["Grbl 1.1h ['$' for help]", "start"];

/// Status of a line without effect, such as a deleted block.
pub const STATUS_NOOP: i64 = 3;

impl Response {
    /// Whether the line was accepted.
    pub fn is_ok(&self) -> bool {
        self.status == 0 || self.status == STATUS_NOOP
    }
}

/// Determines what a line is.
pub fn classify(line: &str) -> Incoming {
    if OTHER_GREETINGS.contains(&line.trim_end()) {
        return Incoming::OtherGreeting;
    }
    let strict = serde_json::from_str::<Value>(line);
    let Ok(value) = strict.or_else(|_| serde_json::from_str(&quoted(line))) else {
        return Incoming::Other(line.to_string());
    };
    let Some(body) = value.get("r") else {
        return match value {
            Value::Object(_) => Incoming::Report(value),
            _ => Incoming::Other(line.to_string()),
        };
    };
    match body.get("msg").and_then(Value::as_str) {
        Some(msg) if msg.contains("SYSTEM READY") => return Incoming::Banner,
        Some(msg) if msg.starts_with("Loading configs") => return Incoming::Report(value),
        _ => {}
    }
    let footer = |i: usize| value.get("f").and_then(|f| f.get(i)).and_then(Value::as_i64);
    match (footer(0), footer(1), footer(2)) {
        (Some(_), Some(status), Some(free)) => {
            Incoming::Response(Response { raw: line.to_string(), body: body.clone(), status, free })
        }
        _ => Incoming::Other(line.to_string()),
    }
}

/// Returns the line with its names in quotes, which `{js:0}` leaves out.
fn quoted(line: &str) -> String {
    let (mut out, mut in_text) = (String::new(), false);
    let mut rest = line;
    while let Some(byte) = rest.chars().next() {
        let (here, behind) = rest.split_at(byte.len_utf8());
        (rest, in_text) = (behind, in_text != (byte == '"'));
        out.push_str(here);
        if !in_text && matches!(byte, '{' | ',') {
            let end = rest.find(|c: char| !c.is_ascii_alphanumeric()).unwrap_or(rest.len());
            let (name, behind) = rest.split_at(end);
            if end > 0 && behind.starts_with(':') {
                out.push_str(&format!("\"{name}\""));
                rest = behind;
            }
        }
    }
    out
}

/// Returns the machine state from a report or from the body of a response.
pub fn state_of(value: &Value) -> Option<i64> {
    let stat = value.get("stat").or_else(|| value.get("sr").and_then(|sr| sr.get("stat")));
    stat.and_then(Value::as_i64)
}

/// Whether a machine state means that nothing moves: ready, stop, end.
pub fn is_idle(stat: i64) -> bool {
    matches!(stat, 1 | 3 | 4)
}

/// Returns the first name in a line of JSON; `None` for wrapped G-code and other lines.
pub fn control_name(line: &str) -> Option<String> {
    let inner = line.trim().strip_prefix('{')?;
    let end = inner.find(':')?;
    let name = inner[..end].trim().trim_matches('"').to_ascii_lowercase();
    (name != "gc" && !name.is_empty()).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tells_lines_apart() {
        let Incoming::Response(r) = classify(r#"{"r":{"n":3},"f":[1,0,7]}"#) else { panic!() };
        assert_eq!((r.status, r.free, r.is_ok()), (0, 7, true));
        let relaxed = r#"{r:{msg:"a, b:{c:"},f:[1,0,7]}"#;
        let Incoming::Response(r) = classify(relaxed) else { panic!() };
        assert_eq!((&r.body["msg"], r.status, r.free), (&"a, b:{c:".into(), 0, 7));
        let banner = r#"{"r":{"fv":0.97,"msg":"SYSTEM READY"},"f":[1,0,0]}"#;
        assert_eq!(classify(banner), Incoming::Banner);
        let Incoming::Report(sr) = classify(r#"{"sr":{"stat":3}}"#) else { panic!() };
        assert_eq!(state_of(&sr), Some(3));
        assert_eq!(classify("Grbl 1.1h ['$' for help]\r"), Incoming::OtherGreeting);
        assert!(matches!(classify("ok"), Incoming::Other(_)));
        assert!(matches!(classify(r#"{"r":{}}"#), Incoming::Other(_)));
    }

    #[test]
    fn names_of_control_lines() {
        assert_eq!(control_name("{sr:n}").as_deref(), Some("sr"));
        assert_eq!(control_name(r#"{"1":null}"#).as_deref(), Some("1"));
        assert_eq!(control_name(r#"{"gc":"G0"}"#), None);
        assert_eq!(control_name("G0 X1"), None);
    }
}
