//! The lines that raise an alarm on arrival, before they are answered.

use super::json;
use super::token::{Operation, Target, resolve};
use crate::config::Name;
use crate::machine::Alarm;
use crate::protocol::STOP_MAX;

/// Returns the alarm that a line of JSON asks for in its first pair, if the whole line is well-formed: `{alarm:1}`,
/// `{"shutd":true}`, `{panic:n,tid:7}`. An alarm behind other pairs is not raised on arrival, because those pairs may
/// fail. Cost: 200 cycles; for a line that begins like an alarm 200 a byte and 3,000.
#[inline(never)]
#[small]
pub fn asks_alarm(line: &[u8]) -> Option<Alarm> {
    if line.len() > STOP_MAX || !may_ask(line) || json::check(line).is_err() {
        return None;
    }
    let start = json::skip_blanks(line) + 1;
    let name = json::pair(line, start)?.name;
    match resolve(Name::new(), name.of(line)) {
        Target::Operation(Operation::Raise(alarm)) => Some(alarm),
        _ => None,
    }
}

/// Whether the first two letters are those of an alarm.
#[small]
fn may_ask(line: &[u8]) -> bool {
    let mut letters = line.iter().filter(|byte| byte.is_ascii_alphanumeric());
    let mut next = || letters.next().map_or(0, u8::to_ascii_lowercase);
    matches!((next(), next()), (b'a', b'l') | (b's', b'h') | (b'p', b'a'))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(line: &str) -> Option<Alarm> {
        asks_alarm(line.as_bytes())
    }

    #[test]
    fn a_line_that_begins_with_an_alarm() {
        assert_eq!(of("{alarm:1}"), Some(Alarm::Alarm));
        assert_eq!(of(" { \"shutd\" : true }"), Some(Alarm::Shutdown));
        assert_eq!(of("{Panic:null,tid:7}"), Some(Alarm::Panic));
    }

    #[test]
    fn other_lines() {
        for line in [
            "",
            "{",
            "{alarm",
            "{alarm:",
            "{alarm:1",
            "{alarm}",
            "{alarms:1}",
            "{alarm:1}}",
            "{alarm:ok}",
            "{xvm:n,alarm:1}",
            "{txt:\"alarm\"}",
            "alarm:1",
            "$alarm",
            "{clear:n}",
            "{sr:n}",
            "{alarm:1,msg:\"longer than what is looked at\"}",
        ] {
            assert_eq!(of(line), None, "{line}");
        }
    }
}
