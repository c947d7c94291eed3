//! Properties that hold for any line.

use super::Mode;
use super::fake::Fake;
use crate::config::{Name, Setting};
use crate::status::Status;
use proptest::prelude::*;
use std::string::String;
use std::vec::Vec;
use std::{format, vec};

/// Whether an answer is nested, separated and quoted as JSON requires.
#[small]
fn is_json(answer: &[u8]) -> bool {
    let (mut depth, mut quoted, mut escaped, mut last) = (0, false, false, b' ');
    let mut separated = true;
    for &byte in answer {
        match byte {
            _ if escaped => {
                escaped = false;
                separated &= matches!(byte, b'"' | b'\\' | b'n');
            }
            b'\\' => escaped = true,
            b'"' => quoted = !quoted,
            _ if quoted && byte < b' ' => separated = false,
            _ if quoted => {}
            b'{' | b'[' => depth += 1,
            b'}' | b']' => depth -= 1,
            _ => {}
        }
        if !quoted {
            separated &= !matches!((last, byte), (b'{' | b',' | b':', b',' | b':') | (b',', b'}'));
            last = byte;
        }
    }
    depth == 0 && !quoted && separated
}

/// Lines that make sense, or nearly make sense.
#[small]
fn lines() -> impl Strategy<Value = Vec<u8>> {
    let word = || {
        prop::sample::select(vec![
            "{", "}", "{sr:{", "x", "xvm", "\"", ":", ",", "n", "t", "f", "gc", "\\", "1", "-1.5",
            "posx", "stat", "1mi", "(msg ", ")", " ", "g0x1", "?", "$", "jv", "js", "sys", "é",
            "h", "defa", "=", ",", "m",
        ])
    };
    let sensible = prop::collection::vec(word(), 0..60).prop_map(|w| w.concat().into_bytes());
    let pair = (
        prop::sample::select(vec![
            "xvm",
            "x",
            "sr",
            "sys",
            "1mi",
            "jv",
            "js",
            "stat",
            "foo",
            "\"GC\"",
            "clear",
            "me",
            "vm",
            "pos",
            "fb",
            "defa",
            "help",
            "txt",
            "tid",
            "msg",
            "rxm",
            "boot",
            "aReallyVeryLongNameThatNobodyHas",
        ]),
        prop::sample::select(vec![
            "n",
            "t",
            "f",
            "\"\"",
            "1",
            "-0012345678.123456789e-1",
            "3.5",
            "\"g0x1 (msg \\\"a)\"",
            "\"g0 (msg a\\\\\\q)\"",
            "\"$x\"",
            "\"?\"",
            "\"{fb:n}\"",
            "\"$foo=\\\"\"",
            "{}",
            "{vm:1,fr:n}",
            "{posx:t,foo:t}",
            "{stat:f}",
            "{mi:16,foo:true}",
            "{x:n}",
        ]),
    );
    let valid = prop::collection::vec(pair, 0..8).prop_map(|pairs| {
        let pairs: Vec<_> = pairs.iter().map(|(name, value)| format!("{name}:{value}")).collect();
        format!("{{{}}}", pairs.join(",")).into_bytes()
    });
    prop_oneof![sensible, valid, prop::collection::vec(any::<u8>(), 0..300)]
}

#[small]
fn sets_style(line: &[u8]) -> bool {
    line.windows(2).any(|pair| pair.eq_ignore_ascii_case(b"js"))
}

/// All names that a line can read.
fn askable() -> Vec<String> {
    let mut names: Vec<String> =
        ["", "$", "o", "m", "q", "g", "h", "prog", "test", "defa", "boot", "me", "sr", "qr"]
            .map(String::from)
            .into();
    let own = |c: &char| c.is_ascii_lowercase() || c.is_ascii_digit();
    let letters: Vec<char> = ('0'..='z').filter(own).collect();
    // Names of groups and settings have five characters at most. Longer ones begin with the name of their group.
    names.extend(letters.iter().map(|letter| format!("{letter}")));
    names.extend(
        (0..Setting::NUMBERS)
            .filter_map(Setting::from_number)
            .map(|setting| String::from_utf8_lossy(setting.name().bytes()).into_owned()),
    );
    for group in [
        "sys", "p1", "sr", "ofs", "tof", "cof", "pos", "mpo", "hom", "prb", "pwr", "com", "_te",
        "_tr", "_ts", "_ps", "_cs", "_es", "_xs", "_fe", "di", "in", "out",
    ] {
        names.push(group.into());
    }
    let systems = ["g54", "g55", "g59", "g28", "g30", "g92", "tt1", "tt10"];
    for group in systems {
        names.push(group.into());
        names.extend("xyzabc".chars().map(|axis| format!("{group}{axis}")));
    }
    names
}

#[test]
fn every_line_with_a_brace_is_json() {
    for (dia, rxm) in [(0, 1), (0, 0), (1, 1)] {
        for name in askable() {
            for line in [
                format!("{{txt:\"${name}\"}}"),
                format!("{{{name}:n}}"),
                format!("{{txt:\"{name}\"}}"),
                format!("${name}"),
                name.clone(),
            ] {
                let mut fake = Fake::new();
                for (name, value) in [("rxm", rxm), ("dia", dia)] {
                    let name = Name::new().with(name.as_bytes()).unwrap();
                    fake.settings.store(Setting::find(&name).unwrap(), value);
                }
                let answer = fake.send(line.as_bytes());
                for told in
                    answer.split(|byte| *byte == b'\n').filter(|told| told.starts_with(b"{"))
                {
                    assert!(is_json(told), "{line}: {}", String::from_utf8_lossy(told));
                }
            }
        }
    }
}

proptest! {
    #[test]
    fn every_line_gets_one_response(
        line in lines(), mode in 0..2u8, status in 0..3usize, variation in 0..3u8,
    ) {
        let mut fake = Fake::new();
        for (name, value) in [("rxm", variation != 1), ("dia", variation == 2)] {
            let setting = Setting::find(&Name::new().with(name.as_bytes()).unwrap()).unwrap();
            fake.settings.store(setting, value.into());
        }
        fake.mode = if mode == 0 { Mode::Json } else { Mode::Text };
        fake.outcome = [Status::Ok, Status::InverseTimeNotAllowed, Status::Noop][status];
        let answer = fake.send(&line);
        let blank = line.iter().all(|b| matches!(b, b' ' | b'\t')) && line.len() < 256;
        let lines = answer.iter().filter(|&&b| b == b'\n').count();
        let responses = answer.split(|&b| b == b'\n').filter(|l| l.starts_with(b"{\"r\":")).count();
        match fake.mode {
            Mode::Json if blank => prop_assert!(answer.is_empty()),
            // The line itself may have changed verbosity and style.
            Mode::Json if fake.settings.json_verbosity() == 0 => {}
            // A line that sets the style twice may be answered in a style other than the last.
            Mode::Json if !fake.settings.json_strict() || sets_style(&line) => {
                prop_assert_eq!(lines, 1);
            }
            Mode::Json => {
                prop_assert_eq!((lines, responses), (1, 1));
                prop_assert!(is_json(&answer), "{:?}", String::from_utf8_lossy(&answer));
            }
            Mode::Text => {
                let last = answer.trim_ascii_end().rsplit(|&b| b == b'\n').next();
                let prompts: [&[u8]; 2] = [b"tinyg [", b"g2core["];
                prop_assert!(last.is_some_and(|last| prompts.iter().any(|p| last.starts_with(p))));
                // `$$` is the longest answer.
                prop_assert!(lines < 300);
            }
        }
        prop_assert!(answer.is_empty() || answer.ends_with(b"\n"));
        prop_assert!(answer.is_ascii());
    }
}
