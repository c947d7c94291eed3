//! `docs/codes.md`: every number that the machine reports, from the tables.

use kerf::canon::{advice, statuses};
use kerf::config::{Name, Setting};
use kerf::protocol::tinyg::{Variation, names, number, status_text};
use kerf::status::Status;

const PREFACE: &str = "\
# All codes

<!-- Made from `src/canon/advice.rs` and `tests/support/codes.rs` by `cargo xtask docs`: change it there. -->

What each number means that the machine tells. What to do when it has stopped: [alarms.md](alarms.md).

- [Status](#status): the second number of `\"f\":[1,0,7]`, and `st` of an exception
- [Exceptions](#exceptions): lines with `\"er\"`
- [What the machine is doing](#what-the-machine-is-doing): `stat`, `macs`, `cycs`, `mots`, `hold`
- [Values](#values): what reports may hold

## Status

0 is done, or queued. Any other number means that the line was not carried out, but for 3 (passed over), 8, 15 and 16, which are told as notes. The text
stands in text mode and in exceptions. `g2core` is the number with `dia` 1, where it is another.

";

const EXCEPTIONS: &str = "\
## Exceptions

Told once, unasked: `{\"er\":{\"fb\":440.20,\"st\":204,\"msg\":\"..\",\"sw\":\"xmin\"}}`. `st` is a status, `msg` its text. An exception goes to the port that
feeds the machine, or that fed it last.

| `st` | comes when | besides |
|---|---|---|
| 6 | the board has started by itself | an alarm: 203 for each line of G-code |
| 8 | a built-in job or your own program has ended | |
| 13 | characters were lost | each lost line is answered with 13 |
| 29 | `{er:n}` asked for it | |
| 34 | EEPROM cannot be written | |
| 37 | steps came late, the first time | `{stv:n}` counts |
| 38 | the program has come to a stop and waits | `~` goes on |
| 180 | a tool without a length: 0 is in force | a note |
| 203 | `{alarm:n}`, or after 250 | |
| 204 | a limit was hit | `sw`: `xmin` `xmax` `ymin` `ymax` `zmin` `zmax` `amin` `amax` |
| 205 | the emergency stop input, or `{shutd:n}` | |
| 206 | `{panic:n}` | |
| 207 | `^d` | |
| 240 to 247 | homing failed, or cannot begin | `ax`: `x` `y` `z` `a` |
| 250 | a probe found nothing | an alarm |
| others | why a line of a built-in job or your own program was refused | the job ends |

Other lines come unasked as well: `sr` (status), `qr` (queue), `{\"jog\":0}` (a jog has ended), `{\"rx\":n}` (the queue was flushed), `prb` in an `r` (a probing has
ended), `{\"ack\":true}` (answer to the byte 5).

## What the machine is doing

| `stat` | | `macs` | |
|---|---|---|---|
| 0 | starting | 0 | starting |
| 1 | ready: nothing has run since the start | 1 | ready |
| 2 | alarm: 203, 204, 250 or 6 | 2 | alarm |
| 3 | at rest, or waiting at M0, M6, M60 | 3 | at rest, or waiting |
| 4 | at rest, the program has ended | 4 | at rest, ended |
| 5 | runs | 5 | runs, probes, homes, jogs, or holds |
| 6 | hold: `!`, or the door is open | 6 | stopped by 205; with `dia` 1: the door is open |
| 7 | probes | 7 | with `dia` 1: stopped by 205 |
| 8 | not used | 8 | panic |
| 9 | homes | | |
| 10 | jogs | | |
| 11 | stopped by 205; with `dia` 1: the door is open | | |
| 12 | with `dia` 1: stopped by 205 | | |
| 13 | panic | | |

| | 0 | 1 | 2 | 3 | 4 |
|---|---|---|---|---|---|
| `cycs` | off | lines | probing | homing | jog |
| `mots` | stands | moves | held | | |
| `hold` | none | not used | not used | slows down | held, at rest |

## Values

Asked for by `{posx:n}`, or together (`{pos:n}`), and chosen for reports by `{sr:{posx:t}}`. They are read only, but for overrides. Settings can be
asked for as well: [settings.md](settings.md). Names that do something: [protocol.md](protocol.md#what-can-be-asked-for-besides-settings-and-values).

| name | is |
|---|---|
";

/// Values of the machine: the name, or the name within its group with `x`, `1` or `e` for the group; and the meaning.
const VALUES: [(&str, &str); 62] = [
    (
        "n",
        "number (N) of the line that was finished last; in motion, of those that move or switch something",
    ),
    ("line", "number (N) of the line that moves"),
    ("vel", "speed now, units/min"),
    ("feed", "feed rate F, units/min"),
    ("stat", "what the machine is doing, see above"),
    ("macs", "the same, coarser"),
    ("cycs", "which cycle, see above"),
    ("mots", "whether it moves, see above"),
    ("hold", "feedhold, see above"),
    ("unit", "0 G20 inches, 1 G21 millimetres"),
    ("coor", "0 G53, 1 to 6 G54 to G59, 7 to 9 G59.1 to G59.3"),
    (
        "momo",
        "motion mode: 0 to 3 G0 to G3, 4 G80, 5 G38.2, 6 to 14 G81 to G89, 15 G73, 16 to 18 G38.3 to G38.5",
    ),
    ("plan", "plane: 0 G17, 1 G18, 2 G19"),
    ("path", "0 G61, 1 G61.1, 2 G64"),
    ("dist", "0 G90, 1 G91"),
    ("frmo", "0 G93, 1 G94, 2 G95"),
    ("tool", "tool in the spindle"),
    ("home", "0 not homed, 1 all axes with a homing switch are homed, 2 homes"),
    ("chk", "1: check mode, in which nothing moves; can be set"),
    ("qr", "free blocks of the queue"),
    ("qi", "blocks added since it was asked last"),
    ("qo", "blocks done since it was asked last"),
    ("rx", "lines that may be sent; with `rxm` 0 characters"),
    ("admo", "0 G90.1, 1 G91.1"),
    ("spe", "1: the spindle turns"),
    ("spd", "0 clockwise, 1 counter-clockwise"),
    ("sps", "speed S, RPM"),
    ("com", "1: mist is on"),
    ("cof", "1: flood is on"),
    ("mfo", "feed override, 1 is 100 %; can be set"),
    ("mto", "rapid override; can be set"),
    ("sso", "spindle override; can be set"),
    ("mfoe", "1: the feed override counts; can be set"),
    ("mtoe", "1: the rapid override counts; can be set"),
    ("ssoe", "1: the spindle override counts; can be set"),
    ("fd", "always 0"),
    ("ma", "always 0"),
    (
        "rst",
        "why the board has started: 0 power, 1 button or port, 2 dip of the supply, 3 watchdog, 4 asked for",
    ),
    ("stv", "how often steps came late since the start; 0 on a machine that is well"),
    ("kept", "1: everything is stored, 0: something is on its way to EEPROM"),
    ("inp", "probe: 1 closed, 0 open, -1 none"),
    ("ind", "door: 1 open, 0 shut (or `saf` 0), -1 none"),
    ("ine", "emergency stop: 1 hit, 0 not (or `est` 0), -1 none"),
    ("prbe", "last probing: 1 contact, 0 none, 2 probes"),
    ("mpo", "`mpox` to `mpoc`: place in machine coordinates, mm or degrees"),
    ("pos", "`posx` to `posc`: place in work coordinates, in the units in force"),
    ("ofs", "`ofsx` to `ofsc`: offset of the work zero, mm or degrees"),
    ("hom", "`homx` to `homc`: 1, the axis is homed"),
    ("tof", "`tofx` to `tofc`: tool length in force, mm or degrees; can be set"),
    ("g92", "`g92x` to `g92c`: offset of G92, in the units in force"),
    ("pwr", "`pwr1` to `pwr4`: 1, the motor has power"),
    ("_te", "`_tex` to `_tec`: where the lines read so far end, mm or degrees"),
    ("_tr", "`_trx` to `_trc`: where the machine is, mm or degrees"),
    ("_ts", "`_ts1` to `_ts4`: how far a motor has been brought, steps"),
    ("_ps", "as `_ts`"),
    ("_cs", "as `_ts`"),
    ("_es", "as `_ts`"),
    ("_xs", "always 0"),
    ("_fe", "always 0"),
    ("prb", "`prbx` to `prbc`: place of the last contact, mm or degrees"),
    (
        "in",
        "`in1` to `in8`: switches at the lower and upper ends of X Y Z A: 1 pressed, 0 not, -1 off or none",
    ),
    ("g28", "`g28x` to `g28c`, `g30x` to `g30c`: stored positions, not in reports"),
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
