//! A program opens the first port of a chip that notices it, after another program has had the port open.

use std::thread;

use kerf::hal::imp::{Machine, eeprom};

const GRBL: &str = "\r\nGrbl 1.1h ['$' for help]\r\n";
const READY: &str = "\"msg\":\"SYSTEM READY\"},\"f\":[1,0,0]}\n";

/// Whether a program has been greeted in both dialects, in that of TinyG first.
fn is_greeting(heard: &str) -> bool {
    heard.starts_with("{\"r\":{\"fv\":") && heard.ends_with(&format!("{READY}{GRBL}"))
}

/// A machine that has greeted.
fn booted() -> Machine {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    machine.run_ms(200);
    machine.received();
    machine
}

/// Sends a line, and returns what is heard within 50 ms.
fn say(machine: &Machine, line: &str) -> String {
    machine.send(line.as_bytes());
    machine.run_ms(50);
    String::from_utf8(machine.received()).unwrap()
}

/// Opens the port as a program does, and returns what the program hears.
fn open(machine: &Machine) -> String {
    machine.open_usb();
    say(machine, "")
}

#[test]
fn it_is_greeted_as_at_the_start() {
    let machine = booted();
    for _ in 0..2 {
        let heard = open(&machine);
        assert!(is_greeting(&heard), "{heard}");
        assert_eq!(heard.matches("SYSTEM READY").count(), 1, "{heard}");
        assert_eq!(say(&machine, "{xvm:n}\n"), "{\"r\":{\"xvm\":800},\"f\":[1,0,7]}\n");
    }
}

#[test]
fn what_it_says_first_decides_anew() {
    let machine = booted();
    let state = say(&machine, "?");
    assert!(state.starts_with("<Idle|"), "{state}");
    assert!(is_greeting(&open(&machine)));
    assert_eq!(say(&machine, "{xvm:n}\n"), "{\"r\":{\"xvm\":800},\"f\":[1,0,7]}\n");
    open(&machine);
    assert!(say(&machine, "?").starts_with("<Idle|"));
    assert_eq!(say(&machine, "g1x1f500\n"), "ok\r\n");
}

#[test]
fn half_a_line_is_forgotten_with_the_program_that_sent_it() {
    let machine = booted();
    assert_eq!(say(&machine, "{xvm:n}\ng1x1"), "{\"r\":{\"xvm\":800},\"f\":[1,0,7]}\n");
    machine.close_usb();
    machine.run_ms(20);
    open(&machine);
    assert_eq!(say(&machine, "{xvm:n}\n"), "{\"r\":{\"xvm\":800},\"f\":[1,0,7]}\n");
}

#[test]
fn a_whole_line_of_a_program_that_has_gone_is_carried_out() {
    let machine = booted();
    machine.send(b"{xvm:700}\n");
    machine.run_ms(2);
    machine.close_usb();
    machine.run_ms(50);
    open(&machine);
    assert_eq!(say(&machine, "{xvm:n}\n"), "{\"r\":{\"xvm\":700},\"f\":[1,0,7]}\n");
}

#[test]
fn a_dialect_that_is_set_stays() {
    let set = || {
        say(&booted(), "{dia:3}\n");
        eeprom::contents()
    };
    eeprom::put(&thread::spawn(set).join().unwrap());
    let machine = booted();
    assert_eq!(open(&machine), GRBL);
    assert_eq!(say(&machine, "g21\n"), "ok\r\n");
}

/// Returns what a program hears that opens the port while a line of another program, in grbl's dialect, is being
/// executed.
fn open_during(line: &str) {
    let machine = booted();
    say(&machine, "?");
    say(&machine, line);
    assert_eq!(open(&machine), "", "{line}");
    assert!(say(&machine, "?").starts_with('<'), "it speaks as before");
}

#[test]
fn nothing_is_said_in_a_move() {
    open_during("g1 x20 f600\n");
}

#[test]
fn nothing_is_said_in_a_dwell() {
    open_during("g4 p1\n");
}

#[test]
fn nothing_is_said_in_a_hold() {
    open_during("g1 x20 f600\n!");
}

#[test]
fn a_stop_of_the_program_goes_on() {
    let machine = booted();
    say(&machine, "{sv:0}\n");
    say(&machine, "m0\n");
    assert_eq!(open(&machine), "");
    say(&machine, "~");
    assert!(is_greeting(&open(&machine)), "the stop has ended");
}

#[test]
fn lines_of_the_start_are_not_carried_out() {
    let machine = booted();
    say(&machine, "?");
    assert_eq!(say(&machine, "$N0=g91\n"), "ok\r\n");
    say(&machine, "g90\n");
    open(&machine);
    say(&machine, "?");
    assert!(say(&machine, "$G\n").contains("G90"), "nothing has been reset");
}

#[test]
fn a_line_that_is_being_answered_is_answered() {
    let machine = booted();
    machine.send(b"{xvm:n}\n");
    for _ in 0..30 {
        machine.open_usb();
        machine.run_ms(1);
    }
    let heard = say(&machine, "");
    assert_eq!(heard.matches("{\"xvm\":800}").count(), 1, "{heard}");
}

#[test]
fn a_grbl_sender_hears_of_an_alarm() {
    let machine = booted();
    say(&machine, "?");
    // The probing move finds no contact.
    say(&machine, "g38.2 z-1 f500\n");
    machine.run_ms(2_000);
    machine.received();
    let heard = open(&machine);
    let greeting = format!("{READY}{GRBL}[MSG:'$H'|'$X' to unlock]\r\n");
    assert!(heard.ends_with(&greeting), "{heard}");
}
