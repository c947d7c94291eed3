//! The lines that raise an alarm on arrival, before they are answered, and those that end one.

use super::json;
use super::token::{Operation, Target, resolve};
use crate::capability::Capability;
use crate::config::Name;
use crate::machine::Alarm;
use crate::protocol::STOP_MAX;

/// Returns the alarm that a line of JSON asks for in its first pair, if the whole line is well-formed: `{alarm:1}`,
/// `{"shutd":true}`, `{panic:n,tid:7}`. An alarm behind other pairs is not raised on arrival, because those pairs may
/// fail. Cost: 200 cycles; for a line that begins like an alarm 200 a byte and 3,000.
#[inline(never)]
#[small]
pub fn asks_alarm(line: &[u8]) -> Option<Alarm> {
    match letters(line) {
        _ if is_text(line) => return None,
        [b'a', b'l'] | [b's', b'h'] | [b'p', b'a'] => {}
        _ => return None,
    }
    match operation(line)? {
        Operation::Raise(alarm) => Some(alarm),
        _ => None,
    }
}

/// Whether a line ends an alarm: `$clear`, or a well-formed line of JSON whose first pair is `{clear:n}`. Cost: 100
/// cycles; for a line that begins like one 200 a byte and 3,000.
#[inline(never)]
#[small]
pub fn ends_alarm(line: &[u8]) -> bool {
    letters(line) == *b"cl" && matches!(operation(line), Some(Operation::Clear))
}

/// Whether a line is a command of text mode.
#[inline(always)]
fn is_text(line: &[u8]) -> bool {
    Capability::Text.is_built_in() && line.first() == Some(&b'$')
}

/// Returns the first two letters of a line, in lower case.
#[inline(never)]
#[small]
fn letters(line: &[u8]) -> [u8; 2] {
    let mut letters = line.iter().filter(|byte| byte.is_ascii_alphanumeric());
    let mut next = || letters.next().map_or(0, u8::to_ascii_lowercase);
    [next(), next()]
}

/// Returns the operation that a line of JSON names in its first pair, if the whole line is well-formed, or that a short
/// line names behind a `$`.
#[inline(never)]
#[small]
fn operation(line: &[u8]) -> Option<Operation> {
    let name = match line {
        _ if line.len() > STOP_MAX => return None,
        [_, name @ ..] if is_text(line) => name.trim_ascii(),
        _ => {
            json::check(line).ok()?;
            json::pair(line, json::skip_blanks(line) + 1)?.name.of(line)
        }
    };
    match resolve(Name::new(), name) {
        Target::Operation(operation) => Some(operation),
        _ => None,
    }
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
    fn a_line_that_ends_an_alarm() {
        for line in ["{clear:n}", "{\"clr\":null,tid:7}", "$clear", "$CLR "] {
            assert!(ends_alarm(line.as_bytes()), "{line}");
        }
        for line in ["{clear", "{alarm:1}", "{xvm:n,clear:n}", "{clock:n}", "$", "clear", "g1x1"] {
            assert!(!ends_alarm(line.as_bytes()), "{line}");
        }
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
