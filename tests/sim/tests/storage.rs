//! Settings and offsets in EEPROM: they survive a power failure at any moment, and writing them delays no step.

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::{Host, LINES_IN_FLIGHT, Machine};

use crate::common::{booted, firmware, set};

/// A machine with these EEPROM contents.
fn booted_with(eeprom: &[u8; 4096]) -> (Machine, Host) {
    let (mut machine, mut host) = (firmware(&MEGA2560_GRBL), Host::new(LINES_IN_FLIGHT));
    machine.set_eeprom(eeprom);
    host.boot(&mut machine, 1_000).unwrap();
    (machine, host)
}

/// The value of a token.
fn value(machine: &mut Machine, host: &mut Host, token: &str) -> f64 {
    let response = host.ask(machine, &format!("{{{token}:n}}"), 5_000).unwrap();
    response.body[token].as_f64().unwrap_or_else(|| panic!("{}", response.raw))
}

#[test]
fn what_was_set_is_there_after_a_reset() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    let writes = machine.eeprom_writes();
    assert_eq!(writes, 0, "defaults take no room");
    for line in
        ["{xvm:1234}", "{4mi:32}", "{gco:3}", "g10 l2 p3 x1.5 y-2", "g10 l1 p10 z4", "g28.1"]
    {
        set(&mut machine, &mut host, line);
    }
    host.run_for_ms(&mut machine, 2_000).unwrap();
    let left = *machine.eeprom();
    let (mut machine, mut host) = booted_with(&left);
    let mut is = |token, expected| {
        assert_eq!(value(&mut machine, &mut host, token), expected, "{token}");
    };
    is("xvm", 1_234.0);
    is("4mi", 32.0);
    is("coor", 3.0);
    is("ofsx", 1.5);
    is("ofsy", -2.0);
    set(&mut machine, &mut host, "g43 h10");
    assert_eq!(value(&mut machine, &mut host, "tofz"), 4.0);
    // A value that is stored already is not written again.
    set(&mut machine, &mut host, "{xvm:1234}");
    host.run_for_ms(&mut machine, 500).unwrap();
    assert_eq!(machine.eeprom_writes(), 0);
}

#[test]
fn a_power_cut_leaves_the_old_value_or_the_new() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    set(&mut machine, &mut host, "{si:200}");
    host.run_for_ms(&mut machine, 500).unwrap();
    set(&mut machine, &mut host, "{si:300}");
    let mut seen = [0; 2];
    for _ in 0..20 {
        let left = *machine.eeprom();
        let (mut other, mut sender) = booted_with(&left);
        match value(&mut other, &mut sender, "si") {
            200.0 => seen[0] += 1,
            300.0 => seen[1] += 1,
            other => panic!("si is {other}"),
        }
        host.run_for_ms(&mut machine, 3).unwrap();
    }
    assert!(seen[0] > 5 && seen[1] > 2, "{seen:?}");
}

#[test]
fn a_power_cut_leaves_the_old_machine_or_the_new() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    let of = |machine: &mut Machine, host: &mut Host| {
        ["mch", "1tr", "xvm", "zjm", "4ma"].map(|token| value(machine, host, token) as i64)
    };
    kept_after(&mut machine, &mut host, "{mch:1,xvm:777}");
    let old = of(&mut machine, &mut host);
    set(&mut machine, &mut host, "{mch:3}");
    let new = of(&mut machine, &mut host);
    let mut seen = [0; 2];
    for ms in [5, 15, 15, 15, 100, 500, 900, 2_000] {
        host.run_for_ms(&mut machine, ms).unwrap();
        let (mut other, mut sender) = booted_with(machine.eeprom());
        let is = of(&mut other, &mut sender);
        assert!(is == old || is == new, "{is:?}");
        seen[usize::from(is == new)] += 1;
    }
    assert!(seen[0] > 0 && seen[1] > 4, "{seen:?}");
}

/// Starts with these EEPROM contents, and returns the machine and what it answers in grbl's dialect.
fn grbl(eeprom: &[u8; 4096], lines: &[u8]) -> (Machine, String) {
    let mut machine = firmware(&MEGA2560_GRBL);
    machine.set_eeprom(eeprom);
    let mut heard = Vec::new();
    for (text, ms) in [(&b""[..], 200), (b"$I\n", 50), (lines, 300)] {
        machine.send(text);
        machine.run_for_ms(ms).unwrap();
        heard = machine.receive();
    }
    (machine, String::from_utf8(heard).unwrap())
}

#[test]
fn a_power_cut_leaves_the_old_start_up_line_or_the_new() {
    let (stored, heard) = grbl(&[0xFF; 4096], b"$N0=G20\n");
    assert_eq!(heard, "ok\r\n");
    let mut machine = grbl(stored.eeprom(), b"").0;
    machine.send(b"$N0=G21\n");
    let (mut seen, mut heard) = ([0; 2], Vec::new());
    // The answer may come in two of the intervals.
    while !heard.ends_with(b"\n") {
        machine.run_for_ms(2).unwrap();
        heard.extend(machine.receive());
        let lines = grbl(machine.eeprom(), b"$N\n").1;
        let which = ["$N0=G20\r\n", "$N0=G21\r\n"].map(|line| lines.starts_with(line));
        seen[which.iter().position(|is| *is).unwrap_or_else(|| panic!("{lines}"))] += 1;
    }
    assert_eq!(heard, b"ok\r\n");
    assert!(seen[0] > 4 && seen[1] > 0, "{seen:?}");
}

#[test]
fn rubbish_is_no_setting() {
    let mut cells = [0u8; 4096];
    for (i, cell) in cells.iter_mut().enumerate() {
        *cell = ((i * 7919) >> 3) as u8;
    }
    let (mut machine, mut host) = booted_with(&cells);
    assert_eq!(value(&mut machine, &mut host, "xvm"), 800.0);
    assert_eq!(value(&mut machine, &mut host, "stat"), 2.0, "an alarm");
    set(&mut machine, &mut host, "{xvm:900}");
    host.run_for_ms(&mut machine, 500).unwrap();
    let left = *machine.eeprom();
    let (mut machine, mut host) = booted_with(&left);
    assert_eq!(value(&mut machine, &mut host, "xvm"), 900.0);
}

#[test]
fn no_step_is_late_while_settings_are_written() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    for line in ["{xvm:2000}", "{xfr:2000}", "{xjm:1000}", "{xtm:1000}"] {
        set(&mut machine, &mut host, line);
    }
    host.run_for_ms(&mut machine, 1_000).unwrap();
    machine.recorder_mut().keep_log();
    let before = machine.eeprom_writes();
    // 20,000 steps a second for three seconds.
    set(&mut machine, &mut host, "g1 f937.5 x47");
    host.run_for_ms(&mut machine, 300).unwrap();
    let from = machine.cycle();
    for round in 0..20 {
        set(&mut machine, &mut host, &format!("{{yvm:{}}}", 500 + round));
        host.run_for_ms(&mut machine, 100).unwrap();
    }
    let to = machine.cycle();
    assert!(machine.eeprom_writes() - before > 150, "{}", machine.eeprom_writes() - before);
    let log = machine.recorder().log();
    let steps: Vec<u64> =
        log.iter().map(|s| s.cycle).filter(|at| (from..to).contains(at)).collect();
    let gaps: Vec<u64> = steps.windows(2).map(|w| w[1] - w[0]).collect();
    assert!(gaps.len() > 30_000, "{}", gaps.len());
    let (least, most) = (gaps.iter().min().unwrap(), gaps.iter().max().unwrap());
    println!("{} intervals of {least} to {most} cycles", gaps.len());
    assert!(most - least <= 2, "{least} to {most}");
}

/// Returns how long a line's settings take to get into EEPROM, ms from their response on.
fn kept_after(machine: &mut Machine, host: &mut Host, line: &str) -> f64 {
    set(machine, host, line);
    let from = machine.cycle();
    while value(machine, host, "kept") == 0.0 {}
    machine.seconds(machine.cycle() - from) * 1e3
}

/// Returns a log in which every slot has been used, and half of the records count.
fn worn() -> [u8; 4096] {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    for round in 0..3 {
        for row in 1..=9 {
            let line = format!("g10 l2 p{row} x{row} y{round} z{row} a{round} b{row} c{round}.5");
            set(&mut machine, &mut host, &line);
            set(&mut machine, &mut host, &format!("g10 l1 p{row} x{round} z{round}.5"));
        }
    }
    for tool in 1..=10 {
        set(&mut machine, &mut host, &format!("g10 l1 p{tool} x1.5 z{tool}.5"));
    }
    kept_after(&mut machine, &mut host, "{si:200}");
    *machine.eeprom()
}

#[test]
fn a_setting_that_is_kept_survives_a_reset_at_once() {
    for (log, one_ms, four_ms) in [([0xFF; 4096], 65.0, 250.0), (worn(), 150.0, 500.0)] {
        let (mut machine, mut host) = booted_with(&log);
        let one = kept_after(&mut machine, &mut host, "{xvm:1234}");
        let four = kept_after(&mut machine, &mut host, "{xvm:900,yvm:901,zvm:902,avm:903}");
        println!("kept: one setting after {one:.1} ms, four after {four:.1} ms");
        assert!(one < one_ms && four < four_ms, "{one} ms, {four} ms");
        let left = *machine.eeprom();
        let (mut machine, mut host) = booted_with(&left);
        for (token, expected) in [("xvm", 900.0), ("yvm", 901.0), ("zvm", 902.0), ("avm", 903.0)] {
            assert_eq!(value(&mut machine, &mut host, token), expected, "{token}");
        }
    }
}

#[test]
fn all_defaults_are_kept_in_time() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    kept_after(&mut machine, &mut host, "{mch:1}");
    set(&mut machine, &mut host, "{mch:2}");
    let ms = kept_after(&mut machine, &mut host, "{mch:3}");
    println!("kept: a machine after {ms:.0} ms");
    assert!(ms < 8_000.0, "{ms} ms");
}
