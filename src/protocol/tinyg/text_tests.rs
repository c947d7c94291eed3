//! Text mode, byte for byte.

use super::fake::Fake;
use super::*;
use crate::machine::Doing;
use crate::status::Status;
use std::string::String;
use std::vec::Vec;

const OK: &str = "tinyg [mm] ok> ";

/// Returns what a new machine answers to a line, without the prompt.
fn listed(line: &str) -> String {
    let answer = Fake::new().ask(line);
    let listing = answer.strip_suffix(OK).expect("a prompt that says ok");
    String::from(listing.strip_suffix('\n').unwrap_or(listing))
}

#[test]
fn one_setting_is_a_line() {
    for line in [
        "[fb]  firmware build            440.20",
        "[fv]  firmware version            0.97",
        "[hp]  hardware platform           1.00",
        "[hv]  hardware version            8.00",
        "[id]  TinyG ID                    0000-KERF",
        "[ja]  junction acceleration  720000 mm",
        "[ct]  chordal tolerance           0.0100 mm",
        "[sl]  soft limit enable           0",
        "[st]  switch type                 0 [0=NO,1=NC]",
        "[mt]  motor idle timeout          2.00 Sec",
        "[ej]  enable json mode            1 [0=text,1=JSON]",
        "[jv]  json verbosity              3 [0=silent,1=footer,2=messages,3=configs,4=linenum,5=verbose]",
        "[js]  json serialize style        1 [0=relaxed,1=strict]",
        "[tv]  text verbosity              1 [0=silent,1=verbose]",
        "[qv]  queue report verbosity      0 [0=off,1=single,2=triple]",
        "[sv]  status report verbosity     1 [0=off,1=filtered,2=verbose]",
        "[si]  status interval           500 ms",
        "[ec]  expand LF to CRLF on TX     0 [0=off,1=on]",
        "[ee]  enable echo                 0 [0=off,1=on]",
        "[ex]  enable flow control         1 [0=off,1=XON/XOFF,2=RTS/CTS]",
        "[baud] USB baud rate              5 [1=9600,2=19200,3=38400,4=57600,5=115200,6=230400]",
        "[gpl] default gcode plane         0 [0=G17,1=G18,2=G19]",
        "[gun] default gcode units mode    1 [0=G20,1=G21]",
        "[gco] default gcode coord system  1 [1-9 (G54-G59.3)]",
        "[gpa] default gcode path control  2 [0=G61,1=G61.1,2=G64]",
        "[gdi] default gcode distance mode 0 [0=G90,1=G91]",
        "[bd]  block delete                1 [0=off,1=on]",
        "[spw] step pulse width            2 us",
        "[1ma] m1 map to axis              0 [0=X,1=Y,2=Z...]",
        "[1sa] m1 step angle               1.800 deg",
        "[1tr] m1 travel per revolution    1.2500 mm",
        "[4tr] m4 travel per revolution  360.0000 deg",
        "[1mi] m1 microsteps               8 [1,2,4,8]",
        "[1po] m1 polarity                 0 [0=normal,1=reverse]",
        "[1pm] m1 power management         2 [0=disabled,1=always on,2=in cycle,3=when moving]",
        "[xam] x axis mode                 1 [standard]",
        "[aam] a axis mode                 1 [standard]",
        "[bam] b axis mode                 0 [disabled]",
        "[xvm] x velocity maximum        800 mm/min",
        "[avm] a velocity maximum       7200 deg/min",
        "[xfr] x feedrate maximum        800 mm/min",
        "[xtn] x travel minimum            0.000 mm",
        "[atn] a travel minimum           -1.000 deg",
        "[xtm] x travel maximum          150.000 mm",
        "[xjm] x jerk maximum           1000 mm/min^3 * 1 million",
        "[xjh] x jerk homing            2000 mm/min^3 * 1 million",
        "[xjd] x junction deviation        0.0100 mm (larger is faster)",
        "[xsn] x switch min                1 [0=off,1=homing,2=limit,3=limit+homing]",
        "[xsx] x switch max                0 [0=off,1=homing,2=limit,3=limit+homing]",
        "[xsv] x search velocity         500 mm/min",
        "[xlv] x latch velocity          100 mm/min",
        "[xlb] x latch backoff             5.000 mm",
        "[xzb] x zero backoff              1.000 mm",
        "[ara] a radius value              0.1989 deg",
        "[xac] x acceleration maximum    200.0 mm/s^2 (0 is none)",
    ] {
        let name = line[1..].split(']').next().unwrap();
        assert_eq!(listed(&std::format!("${name}")), line);
    }
}

#[test]
fn values_are_lines_too() {
    assert_eq!(listed("$posx"), "X position:          0.000 mm");
    assert_eq!(listed("$stat"), "Machine state:       Ready");
    assert_eq!(listed("$qr"), "qr:                 32");
    assert_eq!(listed("$pos").lines().count(), 6);
    assert_eq!(listed("$sr"), listed("?"));
}

#[test]
fn groups_list_what_they_have() {
    let names = |line: &str| -> String {
        let lines = listed(line);
        let names = lines.lines().map(|line| line[1..].split(']').next().unwrap());
        names.collect::<Vec<_>>().join(" ")
    };
    let (sys, axis) = (names("$sys"), names("$b"));
    assert!(sys.starts_with(
        "fb fv hp hv id ja ct sl st mt ej jv js tv qv sv si ec ee ex rxm baud net gpl"
    ));
    assert_eq!(names("$"), sys);
    assert_eq!(axis, "bam bvm bfr btn btm bjm bjd bra bac");
    assert_eq!(names("$1"), "1ma 1sa 1tr 1mi 1po 1pm 1sp");
    assert_eq!(names("$m").split(' ').count(), 4 * 7);
    assert_eq!(names("$q").split(' ').count(), 3 * 16 + 17 + 2 * 9);
    let systems = ["g54", "g55", "g56", "g57", "g58", "g59", "g591", "g592", "g593"];
    let places = systems.iter().chain(&["g92", "g28", "g30"]);
    let places: Vec<String> = places.map(|group| names(&std::format!("${group}"))).collect();
    assert_eq!(
        names("$$"),
        [
            sys,
            names("$m"),
            names("$q"),
            names("$p1"),
            names("$sp"),
            names("$co"),
            names("$sq"),
            places.join(" ")
        ]
        .join(" ")
    );
    assert_eq!(listed("$o").lines().count(), places.len() * 6 + 12);
}

#[test]
fn settings_are_set_and_shown() {
    for line in ["$xvm=1200", "$xvm 1200", "$XVM:1,200", "  $xvm | 1200.0 ", "$xvm\t1.2e3"] {
        assert_eq!(listed(line), "[xvm] x velocity maximum       1200 mm/min", "{line}");
    }
    let mut fake = Fake::new();
    fake.inches = true;
    let answer = "[xtm] x travel maximum            1.500 in\ntinyg [inch] ok> ";
    assert_eq!(fake.ask("$xtm=1.5"), answer);
    assert_eq!(fake.settings.travel_max(0).0, 381_000);
    assert_eq!(
        Fake::new().ask("$1mi=3"),
        "[1mi] m1 microsteps               3 [1,2,4,8]\n\
         tinyg [mm] ok> *** WARNING *** Setting non-standard microstep value"
    );
}

#[test]
fn what_is_refused_says_why() {
    for (line, text) in [
        ("$foo", "Unrecognized command or config name"),
        ("$velocity", "Unrecognized command or config name"),
        ("$x=5", "Unrecognized command or config name"),
        ("$m=5", "Unrecognized command or config name"),
        ("$=5", "Unrecognized command or config name"),
        ("$gc", "Unrecognized command or config name"),
        ("$defaults=1", "Unrecognized command or config name"),
        ("$xvm=abc", "Bad number format"),
        ("$xvm=0x1", "Bad number format"),
        ("$jv=9", "Input value range error"),
        ("$fb=1", "Parameter is read-only"),
        ("$posx=1", "Parameter is read-only"),
        ("$me=5", "Input value range error"),
    ] {
        let answer = std::format!("tinyg [mm] err: {text}: {line} ");
        assert_eq!(Fake::new().ask(line), answer);
    }
}

#[test]
fn prompts_can_be_silenced() {
    let mut fake = Fake::new();
    assert_eq!(fake.ask("$tv=0"), "[tv]  text verbosity              0 [0=silent,1=verbose]");
    assert_eq!(fake.ask("$clear"), "");
    assert_eq!(fake.ask("$foo"), "");
}

#[test]
fn actions_are_done() {
    let mut fake = Fake::new();
    assert_eq!(fake.ask("$me=2"), OK);
    assert_eq!(fake.powered, [false, true, false, false]);
    assert_eq!(fake.ask("$md"), OK);
    assert_eq!(fake.ask("$test=3"), OK);
    assert_eq!(fake.powered, [false; 4]);
}

#[test]
fn help_is_lines_that_fit() {
    for (line, title) in [
        ("h", "Kerf Help"),
        (" H ", "Kerf Help"),
        ("$h", "Kerf Settings Help"),
        ("$HELP", "Kerf Settings Help"),
        ("$defa", "Kerf Defaults Help"),
        ("$test", "Kerf Test Jobs Help"),
    ] {
        let help = listed(line);
        assert!(help.starts_with(&std::format!("\n\n\n### {title} ###\n")), "{line}: {help}");
        assert_eq!(help.matches("###").count(), 2);
        assert!(help.lines().count() <= 22);
    }
    let mut fake = Fake::new();
    assert_eq!(fake.ask("h1"), r#"{"r":{},"f":[1,0,7]}"#);
    assert_eq!(fake.blocks, ["h1"]);
}

const RESTORED: &str = r#"{"r":{"fv":0.970,"fb":440.20,"hp":1,"hv":8,"id":"0000-KERF","msg":"Initializing configs to default settings"},"f":[1,15,7]}"#;

#[test]
fn defaults_are_restored() {
    for line in ["{defa:1}", "{\"defa\":true}", "$defa=1"] {
        let mut fake = Fake::new();
        fake.ask("{xvm:900,sr:{vel:t},jv:5,js:0}");
        let answer = fake.ask(line);
        let text = "tinyg [mm] ok> Initializing configs to default settings";
        assert_eq!(answer, if line.starts_with('$') { text } else { RESTORED });
        assert_eq!(fake.settings.velocity_max(0) as i32, 800);
        assert_eq!(fake.memory.tinyg.token(0).unwrap().name().bytes(), b"posx");
    }
}

#[test]
fn defaults_are_restored_on_demand_alone() {
    let mut fake = Fake::new();
    for (line, answer) in [
        (
            "{defa:n}",
            r#"{"r":{"defa":null,"msg":"Send {defa:true} to reset to default settings"},"f":[1,0,7]}"#,
        ),
        (
            "{defa:0}",
            r#"{"r":{"defa":0,"msg":"Send {defa:true} to reset to default settings"},"f":[1,0,7]}"#,
        ),
        ("{defa:\"1\"}", r#"{"r":{"defa":null},"f":[1,103,7]}"#),
        ("{jv:n,defa:1}", r#"{"r":{"jv":3,"defa":1},"f":[1,106,7]}"#),
        ("{sys:{defa:1}}", r#"{"r":{"sys":{"defa":1}},"f":[1,106,7]}"#),
        (
            "{h:n}",
            r#"{"r":{"h":null,"msg":"Send $h for help, {sys:n} for the settings"},"f":[1,0,7]}"#,
        ),
    ] {
        fake.ask("{xvm:900}");
        assert_eq!(fake.ask(line), answer);
        assert_eq!(fake.settings.velocity_max(0) as i32, 900);
    }
    fake.doing = Doing::Runs;
    assert_eq!(fake.ask("{defa:1}"), r#"{"r":{"defa":1},"f":[1,106,7]}"#);
    assert_eq!(fake.ask("$defa=1"), "tinyg [mm] err: Command not accepted at this time: $defa=1 ");
}

#[test]
fn more_may_follow_the_defaults() {
    let mut fake = Fake::new();
    let answer = RESTORED.replace(r#","msg""#, r#","xvm":900,"msg""#);
    assert_eq!(fake.ask("{defa:1,xvm:900}"), answer);
    assert_eq!(fake.settings.velocity_max(0) as i32, 900);
    let answer = fake.ask("{defa:1,foo:1}");
    assert!(
        answer.ends_with(&std::format!("[1,{},7]}}", number(Status::UnrecognizedName))),
        "{answer}"
    );
}

#[test]
fn a_dollar_brings_text_and_a_brace_json() {
    let mut fake = Fake::new();
    fake.ask("$jv");
    assert_eq!(fake.mode, Mode::Text);
    fake.ask("{jv:n}");
    assert_eq!(fake.mode, Mode::Json);
    fake.ask("h");
    assert_eq!(fake.mode, Mode::Text);
}
