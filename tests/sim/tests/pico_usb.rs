//! USB of the emulated RP2040: the port, back-pressure, a program that does not listen, both ports at once. The tests
//! run like those of `pico.rs`.

use kerf::boards::PICO;
use kerf_sim::emulated::{Emulated, Talks};
use kerf_sim::{AUX, Host, USB};

use crate::common::image;

/// A board that has just been powered up.
fn board() -> Emulated {
    Emulated::load(&image(&PICO), &PICO).unwrap()
}

/// A board that has greeted, and speaks TinyG's dialect on both ports.
fn booted() -> Emulated {
    let mut board = board();
    Host::new(1).boot(&mut board, 1_000).unwrap();
    let answer = ask(&mut board, AUX, "{fv:n}\n", 100);
    assert!(answer.contains("\"fv\":0.97"), "{answer}");
    board
}

/// Sends a text on a port, and returns what is heard there within `ms` milliseconds.
fn ask(board: &mut Emulated, port: usize, text: &str, ms: u64) -> String {
    board.send_to(port, text.as_bytes());
    board.run_for_ms(ms).unwrap();
    String::from_utf8(board.receive_from(port)).unwrap()
}

/// The greeting of grbl's dialect, which comes last while no dialect is settled.
const GRBL: &str = "]}\n\r\nGrbl 1.1h ['$' for help]\r\n";

const DEAF: Talks = Talks { open: true, reads: false };
const CLOSED: Talks = Talks { open: false, reads: true };
const LISTENS: Talks = Talks { open: true, reads: true };

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn the_first_program_that_opens_the_port_is_greeted() {
    let mut board = board();
    board.session(CLOSED);
    board.run_for_ms(300).unwrap();
    assert!(board.receive_from(USB).is_empty());
    board.session(LISTENS);
    board.run_for_ms(20).unwrap();
    let heard = String::from_utf8(board.receive_from(USB)).unwrap();
    assert!(heard.contains("SYSTEM READY") && heard.ends_with('\n'), "{heard}");
}

/// Closes the port and opens it as another program. Returns what that program hears.
fn reopen(board: &mut Emulated) -> String {
    board.session(CLOSED);
    board.run_for_ms(20).unwrap();
    board.receive_from(USB);
    board.session(LISTENS);
    ask(board, USB, "", 20)
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn whoever_opens_the_port_is_greeted_unless_something_runs() {
    let mut board = booted();
    for _ in 0..2 {
        let heard = reopen(&mut board);
        assert!(heard.starts_with("{\"r\":{\"fv\":") && heard.ends_with(GRBL), "{heard}");
        assert_eq!(heard.matches("SYSTEM READY").count(), 1, "{heard}");
        let answer = ask(&mut board, USB, "{xvm:n}\n", 20);
        assert!(answer.starts_with("{\"r\":{\"xvm\":"), "{answer}");
    }
    // The first bytes that the new program sends settle the dialect.
    reopen(&mut board);
    assert!(ask(&mut board, USB, "?", 20).starts_with("<Idle|"));
    assert_eq!(ask(&mut board, USB, "g1x5f600\n", 20), "ok\r\n");
    assert_eq!(reopen(&mut board), "", "a job goes on");
    assert!(ask(&mut board, USB, "?", 20).starts_with("<Run|"));
    board.run_for_ms(1_000).unwrap();
    assert_eq!(Emulated::steps(&board)[0], 6_400);
    assert!(reopen(&mut board).contains("SYSTEM READY"));
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn half_a_line_is_forgotten_with_the_program_that_sent_it() {
    let mut board = booted();
    ask(&mut board, USB, "g1x1", 20);
    assert!(reopen(&mut board).contains("SYSTEM READY"));
    let answer = ask(&mut board, USB, "{xvm:n}\n", 20);
    assert!(answer.starts_with("{\"r\":{\"xvm\":"), "{answer}");
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn nothing_is_lost_though_nobody_waits_for_answers() {
    let mut board = booted();
    // More lines than blocks, pool and ring have room for.
    let lines = 1_400;
    let x = |n: usize| if n.is_multiple_of(2) { "0" } else { ".1" };
    let text: String = (1..=lines).map(|n| format!("n{n} g1 f600 x{}\n", x(n))).collect();
    let heard = ask(&mut board, USB, &text, 1_000);
    assert!(heard.matches("\"r\":").count() < lines && board.waiting() > 0, "held back");
    let mut heard = heard;
    // Waits until X has been at rest for a while.
    let (mut seconds, mut rests) = (0, 0);
    while rests < 3 && seconds < 200 {
        let before = Emulated::steps(&board)[0];
        heard += &ask(&mut board, USB, "", 1_000);
        rests = if Emulated::steps(&board)[0] == before { rests + 1 } else { 0 };
        seconds += 1;
    }
    let answers: Vec<_> = heard.lines().filter(|line| line.contains("\"r\":")).collect();
    assert_eq!(answers.len(), lines);
    assert!(answers.iter().all(|line| line.contains("\"f\":[1,0,")), "{answers:?}");
    assert_eq!(Emulated::steps(&board)[0], 0);
}

/// The moves fill blocks, pool and ring. The stop comes behind them, in a packet of its own or in their last packet.
/// If there are more moves, the computer is held back, and the stop with it.
#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_stop_acts_at_once_however_much_waits_before_it() {
    for (moves, behind) in [(4, "!"), (80, "!"), (95, "!"), (94, ""), (97, ""), (99, "")] {
        let mut board = booted();
        let mut text: String = (1..=moves).map(|n| format!("g1f400x{}\n", 10 * (n % 2))).collect();
        if behind.is_empty() {
            text.push('!');
        }
        ask(&mut board, USB, &text, 500);
        ask(&mut board, USB, behind, 5);
        let takes = board.waiting() == 0;
        board.run_for_ms(300).unwrap();
        let held = Emulated::steps(&board);
        board.run_for_ms(200).unwrap();
        println!("{moves} moves: {held:?}, {takes}");
        assert!(takes && Emulated::steps(&board) == held, "{moves} moves");
    }
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_program_that_does_not_listen_keeps_nobody_else_waiting() {
    for talks in [DEAF, CLOSED] {
        let mut board = booted();
        board.session(talks);
        board.send_to(USB, "{xvm:n}\n{yvm:n}\n{zvm:n}\n{avm:n}\n{sys:n}\n".as_bytes());
        board.run_for_ms(100).unwrap();
        let answer = ask(&mut board, AUX, "{xvm:n}\n", 100);
        assert!(answer.contains("xvm"), "{talks:?}: {answer}");
    }
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn both_ports_are_answered_while_a_job_runs() {
    let mut board = booted();
    let mut answers = [0, 0];
    for n in 0..100 {
        board.send_to(USB, format!("g1 f1000 x{}\n", n % 5).as_bytes());
        board.send_to(AUX, b"{posx:n}\n");
        board.run_for_ms(20).unwrap();
        for port in [USB, AUX] {
            let heard = String::from_utf8(board.receive_from(port)).unwrap();
            answers[port] += heard.matches("\"r\":").count();
        }
    }
    println!("{answers:?}");
    assert!(answers[AUX] >= 98 && answers[USB] >= 60, "{answers:?}");
    let refused = ask(&mut board, AUX, "g1 x1\n", 100);
    assert!(refused.contains("\"f\":[1,117,"), "{refused}");
}
