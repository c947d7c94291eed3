//! The image that tests a chip (`tests/chip/verify`), behind the boot loader of the Arduino Mega: its answers on a sound
//! board, and on boards with a fault each. `cargo xtask examples` builds it.

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::mechanics::Random;
use kerf_sim::{Host, Image, Loader, Machine};

use crate::common::{CALLED, JUMP_TO_0, MS, image, part};

const GREETING: &str = "kerf-chip 1 atmega2560";
/// Time of a byte on the wire at 115,200 baud, in cycles.
const BYTE: u64 = 1_389;
/// The time of a count of the timers, in cycles.
const COUNT: u64 = 64;
/// Longest time from a byte to the start or stop of the timers, in cycles: what `image/count.rs` says.
const LATE: u64 = 90;

/// A board that has started the image.
fn started() -> Machine {
    let mut machine = Machine::load(&part("verify"), &MEGA2560_GRBL).unwrap();
    machine.install(&Loader::of_debian().unwrap());
    assert_eq!(line(&mut machine, 1_500), GREETING);
    machine
}

/// Waits for a line; an empty one if none comes.
fn line(machine: &mut Machine, ms: u64) -> String {
    machine.run_until_line(machine.cycle() + ms * MS).unwrap();
    let text = String::from_utf8(machine.receive()).unwrap();
    text.strip_suffix('\n').unwrap_or_default().to_string()
}

/// Has it hang. Returns the time from its answer to the greeting, ms.
fn hangs(machine: &mut Machine) -> u64 {
    assert_eq!(ask(machine, "hang"), "hang");
    let (from, resets) = (machine.cycle(), machine.resets());
    assert_eq!(line(machine, 2_500), GREETING);
    assert_eq!(machine.resets(), resets + 1);
    assert_eq!(ask(machine, "hello"), GREETING);
    (machine.cycle() - from) / MS
}

/// Sends a command, and waits for its answer.
fn ask(machine: &mut Machine, command: &str) -> String {
    machine.send(format!("{command}\n").as_bytes());
    line(machine, 3_000)
}

/// Returns the numbers of an answer, behind its name.
fn numbers(answer: &str, name: &str) -> Vec<u64> {
    let mut words = answer.split(' ');
    assert_eq!(words.next(), Some(name), "{answer}");
    words.map(|word| word.parse().unwrap()).collect()
}

/// Puts a program below the loader in place of another, and lets the loader start it.
fn swap(machine: &mut Machine, program: &Image) {
    machine.fill_flash(&program.flash);
    machine.reset();
    assert!(machine.recognises(program));
}

#[test]
fn it_greets_with_all_pins_as_inputs() {
    let mut machine = started();
    assert_eq!(ask(&mut machine, "hello"), GREETING);
    assert_eq!(ask(&mut machine, "hello\r"), GREETING);
    let ports = (0x21..0x36).step_by(3).chain((0x101..0x10C).step_by(3));
    for direction in ports {
        let both = [machine.peek(direction), machine.peek(direction + 1)];
        assert_eq!(both, [0, 0], "the port at {direction:#x}");
    }
}

#[test]
fn what_is_no_command_is_answered_by_a_mark() {
    let mut machine = started();
    let long = ["h".repeat(41), "h".repeat(300)];
    let bad = [
        "",
        "foo",
        "hell",
        "Hello",
        " hello",
        "hello ",
        "ram 1",
        "stack",
        "stack 511",
        "stack 8704",
        "stack 00000512",
        "stack -1",
        "stack 600 1",
        "cells 0",
        "duty",
        "duty 2",
        "duty 0 1",
        "cells 0 65",
        "cells 4090 7",
        "cells 0 1 1",
        "rate 460800 1",
        "rate 115200",
        "rate 0 1",
    ];
    for command in bad.into_iter().chain(long.iter().map(String::as_str)) {
        assert_eq!(ask(&mut machine, command), "?", "{command}");
    }
    assert_eq!(ask(&mut machine, "hello"), GREETING);
}

#[test]
fn sound_ram_is_sound() {
    let mut machine = started();
    let found = numbers(&ask(&mut machine, "ram"), "ram");
    assert!(found[0] > 8_192 - 250 && found[1..] == [0, 0], "{found:?}");
    assert_eq!(ask(&mut machine, "hello"), GREETING);
}

#[test]
fn bits_of_ram_that_stay_are_found() {
    for cases in [
        &[(0x205, 0x01, 0x01)][..],
        &[(0x300, 0x80, 0x00)],
        &[(0x2100, 0x10, 0x10)],
        // A bit that stays 0, one that stays 1, a whole byte.
        &[(0x1000, 0x04, 0x00), (0x0FFF, 0x04, 0x04), (0x1ABC, 0xFF, 0xC5)],
    ] {
        let mut machine = started();
        for (address, mask, value) in cases {
            machine.stick_ram(*address, *mask, *value);
        }
        let found = numbers(&ask(&mut machine, "ram"), "ram");
        let first = cases.iter().map(|(address, _, _)| u64::from(*address)).min().unwrap();
        assert_eq!(found[1..], [cases.len() as u64, first], "{cases:x?}");
    }
}

/// Bytes from the end of Kerf's statics that the image may not count: the mark of the last reset lies there.
const MARK: u16 = 2;
/// Bytes by which the paint may show more free stack than the stack pointer: room that a function has not written to.
const UNWRITTEN: i64 = 8;

#[test]
fn paint_shows_how_much_stack_the_firmware_has_never_used() {
    let mut machine = started();
    let painted = numbers(&ask(&mut machine, "paint"), "paint")[0];
    assert!(painted > 7_850, "{painted}");
    let firmware = Image::read(&image(&MEGA2560_GRBL)).unwrap();
    swap(&mut machine, &firmware);
    let mut host = Host::new(1);
    host.boot(&mut machine, 3_000).unwrap();
    for command in ["{xvm:1200}", "g1 f900 x3", "g2 x6 i2", "{sys:n}"] {
        host.ask(&mut machine, command, 5_000).unwrap();
    }
    host.run_for_ms(&mut machine, 1_000).unwrap();
    let free = i64::from(machine.free_stack().unwrap());
    machine.receive();
    swap(&mut machine, &Image::read(&part("verify")).unwrap());
    assert_eq!(line(&mut machine, 1_500), GREETING);
    let from = firmware.static_end + MARK;
    let found = numbers(&ask(&mut machine, &format!("stack {from}")), "stack")[0] as i64;
    let more = found + i64::from(MARK) - free;
    assert!((0..=UNWRITTEN).contains(&more), "free {free}, found {found}");
}

/// A board with random contents of its EEPROM.
fn with_random_cells() -> Machine {
    let mut machine = started();
    let mut random = Random::new(1);
    machine.set_eeprom(&std::array::from_fn(|_| random.below(256) as u8));
    machine
}

#[test]
fn cells_are_tested_and_keep_their_contents() {
    let mut machine = with_random_cells();
    let before = *machine.eeprom();
    for (from, count) in [(0, 64), (4_032, 64), (1_000, 1), (4_096, 0)] {
        let written = machine.eeprom_writes();
        let answer = ask(&mut machine, &format!("cells {from} {count}"));
        assert_eq!(answer, format!("cells {from} {count} 0 0"));
        assert_eq!(machine.eeprom_writes() - written, 2 * count);
    }
    assert!(before == *machine.eeprom());
}

#[test]
fn bits_of_cells_that_stay_are_found() {
    let mut machine = with_random_cells();
    machine.stick_cell(100, 0x10, 0x00);
    machine.stick_cell(103, 0xFF, 0xFF);
    let before = *machine.eeprom();
    assert_eq!(ask(&mut machine, "cells 64 64"), "cells 64 64 2 100");
    assert_eq!(ask(&mut machine, "cells 101 10"), "cells 101 10 1 103");
    assert_eq!(ask(&mut machine, "cells 104 10"), "cells 104 10 0 0");
    assert!(before == *machine.eeprom());
}

/// Has the timers count for a time between two bytes. Returns the counts.
fn counted(machine: &mut Machine, cycles: u64) -> Vec<u64> {
    machine.run_for_ms(1).unwrap();
    machine.send(b"count\n");
    let from = machine.cycle() + 5 * BYTE;
    // Instructions end when they end: the byte begins where it is sent from.
    machine.run_until(from + cycles).unwrap();
    let late = machine.cycle() - from - cycles;
    machine.send(b"\n");
    let counts = numbers(&line(machine, 100), "count");
    let right = cycles + late;
    let wrong = |count: &u64| (count * COUNT).abs_diff(right) > COUNT + LATE;
    if counts.iter().any(wrong) {
        println!("{right} cycles, {} counts: {counts:?}", right / COUNT);
    }
    counts
}

/// Whether each timer has counted a time, to a count and what polling takes.
fn are_right(counts: &[u64], cycles: u64) -> bool {
    counts.len() == 6 && counts.iter().all(|n| (n * COUNT).abs_diff(cycles) <= COUNT + LATE)
}

#[test]
fn all_timers_count_right_to_the_clock() {
    let mut machine = started();
    let mut random = Random::new(2);
    for _ in 0..200 {
        // Most end where the short timers overflow.
        let cycles = (1 + random.below(20)) * 256 * COUNT + random.below(400) - 200;
        assert!(are_right(&counted(&mut machine, cycles), cycles));
    }
    for around in 0..20 {
        let cycles = 65_536 * COUNT + around * 16 - 160;
        assert!(are_right(&counted(&mut machine, cycles), cycles));
    }
    let long = 16_000_000 * 3;
    assert!(are_right(&counted(&mut machine, long), long));
}

#[test]
fn a_byte_that_is_no_line_feed_stops_and_begins_a_line() {
    let mut machine = started();
    machine.send(b"count\n");
    machine.run_for_ms(20).unwrap();
    machine.send(b"x");
    machine.run_for_ms(20).unwrap();
    assert!(machine.receive().is_empty());
    machine.send(b"yz\n");
    let counts = numbers(&line(&mut machine, 100), "count");
    assert!(counts.iter().all(|n| (4_500..5_100).contains(n)), "{counts:?}");
    assert_eq!(ask(&mut machine, "hello"), GREETING);
}

#[test]
fn faults_of_timers_are_seen() {
    let second = 16_000_000;
    for (timer, pace) in [(0, 0.0), (3, 0.0), (2, 0.5), (5, 64.0 / 63.0), (1, 64.0 / 65.0)] {
        let mut machine = started();
        machine.set_pace(timer, pace);
        let mut counts = counted(&mut machine, second);
        let wrong = counts[timer] as f64 * COUNT as f64 / second as f64;
        assert!((wrong - pace).abs() < 1e-4, "timer {timer}: {wrong} instead of {pace}");
        counts[timer] = counts[4];
        assert!(are_right(&counts, second), "{counts:?}");
        machine.set_pace(timer, 1.0);
        assert!(are_right(&counted(&mut machine, second), second));
    }
}

/// Orders an echo of `count` bytes at a rate, and lets the host change to its own rate.
fn change_rate(machine: &mut Machine, rate: u32, count: usize, host: u32) -> u64 {
    let divisor = numbers(&ask(machine, &format!("rate {rate} {count}")), "rate")[0];
    machine.set_baud(host);
    machine.run_for_ms(1).unwrap();
    divisor
}

/// Sends bytes, and returns what comes back until 50 ms before the result, and the result.
fn echo(machine: &mut Machine, sent: &[u8], silence_ms: u64) -> (Vec<u8>, String) {
    machine.send(sent);
    let mut back = Vec::new();
    while machine.wire().backlog() > 0 {
        machine.run_for_ms(1).unwrap();
        back.extend(machine.receive());
    }
    machine.run_for_ms(silence_ms + 20).unwrap();
    back.extend(machine.receive());
    machine.set_baud(115_200);
    (back, line(machine, 100))
}

fn random_bytes(count: usize) -> Vec<u8> {
    let mut random = Random::new(count as u64);
    (0..count).map(|_| random.below(256) as u8).collect()
}

#[test]
fn random_bytes_come_back_at_every_rate() {
    let mut machine = started();
    let rates = [(115_200, 16), (230_400, 8), (250_000, 7), (500_000, 3), (1_000_000, 1)];
    for (rate, divisor) in rates {
        let sent = random_bytes(3_000);
        assert_eq!(change_rate(&mut machine, rate, sent.len(), rate), divisor);
        let (back, result) = echo(&mut machine, &sent, 0);
        assert_eq!(result, "echo 3000 0 0", "at {rate}");
        assert!(back == sent, "at {rate}");
    }
    assert_eq!(ask(&mut machine, "hello"), GREETING);
}

#[test]
fn an_echo_ends_when_the_line_is_silent() {
    let mut machine = started();
    change_rate(&mut machine, 500_000, 10, 500_000);
    let (back, result) = echo(&mut machine, b"four", 300);
    assert_eq!((&back[..], &result[..]), (&b"four"[..], "echo 4 0 0"));
    change_rate(&mut machine, 500_000, 10, 500_000);
    let (back, result) = echo(&mut machine, b"", 2_000);
    assert_eq!((back.len(), &result[..]), (0, "echo 0 0 0"));
    change_rate(&mut machine, 250_000, 0, 250_000);
    assert_eq!(echo(&mut machine, b"", 0).1, "echo 0 0 0");
}

#[test]
fn a_rate_that_is_off_is_told_as_framing_errors() {
    let mut machine = started();
    let mut misframed = |host, silence_ms| {
        let sent = random_bytes(100);
        change_rate(&mut machine, 250_000, sent.len(), host);
        let (back, result) = echo(&mut machine, &sent, silence_ms);
        assert!(back.is_empty());
        numbers(&result, "echo")
    };
    assert_eq!(misframed(230_000, 0), [100, 100, 0]);
    // A byte that begins while the receiver still waits for the end of the last is not seen.
    let [received, framing, 0] = misframed(270_000, 300)[..] else { panic!("overruns") };
    assert!((40..100).contains(&received) && framing == received, "{received}, {framing}");
}

/// At 230,400 baud the chip sends 3.7 % slower than it receives.
#[test]
fn bytes_that_come_too_fast_for_too_long_are_told_as_overruns() {
    let mut machine = started();
    let sent = random_bytes(12_000);
    change_rate(&mut machine, 230_400, sent.len(), 230_400);
    let (back, result) = echo(&mut machine, &sent, 0);
    let numbers = numbers(&result, "echo");
    assert_eq!(numbers[..2], [12_000, 0], "{result}");
    assert_eq!(back.len() as u64, 12_000 - numbers[2], "{result}");
    assert!(back[..6_000] == sent[..6_000] && (1..300).contains(&numbers[2]), "{result}");
}

#[test]
fn the_reference_is_converted_against_five_volts() {
    let mut machine = started();
    assert_eq!(ask(&mut machine, "volt"), "volt 225");
    assert_eq!(ask(&mut machine, "volt"), "volt 225");
}

/// After a reset by the watchdog the loader means to start the program at once, but EIND is 1, and it calls 0x20000.
/// Nothing is there, so the loader is reached again, and waits its second.
#[test]
fn it_comes_back_when_it_has_hung() {
    let ms = hangs(&mut started());
    assert!((1_000..1_300).contains(&ms), "{ms} ms");
}

#[test]
fn it_comes_back_at_once_with_a_jump_where_the_loader_calls() {
    let mut machine = started();
    let mut flash = Image::read(&part("verify")).unwrap().flash;
    flash.resize(CALLED, 0xFF);
    flash.extend(JUMP_TO_0);
    machine.fill_flash(&flash);
    let ms = hangs(&mut machine);
    assert!((240..300).contains(&ms), "{ms} ms");
}

#[test]
fn all_commands_work_one_after_another() {
    let mut machine = started();
    for command in ["ram", "paint", "stack 6617", "cells 5 3", "volt", "hello", "ram"] {
        let answer = ask(&mut machine, command);
        let name = command.split(' ').next().unwrap();
        assert!(answer.starts_with(name) || answer == GREETING, "{command}: {answer}");
    }
}
