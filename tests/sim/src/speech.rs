//! grbl's dialect for [`Host`](crate::Host), which thinks in TinyG's: what it sends, and what comes back.

use serde_json::{Map, Number, Value};

use crate::by_name;
use crate::protocol::{Incoming, Response};

/// The dialect that a sender speaks.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Speech {
    /// TinyG's.
    #[default]
    TinyG,
    /// grbl's.
    Grbl,
}

impl Speech {
    /// Returns the dialect in which jobs are sent to a board with these features; `None` if it has neither.
    pub fn of(features: &[&str]) -> Option<Speech> {
        let has = |feature| features.contains(&feature);
        match (has("dialect-tinyg"), has("dialect-grbl")) {
            (true, _) => Some(Speech::TinyG),
            (_, true) => Some(Speech::Grbl),
            _ => None,
        }
    }
}

/// Words of a message about late steps.
pub const LATE: &str = "[MSG:Steps came late]";

/// Returns a line as grbl's dialect has it: `{spn:4}` is `$spn=4`, `{spn:n}` is `$spn`.
pub fn translated(line: &str) -> String {
    let is_group = line.trim().starts_with('{');
    match by_name::lines(line).as_deref() {
        Ok([one]) if is_group => one.clone(),
        _ => line.to_string(),
    }
}

/// Takes the value from a line such as `$spn=4`.
fn shown(line: &str) -> Option<Map<String, Value>> {
    let (name, value) = line.strip_prefix('$')?.split_once('=')?;
    let value = value.parse::<Number>().map_or(Value::from(value), Value::Number);
    Some(Map::from_iter([(name.to_string(), value)]))
}

/// Returns the machine state of a status report, as in TinyG's dialect.
fn state(line: &str) -> Option<i64> {
    let state = line.strip_prefix('<')?.split(['|', ':', '>']).next()?;
    Some(match state {
        "Idle" | "Check" => 3,
        "Alarm" => 2,
        "Hold" | "Door" => 6,
        "Home" => 9,
        _ => 5,
    })
}

/// Determines what a line is. The value that an answer shows comes in a report before it.
pub fn classify(line: &str) -> Incoming {
    let answer = |status| {
        let (raw, body) = (line.to_string(), Value::Null);
        Incoming::Response(Response { raw, body, status, free: 0 })
    };
    if line.starts_with("Grbl 1.1") {
        return Incoming::Banner;
    }
    if line == "ok" {
        return answer(0);
    }
    if let Some(number) = line.strip_prefix("error:") {
        return answer(number.parse().unwrap_or(-1));
    }
    if let Some(stat) = state(line) {
        return Incoming::Report(Value::Object(Map::from_iter([("stat".into(), stat.into())])));
    }
    match shown(line) {
        Some(values) => Incoming::Report(Value::Object(values)),
        None if line == LATE => Incoming::Late,
        // Messages, and the lists of commands.
        None if line.starts_with('[') => Incoming::OtherGreeting,
        None => Incoming::Other(line.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_translated() {
        for (line, want) in [("{spn:4}", "$spn=4"), ("{\"1ma\":n}", "$1ma"), ("G0 X1", "G0 X1")] {
            assert_eq!(translated(line), want);
        }
    }

    #[test]
    fn tells_lines_apart() {
        let status = |line| match classify(line) {
            Incoming::Response(response) => response.status,
            other => panic!("{other:?}"),
        };
        assert_eq!((status("ok"), status("error:20")), (0, 20));
        assert_eq!(classify("Grbl 1.1h ['$' for help]"), Incoming::Banner);
        assert_eq!(classify("$1tr=1.25"), Incoming::Report(serde_json::json!({"1tr": 1.25})));
        assert_eq!(classify("<Run|MPos:0>"), Incoming::Report(serde_json::json!({"stat": 5})));
        assert_eq!(classify("[MSG:Pgm End]"), Incoming::OtherGreeting);
        assert!(matches!(classify("ALARM:1"), Incoming::Other(_)));
    }
}
