//! The tables of the firmware that the page needs, as JSON.
//!
//! The page asks for them once, when it loads. Nothing here depends on a machine.

use kerf::boards::ACTIVE;
use kerf::canon::{advice, statuses, text};
use kerf::config::{VERSION, machines};
use kerf::protocol::tinyg::number;

/// Returns the text as a JSON string.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            '\n' => quoted.push_str("\\n"),
            c => quoted.push(c),
        }
    }
    quoted + "\""
}

fn list(items: impl Iterator<Item = String>) -> String {
    format!("[{}]", items.collect::<Vec<_>>().join(","))
}

/// Returns
/// `{"version":..,"board":..,"machines":[{"name":..,"about":..}],"codes":[{"code":..,"text":..,"cause":..,"cure":..}]}`:
/// the machines in the order of their numbers, and the codes of all statuses that a sender may receive.
pub fn json() -> String {
    let machine = |machine: &&machines::MachineProfile| {
        format!("{{\"name\":{},\"about\":{}}}", quoted(machine.name), quoted(machine.about))
    };
    let code = |status| {
        let (cause, cure) = advice(status).unwrap_or_default();
        format!(
            "{{\"code\":{},\"text\":{},\"cause\":{},\"cure\":{}}}",
            number(status),
            quoted(&text(status)),
            quoted(cause),
            quoted(cure)
        )
    };
    format!(
        "{{\"version\":{},\"board\":{},\"machines\":{},\"codes\":{}}}",
        quoted(VERSION),
        quoted(ACTIVE.name),
        list(machines::ALL.iter().map(machine)),
        list(statuses().map(code))
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_are_there() {
        let json = json();
        assert!(
            json.contains("{\"name\":\"router\",\"about\":\"a router of the Shapeoko class\"}")
        );
        assert!(json.contains("{\"code\":142,\"text\":\"Feedrate not specified\","));
        assert_eq!(quoted("a\"b\\\n"), "\"a\\\"b\\\\\\n\"");
    }
}
