use super::*;
use crate::hal::ring::Ring;
use std::boxed::Box;

fn pool() -> LinePool {
    LinePool::new(Box::leak(Box::new([0; 600])), 40)
}

fn feed(pool: &mut LinePool, text: &[u8]) {
    for &byte in text {
        assert!(pool.ready());
        pool.put(byte);
    }
}

fn take(pool: &mut LinePool, data: bool) -> Option<(std::vec::Vec<u8>, Class)> {
    let (id, class) = pool.next(data)?;
    let text = pool.text(id).to_vec();
    pool.remove(id);
    Some((text, class))
}

#[test]
fn control_overtakes_data_and_order_holds_within_each() {
    let mut pool = pool();
    feed(&mut pool, b"g1x1\r\n  {a:n}\n\ng1x2\n{\"gc\":\"g0\"}\n?\n");
    assert_eq!(pool.free(), 3);
    assert_eq!(take(&mut pool, false), Some((b"{a:n}".to_vec(), Class::Control)));
    assert_eq!(take(&mut pool, true), Some((b"?".to_vec(), Class::Control)));
    assert_eq!(take(&mut pool, false), None);
    for line in [&b"g1x1"[..], b"g1x2", b"{\"gc\":\"g0\"}"] {
        assert_eq!(take(&mut pool, true), Some((line.to_vec(), Class::Data)));
    }
    assert_eq!(pool.free(), 8);
}

#[test]
fn a_line_that_is_coming_in_survives_removals() {
    let mut pool = pool();
    feed(&mut pool, b"first\nsecond\nthi");
    take(&mut pool, true);
    feed(&mut pool, b"rd\n");
    assert_eq!(take(&mut pool, true).map(|l| l.0), Some(b"second".to_vec()));
    assert_eq!(take(&mut pool, true).map(|l| l.0), Some(b"third".to_vec()));
}

#[test]
fn long_and_damaged_lines_become_one_fault_each() {
    let mut pool = pool();
    feed(&mut pool, &[b'x'; 300]);
    feed(&mut pool, b"\ngood\nbad");
    pool.spoil(Status::BufferFull);
    feed(&mut pool, b"more\nok\n");
    assert_eq!(take(&mut pool, true).map(|l| l.1), Some(Class::Fault(Status::InputTooLong)));
    assert_eq!(take(&mut pool, true).map(|l| l.0), Some(b"good".to_vec()));
    assert_eq!(take(&mut pool, true).map(|l| l.1), Some(Class::Fault(Status::BufferFull)));
    assert_eq!(take(&mut pool, true).map(|l| l.0), Some(b"ok".to_vec()));
}

#[test]
fn a_line_longer_than_the_pool_is_one_fault() {
    let mut pool = LinePool::new(Box::leak(Box::new([0; 20])), 0);
    for line in ["g1 x2 (0123456789)  \r\n", "(0123456789abcdefghi)\n"] {
        feed(&mut pool, line.as_bytes());
        // What is kept of the line leaves room for a control line.
        feed(&mut pool, b"?\n");
        assert_eq!(take(&mut pool, true), Some((b"?".to_vec(), Class::Control)));
        let fault = take(&mut pool, true);
        assert_eq!(fault.map(|line| line.1), Some(Class::Fault(Status::InputTooLong)));
    }
    assert_eq!(take(&mut pool, true), None);
}

#[test]
fn empty_lines_count_where_they_are_wanted() {
    let mut pool = pool();
    feed(&mut pool, b"\r\n\n");
    assert_eq!(pool.free(), 8);
    pool.keep_empty(true);
    feed(&mut pool, b"?\r\n\r\n\n");
    assert_eq!(pool.free(), 5);
    assert_eq!(take(&mut pool, true), Some((b"?".to_vec(), Class::Control)));
    assert_eq!(take(&mut pool, true), Some((b"".to_vec(), Class::Data)));
}

#[test]
fn text_in_pieces_is_text_byte_by_byte() {
    let (mut pieces, mut bytes) = (pool(), pool());
    for round in 0..200 {
        let long = "(".repeat(round * 7 % 300);
        let line = std::format!("  N{round} X1.5\tY2{long}\r\n\n \x01x\ny\r");
        let mut rest = line.as_bytes();
        while !rest.is_empty() {
            assert!(pieces.ready());
            let (count, _) = pieces.put_text(&rest[..rest.len().min(round % 9 + 1)]);
            let count = usize::from(count);
            rest = &rest[count..];
            if count == 0 {
                pieces.put(rest[0]);
                rest = &rest[1..];
            }
        }
        feed(&mut bytes, line.as_bytes());
        for _ in 0..4 {
            assert_eq!(take(&mut pieces, true), take(&mut bytes, true));
        }
    }
}

#[test]
fn lines_taken_whole_are_those_taken_byte_by_byte() {
    for in_order in [false, true] {
        let (mut whole, mut bytes) = (pool(), pool());
        whole.keep_order(in_order);
        bytes.keep_order(in_order);
        for round in 0..200 {
            let long = "x".repeat(round * 7 % 300);
            let line = std::format!("g1x{round}{long}\n\ny2?\r\nm3\rz4\n");
            let mut rest = line.as_bytes();
            let mut at_once = 0u8;
            while !rest.is_empty() {
                // The bytes that have come so far.
                let come = &rest[..rest.len().min(round % 40 + 1)];
                let (count, ends) = whole.put_text(come);
                at_once += u8::from(ends);
                if count == 0 {
                    whole.put(rest[0]);
                }
                rest = &rest[usize::from(count.max(1))..];
            }
            assert_eq!(at_once > 0, round % 40 >= 2, "{round}");
            feed(&mut bytes, line.as_bytes());
            for _ in 0..5 {
                let id = LineId(0);
                assert_eq!(whole.length(id), bytes.length(id));
                assert_eq!(take(&mut whole, true), take(&mut bytes, true));
            }
            assert!(whole.is_empty());
        }
    }
}

#[test]
fn dropped_lines_keep_their_place_and_control_lines_are_none_of_them() {
    let mut pool = pool();
    feed(&mut pool, b"g1x1\n{a:n}\ng1x2\ng1x");
    pool.terminate_partial(Status::Terminated);
    pool.terminate(Status::Terminated);
    feed(&mut pool, b"3\ng1x4\n{b:");
    pool.terminate_partial(Status::Terminated);
    feed(&mut pool, b"n}\n");
    let dropped = Class::Fault(Status::Terminated);
    for (text, class) in [
        ("{a:n}", Class::Control),
        ("{b:n}", Class::Control),
        ("g1x1", dropped),
        ("g1x2", dropped),
        ("", dropped),
        ("g1x4", Class::Data),
    ] {
        assert_eq!(take(&mut pool, true), Some((text.into(), class)));
    }
    assert!(!pool.has_data());
    // Where lines keep their order, the beginning of a dropped line is kept.
    pool.keep_order(true);
    feed(&mut pool, b"g1x");
    pool.terminate_partial(Status::Terminated);
    feed(&mut pool, b"3\n");
    assert_eq!(take(&mut pool, true), Some((b"g1x".to_vec(), dropped)));
    pool.keep_order(false);
    // Between two lines there is nothing to drop.
    pool.terminate_partial(Status::Terminated);
    feed(&mut pool, b"\n");
    assert_eq!(pool.free(), 8);
}

#[test]
fn comments_are_known() {
    for (text, aside) in [
        ("g1 (x", true),
        ("g1 (x; (", true),
        ("g1 (x (y) z", true),
        ("g1 (x (y)) z", false),
        ("g1 (x) y", false),
        ("g1 ; (x)", true),
        ("(x)\n;y\ng1", false),
    ] {
        let mut pool = pool();
        feed(&mut pool, text.as_bytes());
        assert_eq!(pool.aside() != Aside::NONE, aside, "{text}");
        let ahead = text.bytes().fold(Aside::NONE, Aside::after);
        assert_eq!(ahead, pool.aside(), "{text}");
    }
}

#[test]
fn a_percent_sign_that_flushes_nothing_begins_a_name() {
    // The text before the percent sign, the text behind it, and the lines that come of it.
    for (before, behind, lines) in [
        ("", "prog1\n", &["%prog1"][..]),
        ("", " \t1234\r\n", &["%1234"]),
        ("", "_N_A\rg0\r", &["%_N_A", "g0"]),
        ("\r", "Gear\n", &["%Gear"]),
        ("\u{FEFF}", "prog1\n", &["\u{FEFF}%prog1"]),
        ("", "\n", &[]),
        ("\u{FEFF}", "\n", &["\u{FEFF}%"]),
        // These are lines of their own, as behind a flush.
        ("", "\nx1\n", &["x1"]),
        ("", "{a:n}\n", &["{a:n}"]),
        ("", "$x\n", &["$x"]),
        ("", "?g0\n", &["?", "g0"]),
        ("", "(x)\n", &["(x)"]),
        ("g0 ", "x1\n", &["g0 x1"]),
    ] {
        for in_pieces in [false, true] {
            let mut pool = pool();
            feed(&mut pool, before.as_bytes());
            pool.percent();
            let mut rest = behind.as_bytes();
            while !rest.is_empty() {
                let (count, _) = if in_pieces { pool.put_text(rest) } else { (0, false) };
                if count == 0 {
                    pool.put(rest[0]);
                }
                rest = &rest[usize::from(count.max(1))..];
            }
            let mut came = std::vec::Vec::new();
            while let Some((line, _)) = take(&mut pool, true) {
                came.push(std::string::String::from_utf8(line).unwrap());
            }
            assert_eq!(came, lines, "{before:?} % {behind:?}");
        }
    }
    // A flush begins no name, and a printing host has none.
    let mut pool = pool();
    pool.percent();
    feed(&mut pool, b"prog1\n");
    // Real-time characters are not counted.
    assert_eq!(pool.length(LineId(0)), 6);
    assert_eq!(take(&mut pool, true), Some((b"%prog1".to_vec(), Class::Data)));
    // A line may be as long as without the percent sign.
    for (len, class) in [(254, Class::Data), (255, Class::Fault(Status::InputTooLong))] {
        pool.percent();
        let line = [&b"g0 ("[..], &std::vec![b'x'; len - 4], b"\n"].concat();
        feed(&mut pool, &line);
        assert_eq!(pool.length(LineId(0)), len as u16 + 1);
        let (text, is) = take(&mut pool, true).unwrap();
        assert_eq!((&text[..4], is), (&b"g0 ("[..], class), "{len}");
    }
    pool.percent();
    pool.terminate_partial(Status::Terminated);
    feed(&mut pool, b"prog1\n");
    assert_eq!(take(&mut pool, true), Some((b"prog1".to_vec(), Class::Data)));
    pool.keep_plain(true);
    pool.percent();
    feed(&mut pool, b"prog1\n");
    let expected = if cfg!(feature = "dialect-reprap") { "prog1" } else { "%prog1" };
    assert_eq!(take(&mut pool, true), Some((expected.into(), Class::Data)));
}

#[test]
fn a_full_pool_is_not_ready() {
    let mut pool = pool();
    feed(&mut pool, b"1\n2\n3\n4\n5\n6\n7\n8\n");
    assert!(!pool.ready());
    take(&mut pool, true);
    assert!(pool.ready());
}

#[test]
fn every_byte_is_counted_with_some_line() {
    let mut pool = pool();
    let long = [b'x'; 300];
    let mut counted = 0;
    let mut sent = 0;
    for line in [
        &b"g0 x1"[..],
        b"  g0",
        b"\ng0",
        b"\r\n\r\ng0",
        b"\t\n  \n{fb:n}",
        b"g0\r",
        b"g0",
        &long,
        b"",
    ] {
        let line = [line, b"\n"].concat();
        feed(&mut pool, &line);
        sent += line.len();
        while let Some((id, _)) = pool.next(true) {
            counted += usize::from(pool.length(id));
            pool.remove(id);
        }
    }
    // The last line is empty: its byte counts with the next line.
    assert_eq!((sent - counted, pool.besides), (1, 1));
    feed(&mut pool, b"g1\r\ng2\n");
    assert_eq!([pool.length(LineId(0)), pool.length(LineId(1))], [4, 4]);
}

#[test]
fn an_over_long_line_is_known_by_its_beginning() {
    let mut pool = pool();
    feed(&mut pool, b"{");
    (0..300).for_each(|_| feed(&mut pool, b"x"));
    feed(&mut pool, b"\n");
    assert_eq!(pool.length(LineId(0)), 302);
    let (text, class) = take(&mut pool, true).unwrap();
    assert_eq!(class, Class::Fault(Status::InputTooLong));
    assert!(text.starts_with(b"{xxx") && text.len() == usize::from(REST_MAX));
}

#[test]
fn a_question_mark_needs_no_end() {
    let mut pool = pool();
    let mut heard = |text: &[u8]| {
        feed(&mut pool, text);
        let lengths = (0..pool.entries.len()).map(|n| pool.length(LineId(n as u8)));
        let lengths = lengths.collect::<std::vec::Vec<_>>();
        let mut lines = std::vec::Vec::new();
        while let Some((line, class)) = take(&mut pool, true) {
            let text = std::string::String::from_utf8(line).unwrap();
            lines.push((std::string::String::from(text.trim()), class));
        }
        let (text, classes): (std::vec::Vec<_>, std::vec::Vec<_>) = lines.into_iter().unzip();
        (lengths, text.join(" "), classes.last().copied())
    };
    let (lengths, text, last) = heard(b" ??\t?g0x1\n?\n");
    assert_eq!((&lengths[..], &*text), (&[2, 2, 1, 5, 2][..], "? ? ? ? g0x1"));
    assert_eq!(last, Some(Class::Data));
    let (lengths, text, last) = heard(b"? \r\n?{a:n}\n");
    assert_eq!((&lengths[..], &*text), (&[3, 2, 6][..], "? ? {a:n}"));
    assert_eq!(last, Some(Class::Control));
}

#[test]
fn lines_in_order_leave_the_reserve() {
    let mut pool = LinePool::new(Box::leak(Box::new([0; 100])), 20);
    // Both lines begin where a short control line would fit whole.
    feed(&mut pool, b"0123456789012345678901234567890123456789\n");
    assert!(pool.ready());
    feed(&mut pool, b"{a:n}\n0123456789012345");
    assert_eq!(pool.put_text(b"456789"), (6, false));
    assert_eq!(pool.put_text(b"0123456789012345"), (13, false));
    assert!(!pool.ready() && pool.room() == 0);
    assert!(pool.has_reserve(20) && !pool.has_reserve(21));
}

#[test]
fn a_control_line_overtakes_what_is_coming_in() {
    let mut pool = LinePool::new(Box::leak(Box::new([0; 40])), 16);
    let ring: &'static Ring<u8, 32> = Box::leak(Box::new(Ring::new()));
    let (mut put, got) = ring.split().unwrap();
    let mut got = got.into_view();
    for _ in 0..9 {
        feed(&mut pool, b"g1x1\ng1x2 y");
        take(&mut pool, true);
        put.push_all(b"{gc:\"g1\"}{stat:n}".iter().copied());
        let ring = got.window();
        assert!(pool.has_reserve(9) && !pool.is_control(&ring, 0, 9));
        assert!(pool.has_reserve(8) && pool.is_control(&ring, 9, 8));
        pool.put_before(&ring, 9, 8, 1);
        while got.pop().is_some() {}
        assert_eq!(pool.length(LineId(0)), 10);
        feed(&mut pool, b"3\n");
        assert_eq!(take(&mut pool, true), Some((b"{stat:n}".to_vec(), Class::Control)));
        assert_eq!(take(&mut pool, true), Some((b"g1x2 y3".to_vec(), Class::Data)));
    }
}

/// A line of JSON that holds G-code is data from the start. As a control line it would overtake, and outlive a kill.
#[test]
fn json_that_holds_g_code_is_data() {
    for line in [
        r#"{gc:"g1x2"}"#,
        r#"{ "GC" : "g1x2" }"#,
        r#"{tid:1,gc:"g1x2"}"#,
        r#"{"tid" : 1, "tid":2 ,"gc":"g1x2"}"#,
        r#"{txt:"g1x2"}"#,
        r#"{tid:1,txt:" n1 g1"}"#,
        r#"{txt:"h1 g43"}"#,
    ] {
        assert_eq!(pool().classify(line.as_bytes()), Class::Data, "{line}");
    }
    for line in [
        "{gcx:n}",
        "{tid:1}",
        "{tid:1,tid:2}",
        "{tid:1,stat:n}",
        r#"{txt:" $xvm=1"}"#,
        r#"{txt:"?"}"#,
        r#"{msg:"gc:"}"#,
        "{",
        "{tid",
        "{txt:",
    ] {
        assert_eq!(pool().classify(line.as_bytes()), Class::Control, "{line}");
    }
}

/// A control line that was taken in part would wait, and control lines behind it would overtake it.
#[test]
fn a_control_line_comes_whole_or_stays_in_the_ring() {
    let mut pool = LinePool::new(Box::leak(Box::new([0; 40])), 16);
    feed(&mut pool, b"g1x1y1z1\n");
    assert_eq!((pool.room(), pool.ready()), (16, false), "a line end needs room too");
    assert_eq!(pool.put_text(b"{stat:n}"), (0, false));
    assert_eq!(pool.put_text(b"g1x2"), (4, false));
}
