//! The whole firmware on the host, in mocked time: bytes in, responses and steps out.

use kerf::boards::inputs;
use kerf::hal::imp::Machine;
use kerf::motion::queue::{self, CAPACITY};

/// The greeting of grbl's dialect, which comes last while no dialect is settled.
const GRBL: &str = "\r\nGrbl 1.1h ['$' for help]\r\n";

/// What the greeting adds in an alarm.
const LOCKED: &str = "[MSG:'$H'|'$X' to unlock]\r\n";

/// A sender's end of the line, and all it has heard.
struct Sender {
    machine: Machine,
    heard: String,
}

impl Sender {
    fn boot() -> Self {
        let mut sender = Self::boot_open();
        let heard = sender.heard.clone();
        // TinyG's dialect from now on.
        let answer = sender.ask("{}\n", 20);
        assert!(answer.ends_with("{\"r\":{},\"f\":[1,0,7]}\n"), "{answer}");
        sender.heard = heard;
        sender
    }

    /// A sender that has said nothing.
    fn boot_open() -> Self {
        let machine = Machine::boot(115_200).expect("one machine for each test thread");
        let mut sender = Sender { machine, heard: String::new() };
        let banner = sender.ask("", 100);
        let banner = banner.trim_end_matches(LOCKED).trim_end_matches(GRBL);
        assert!(banner.starts_with("{\"r\":{\"fv\":0.970,\"fb\":440.20,"), "{banner}");
        assert!(banner.contains("\"msg\":\"SYSTEM READY\"},\"f\":[1,0,0]}\n"), "{banner}");
        sender
    }

    /// Sends a text, and returns what the machine sends within some milliseconds.
    fn ask(&mut self, text: &str, ms: u64) -> String {
        let before = self.heard.len();
        self.machine.send(text.as_bytes());
        self.machine.run_ms(ms);
        self.heard += &String::from_utf8(self.machine.received()).expect("ASCII");
        self.heard[before..].to_string()
    }

    /// Returns the time that these lines take until the machine stops, in ms, to a multiple of `step`.
    fn time(&mut self, lines: &str, step: u64) -> u64 {
        self.machine.send(lines.as_bytes());
        let mut heard = Vec::new();
        let mut ms = 0;
        while !String::from_utf8_lossy(&heard).contains("\"stat\":3") && ms < 60_000 {
            self.machine.run_ms(step);
            heard.extend(self.machine.received());
            ms += step;
        }
        ms
    }

    /// Number of responses so far, without the greeting.
    fn answered(&self) -> usize {
        self.heard.matches("{\"r\":").count() - 1
    }
}

#[test]
fn a_move_ends_on_its_step() {
    let mut sender = Sender::boot();
    let build = sender.ask("{fb:n}\n", 20);
    assert_eq!(build.lines().next(), Some("{\"r\":{\"fb\":440.20},\"f\":[1,0,7]}"));
    let answer = sender.ask("g1x10f500\n", 5_000);
    assert_eq!(answer.lines().next(), Some("{\"r\":{},\"f\":[1,0,7]}"));
    assert!(answer.contains("\"stat\":5"), "{answer}");
    assert!(answer.trim_end().ends_with("\"stat\":3}}"), "{answer}");
    assert_eq!(sender.machine.emitted().position, [12_800, 0, 0, 0]);
}

#[test]
fn refused_lines_move_nothing() {
    let mut sender = Sender::boot();
    for (line, status) in
        [("g1x10", 142), ("g5", 131), ("m77", 132), ("g1x", 102), ("g2x1f100", 157)]
    {
        let answer = sender.ask(&format!("{line}\n"), 300);
        assert_eq!(answer.lines().next(), Some(&*format!("{{\"r\":{{}},\"f\":[1,{status},7]}}")));
    }
    assert_eq!(sender.machine.emitted().steps, [0; 4]);
}

#[test]
fn back_pressure_reaches_the_sender() {
    let mut sender = Sender::boot();
    // Far more moves than blocks, four lines in flight: the responses stop when the planner is full...
    let mut sent = 0;
    while sender.answered() == sent {
        sender.ask("g1f800x1\ng1x2\ng1x3\ng1x4\n", 100);
        sent += 4;
        assert!(sent < 400, "somebody should have to wait");
    }
    assert!(sent >= CAPACITY, "it takes all blocks first");
    assert!(queue::used() >= CAPACITY - 1, "{} blocks", queue::used());
    // ...a control line is still answered...
    // CNCjs ignores the response to a line if it is paused while fewer than six blocks are reported free.
    let told = sender.ask("{qr:n}\n", 50);
    assert!(told.contains("{\"r\":{\"qr\":6},"), "control lines overtake: {told}");
    // ...and in the end every line is answered once, and executed.
    sender.ask("", 60_000);
    assert_eq!(sender.answered(), sent + 1);
    assert_eq!(sender.machine.emitted().position[0], 4 * 1280);
    assert!(sender.heard.trim_end().ends_with("\"stat\":3}}"));
}

#[test]
fn a_flood_is_answered_by_errors_and_not_by_corruption() {
    flood("\n");
}

#[test]
fn a_flood_of_lines_with_two_ends_is_answered_too() {
    flood("\r\n");
}

#[test]
fn a_flood_of_lines_that_end_in_returns_is_answered_too() {
    flood("\r");
}

fn flood(end: &str) {
    let mut sender = Sender::boot();
    // No flow control at all: 600 lines at the full speed of the line. Lines that do not fit are refused.
    let job: String = (0..600).map(|n| format!("g1 f800 x{}{end}", n % 2 * 10)).collect();
    sender.ask(&job, 400_000);
    assert!(sender.heard.contains("{\"er\":{\"fb\":440.20,\"st\":13,"), "loss is reported");
    let position = sender.machine.emitted().position[0];
    assert!(position == 0 || position == 12_800, "never anywhere else: {position}");
    // An XOFF or XON may stand anywhere.
    let heard = sender.heard.replace(['\x11', '\x13'], "");
    let answers = heard.lines().filter(|line| line.starts_with("{\"r\":{},\"f\""));
    assert_eq!(answers.count(), 600, "every line is answered, those that were lost too");
    assert!(sender.ask("{fb:n}\n", 50).contains("440.20"), "and it still answers");
    sender.ask("g1 x77\n", 10_000);
    assert_eq!(
        sender.machine.emitted().position[0],
        77 * 1_280,
        "the line behind the loss is whole"
    );
}

#[test]
fn over_long_lines_are_refused_whole() {
    let mut sender = Sender::boot();
    let line = format!("g1 f100 x1 ({})\n", "x".repeat(300));
    let answer = sender.ask(&line, 200);
    assert_eq!(answer.lines().next(), Some("{\"r\":{},\"f\":[1,107,7]}"));
    assert_eq!(sender.machine.emitted().steps, [0; 4]);
}

#[test]
fn enquiry_and_reset_act_at_once() {
    let mut sender = Sender::boot();
    // A sender that begins with a reset is greeted. After a line in TinyG's dialect a reset restarts the board.
    sender.ask("{fv:n}\n", 20);
    assert_eq!(sender.ask("g1\x05", 20), "{\"ack\":true}\n");
    sender.ask("\x18", 20);
    assert!(kerf::hal::imp::was_reset());
}

#[test]
fn a_damaged_byte_behind_a_return_damages_one_line_only() {
    let mut sender = Sender::boot();
    sender.machine.send(b"g0 x1\r");
    sender.machine.send_damaged();
    let heard = sender.ask("\ng0 x2\r", 2_000);
    let answers = heard.lines().filter_map(|line| line.strip_prefix("{\"r\":{},\"f\":[1,"));
    let statuses: Vec<_> = answers.filter_map(|line| line.split(',').next()).collect();
    assert_eq!(statuses, ["0", "13", "0"], "{heard}");
    assert_eq!(sender.machine.emitted().position[0], 2 * 1_280);
}

/// A response waits for room, and an exception and an acknowledgement wait for the response. Each of the two is sent
/// in its turn, and neither keeps waking the other until then.
#[test]
fn an_enquiry_and_an_exception_wait_for_a_response() {
    let mut sender = Sender::boot();
    sender.machine.send(b"{sys:n}\n{sys:n}\n");
    sender.machine.send_damaged();
    let heard = sender.ask("\n\x05g0 x1\n", 1_000);
    assert_eq!(heard.matches("{\"ack\":true}\n").count(), 1, "{heard}");
    assert_eq!(heard.matches("{\"er\":{").count(), 1, "{heard}");
    assert_eq!(sender.answered(), 4, "{heard}");
}

#[test]
fn new_steps_per_unit_never_make_the_machine_jump() {
    let mut sender = Sender::boot();
    sender.ask("g1 f800 x10\n", 5_000);
    sender.ask("{1tr:2.5}\n", 50);
    sender.ask("g1 x10\n", 500);
    assert_eq!(sender.machine.emitted().position[0], 12_800);
    sender.ask("g1 x11\n", 2_000);
    assert_eq!(sender.machine.emitted().position[0], 12_800 + 640);
}

#[test]
fn a_rotary_axis_keeps_its_limit_beside_the_smallest_linear_travel() {
    for line in ["g0 a360\n", "g0 x0.0001 a360\n"] {
        let ms = std::thread::spawn(move || {
            let mut sender = Sender::boot();
            sender.ask("{aam:1,avm:600}\n", 50);
            sender.time(line, 100)
        })
        .join()
        .expect("no panic");
        // 360 degrees at 600 a minute, plus a ramp.
        assert!((36_000..38_000).contains(&ms), "{line:?} took {ms} ms");
    }
}

#[test]
fn exact_stop_stops_between_moves_and_not_within_an_arc() {
    let time = |lines: &'static str| {
        let timed = std::thread::spawn(move || {
            let mut sender = Sender::boot();
            let ms = sender.time(lines, 10);
            (ms, sender.machine.emitted().position)
        });
        timed.join().expect("no panic")
    };
    let (continuous, end) = time("g64 g1 f600 x2\nx4\nx6\n");
    let (exact_path, _) = time("g61 g1 f600 x2\nx4\nx6\n");
    let (exact_stop, stop_end) = time("g61.1 g1 f600 x2\nx4\nx6\n");
    // Without means a move takes less time, by what they cover.
    assert!((10..80).contains(&(continuous - exact_path)), "{continuous} and {exact_path} ms");
    // There are two more stops. Each costs half of the ramp down and half of the ramp up.
    assert!(exact_stop > continuous + 100, "{exact_stop} and {continuous} ms");
    let (one, _) = time("g1 f600 x2\n");
    assert!(exact_stop + 50 > 3 * one, "each of {exact_stop} ms is from rest to rest, {one} ms");
    assert_eq!((end, stop_end), ([7_680, 0, 0, 0], [7_680, 0, 0, 0]));
    let (arc, _) = time("g64 g1 f600 x1\ng2 i5\n");
    let (stopping_arc, _) = time("g61.1 g1 f600 x1\ng2 i5\n");
    assert!((arc..arc + 300).contains(&stopping_arc), "{stopping_arc} and {arc} ms");
}

#[test]
fn the_steppers_are_told_what_the_drivers_want() {
    let mut sender = Sender::boot();
    sender.ask("{spw:5,2sp:1}\n", 50);
    assert_eq!(kerf::hal::imp::stepper::step_output(), (5, 0b0010));
    // The setting is refused while something moves.
    sender.ask("g1 f500 x1\n{spw:7}\n", 50);
    assert_eq!(kerf::hal::imp::stepper::step_output(), (5, 0b0010));
}

#[test]
fn settings_and_offsets_survive_a_reset() {
    // The whole machine: what is stored after one boot is found at the next.
    let contents = {
        let mut sender = Sender::boot();
        for line in ["{xvm:1234}", "{1mi:16}", "{gun:0}", "g10 l2 p1 x1.5", "g28.1", "{si:200}"] {
            sender.ask(&format!("{line}\n"), 300);
        }
        sender.machine.run_ms(3_000);
        kerf::hal::imp::eeprom::contents()
    };
    std::thread::spawn(move || {
        kerf::hal::imp::eeprom::put(&contents);
        let mut sender = Sender::boot();
        let answer = sender.ask("{xvm:n,1mi:n,gun:n,si:n,unit:n,ofsx:n,posx:n}\n", 300);
        let expected = "{\"r\":{\"xvm\":49,\"1mi\":16,\"gun\":0,\"si\":200,\"unit\":0,\"ofsx\":1.500,\
                        \"posx\":-0.059},\"f\":[1,0,7]}";
        assert_eq!(answer.lines().next(), Some(expected));
    })
    .join()
    .unwrap();
}

#[test]
fn a_kill_at_rest_is_no_hold() {
    let mut sender = Sender::boot();
    sender.ask("{sr:{stat:t,hold:t,mots:t,cycs:t}}\n", 100);
    for kill in ["!\x04", "\x04", "!\x04%"] {
        let heard = sender.ask(kill, 200);
        assert!(heard.contains("\"st\":207"), "{heard}");
        for held in ["\"stat\":6", "\"hold\":3", "\"hold\":4", "\"mots\":2", "\"cycs\":1"] {
            assert!(!heard.contains(held), "{heard}");
        }
    }
    assert!(sender.heard.contains("{\"sr\":{\"stat\":4,"), "{}", sender.heard);
    // A kill that stops something is reported.
    sender.ask("g1 x10 f500\n", 200);
    let heard = sender.ask("!\x04", 500);
    assert!(heard.contains("\"stat\":6"), "{heard}");
    // A program stop that does not wait also stands still.
    sender.ask("{psw:0}\nm0\n", 200);
    let heard = sender.ask("!\x04", 200);
    assert!(heard.contains("\"st\":207") && !heard.contains("\"stat\":6"), "{heard}");
}

/// Returns the EEPROM contents when the machine restarts because these lines asked for it.
fn left_by(lines: &'static str) -> Vec<u8> {
    let play = move || {
        let sender = Sender::boot();
        sender.machine.send(lines.as_bytes());
        assert!(sender.machine.run_until(10_000, kerf::hal::imp::was_reset), "{lines}");
        kerf::hal::imp::eeprom::contents()
    };
    std::thread::spawn(play).join().unwrap()
}

#[test]
fn an_ordered_reset_keeps_every_setting_that_was_acknowledged() {
    let all = "{xvm:1234,yvm:1235}\n{zvm:1236}\ng10 l2 p2 x1.5 y2\n{p1frq:2500}\n";
    let expected = "{\"r\":{\"xvm\":1234,\"yvm\":1235,\"zvm\":1236,\"p1frq\":2500,\"g55x\":1.500,\
                    \"g55y\":2.000},\"f\":[1,0,7]}";
    for order in ["{reset:1}\n", "{boot:1}\n", "$reset=1\n"] {
        let contents = left_by((all.to_string() + order).leak());
        let check = move || {
            kerf::hal::imp::eeprom::put(&contents);
            let answer = Sender::boot().ask("{xvm:n,yvm:n,zvm:n,p1frq:n,g55x:n,g55y:n}\n", 300);
            assert_eq!(answer.lines().next(), Some(expected), "{order}");
        };
        std::thread::spawn(check).join().unwrap();
    }
}

#[test]
fn defaults_and_the_mode_survive_a_reset() {
    let contents = {
        let mut sender = Sender::boot();
        for line in ["{xvm:1234,1mi:16}", "{defa:1}", "{ej:0}"] {
            sender.ask(&format!("{line}\n"), 300);
        }
        sender.machine.run_ms(3_000);
        kerf::hal::imp::eeprom::contents()
    };
    std::thread::spawn(move || {
        kerf::hal::imp::eeprom::put(&contents);
        let mut sender = Sender::boot_open();
        assert!(sender.ask("g21\n", 300).contains("tinyg [mm] ok> "));
        let answer = sender.ask("{xvm:n,1mi:n,ej:n}\n", 300);
        assert!(answer.contains("{\"r\":{\"xvm\":800,\"1mi\":8,\"ej\":0},\"f\":[1,0,7]}"));
    })
    .join()
    .unwrap();
}

#[test]
fn xoff_stops_a_sender_that_heeds_it_before_anything_is_lost() {
    let mut sender = Sender::boot();
    // Slow moves keep the planner busy, so that lines pile up.
    let lines: String = (0..120).map(|i| format!("N{i} g1 f100 x{}.25\n", i % 7)).collect();
    let mut bytes = lines.as_bytes().chunks(1);
    let (mut stopped, mut stops) = (false, 0);
    for _ in 0..2_000_000 {
        if !stopped {
            match bytes.next() {
                Some(byte) => sender.machine.send(byte),
                None => break,
            }
        }
        sender.machine.run_ms(if stopped { 20 } else { 0 });
        sender.machine.run_until(1, || false);
        for byte in sender.machine.received() {
            match byte {
                0x13 => (stopped, stops) = (true, stops + 1),
                0x11 => stopped = false,
                _ => sender.heard.push(byte.into()),
            }
        }
    }
    sender.ask("", 200_000);
    assert!(stops > 2, "{stops}");
    assert_eq!(sender.answered(), 120);
    assert!(!sender.heard.contains("\"er\""), "{}", sender.heard);
}

#[test]
fn xoff_and_xon_stand_between_lines() {
    let mut sender = Sender::boot();
    sender.ask("{sv:0}\n", 100);
    // Slow moves make lines pile up, and requests keep the transmitter busy.
    let line = |i| format!("N{i} g1 f600 x{}.25\n{{xvm:n,yvm:n}}\n{{xvm:n}}\n", i % 7);
    let lines: Vec<u8> = (0..150).flat_map(|i| line(i).into_bytes()).collect();
    let mut bytes = lines.chunks(1);
    let (mut stopped, mut said) = (false, Vec::new());
    while bytes.len() > 0 {
        if !stopped && let Some(byte) = bytes.next() {
            sender.machine.send(byte);
        }
        sender.machine.run_until(1, || false);
        for byte in sender.machine.received() {
            stopped = if stopped { byte != 0x11 } else { byte == 0x13 };
            said.push(byte);
        }
    }
    sender.machine.run_ms(100_000);
    said.extend(sender.machine.received());
    let is_flow = |byte: &u8| matches!(byte, 0x11 | 0x13);
    let flows = said.iter().filter(|byte| is_flow(byte)).count();
    assert!(flows > 20, "{flows}");
    for line in said.split(|byte| *byte == b'\n') {
        let text = line.iter().skip_while(|byte| is_flow(byte));
        let inside = text.filter(|byte| is_flow(byte)).count();
        assert_eq!(inside, 0, "{:?}", String::from_utf8_lossy(line));
    }
    let answered = said.split(|byte| *byte == b'\n').filter(|line| line.ends_with(b"]}")).count();
    assert_eq!(answered, 450, "{:?}", String::from_utf8_lossy(&said));
}

#[test]
fn xoff_from_the_sender_holds_answers_back() {
    let mut sender = Sender::boot();
    assert_eq!(sender.ask("\u{13}{fb:n}\n", 500), "");
    assert!(sender.ask("\u{11}", 500).starts_with("{\"r\":{\"fb\":440.20}"));
    // Without flow control they are like other bytes that are not printable.
    sender.ask("{ex:0}\n", 100);
    assert_ne!(sender.ask("\u{13}{fb:n}\n", 500), "");
}

#[test]
fn a_report_tells_of_one_moment() {
    let mut sender = Sender::boot();
    // Longer than the transmit ring: exec has many turns until the last value has been sent.
    let between =
        "ofsx:t,ofsy:t,ofsz:t,posa:t,posb:t,posc:t,mpoa:t,mpob:t,mpoc:t,homx:t,homy:t,homz:t";
    sender.ask("{sv:2,si:100,xjm:5000}\n", 50);
    sender.ask(&format!("{{sr:{{posx:t,{between},mpox:t}}}}\n"), 100);
    sender.ask("g0x100\n", 20);
    let mut heard = String::new();
    for _ in 0..20 {
        heard += &sender.ask("{sr:n}\n", 170);
    }
    let value = |report: &str, name: &str| {
        let (_, rest) = report.split_once(&format!("\"{name}\":"))?;
        rest.split([',', '}']).next()?.parse::<f64>().ok()
    };
    let mut moved = 0;
    for report in heard.lines() {
        let (Some(work), Some(machine)) = (value(report, "posx"), value(report, "mpox")) else {
            continue;
        };
        assert_eq!(work, machine, "{report}");
        moved += usize::from(work > 0.0);
    }
    assert!(moved > 30, "{heard}");
}

#[test]
fn the_watchdog_is_fed_whatever_the_machine_does() {
    use kerf::hal::imp::{now, watchdog};
    let mut sender = Sender::boot();
    let mut late = 0;
    for (line, ms) in [
        ("g1 f600 x2\n", 1_500),
        ("g4 p1\n", 1_200),
        ("g1 f0.1 x2.005\n", 4_000),
        ("{sys:n}\n{defa:1}\n{xsn:2,spph:1,spde:1}\n", 500),
        ("m3 s1000 g1 f300 x9\n", 1_500),
        ("!", 1_000),
        ("~", 1_500),
    ] {
        sender.ask(line, 0);
        for _ in 0..ms {
            sender.ask("", 1);
            late = late.max(now() - watchdog::fed());
        }
    }
    // A limit switch stops the steps for good, but is no reason for a reset.
    sender.machine.set_input(kerf::boards::inputs::X_MIN, true);
    sender.ask("", 1_000);
    assert!(sender.heard.contains("\"st\":204"), "{}", sender.heard);
    late = late.max(now() - watchdog::fed());
    assert!(late < 100 * 16_000, "{} ms", late / 16_000);
}

#[test]
fn a_jog_whose_line_is_cut_by_its_end_does_not_begin() {
    let mut sender = Sender::boot();
    sender.ask("{jogx:10", 50);
    sender.machine.send(&[0x85]);
    sender.ask("", 50);
    sender.ask("0}\n", 500);
    assert!(sender.heard.contains("{\"r\":{\"jogx\":100},\"f\":[1,5,"), "{}", sender.heard);
    assert_eq!(sender.machine.emitted().steps, [0; 4]);
    sender.ask("{jogx:1}\n", 1_000);
    assert!(sender.heard.contains("{\"r\":{\"jogx\":1},\"f\":[1,0,"), "{}", sender.heard);
}

#[test]
fn a_probing_may_fail_while_its_alarm_is_being_cleared() {
    // The move takes about this long.
    for ms in 0..150 {
        let play = move || {
            let mut sender = Sender::boot();
            sender.ask("g38.2 z-0.3 f600\n", 5 * ms);
            sender.ask("{\"sys\":n,\"clear\":n}\n", 1_500);
            sender.ask("{clear:n}\n", 500);
            sender.ask("{stat:n}\n", 500);
            assert!(sender.heard.contains("\"stat\":3},\"f\""), "{ms}: {}", sender.heard);
        };
        std::thread::spawn(play).join().expect("no panic");
    }
}

#[test]
fn a_reset_that_nobody_wanted_is_told() {
    use kerf::hal::imp::watchdog;
    use kerf::hal::resets::Cause;
    for (cause, told) in [
        (Cause::PowerOn, false),
        (Cause::External, false),
        (Cause::BrownOut, true),
        (Cause::Watchdog, true),
        (Cause::Asked, false),
    ] {
        let heard = std::thread::spawn(move || {
            watchdog::set_cause(cause);
            let mut sender = Sender::boot();
            sender.ask("{rst:n}\n", 100);
            // A sender that is in the middle of a program must not go on with it.
            sender.ask("g1 f100 x1\n", 100);
            sender.ask("{clear:n}\n", 100);
            sender.ask("g1 f100 x1\n", 100);
            sender.heard
        });
        let heard = heard.join().expect("no panic");
        assert!(heard.contains(&format!("{{\"rst\":{}}}", cause as u8)), "{heard}");
        // While no dialect is settled, in grbl's way.
        assert_eq!(heard.contains("ALARM:3\r\n"), told, "{heard}");
        assert_eq!(heard.matches(",203,").count(), usize::from(told), "{heard}");
    }
}

#[test]
fn a_move_of_several_blocks_stops_exactly_at_its_end() {
    // A block is 25.6 mm at most.
    let time = |mode: &str, to: [u8; 2]| {
        let lines = format!("{mode}\ng1 f3000 x{}\nx{}\n", to[0], to[1]);
        let timed = move || {
            let mut sender = Sender::boot();
            sender.ask("{xvm:3000,xfr:3000,xac:100}\n", 50);
            sender.time(&lines, 1)
        };
        std::thread::spawn(timed).join().unwrap()
    };
    let [one, several] = [[20, 60], [40, 60]].map(|to| time("g61.1", to) - time("g64", to));
    assert!(one > 100, "{one} ms more");
    assert!(several.abs_diff(one) < 20, "{one} ms and {several} ms more");
}

#[test]
fn a_percent_sign_in_a_comment_of_an_earlier_hold_flushes_nothing() {
    let mut sender = Sender::boot();
    sender.ask("{saf:1,psw:1}\n", 50);
    sender.ask("g1x20f600\nm0\n", 300);
    assert!(sender.ask("!", 500).contains("\"stat\":6"));
    sender.ask("(100 %)\n", 100);
    sender.ask("~", 300);
    // The pool is full, so that the reader looks ahead in the ring, where a byte has been lost.
    for n in 0..8 {
        sender.ask(&format!("g0 y0 ({n})\n"), 10);
    }
    sender.machine.send(b"g0 y1\ng0");
    sender.machine.send_damaged();
    let answer = sender.ask("y2\n", 100);
    sender.machine.set_input(inputs::DOOR, true);
    let answer = answer + &sender.ask("", 500);
    assert!(answer.contains("\"stat\":6"), "{answer}");
    assert!(!answer.contains("\"rx\""), "{answer}");
    sender.machine.set_input(inputs::DOOR, false);
    sender.ask("", 100);
    sender.ask("~", 3_000);
    assert_eq!(sender.machine.emitted().position[0], 25_600);
}

/// A report on one port tells of one moment, though a move begins on the other port while it is sent.
#[test]
fn a_report_does_not_mix_rest_with_the_target_of_a_move() {
    for n in 0..60u64 {
        // Blanks shift the report by less than a millisecond.
        let (delay, blanks) = (n / 12, n as usize % 12);
        let one = std::thread::spawn(move || {
            let machine = Machine::boot(115_200).expect("one machine for each thread");
            machine.run_ms(200);
            let list = "line:t,stat:t,mpox:t,mpoy:t,mpoz:t,posx:t,posy:t,posz:t,n:t,vel:t,feed:t";
            machine.send(format!("{{sv:0}}\n{{sr:{{{list}}}}}\n").as_bytes());
            machine.run_ms(200);
            machine.received_aux();
            machine.send_aux(format!("{}{{sr:n}}\n", " ".repeat(blanks)).as_bytes());
            machine.run_ms(delay);
            machine.send(b"n5 g0 x10 y10 z10\n");
            machine.run_ms(200);
            let heard = String::from_utf8(machine.received_aux()).expect("text");
            if heard.contains("\"vel\":0.00") {
                assert_eq!(heard.matches(":0.000").count(), 6, "{heard}");
                assert!(heard.contains("\"n\":0"), "{heard}");
            }
        });
        assert!(one.join().is_ok(), "a delay of {delay} ms, {blanks} blanks");
    }
}
