//! G-code behind a jog of grbl's senders: the G-code does not keep the jog from being ended, and is not dropped with
//! it.

use kerf::hal::imp::Machine;

use crate::apart::apart;

fn say(machine: &Machine, text: &str, ms: u64) -> String {
    machine.send(text.as_bytes());
    machine.run_ms(ms);
    String::from_utf8_lossy(&machine.received()).into_owned()
}

/// A machine that speaks grbl's dialect.
fn boot() -> Machine {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    machine.run_ms(100);
    say(&machine, "$I\n", 50);
    say(&machine, "g90 g21 f600\n", 50);
    machine
}

/// Returns how far X has come when a jog to 20 mm is ended after a line was sent behind it.
fn ended_behind(line: &str) -> i64 {
    let machine = boot();
    assert_eq!(say(&machine, "$J=G91 X20 F600\n", 100), "ok\r\n");
    // The line waits.
    assert_eq!(say(&machine, line, 100), "");
    machine.send(&[0x85]);
    machine.run_ms(5_000);
    // The line came before the end of the jog, and is refused.
    let heard = String::from_utf8_lossy(&machine.received()).into_owned();
    assert!(heard.starts_with("error:9\r\n"), "{line:?}: {heard:?}");
    assert!(say(&machine, "?", 20).starts_with("<Idle"));
    let at = machine.emitted().position[0];
    assert_eq!(say(&machine, "$J=G91 X1 F600\n", 1_000), "ok\r\n");
    assert_eq!(machine.emitted().position[0], at + 1_280);
    at
}

#[test]
fn a_jog_ends_whatever_waits_behind_it() {
    for line in
        ["m8\n", "g54\n", "t1\n", "g4 p0.1\n", "g1 x0 f600\n", "g1 x0 f600 (c)\n", "g92 x1\n"]
    {
        let at = apart(|| ended_behind(line));
        assert!((1_000..5_000).contains(&at), "{line:?}: {at}");
    }
}

/// Returns where X ends when moves come behind a jog, and then the byte that would end a jog.
fn ends_behind(first: &str) -> i64 {
    let machine = boot();
    assert_eq!(say(&machine, "$J=G91 X2 F600\n", 50), "ok\r\n");
    assert_eq!(say(&machine, first, 500), "ok\r\n");
    assert!(say(&machine, "?", 20).starts_with("<Run"));
    assert_eq!(say(&machine, "g1 x12 f600\n", 20), "ok\r\n");
    assert_eq!(say(&machine, "$J=G91 X1 F600\n", 20), "error:8\r\n");
    machine.send(&[0x85]);
    machine.run_ms(5_000);
    machine.emitted().position[0]
}

#[test]
fn what_is_answered_behind_a_jog_is_no_jog() {
    for first in ["g1 x6 f600\n", "g1 x6 f600 (c)\n"] {
        assert_eq!(apart(|| ends_behind(first)), 12 * 1_280, "{first:?}");
    }
}

/// `{"jogx":..}` is a jog as well: its end is reported, whatever comes behind it.
#[test]
fn a_jog_of_tinyg_is_over_before_the_next_line_begins() {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    machine.run_ms(100);
    say(&machine, "{sv:0}\n", 50);
    say(&machine, "{jogx:5}\n", 50);
    say(&machine, "g1 y2 f600\n", 20);
    assert_eq!(machine.emitted().position[1], 0);
    machine.run_ms(5_000);
    assert_eq!(machine.emitted().position[..2], [5 * 1_280, 2 * 1_280]);
}
