//! Ports whose dialect is undecided, and lines that end a decision.

use std::thread;

use kerf::hal::imp::{Machine, eeprom};

const GRBL: &str = "\r\nGrbl 1.1h ['$' for help]\r\n";
const READY: &str = "\"msg\":\"SYSTEM READY\"},\"f\":[1,0,0]}\n";
/// The answer to `{xvm:n}`.
const JSON: &str = "{\"r\":{\"xvm\":800},\"f\":[1,0,7]}\n";

/// A machine that has greeted.
fn booted() -> Machine {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    machine.run_ms(200);
    machine.received();
    machine
}

/// Sends a text, and returns what is heard within 100 ms, without reports of TinyG's dialect.
fn say(machine: &Machine, text: &str) -> String {
    machine.send(text.as_bytes());
    machine.run_ms(100);
    let heard = String::from_utf8(machine.received()).expect("UTF-8");
    heard.split_inclusive('\n').filter(|line| !line.starts_with("{\"sr\"")).collect()
}

/// Does something in a thread of its own, because each thread has one machine.
fn alone<T: Send + 'static>(run: impl FnOnce() -> T + Send + 'static) -> T {
    thread::spawn(run).join().expect("no panic")
}

#[test]
fn what_decides_nothing_is_answered_in_grbls_way() {
    let machine = booted();
    for line in ["\n", "g21\n", "(a comment)\n", "g91 g1 x1 f3000\n", "$X\n"] {
        assert_eq!(say(&machine, line), "ok\r\n", "{line}");
    }
    assert_eq!(say(&machine, "[xvm:n]\n"), "error:1\r\n");
    machine.run_ms(500);
    assert_eq!(machine.emitted().position[0], 1_280);
    assert_eq!(say(&machine, "{xvm:n}\n"), JSON);
    assert_eq!(say(&machine, "\n"), "");
}

#[test]
fn braces_select_tinygs_dialect_at_rest_whatever_was_said_first() {
    for first in ["?", "$I\n", "M115\n", "N1 M110*34\n"] {
        alone(move || {
            let machine = booted();
            say(&machine, first);
            assert_eq!(say(&machine, "{xvm:n}\n"), JSON, "{first}");
            // From now on a question is one of TinyG's, and nothing leads back.
            let heard = say(&machine, "$xvm\n");
            assert!(heard.ends_with("tinyg [mm] ok> \n"), "{first}: {heard:?}");
            let heard = say(&machine, "$I\n{xvm:n}\n");
            assert!(heard.ends_with(JSON) && !heard.contains("[VER:"), "{first}: {heard:?}");
        });
    }
}

#[test]
fn braces_select_nothing_while_the_machine_is_busy() {
    for (first, move_) in [("?", "g1 x5 f600\n"), ("M115\n", "G1 X5 F600\n")] {
        alone(move || {
            let machine = booted();
            say(&machine, first);
            say(&machine, move_);
            let heard = say(&machine, "{xvm:n}\n");
            assert!(!heard.contains("{\"r\""), "{first}: {heard}");
            machine.run_ms(2_000);
            machine.received();
            assert_eq!(say(&machine, "{xvm:n}\n"), JSON, "{first}");
        });
    }
}

#[test]
fn braces_select_nothing_where_a_dialect_is_set() {
    let left = alone(|| {
        say(&booted(), "{dia:3}\n");
        eeprom::contents()
    });
    eeprom::put(&left);
    let machine = booted();
    assert!(say(&machine, "{xvm:n}\n").starts_with("error:"));
    assert_eq!(say(&machine, "g21\n"), "ok\r\n");
}

/// An alarm is no work: a sender of TinyG's dialect that has followed another one can end it.
#[test]
fn braces_select_tinygs_dialect_in_an_alarm() {
    let machine = booted();
    say(&machine, "?");
    say(&machine, "g1 x5 f600\n");
    machine.send(b"\x18");
    machine.run_ms(500);
    assert!(say(&machine, "").contains("ALARM:3"));
    assert_eq!(say(&machine, "g0 x0\n"), "error:9\r\n");
    let heard = say(&machine, "{clear:n}\n");
    assert!(heard.contains("{\"r\":{\"clear\":null},\"f\":[1,0,7]}"), "{heard}");
    assert!(say(&machine, "g21\n").contains("{\"r\":{},\"f\":[1,0,7]}"));
}

#[test]
fn a_reset_keeps_the_position_and_is_an_alarm_in_motion() {
    let machine = booted();
    assert_eq!(say(&machine, "g91 g1 x1 f3000\n"), "ok\r\n");
    machine.run_ms(500);
    let heard = say(&machine, "\x18");
    assert!(
        heard.starts_with("{\"r\":{\"fv\":") && heard.ends_with(&format!("{READY}{GRBL}")),
        "{heard}"
    );
    assert!(say(&machine, "?").starts_with("<Idle|MPos:1.000,"));
    alone(|| {
        let machine = booted();
        assert_eq!(say(&machine, "g1 x5 f600\n"), "ok\r\n");
        machine.send(b"\x18");
        machine.run_ms(500);
        let heard = say(&machine, "");
        assert!(!kerf::hal::imp::was_reset() && heard.contains("ALARM:3\r\n"), "{heard}");
        assert!(say(&machine, "?").starts_with("<Alarm|MPos:"));
    });
}

/// A sender that speaks as soon as it has heard its greeting is not greeted twice, or it would take the second greeting
/// for a restart.
#[test]
fn a_line_right_behind_its_greeting_is_no_cause_of_another() {
    let mut wrong = Vec::new();
    for (delay, opens) in (0..40).flat_map(|delay| [(delay, false), (delay, true)]) {
        let heard = alone(move || {
            let machine = Machine::boot(115_200).expect("one machine for each thread");
            if opens {
                machine.run_ms(200);
                machine.received();
                machine.open_usb();
            }
            machine.run_ms(delay);
            machine.send(b"{xvm:n}\n");
            machine.send_aux(b"{xvm:n}\n");
            machine.run_ms(300);
            [machine.received(), machine.received_aux()]
        });
        for (port, heard) in heard.into_iter().enumerate() {
            let heard = String::from_utf8(heard).expect("UTF-8");
            if heard.matches("SYSTEM READY").count() > 1 {
                wrong.push((delay, opens, port));
            }
        }
    }
    assert!(wrong.is_empty(), "delay in ms, whether a program opens the port, port: {wrong:?}");
}

/// Where a line begins with a brace, nothing in it is grbl's.
#[test]
fn a_question_mark_in_the_first_line_of_json_is_text() {
    let machine = booted();
    let heard = say(&machine, "{\"uda0\":\"?\",xvm:n}\n");
    assert!(!heard.contains('<'), "{heard}");
    alone(|| {
        let machine = booted();
        let heard = say(&machine, "{txt:\"?\"}\n");
        assert!(heard.starts_with("{\"r\":{\"txt\":\"X position:"), "{heard}");
    });
}

/// Fills the queue of a machine, so that the line that is read waits for room. Its second port has sent `first`.
fn crowded(first: &str) -> Machine {
    let machine = booted();
    say(&machine, "{sv:0}\n");
    machine.send_aux(first.as_bytes());
    machine.run_ms(100);
    for n in 0..85 {
        machine.send(format!("g1 f300 x{}\n", n + 1).as_bytes());
        machine.run_ms(20);
    }
    machine.received_aux();
    machine
}

/// The first line in TinyG's dialect is a control line as any other: it does not wait for what is in work.
#[test]
fn the_first_request_overtakes_and_its_alarm_acts_at_once() {
    for first in ["", "\n", "(a comment)\n"] {
        alone(move || {
            let machine = crowded(first);
            machine.send_aux(b"{stat:n}\n");
            machine.run_ms(50);
            let heard = String::from_utf8(machine.received_aux()).expect("UTF-8");
            assert_eq!(heard, "{\"r\":{\"stat\":5},\"f\":[1,0,7]}\n", "{first:?}");
        });
        alone(move || {
            let machine = crowded(first);
            let before = machine.emitted().position[0];
            machine.send_aux(b"{shutd:1}\n");
            machine.run_ms(1_000);
            let went = machine.emitted().position[0] - before;
            // 5 mm a second.
            assert!(went < 1_280, "{first:?}: {went}");
        });
    }
}

/// What needs a machine at rest is done by the first line, too.
#[test]
fn the_first_request_finds_the_machine_at_rest() {
    let lines = ["{chk:1}", "{defa:1}", "{mch:1}", "{jogx:1}", "{test:1}", "$chk=1", "$defa=1"];
    let mut wrong = Vec::new();
    for line in lines {
        let [first, second] = ["", "{}\n"].map(|before| {
            alone(move || {
                let machine = booted();
                say(&machine, before);
                say(&machine, &format!("{line}\n"))
            })
        });
        if first != second {
            wrong.push([line.to_string(), first, second]);
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
