//! Files as CAM programs write them, sent to the whole firmware on the host: what is around the moves changes no step.

use std::thread;

use kerf::hal::imp::Machine;
use proptest::prelude::*;

use crate::gcode_props::{dressed_move, idle_line};

/// A line, and where it is cut for a pause: a byte may come late.
type Sent = (Vec<u8>, usize);

/// Sends lines to a machine. Returns the position of its motors at the end, and all that it has sent.
fn play(first: &'static str, lines: Vec<Sent>) -> (Vec<i64>, String) {
    let played = thread::spawn(move || {
        let machine = Machine::boot(115_200).expect("one machine for each thread");
        machine.run_ms(200);
        machine.send(first.as_bytes());
        machine.run_ms(100);
        machine.received();
        for (line, at) in lines {
            let (front, back) = line.split_at(at % (line.len() + 1));
            for part in [front, back] {
                machine.send(part);
                machine.run_ms(20);
            }
        }
        machine.run_ms(20_000);
        let position = machine.emitted().position.to_vec();
        (position, String::from_utf8_lossy(&machine.received()).into_owned())
    });
    played.join().expect("no panic")
}

/// Returns the answers that refuse a line.
fn refusals(heard: &str) -> Vec<&str> {
    let is_good = |line: &&str| match line.split_once("\"f\":[1,") {
        // A deleted line is answered by 3.
        Some((_, rest)) => rest.starts_with("0,") || rest.starts_with("3,"),
        None => !line.starts_with("error:"),
    };
    heard.lines().filter(|line| !is_good(line)).collect()
}

proptest! {
    #![proptest_config(crate::cases::cases(48))]
    #[test]
    fn harmless_text_changes_no_step(
        moves in prop::collection::vec((idle_line(), dressed_move(), any::<[usize; 2]>()), 1..8),
        end in prop_oneof![Just("\n"), Just("\r\n"), Just("\r")],
        first in prop_oneof![Just("{ej:1}\n"), Just("$I\n"), Just("{dia:1}\n")],
    ) {
        // The exclamation mark stops, and a question mark asks, also in a comment.
        let text = |text: &str| format!("{}{end}", text.replace(['!', '?', '~'], "-")).into_bytes();
        let mut full: Vec<Sent> = Vec::new();
        let mut plain: Vec<Sent> = Vec::new();
        for (idle, (line, dressed), at) in &moves {
            full.extend([(text(idle), at[0]), (text(dressed), at[1])]);
            plain.push((text(line), 0));
        }
        let (expected, heard) = play(first, plain);
        prop_assert_eq!(refusals(&heard), Vec::<&str>::new());
        let (position, heard) = play(first, full);
        prop_assert_eq!(refusals(&heard), Vec::<&str>::new(), "{}", heard);
        prop_assert_eq!(position, expected, "{}", heard);
    }
}
