//! Exchanges of lines and answers, byte for byte.

use super::fake::{Chunk, Fake};
use super::notice::{Banner, Exception};
use super::report::queue_report;
use super::*;
use crate::config::Settings;
use crate::machine::Doing;
use crate::motion::snapshot::Program;
use crate::protocol::{Occasion, Remembers};
use crate::status::Status;
use std::format;
use std::string::String;
use std::vec::Vec;

/// Each line is sent to a new machine, and its answer compared.
#[test]
fn answers_as_documented() {
    for (line, answer) in [
        ("{fb:n}", r#"{"r":{"fb":440.20},"f":[1,0,7]}"#),
        ("{xvm:n}", r#"{"r":{"xvm":800},"f":[1,0,7]}"#),
        (r#"{"xvm":1200}"#, r#"{"r":{"xvm":1200},"f":[1,0,7]}"#),
        (
            "{x:n}",
            r#"{"r":{"x":{"am":1,"vm":800,"fr":800,"tn":0.000,"tm":150.000,"jm":1000,"jh":2000,"jd":0.0100,"sn":1,"sx":0,"sv":500,"lv":100,"lb":5.000,"zb":1.000,"ac":200.0,"bl":0.000}},"f":[1,0,7]}"#,
        ),
        ("{x:{vm:1000,fr:n}}", r#"{"r":{"x":{"vm":1000,"fr":800}},"f":[1,0,7]}"#),
        ("g0x10", r#"{"r":{},"f":[1,0,7]}"#),
        (r#"{"gc":"g0x10"}"#, r#"{"r":{},"f":[1,0,7]}"#),
        ("{foo:n}", r#"{"r":{"foo":null},"f":[1,100,7]}"#),
        ("{fb:1}", r#"{"r":{"fb":1},"f":[1,104,7]}"#),
        ("{gun:2}", r#"{"r":{"gun":2},"f":[1,110,7]}"#),
        ("{si:10}", r#"{"r":{"si":100},"f":[1,0,7]}"#),
        ("{qr:n}", r#"{"r":{"qr":32},"f":[1,0,7]}"#),
        ("{rx:n}", r#"{"r":{"rx":7},"f":[1,0,7]}"#),
        (
            "{1mi:3}",
            r#"{"r":{"1mi":3,"msg":"*** WARNING *** Setting non-standard microstep value"},"f":[1,0,7]}"#,
        ),
        (
            "{sr:n}",
            r#"{"r":{"sr":{"posx":0.000,"posy":0.000,"posz":0.000,"posa":0.000,"feed":0.00,"vel":0.00,"unit":1,"coor":1,"dist":0,"frmo":1,"stat":1}},"f":[1,0,7]}"#,
        ),
        ("{sr:{posx:t,stat:t}}", r#"{"r":{"sr":{"posx":0.000,"stat":1}},"f":[1,0,7]}"#),
        ("{sr:{posx:f}}", r#"{"r":{"sr":{"posx":false}},"f":[1,100,7]}"#),
        ("{clear:n}", r#"{"r":{"clear":null},"f":[1,0,7]}"#),
        (r#"{"xvm":}"#, r#"{"r":{"err":"{\"xvm\":}"},"f":[1,111,7]}"#),
        ("", ""),
    ] {
        assert_eq!(Fake::new().ask(line), answer, "{line}");
    }
}

/// Answers of which the exchanges above have no example.
#[test]
fn answers_as_senders_expect() {
    for (line, answer) in [
        ("{}", r#"{"r":{},"f":[1,0,7]}"#),
        ("  ", ""),
        (r#"{"QR":""}"#, r#"{"r":{"qr":32},"f":[1,0,7]}"#),
        ("{xvm:n,xfr:900,2po:t}", r#"{"r":{"xvm":800,"xfr":900,"2po":1},"f":[1,0,7]}"#),
        ("{x:{vm:n},y:{vm:n},jv:n}", r#"{"r":{"x":{"vm":800},"y":{"vm":800},"jv":3},"f":[1,0,7]}"#),
        ("{xvm:900,foo:1,xfr:900}", r#"{"r":{"xvm":900,"foo":null},"f":[1,100,7]}"#),
        ("{x:{foo:1,vm:2},y:n}", r#"{"r":{"x":{"foo":null}},"f":[1,100,7]}"#),
        ("{foo:{a:1}}", r#"{"r":{"foo":null},"f":[1,100,7]}"#),
        ("{x:5}", r#"{"r":{"x":5},"f":[1,103,7]}"#),
        ("{xvm:fast}", r#"{"r":{"err":"{xvm:fast}"},"f":[1,111,7]}"#),
        ("{xvm:nonsense}", r#"{"r":{"err":"{xvm:nonsense}"},"f":[1,111,7]}"#),
        ("{sl:talse}", r#"{"r":{"err":"{sl:talse}"},"f":[1,111,7]}"#),
        ("{sl:fxalse}", r#"{"r":{"err":"{sl:fxalse}"},"f":[1,111,7]}"#),
        ("{sl:True,js:FALSE,xvm:NULL}", r#"{"r":{"sl":1,"js":0,"xvm":800},"f":[1,0,7]}"#),
        (r#"{xvm:"12"}"#, r#"{"r":{"xvm":null},"f":[1,103,7]}"#),
        ("{jv:007}", r#"{"r":{"jv":7},"f":[1,110,7]}"#),
        ("{jv:1.5}", r#"{"r":{"jv":1.5},"f":[1,102,7]}"#),
        ("{stat:1}", r#"{"r":{"stat":1},"f":[1,104,7]}"#),
        ("{sr:{}}", r#"{"r":{"sr":{}},"f":[1,101,7]}"#),
        ("{sr:{foo:t}}", r#"{"r":{"sr":{"foo":null}},"f":[1,100,7]}"#),
        ("{sr:{foo:t,vel:t,x:t,vel:t},qr:n}", r#"{"r":{"sr":{"vel":0.00},"qr":32},"f":[1,0,7]}"#),
        ("{sys:{jv:n,xvm:n}}", r#"{"r":{"sys":{"jv":3,"xvm":800}},"f":[1,0,7]}"#),
        ("{4:{tr:n}}", r#"{"r":{"4":{"tr":360.0000}},"f":[1,0,7]}"#),
        ("{pos:{x:n}}", r#"{"r":{"pos":{"x":0.000}},"f":[1,0,7]}"#),
        (
            "{mpo:n}",
            r#"{"r":{"mpo":{"x":-214748.365,"y":-214748.365,"z":-214748.365,"a":-214748.365,"b":-214748.365,"c":-214748.365}},"f":[1,0,7]}"#,
        ),
        ("{pwr:n}", r#"{"r":{"pwr":{"1":0,"2":0,"3":0,"4":0}},"f":[1,0,7]}"#),
        ("{me:2,pwr:n}", r#"{"r":{"me":2,"pwr":{"1":0,"2":1,"3":0,"4":0}},"f":[1,0,7]}"#),
        ("{me:n,md:1,pwr1:n}", r#"{"r":{"me":null,"md":1,"pwr1":0},"f":[1,0,7]}"#),
        ("{md:5}", r#"{"r":{"md":5},"f":[1,110,7]}"#),
        ("{clr:null}", r#"{"r":{"clr":null},"f":[1,0,7]}"#),
        ("{spc:n}", r#"{"r":{"spc":null},"f":[1,100,7]}"#),
        ("{mt:n}", r#"{"r":{"mt":2.00},"f":[1,0,7]}"#),
        ("{id:n}", r#"{"r":{"id":"0000-KERF"},"f":[1,0,7]}"#),
        ("{gc:\"g0x1\",xvm:n}", r#"{"r":{"xvm":800},"f":[1,0,7]}"#),
        ("{xvm:n,gc:\"g0x1\"}", r#"{"r":{"xvm":800,"gc":null},"f":[1,106,7]}"#),
        ("{xvm:900,yvm", r#"{"r":{"err":"{xvm:900,yvm"},"f":[1,111,7]}"#),
        ("g0x1 (msg hello)", r#"{"r":{"msg":" hello"},"f":[1,0,7]}"#),
        ("g0x1 (just a comment)", r#"{"r":{},"f":[1,0,7]}"#),
    ] {
        assert_eq!(Fake::new().ask(line), answer, "{line}");
    }
}

#[test]
fn a_malformed_line_does_nothing() {
    let mut fake = Fake::new();
    fake.ask("{xvm:900,gc:\"g0\",yvm");
    assert!(fake.blocks.is_empty());
    assert_eq!(fake.settings.velocity_max(0), Settings::new().velocity_max(0));
}

#[test]
fn blocks_are_run_and_answered_with_their_status() {
    let mut fake = Fake::new();
    fake.outcome = Status::FeedrateMissing;
    assert_eq!(fake.ask(" G1 X10"), r#"{"r":{},"f":[1,142,7]}"#);
    assert_eq!(fake.ask(r#"{"gc":"g1 x10",xvm:900}"#), r#"{"r":{},"f":[1,142,7]}"#);
    assert_eq!(fake.blocks, ["G1 X10", "g1 x10"]);
    assert_eq!(fake.ask("{xvm:n}"), r#"{"r":{"xvm":800},"f":[1,0,7]}"#);
}

#[test]
fn verbosity_shows_more_and_more() {
    let mut fake = Fake::new();
    fake.line = 20;
    let block = "n20 g0x10 (MSG \"hi\")";
    for (jv, setting, answer) in [
        (0, "", ""),
        (1, r#"{"r":{},"f":[1,0,7]}"#, r#"{"r":{},"f":[1,0,7]}"#),
        (2, r#"{"r":{},"f":[1,0,7]}"#, r#"{"r":{"msg":" \"hi\""},"f":[1,0,7]}"#),
        (3, r#"{"r":{"jv":3},"f":[1,0,7]}"#, r#"{"r":{"msg":" \"hi\""},"f":[1,0,7]}"#),
        (4, r#"{"r":{"jv":4},"f":[1,0,7]}"#, r#"{"r":{"msg":" \"hi\"","n":20},"f":[1,0,7]}"#),
        (
            5,
            r#"{"r":{"jv":5},"f":[1,0,7]}"#,
            r#"{"r":{"gc":"N20G0X10","msg":" \"hi\"","n":20},"f":[1,0,7]}"#,
        ),
    ] {
        assert_eq!(fake.ask(&format!("{{jv:{jv}}}")), setting);
        assert_eq!(fake.ask(block), answer);
    }
    fake.line = 0;
    assert_eq!(fake.ask("g0x10"), r#"{"r":{"gc":"G0X10"},"f":[1,0,7]}"#);
    assert_eq!(fake.ask("{js:0}"), r#"{r:{js:0},f:[1,0,7]}"#);
}

#[test]
fn cncjs_connects() {
    let mut fake = Fake::new();
    let request = "{sr:{stat:t,line:t,vel:t,feed:t,unit:t,coor:t,momo:t,plan:t,path:t,dist:t,\
                   admo:t,frmo:t,tool:t,posx:t,posy:t,posz:t,posa:t,posb:t,posc:t,mpox:t,mpoy:t,\
                   mpoz:t,mpoa:t,mpob:t,mpoc:t,sps:t,com:t,cof:t,tofx:t,tofy:t,tofz:t,tofa:t}}";
    assert!(request.len() <= 254, "{}", request.len());
    let answer = fake.ask(request);
    assert!(answer.starts_with(r#"{"r":{"sr":{"stat":1,"line":0,"vel":0.00,"#), "{answer}");
    assert!(answer.ends_with(r#""tofa":0.000}},"f":[1,0,7]}"#), "{answer}");
    assert!(answer.contains("admo"));
    assert!(fake.ask("{sys:n}").starts_with(
        r#"{"r":{"sys":{"fb":440.20,"fv":0.970,"hp":1,"hv":8,"id":"0000-KERF","ja":720000,"#
    ));
}

#[test]
fn a_report_has_room_for_what_senders_ask() {
    let mut fake = Fake::new();
    let pairs =
        |names: &[&str]| names.iter().map(|n| format!("{n}:t")).collect::<Vec<_>>().join(",");
    let names: Vec<String> = "xyzabc"
        .chars()
        .flat_map(|a| ["am", "vm", "fr", "tn", "tm", "jm", "jd"].map(|s| format!("{a}{s}")))
        .collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    assert!(fake.ask(&format!("{{sr:{{{}}}}}", pairs(&names[..36]))).ends_with("[1,0,7]}"));
    assert_eq!(fake.ask("{sr:n}").matches("vm").count(), 5);
    let mut report = StatusReport::new();
    report.clear();
    let token = |number: u16| Token::numbered(number * 13);
    for number in 0..36 {
        assert!(report.add(token(number)));
    }
    assert!(report.add(token(0)));
    assert!(!report.add(token(36)));
    assert!((0..36).all(|index| report.token(index) == Some(token(index.into()))));
    assert_eq!(report.token(36), None);
}

#[test]
fn inches_are_spoken() {
    let mut fake = Fake::new();
    fake.inches = true;
    fake.position = 508_000;
    assert_eq!(
        fake.ask("{posx:n,xvm:50,xtm:n}"),
        r#"{"r":{"posx":2.000,"xvm":50,"xtm":5.906},"f":[1,0,7]}"#
    );
}

#[test]
fn text_is_answered_with_prompts() {
    let mut fake = Fake::new();
    fake.rest = Program::Stopped;
    let screen = fake.ask("?");
    assert_eq!(fake.mode, Mode::Text);
    for (line, expected) in screen.lines().zip([
        "X position:          0.000 mm",
        "Y position:          0.000 mm",
        "Z position:          0.000 mm",
        "A position:          0.000 deg",
        "Feed rate:           0.000 mm/min",
        "Velocity:            0.000 mm/min",
        "Units:               G21 - millimeter mode",
        "Coordinate system:   G54 - coordinate system 1",
        "Distance mode:       G90 - absolute distance mode",
        "Feed rate mode:      G94 - units-per-minute mode (i.e. feedrate mode)",
        "Machine state:       Stop",
        "tinyg [mm] ok> ",
    ]) {
        assert_eq!(line, expected);
    }
    assert_eq!(screen.lines().count(), 12);
    assert_eq!(fake.ask("g0x0 (msg hello)"), "tinyg [mm] ok>  hello");
    assert_eq!(fake.ask(""), "tinyg [mm] ok> ");
    assert_eq!(fake.ask("$xvm"), "[xvm] x velocity maximum        800 mm/min\ntinyg [mm] ok> ");
    fake.outcome = Status::FeedrateMissing;
    assert_eq!(fake.ask("g1x10"), "tinyg [mm] err: Feedrate not specified: g1x10 ");
    fake.inches = true;
    assert_eq!(fake.ask("{tv:0}"), r#"{"r":{"tv":0},"f":[1,0,7]}"#);
    assert_eq!(fake.mode, Mode::Json);
    fake.mode = Mode::Text;
    assert_eq!(fake.ask("g1x10"), "");
}

#[test]
fn the_screen_shows_any_token() {
    let mut fake = Fake::new();
    fake.ask("{sr:{line:t,momo:t,tool:t,mpox:t,ofsx:t,homx:t,hold:t,xvm:t,mt:t,id:t,pwr1:t}}");
    let screen = fake.ask("?");
    let expected = [
        "Line number:         0",
        "Motion mode:         G80 - cancel motion mode (none active)",
        "Tool number          0",
        "X machine posn:-214748.365 mm",
        "X work offset:       0.000 mm",
        "X axis homing state: 0",
        "Feedhold state:      Off",
        "[xvm] x velocity maximum        800 mm/min",
        "[mt]  motor idle timeout          2.00 Sec",
        "[id]  TinyG ID                    0000-KERF",
        "pwr1:                0",
    ];
    assert_eq!(screen.lines().take(11).collect::<Vec<_>>(), expected);
}

/// Returns everything that `step` writes.
fn all(mut step: impl FnMut(&mut Chunk) -> bool) -> String {
    let mut all = Vec::new();
    loop {
        let mut chunk = Chunk::default();
        let more = step(&mut chunk);
        all.extend(chunk.bytes);
        if !more {
            return String::from_utf8(all).unwrap();
        }
    }
}

fn automatic(fake: &mut Fake, mode: Mode) -> String {
    let Some(mut report) = Report::begin(mode, fake) else { return String::from("none") };
    all(|out| report.step(fake, out))
}

#[test]
fn automatic_reports_tell_what_changed() {
    let mut fake = Fake::new();
    assert!(automatic(&mut fake, Mode::Json).starts_with(r#"{"sr":{"posx":0.000,"posy""#));
    assert_eq!(automatic(&mut fake, Mode::Json), "");
    fake.position = 100_900;
    fake.rest = Program::Stopped;
    assert_eq!(automatic(&mut fake, Mode::Json), "{\"sr\":{\"posx\":10.090,\"stat\":3}}\n");
    // A change smaller than the last decimal shown does not count.
    fake.position = 100_901;
    assert_eq!(automatic(&mut fake, Mode::Json), "");
    fake.doing = Doing::Runs;
    fake.position = 0;
    assert_eq!(automatic(&mut fake, Mode::Text), "posx:0.000,stat:5\n");
    fake.ask("{sr:{stat:t}}");
    assert_eq!(automatic(&mut fake, Mode::Json), "{\"sr\":{\"stat\":5}}\n");
    fake.ask("{sv:2}");
    assert_eq!(automatic(&mut fake, Mode::Json), "{\"sr\":{\"stat\":5}}\n");
    fake.ask("{sv:0}");
    assert_eq!(automatic(&mut fake, Mode::Json), "none");
}

#[test]
fn queue_reports_tell_as_much_as_wanted() {
    let mut fake = Fake::new();
    for (qv, mode, expected) in [
        (0, Mode::Json, ""),
        (1, Mode::Json, "{\"qr\":32}\n"),
        (2, Mode::Json, "{\"qr\":32,\"qi\":0,\"qo\":0}\n"),
        (1, Mode::Text, "qr:32\n"),
        (3, Mode::Text, "qr:32,qi:0,qo:0\n"),
    ] {
        fake.ask(&format!("{{qv:{qv}}}"));
        let mut chunk = Chunk::default();
        queue_report(mode, &mut fake, &mut chunk);
        assert_eq!(chunk.bytes, expected.as_bytes());
    }
}

#[test]
fn notices_are_as_documented() {
    let mut banner = Banner::begin(Occasion::Ready, &Settings::new());
    assert_eq!(
        all(|out| banner.step(&mut Fake::new(), out)),
        "{\"r\":{\"fv\":0.970,\"fb\":440.20,\"hp\":1,\"hv\":8,\"id\":\"0000-KERF\",\
         \"kerf\":\"0.1.0\",\"msg\":\"SYSTEM READY\"},\"f\":[1,0,0]}\n"
            .replace("0.1.0", crate::config::VERSION)
    );
    for (status, text) in [
        (Status::BufferFull, "{\"er\":{\"fb\":440.20,\"st\":13,\"msg\":\"Buffer full\"}}\n"),
        (
            Status::ArcRadiusTolerance,
            "{\"er\":{\"fb\":440.20,\"st\":158,\
             \"msg\":\"Arc specification error - radius arc out of tolerance\"}}\n",
        ),
    ] {
        let mut exception = Exception::begin(status, &Settings::new());
        assert_eq!(all(|out| exception.step(&mut Fake::new(), out)), text);
    }
}

#[test]
fn ram_is_accounted_for() {
    assert_eq!(size_of::<Request>(), 24);
    assert_eq!(size_of::<StatusReport>(), 151);
    assert_eq!(size_of::<Report>(), 6);
    // With the number of a line of a file, which images without a card do not have.
    assert_eq!((size_of::<Banner>(), size_of::<Exception>()), (4, 12));
}
