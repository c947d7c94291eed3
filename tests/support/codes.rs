//! `docs/codes.md`: every number that the machine reports, from the tables.

use kerf::canon::{advice, statuses};
use kerf::config::{Name, Setting};
use kerf::protocol::tinyg::{Variation, names, number, status_text};
use kerf::status::Status;

const PREFACE: &str = "\
# All codes

<!-- Made from `src/canon/advice.rs` and `tests/support/codes.rs` by `cargo xtask docs`: change it there. -->

The meaning of all numbers in responses and reports. What to do when the machine has stopped: [alarms.md](alarms.md).

- [Status](#status): the second number of `\"f\":[1,0,7]`, and `st` of an exception
- [Exceptions](#exceptions): lines with `\"er\"`
- [What the machine is doing](#what-the-machine-is-doing): `stat`, `macs`, `cycs`, `mots`, `hold`
- [Values](#values): what reports may contain

## Status

0 means that the line has run or is queued. Any other number means that the line did not run, except for the notes 8, 15 and 16. Text mode and exceptions show
the text. The column `g2core` has the number with `dia` 1, if it differs.

";

const EXCEPTIONS: &str = "\
## Exceptions

Kerf sends an exception once, without a request: `{\"er\":{\"fb\":440.20,\"st\":204,\"msg\":\"..\",\"sw\":\"xmin\"}}`. `st` is a status, `msg` its text. It goes to the port that
sends G-code, or that sent it last.

| `st` | cause | notes |
|---|---|---|
| 6 | the board has restarted by itself | an alarm: each line of G-code is answered with 203 |
| 8 | a built-in job or the stored program has ended | |
| 13 | characters were lost | each lost line is answered with 13 |
| 29 | `{er:n}` asked for it | |
| 34 | EEPROM cannot be written | |
| 37 | steps came late for the first time | `{stv:n}` counts them |
| 38 | the program waits at a program stop | `~` resumes |
| 57, 58, 60 | motors moved, and a driver does not answer, is not set, or has switched off | an alarm, on `skr-pico` |
| 59 | a driver has reset: home | an alarm, if motors moved |
| 61, 62 | a driver is hot; a motor's wire seems open | told once |
| 180 | a tool has no length: 0 is used | a note |
| 203 | `{alarm:n}`, or after 250 | |
| 204 | a limit was hit | `sw`: `xmin` `xmax` `ymin` `ymax` `zmin` `zmax` `amin` `amax` |
| 205 | the emergency stop, or `{shutd:n}` | |
| 206 | `{panic:n}` | |
| 207 | `^d` | |
| 240 to 247 | homing has failed, or cannot begin | `ax`: `x` `y` `z` `a` |
| 250 | probing has failed | an alarm |
| others | as in the table of statuses; or a line of a built-in job or the stored program was refused | a refusal ends the job |

Kerf sends other lines without a request, too: `sr` (status report), `qr` (queue report), `{\"jog\":0}` (a jog has ended), `{\"rx\":n}` (the queue was flushed), `prb` in an
`r` (probing has ended), `{\"ack\":true}` (answer to the byte 5).

## What the machine is doing

| `stat` | | `macs` | |
|---|---|---|---|
| 0 | starting | 0 | starting |
| 1 | ready: nothing has run since the start | 1 | ready |
| 2 | alarm: 203, 204, 250 or 6 | 2 | alarm |
| 3 | at rest, or waiting at M0, M1, M6, M60 or G88 | 3 | at rest, or waiting |
| 4 | at rest, the program has ended | 4 | at rest, ended |
| 5 | running | 5 | running, probing, homing, jogging, or in a hold |
| 6 | feedhold: `!`, or the door is open | 6 | stopped by 205; with `dia` 1: the door is open |
| 7 | probing | 7 | with `dia` 1: stopped by 205 |
| 8 | not used | 8 | panic |
| 9 | homing | | |
| 10 | jogging | | |
| 11 | stopped by 205; with `dia` 1: the door is open | | |
| 12 | with `dia` 1: stopped by 205 | | |
| 13 | panic | | |

| | 0 | 1 | 2 | 3 | 4 |
|---|---|---|---|---|---|
| `cycs` | off | G-code | probing | homing | jog |
| `mots` | stopped | moving | held | | |
| `hold` | none | not used | not used | slowing down | held, at rest |

## Values

`{posx:n}` reads one value, `{pos:n}` a group, and `{sr:{posx:t}}` selects values for status reports. A value is read-only unless it says otherwise. Settings
can be read as well: [settings.md](settings.md). Names that do something: [protocol.md](protocol.md#what-can-be-asked-for-besides-settings-and-values).

| name | meaning |
|---|---|
";

/// Values of the machine: the name, or the name within its group with `x`, `1` or `e` for the group; and the meaning.
const VALUES: [(&str, &str); 66] = [
    (
        "n",
        "line number (N) of the last finished line; in motion, of those that move or switch something",
    ),
    ("line", "line number (N) of the moving line"),
    ("vel", "present speed, units/min"),
    ("feed", "feed rate F, units/min"),
    ("stat", "machine state, see above"),
    ("macs", "machine state with fewer values, see above"),
    ("cycs", "present cycle, see above"),
    ("mots", "motion state, see above"),
    ("hold", "feedhold, see above"),
    ("unit", "units: 0 G20 inches, 1 G21 millimetres"),
    ("coor", "coordinate system: 0 G53, 1 to 6 G54 to G59, 7 to 9 G59.1 to G59.3"),
    (
        "momo",
        "motion mode: 0 to 3 G0 to G3, 4 G80, 5 G38.2, 6 to 14 G81 to G89, 15 G73, 16 to 18 G38.3 to G38.5",
    ),
    ("plan", "plane: 0 G17, 1 G18, 2 G19"),
    ("path", "path control mode: 0 G61, 1 G61.1, 2 G64"),
    ("dist", "distance mode: 0 G90, 1 G91"),
    ("frmo", "feed mode: 0 G93, 1 G94, 2 G95"),
    ("tool", "tool in the spindle"),
    ("home", "homing state: 0 not homed, 1 all axes with a homing switch are homed, 2 homing"),
    ("chk", "1: check mode, in which nothing moves; can be set"),
    ("qr", "free blocks in the queue"),
    ("qi", "blocks added since the last query"),
    ("qo", "blocks removed since the last query"),
    ("rx", "lines that may be sent; with `rxm` 0, characters"),
    ("admo", "arc distance mode: 0 G90.1, 1 G91.1"),
    ("spe", "1: the spindle is on"),
    ("spd", "0 clockwise, 1 counter-clockwise"),
    ("sps", "speed S, RPM"),
    ("com", "1: mist is on"),
    ("cof", "1: flood is on"),
    ("mfo", "feed override, 1 is 100 %; can be set"),
    ("mto", "rapid override; can be set"),
    ("sso", "spindle override; can be set"),
    ("mfoe", "1: the feed override is on; can be set"),
    ("mtoe", "1: the rapid override is on; can be set"),
    ("ssoe", "1: the spindle override is on; can be set"),
    ("fd", "always 0"),
    ("ma", "always 0"),
    (
        "rst",
        "cause of the last start: 0 power, 1 reset button or port, 2 low supply voltage, 3 watchdog, 4 request",
    ),
    ("stv", "number of times that steps came late since the start; should be 0"),
    ("usbr", "RP2040, else 0: number of times that USB hung and was restarted since the start"),
    (
        "usbe",
        "RP2040, else 0: milliseconds with errors of the USB bus since the start, modulo 65,536",
    ),
    (
        "pls",
        "rising edges at D47 since the start, modulo 65,536: connect it with a step pin to count pulses; 0 on images with `spn`, and on the RP2040",
    ),
    ("kept", "1: everything is stored, 0: EEPROM is still being written"),
    ("inp", "probe: 1 closed, 0 open, -1 no input"),
    ("ind", "door: 1 open, 0 closed (or `saf` 0), -1 no input"),
    ("ine", "emergency stop: 1 pressed, 0 not pressed (or `est` 0), -1 no input"),
    ("prbe", "last probing: 1 contact, 0 no contact, 2 still probing"),
    ("mpo", "`mpox` to `mpoc`: position in machine coordinates, mm or degrees"),
    ("pos", "`posx` to `posc`: position in work coordinates, active units"),
    ("ofs", "`ofsx` to `ofsc`: work offset, mm or degrees"),
    ("hom", "`homx` to `homc`: 1: the axis is homed"),
    ("tof", "`tofx` to `tofc`: active tool length, mm or degrees; can be set"),
    ("g92", "`g92x` to `g92c`: G92 offset, active units"),
    ("pwr", "`pwr1` to `pwr4`: 1: the motor has power"),
    (
        "drx",
        "`drx1` to `drx4`, on `skr-pico`: state of the driver, see [rp2040.md](rp2040.md#skr-pico)",
    ),
    ("_te", "`_tex` to `_tec`: end position of the last line read, mm or degrees"),
    ("_tr", "`_trx` to `_trc`: present position, mm or degrees"),
    ("_ts", "`_ts1` to `_ts4`: present motor position, steps"),
    ("_ps", "as `_ts`"),
    ("_cs", "as `_ts`"),
    ("_es", "as `_ts`"),
    ("_xs", "always 0"),
    ("_fe", "always 0"),
    ("prb", "`prbx` to `prbc`: position of the last contact, mm or degrees"),
    (
        "in",
        "`in1` to `in8`: switches at the lower and upper ends of X Y Z A: 1 pressed, 0 not pressed, -1 off or no input",
    ),
    ("g28", "`g28x` to `g28c`, `g30x` to `g30c`: stored positions; cannot be in reports"),
];

fn status_row(status: Status) -> String {
    let text: String =
        status_text(status).into_iter().flat_map(|t| t.bytes()).map(char::from).collect();
    let (cause, cure) = advice(status).expect("each has its advice");
    let there = Variation::G2core.code(status);
    let there = if there == number(status) { String::new() } else { there.to_string() };
    format!("| {} | {there} | {text} | {cause} | {cure} |\n", number(status))
}

/// Returns the whole page.
pub fn markdown() -> String {
    let mut text = PREFACE.to_string();
    text += "| status | g2core | text | why | do |\n|---|---|---|---|---|\n";
    statuses().for_each(|status| text += &status_row(status));
    text += "\n";
    text += EXCEPTIONS;
    for (name, meaning) in VALUES {
        text += &format!("| `{name}` | {meaning} |\n");
    }
    text
}

/// Returns the names that can be asked for but are documented nowhere: not here, not in settings.md, not in
/// protocol.md.
pub fn untold() -> Vec<String> {
    let protocol = std::fs::read_to_string("docs/protocol.md").expect("docs/protocol.md");
    let settings = std::fs::read_to_string("docs/settings.md").expect("docs/settings.md");
    let is_told = |name: &String| {
        let group = &name[..name.len() - 1];
        let own = VALUES.iter().any(|(value, _)| value == name || *value == group);
        let setting = Setting::find(&Name::new().with(name.as_bytes()).expect("short"));
        let spelled = |text: &str| {
            text.contains(&format!("`{name}`")) || text.contains(&format!("`{group}`"))
        };
        // Of these ranges only the first and the last name are spelled out.
        let ranges = ["g5", "tt", "jog"];
        let in_range = ranges.iter().any(|range| name.starts_with(range));
        own || in_range || setting.is_some() || spelled(&protocol) || spelled(&settings)
    };
    names().into_iter().filter(|name| !is_told(name)).collect()
}
