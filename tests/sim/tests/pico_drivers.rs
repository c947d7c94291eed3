//! The drivers of the SKR Pico, which are emulated with their motors and with a hard stop that blocks the motors:
//! what drivers are sent, and homing by a stall. The tests run like those of `pico.rs`.

use kerf::boards::{SKR_PICO, gp};
use kerf_sim::emulated::{Ails, DRIVERS, Driver, Emulated};
use kerf_sim::{Host, LINES_IN_FLIGHT, Runs};

use crate::common::image;

/// Full steps in a millimetre of X and Y: 200 in a turn of 1.25 mm.
const FULL_STEPS: f64 = 160.0;
/// Most distance from the stop of a motor that has slipped there, full steps.
const SLIPS: f64 = 2.0;
/// Position of the stop of X, full steps; X homes downwards.
const STOP: i64 = -6 * FULL_STEPS as i64;

/// A board that has been powered up, and a sender. X and Y have a driver each, whose DIAG is at the input of the
/// axis's limit switch.
fn booted(x: Driver) -> (Emulated, Host) {
    let mut board = Emulated::load(&image(&SKR_PICO), &SKR_PICO).unwrap();
    let y = Driver { address: 2, motor: 1, gpio: 3, ..x };
    board.drivers(&[x, y]);
    let mut host = Host::new(LINES_IN_FLIGHT);
    host.boot(&mut board, 1_000).unwrap();
    (board, host)
}

fn driver() -> Driver {
    Driver { address: 0, motor: 0, gpio: 4, stop: STOP, above: false, powered: true }
}

/// Returns the status of a line.
fn status(board: &mut Emulated, host: &mut Host, line: &str) -> i64 {
    host.ask(board, line, 5_000).unwrap().status
}

/// Sends a line that must be accepted.
fn set(board: &mut Emulated, host: &mut Host, line: &str) {
    assert_eq!(status(board, host, line), 0, "{line}");
}

/// The value of a token.
fn value(board: &mut Emulated, host: &mut Host, token: &str) -> f64 {
    let response = host.ask(board, &format!("{{{token}:n}}"), 5_000).unwrap();
    response.body[token].as_f64().unwrap_or_else(|| panic!("{}", response.raw))
}

/// Homes axes, and waits for the end. Returns the exceptions that were reported.
fn home(board: &mut Emulated, host: &mut Host, line: &str) -> String {
    let answer = host.ask(board, line, 5_000).unwrap();
    wait(board, host);
    format!("{}{}", answer.raw, exceptions(host))
}

/// Waits until nothing moves.
fn wait(board: &mut Emulated, host: &mut Host) {
    for _ in 0..100 {
        host.run_for_ms(board, 100).unwrap();
        // Ready, at the end of a program or of motion, or in an alarm.
        if [1.0, 2.0, 3.0, 4.0].contains(&value(board, host, "stat")) {
            return;
        }
    }
    panic!("homing does not end");
}

/// Returns all reports and unexpected lines.
fn exceptions(host: &mut Host) -> String {
    format!("{:?}{:?}", host.take_reports(), host.strays())
}

/// Returns the distance of X from its stop, mm.
fn from_stop(board: &mut Emulated) -> f64 {
    (board.rotors()[0] - STOP as f64) / FULL_STEPS
}

/// Returns the length of the datagram that begins here: one that writes, or a request to read.
fn length(datagram: &[u8]) -> usize {
    if datagram.get(2).is_some_and(|register| register & 0x80 == 0) { 4 } else { 8 }
}

/// Takes the whole datagrams from what drivers were sent: address, register, value of those that write. Checks the
/// checksum of each.
fn told(rest: &mut Vec<u8>) -> Vec<(u8, u8, u32)> {
    let crc = |bytes: &[u8]| {
        let bits = bytes.iter().flat_map(|byte| (0..8).map(move |bit| byte >> bit & 1));
        bits.fold(0u8, |crc, bit| crc << 1 ^ if crc >> 7 != bit { 7 } else { 0 })
    };
    let mut told = Vec::new();
    while rest.len() >= length(rest) {
        let length = length(rest);
        let datagram: Vec<_> = rest.drain(..length).collect();
        let (sum, words) = datagram.split_last().unwrap();
        assert_eq!((words[0], *sum), (5, crc(words)), "{datagram:x?}");
        if length == 8 {
            let value = u32::from_be_bytes(datagram[3..7].try_into().unwrap());
            told.push((datagram[1], datagram[2], value));
        }
    }
    told
}

/// Returns what drivers were sent since the last call; `rest` is the datagram that has begun.
fn take_told(board: &mut Emulated, rest: &mut Vec<u8>) -> Vec<(u8, u8, u32)> {
    rest.extend(board.receive_line(DRIVERS));
    told(rest)
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn drivers_are_told_their_settings() {
    let (mut board, mut host) = booted(driver());
    let mut rest = Vec::new();
    host.run_for_ms(&mut board, 100).unwrap();
    let told = take_told(&mut board, &mut rest);
    for address in 0..4 {
        for wanted in
            [(0x80, 0x1C0), (0xEC, 0x1503_0053), (0x90, 0x0008_1209), (0xC0, 0), (0x83, 0x200)]
        {
            assert!(told.contains(&(address, wanted.0, wanted.1)), "{address}: {told:x?}");
        }
    }
    for line in ["{drr2:1.4,drh2:0.05}", "{drc4:0}", "{3mi:64}", "{drs1:255}"] {
        set(&mut board, &mut host, line);
    }
    // Address 2 belongs to motor 2, address 1 to motor 3. Changed values do not wait for their turn: two datagrams of a
    // millisecond each follow the last answer. Before them the flash is written, in pieces of a part of a millisecond.
    host.run_for_ms(&mut board, 5).unwrap();
    let told = take_told(&mut board, &mut rest);
    for wanted in [
        (2, 0x90, 0x0008_1800),
        (2, 0xEC, 0x1501_0053),
        (3, 0x80, 0x1C4),
        (1, 0xEC, 0x1203_0053),
        (0, 0xC0, 255),
    ] {
        assert!(told.contains(&wanted), "{wanted:x?} in {told:x?}");
    }
    for line in ["{drr1:1.401}", "{drh1:0.04}", "{drs1:256}", "{drs1:-1}", "{1mi:3}", "{1mi:255}"] {
        assert_ne!(status(&mut board, &mut host, line), 0, "{line}");
    }
    host.run_for_ms(&mut board, 500).unwrap();
    board.cut_power();
    // The cut breaks a datagram off.
    rest.clear();
    board.receive_line(DRIVERS);
    host.boot(&mut board, 2_000).unwrap();
    assert_eq!(value(&mut board, &mut host, "drr2"), 1.4);
    host.run_for_ms(&mut board, 100).unwrap();
    let told = take_told(&mut board, &mut rest);
    assert!(told.contains(&(2, 0x90, 0x0008_1800)) && told.contains(&(0, 0xC0, 255)), "{told:x?}");
    assert_eq!(status(&mut board, &mut host, "{defa:1}"), 15);
    host.run_for_ms(&mut board, 50).unwrap();
    let told = take_told(&mut board, &mut rest);
    assert!(told.contains(&(2, 0x90, 0x0008_1209)) && told.contains(&(0, 0xC0, 0)), "{told:x?}");
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn motors_turn_as_far_as_steps_say_with_any_microsteps() {
    let (mut board, mut host) = booted(Driver { stop: -1_000_000, ..driver() });
    for (microsteps, x, y) in [(8, 1.0, -0.5), (1, 2.0, 0.5), (128, 2.5, 1.0)] {
        set(&mut board, &mut host, &format!("{{1mi:{microsteps},2mi:{microsteps}}}"));
        set(&mut board, &mut host, &format!("g1 x{x} y{y} f600"));
        host.run_for_ms(&mut board, 800).unwrap();
        assert_eq!(board.rotors(), [x * FULL_STEPS, y * FULL_STEPS], "{microsteps}");
    }
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn an_axis_homes_by_a_stall() {
    for (settings, zero) in [
        ("{xsv:500}", 1.0),
        ("{xsv:600,xjh:1000}", 0.5),
        ("{xsv:300,xjh:20,1mi:32}", 2.0),
        ("{xsv:800,xlb:0,st:1}", 1.0),
    ] {
        let (mut board, mut host) = booted(driver());
        for line in ["{drs1:60}", "{xsn:1,xtm:20}", settings, &format!("{{xzb:{zero}}}")] {
            set(&mut board, &mut host, line);
        }
        for start in [0.0, 3.0] {
            home(&mut board, &mut host, "g28.2 x0");
            assert_eq!(value(&mut board, &mut host, "homx"), 1.0, "{settings}");
            assert_eq!(value(&mut board, &mut host, "mpox"), 0.0, "{settings}");
            let off = (from_stop(&mut board) - zero) * FULL_STEPS;
            println!("{settings} from {start}: {off} full steps off");
            assert!(off.abs() <= SLIPS, "{settings}: {off} full steps off");
            // In a job no step is lost on the way, and a stall ends no move. Fast moves have a stall at each full
            // step of a motor that is blocked.
            let before = board.rotors()[0];
            set(&mut board, &mut host, "g0 x3");
            host.run_for_ms(&mut board, 1_000).unwrap();
            assert_eq!(board.rotors()[0], before + 3.0 * FULL_STEPS);
        }
    }
}

/// Settings with which X and Y home by a stall, downwards.
const HOMES: [&str; 2] = ["{drs1:60,drs2:60}", "{x:{sn:1,tm:9,zb:1},y:{sn:1,tm:9,zb:1}}"];

/// A board with these settings.
fn homes(x: Driver) -> (Emulated, Host) {
    let (mut board, mut host) = booted(x);
    for line in HOMES {
        set(&mut board, &mut host, line);
    }
    (board, host)
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn an_axis_that_is_at_its_stop_homes() {
    let (mut board, mut host) = homes(Driver { stop: 0, ..driver() });
    home(&mut board, &mut host, "g28.2 x0 y0");
    for rotor in board.rotors() {
        assert!((rotor - FULL_STEPS).abs() <= SLIPS, "{:?}", board.rotors());
    }
    // A second homing, from the stop, at an upper end.
    let (mut board, mut host) = homes(Driver { stop: 0, above: true, ..driver() });
    set(&mut board, &mut host, "{x:{sn:0,sx:1}}");
    home(&mut board, &mut host, "g28.2 x0");
    assert!((board.rotors()[0] + FULL_STEPS).abs() <= SLIPS, "{:?}", board.rotors());
    assert_eq!(value(&mut board, &mut host, "mpox"), 9.0);
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_feed_override_slows_no_search_for_a_stall() {
    for feed in ["{mfo:0.3}", "{mfo:1.8}"] {
        let (mut board, mut host) = homes(driver());
        set(&mut board, &mut host, feed);
        home(&mut board, &mut host, "g28.2 x0");
        assert_eq!(value(&mut board, &mut host, "homx"), 1.0, "{feed}");
        assert!((from_stop(&mut board) - 1.0).abs() * FULL_STEPS <= SLIPS, "{feed}");
    }
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn what_cannot_find_a_stall_says_so() {
    let far = Driver { stop: -1_000_000, ..driver() };
    for (x, lines, status, moves) in [
        // Without power nobody knows how far a step is.
        (Driver { powered: false, ..driver() }, vec![], 57, false),
        // With no sensitivity at all the axis searches over all of its travel.
        (driver(), vec!["{drs1:1}"], 240, true),
        // With sensitivity 0 there is no switch that is open at rest.
        (driver(), vec!["{drs1:0}"], 247, true),
        // Without stealthChop the driver measures no load.
        (driver(), vec!["{drc1:0}"], 246, false),
        (far, vec!["{1ma:0,2ma:0,sqsw:3}"], 246, false),
    ] {
        let (mut board, mut host) = homes(x);
        for line in &lines {
            set(&mut board, &mut host, line);
        }
        let said = home(&mut board, &mut host, "g28.2 x0");
        assert!(said.contains(&status.to_string()), "{lines:?}: {said}");
        assert_eq!(value(&mut board, &mut host, "homx"), 0.0, "{lines:?}");
        assert_eq!(board.positions()[0] != 0, moves, "{lines:?}");
    }
    // The jumper is missing, or the driver reports a fault: the pin is high at standstill.
    let (mut board, mut host) = homes(driver());
    board.drivers(&[]);
    board.drive(gp(4), true);
    assert!(home(&mut board, &mut host, "g28.2 x0").contains("247"));
    assert_eq!(board.positions()[0], 0);
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_stall_stops_a_job_only_if_it_is_a_limit() {
    for (mode, stopped) in [("{xsn:1}", false), ("{xsn:3}", true)] {
        let (mut board, mut host) = homes(driver());
        for line in ["{xvm:800,xsv:600}", mode, "g0 x-9"] {
            set(&mut board, &mut host, line);
        }
        host.run_for_ms(&mut board, 1_500).unwrap();
        let alarmed = value(&mut board, &mut host, "stat") == 2.0;
        assert_eq!(alarmed, stopped, "{mode}");
        assert_eq!(board.positions()[0] == -9 * 1_280, !stopped, "{mode}");
    }
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_search_for_a_stall_is_held_and_ended_as_others_are() {
    let (mut board, mut host) = homes(driver());
    set(&mut board, &mut host, "g28.2 x0");
    host.run_for_ms(&mut board, 300).unwrap();
    assert_ne!(status(&mut board, &mut host, "{drs1:70}"), 0, "not while it moves");
    board.send_now(b'!');
    host.run_for_ms(&mut board, 300).unwrap();
    let held = board.positions()[0];
    host.run_for_ms(&mut board, 300).unwrap();
    assert_eq!(board.positions()[0], held);
    board.send_now(b'~');
    wait(&mut board, &mut host);
    assert!((from_stop(&mut board) - 1.0).abs() * FULL_STEPS <= SLIPS);
    set(&mut board, &mut host, "g28.2 x0");
    host.run_for_ms(&mut board, 300).unwrap();
    for byte in *b"!%" {
        board.send_now(byte);
        host.run_for_ms(&mut board, 300).unwrap();
    }
    assert!(exceptions(&mut host).contains("240"));
    assert_eq!(value(&mut board, &mut host, "homx"), 0.0);
    // The feed override counts again.
    set(&mut board, &mut host, "{mfo:0.5}");
    let before = board.positions()[0];
    set(&mut board, &mut host, "g91 g1 x5 f600");
    host.run_for_ms(&mut board, 600).unwrap();
    let way = (board.positions()[0] - before) as f64 / 1_280.0;
    assert!((2.0..3.2).contains(&way), "{way} mm");
}

/// Bits of DRV_STATUS and GSTAT: TMC2209 data sheet, 5.5.3 and 5.1.
const HOT: u32 = 1;
const OVERHEATED: u32 = 1 << 1;
const SHORTED: u32 = 1 << 3;
const OPEN: u32 = 1 << 6;
const SWITCHED_OFF: u32 = 1 << 1;

/// A board with its own four drivers, and a sender.
fn with_drivers() -> (Emulated, Host) {
    let mut board = Emulated::load(&image(&SKR_PICO), &SKR_PICO).unwrap();
    let mut host = Host::new(LINES_IN_FLIGHT);
    host.boot(&mut board, 1_000).unwrap();
    (board, host)
}

fn states(board: &mut Emulated, host: &mut Host) -> [f64; 4] {
    ["drx1", "drx2", "drx3", "drx4"].map(|name| value(board, host, name))
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_move_waits_at_the_start_until_drivers_have_their_settings() {
    let (mut board, mut host) = with_drivers();
    set(&mut board, &mut host, "g1 x1 f600");
    let since = board.cycle() / board.cycles(1);
    assert_eq!(states(&mut board, &mut host), [0.0; 4], "after {since} ms");
    host.run_for_ms(&mut board, 600).unwrap();
    assert_eq!(board.positions()[0], 1_280);
    let group = host.ask(&mut board, "{dr:n}", 5_000).unwrap();
    assert_eq!(group.body["dr"]["x1"], 0, "{}", group.raw);
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn nothing_moves_while_a_driver_has_not_taken_its_settings() {
    for (ails, state, refused) in [
        // Without motor power all are silent; a dead UART is one of them.
        (Ails { powered: Some(false), ..Ails::default() }, [1.0; 4], 57),
        (Ails { address: Some(2), deaf: Some(true), ..Ails::default() }, [0.0, 1.0, 0.0, 0.0], 57),
        (
            Ails { address: Some(1), status: Some(OVERHEATED), ..Ails::default() },
            [0.0, 0.0, 3.0, 0.0],
            60,
        ),
        (
            Ails { address: Some(3), status: Some(SHORTED), ..Ails::default() },
            [0.0, 0.0, 0.0, 4.0],
            60,
        ),
    ] {
        let mut board = Emulated::load(&image(&SKR_PICO), &SKR_PICO).unwrap();
        board.ail(ails);
        let mut host = Host::new(LINES_IN_FLIGHT);
        host.boot(&mut board, 1_000).unwrap();
        host.run_for_ms(&mut board, 600).unwrap();
        assert_eq!(states(&mut board, &mut host), state, "{ails:?}");
        set(&mut board, &mut host, "{xsn:1,xtm:20}");
        for line in ["g1 x1 f600", "g0 y-1", "g2 x1 r2 f600", "g28.2 x0", "{jogx:5}"] {
            assert_eq!(status(&mut board, &mut host, line), refused, "{line} {ails:?}");
        }
        // Lines that move nothing run.
        for line in ["m3 s100", "g4 p0.1", "g92 x5", "m5"] {
            set(&mut board, &mut host, line);
        }
        assert_eq!(board.positions(), [0; 4]);
        // It is well again.
        let well = Ails { powered: Some(true), deaf: Some(false), status: Some(0), ..ails };
        board.ail(well);
        host.run_for_ms(&mut board, 600).unwrap();
        assert_eq!(states(&mut board, &mut host), [0.0; 4], "{ails:?}");
        set(&mut board, &mut host, "g1 x6 f600");
        host.run_for_ms(&mut board, 600).unwrap();
        assert_eq!(board.positions()[0], 1_280, "{ails:?}");
    }
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_driver_of_an_axis_out_of_use_may_be_silent() {
    let (mut board, mut host) = with_drivers();
    board.ail(Ails { address: Some(3), deaf: Some(true), ..Ails::default() });
    host.run_for_ms(&mut board, 600).unwrap();
    assert_eq!(status(&mut board, &mut host, "g0 x1"), 57);
    set(&mut board, &mut host, "{aam:0}");
    host.run_for_ms(&mut board, 50).unwrap();
    set(&mut board, &mut host, "g0 x1");
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_driver_that_resets_gets_its_settings_and_in_motion_it_is_an_alarm() {
    let reset = Ails { address: Some(0), reset: true, ..Ails::default() };
    let off = Ails { address: Some(0), global: Some(SWITCHED_OFF), ..Ails::default() };
    let dead = Ails { address: Some(0), powered: Some(false), ..Ails::default() };
    for (ails, status, moves) in
        [(reset, "59", true), (off, "60", true), (dead, "57", true), (reset, "59", false)]
    {
        let (mut board, mut host) = with_drivers();
        for line in ["{1mi:32}", "g28.3 x0 y0"] {
            set(&mut board, &mut host, line);
        }
        assert_eq!(value(&mut board, &mut host, "homx"), 1.0);
        host.run_for_ms(&mut board, 300).unwrap();
        if moves {
            set(&mut board, &mut host, "g1 x20 f600");
            host.run_for_ms(&mut board, 300).unwrap();
        }
        let mut rest = Vec::new();
        take_told(&mut board, &mut rest);
        board.ail(ails);
        host.run_for_ms(&mut board, 700).unwrap();
        let said = exceptions(&mut host);
        assert!(said.contains(status), "{ails:?}: {said}");
        assert_eq!(value(&mut board, &mut host, "homx"), 0.0, "{ails:?}");
        let alarmed = value(&mut board, &mut host, "stat") == 2.0;
        assert_eq!(alarmed, moves, "{ails:?}");
        let told = take_told(&mut board, &mut rest);
        assert!(told.contains(&(0, 0xEC, 0x1303_0053)), "32 microsteps: {told:x?}");
        if moves {
            // It has come to rest, before the end of its way.
            let at = board.positions()[0];
            assert!((1..20 * 5_120).contains(&at), "{at}");
            board.ail(Ails { powered: Some(true), ..dead });
            host.run_for_ms(&mut board, 600).unwrap();
            set(&mut board, &mut host, "{clear:n}");
        }
        set(&mut board, &mut host, "g91 g0 x1");
    }
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn a_hot_driver_and_an_open_wire_are_told_once() {
    let (mut board, mut host) = with_drivers();
    set(&mut board, &mut host, "{xvm:600,xfr:600,xtm:100}");
    for (status, name, state) in [(HOT, "61", 6.0), (OPEN, "62", 7.0)] {
        host.run_for_ms(&mut board, 300).unwrap();
        exceptions(&mut host);
        set(&mut board, &mut host, "g91 g1 x25 f600");
        board.ail(Ails { address: Some(0), status: Some(status), ..Ails::default() });
        host.run_for_ms(&mut board, 1_500).unwrap();
        let said = exceptions(&mut host);
        assert_eq!(said.matches(&format!("Number({name})")).count(), 1, "{said}");
        assert_eq!(states(&mut board, &mut host), [state, 0.0, 0.0, 0.0]);
        host.run_for_ms(&mut board, 1_500).unwrap();
        board.ail(Ails { address: Some(0), status: Some(0), ..Ails::default() });
    }
    assert_eq!(board.positions()[0], 50 * 1_280, "nothing was stopped");
}

#[test]
#[ignore = "needs the emulator, which `cargo xtask test` installs"]
fn printing_hosts_set_and_see_drivers() {
    let mut board = Emulated::load(&image(&SKR_PICO), &SKR_PICO).unwrap();
    board.run_for_ms(300).unwrap();
    let mut ask = |line: &str, ms| {
        board.send(format!("{line}\n").as_bytes());
        board.run_for_ms(ms).unwrap();
        String::from_utf8(board.receive()).unwrap()
    };
    ask("M105", 50);
    let said = ask("M906 X800 Y800.0 E650", 100);
    assert!(said.contains("ok"), "{said}");
    let said = ask("M906", 50);
    assert!(said.contains("M906 X800 Y800 Z580 E650"), "{said}");
    let said = ask("M906 X100 Z5000", 50);
    assert!(said.contains("number out of range"), "{said}");
    let said = ask("M569 S0 X E", 100);
    assert!(said.contains("ok"), "{said}");
    let said = ask("M569", 50);
    assert!(said.contains("driver 1 (X): spreadCycle"), "{said}");
    assert!(said.contains("driver 2 (Y): stealthChop"), "{said}");
    let said = ask("M122", 50);
    assert!(said.contains("driver 1 (X): OK, run 800 mA, hold 310 mA, spreadCycle"), "{said}");
    assert!(said.contains("DRV_STATUS 80000000"), "{said}");
}
