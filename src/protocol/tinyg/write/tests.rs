use super::*;
use crate::config::{Name, Setting, Settings};
use crate::protocol::Checksum;
use crate::text;
use std::string::String;
use std::vec::Vec;

impl Out for Vec<u8> {
    fn put(&mut self, byte: u8) {
        self.push(byte);
    }
    fn begin_sum(&mut self) {}
    fn take_sum(&mut self) -> u16 {
        let mut sum = Checksum::default();
        self.iter().for_each(|byte| sum.add(*byte));
        sum.value()
    }
}

const ENDING: Ending = Ending { free: 7, length: 12 };

fn settings(pairs: &[(&str, i32)]) -> Settings {
    let mut settings = Settings::new();
    for (name, value) in pairs {
        let setting = Setting::find(&Name::new().with(name.as_bytes()).unwrap()).unwrap();
        settings.store(setting, *value);
    }
    settings
}

fn written(mut format: Format) -> String {
    let mut out = Vec::new();
    Writer::frame(&mut out, &mut format).begin_response();
    let mut writer = Writer::body(&mut out, &mut format);
    writer.key(b"A");
    writer.open();
    writer.key_text(text!("a"));
    writer.fixed(Fixed { value: -1500, decimals: 3 });
    writer.close();
    let mut writer = Writer::message(&mut out, &mut format);
    writer.key(b"msg");
    writer.string(text!("c"));
    Writer::frame(&mut out, &mut format).end_response(Status::Noop, ENDING);
    String::from_utf8(out).unwrap()
}

#[test]
fn writes_json() {
    let expected = "{\"r\":{\"a\":{\"a\":-1.500},\"msg\":\"c\"},\"f\":[1,3,7]}\n";
    assert_eq!(written(Format::json(&settings(&[]))), expected);
    let relaxed = "{r:{a:{a:-1.500},msg:\"c\"},f:[1,3,7]}\n\r";
    assert_eq!(written(Format::json(&settings(&[("js", 0), ("ec", 1)]))), relaxed);
}

#[test]
fn an_empty_response_is_what_its_parts_are() {
    for pair in ["ja", "js", "rxm", "dia", "ec"] {
        for status in [Status::Ok, Status::BufferFull, Status::LimitHit] {
            let settings = settings(&[(pair, i32::from(pair != "js" && pair != "rxm"))]);
            let (mut parts, mut whole) = (Vec::new(), Vec::new());
            let mut format = Format::response(&settings);
            Writer::frame(&mut parts, &mut format).begin_response();
            Writer::frame(&mut parts, &mut format).end_response(status, ENDING);
            let mut format = Format::response(&settings);
            Writer::frame(&mut whole, &mut format).empty_response(status, ENDING);
            assert_eq!(parts, whole);
        }
    }
}

#[test]
fn verbosity_hides() {
    let at = |jv, rxm| written(Format::response(&settings(&[("jv", jv), ("rxm", rxm)])));
    let bodies =
        ["{}", "{\"msg\":\"c\"}", "{\"a\":{\"a\":-1.500},\"msg\":\"c\"}", "{\"a\":{\"a\":-1.500}}"];
    let body = |text: String| text.split(",\"f\"").next().unwrap().replace("{\"r\":", "");
    assert_eq!([at(0, 1), at(0, 0)], ["", ""]);
    assert_eq!([1, 2, 3, 5].map(|jv| body(at(jv, 1))), [0, 1, 2, 2].map(|i| bodies[i]));
    assert_eq!([1, 2, 3, 5].map(|jv| body(at(jv, 0))), [3, 2, 2, 2].map(|i| bodies[i]));
}

#[test]
fn lines_in_a_string_are_escaped() {
    let mut out = Vec::new();
    let mut format = Format::json(&settings(&[("ec", 1)]));
    format.wrap(true);
    let mut writer = Writer::body(&mut out, &mut format);
    writer.text(text!("a\"b"));
    writer.byte(b'\\');
    writer.end_line();
    assert_eq!(out, br#"a\"b\\\n"#);
}

#[test]
fn foreign_text_is_escaped() {
    let mut out = Vec::new();
    let mut format = Format::json(&settings(&[]));
    let mut writer = Writer::body(&mut out, &mut format);
    b"a\"\\\n\xff".iter().for_each(|&b| writer.escaped(b));
    assert_eq!(out, br#"a\"\\??"#);
}

/// Responses recorded from another manufacturer's machine. A transcript has those recorded responses that answer a
/// line.
#[test]
fn checksums_are_those_of_real_machines() {
    let respond = |status, length, fill: &dyn Fn(&mut Writer<Vec<u8>>)| {
        let mut out = Vec::new();
        let mut format = Format::response(&settings(&[("rxm", 0)]));
        let mut writer = Writer::frame(&mut out, &mut format);
        writer.begin_response();
        fill(&mut writer);
        writer.end_response(status, Ending { free: 7, length });
        String::from_utf8(out).unwrap()
    };
    let probe = |x: i32, y: i32, z: i32| {
        respond(Status::Ok, 0, &|writer| {
            writer.key(b"prb");
            writer.open();
            writer.key(b"e");
            writer.fixed(Fixed::int(1));
            for (name, value) in [("x", x), ("y", y), ("z", z), ("a", 0), ("b", 0), ("c", 0)] {
                writer.key(name.as_bytes());
                writer.fixed(Fixed { value, decimals: 3 });
            }
            writer.close();
        })
    };
    let probed = r#"{"r":{"prb":{"e":1,"x":20.000,"y":20.000,"z":-38.910,"a":0.000,"b":0.000,"c":0.000}},"f":[1,0,0,1397]}"#;
    assert_eq!(probe(20_000, 20_000, -38_910).trim_end(), probed);
    let probed = r#"{"r":{"prb":{"e":1,"x":0.000,"y":0.000,"z":0.259,"a":0.000,"b":0.000,"c":0.000}},"f":[1,0,0,9523]}"#;
    assert_eq!(probe(0, 0, 259).trim_end(), probed);
    let restored = respond(Status::Initializing, 14, &|writer| {
        let numbers = [("fv", 970, 3), ("fb", 44_020, 2), ("hp", 1, 0), ("hv", 8, 0)];
        for (name, value, decimals) in numbers {
            writer.key(name.as_bytes());
            writer.fixed(Fixed { value, decimals });
        }
        writer.key(b"id");
        writer.string(text!("3Y2462-VUN"));
        writer.key(b"msg");
        writer.string(text!("Initializing configs to default settings"));
    });
    let expected = r#"{"r":{"fv":0.970,"fb":440.20,"hp":1,"hv":8,"id":"3Y2462-VUN","msg":"Initializing configs to default settings"},"f":[1,15,14,6629]}"#;
    assert_eq!(restored.trim_end(), expected);
}
