//! Makes `docs/settings.md` from the tables of settings and their meanings.

use std::format;
use std::string::{String, ToString};
use std::vec::Vec;

#[cfg(feature = "drivers")]
use super::groups::driver;
use super::groups::{
    Meaning, axis, bed, coolant, hot_end, job, motor, pwm, shaper, spindle, squaring, system, user,
};
use super::name::token;
use super::table::{CLAMP, HOMING, IDLE, JERK, Kind, MODE, RADIUS, SettingRow};
use super::{Digits, Fixed, Name, Owner, Setting, Words, machines};
use crate::progmem::Text;

const PREFACE: &str = "\
# Settings

<!-- Made from `src/config` by `cargo xtask docs`: change it there. -->

Requests, in JSON and in text mode:

| | JSON | Text |
|---|---|---|
| read one setting | `{xvm:n}` | `$xvm` |
| read a group | `{x:n}` | `$x` |
| read several | `{xvm:n,x:{fr:n}}` | `$m` motors, `$q` axes, `$$` all |
| write | `{xvm:1200}` | `$xvm=1200` |
| restore all defaults | `{defa:1}` | `$defa=1` |

A setting takes effect before its response is sent, for the lines after it. Moves that are running or queued keep the limits
with which they were planned. A setting survives a power cut, unless its description says otherwise. After G20,
lengths are read and written in inches; values of rotary axes stay in degrees. A write is refused with one of these statuses:

| status | reason |
|---|---|
| 102 | not a number, or a fraction where an integer is required |
| 103 | a string where a number is required |
| 104 | the setting is fixed |
| 106 | the setting can be changed only at rest, and the machine moves |
| 108, 109 | a number below the minimum, above the maximum |
| 110 | an integer, a driver current or `he1pa` outside its range |

The column `Decimals` gives the number of decimals that are stored. Further decimals are rounded. Responses may show fewer decimals
than are stored ([backup.md](backup.md#fewer-decimals-than-are-kept)).

`{defa:1}` is accepted only at rest. Its response has status 15, the build and a message. Offsets, stored positions and tools are kept.

";

const MACHINES: &str = "\
## Machines

`{mch:1}` sets all settings of motors and axes, `ja`, `ct` and `gpl` to the values of that machine. All other settings stay as they
are. While anything moves, the request is refused with status 106. `{mch:n}` reads the machine that was chosen last, even if settings have been changed
since. In an image that is built with `--machine NAME`, the values of that machine are the defaults. The values are a starting point: check `tr`,
`sa`, `mi` and the travel against your machine before you trust them. Storing takes about 2.4 s: wait until `{kept:n}` is 1. If the power
is cut before that, some settings may have their old values: choose the machine again.

After homing an axis stands at one end of its travel: at `tn` if it homes to the lower switch, at `tm` if it homes to the upper one. Z homes upwards on
all machines except the `printer`, and machine zero is the top of Z. On the `printer` Z 0 is the bed.

";

const PLACES: &str = "\
## Offsets

Coordinate systems, stored positions and tools are groups, too. Each value can be read and written alone (`g54x`) or together with
others (`{g54:{x:1,y:2}}`). Lengths and angles have four decimals.

| Group | Members | Meaning | Set by | Survives a power cut |
|---|---|---|---|---|
| `g54` to `g59`, `g591` to `g593` | `x` to `c` | origin of a coordinate system, G54 to G59.3 | a write, G10 L2, G10 L20 | yes |
| `tt1` to `tt10` | `x` `z` | length of a tool | a write, G10 L1, G10 L10 | yes |
| `g28`, `g30` | `x` to `c` | stored position | G28.1, G30.1 | yes |
| `g92` | `x` to `c` | offset of G92, active or not | G92 | no |

A new value takes effect before its response is sent; that of a tool takes effect with the next G43. All values are 0 at first. `$o` and `$$`
list all of these groups except the tools. Values that survive a power cut cannot be in status reports.

## Stored program

Kerf stores one program of G-code, for example to measure a tool or to move to a fixed position. The program has room for 735 bytes, 559 in
an image that can print. A line may have 48 bytes, and takes one byte more for its end.

| | JSON | Text |
|---|---|---|
| begin a new program | `{prog:f}` | `$prog=f` |
| add a line | `{prog:\"G0 X1\"}` | `$prog=G0 X1` |
| complete the program | `{prog:t}` | `$prog=t` |
| show the program | `{prog:n}` | `$prog` |
| run the program | `{test:100}` | `$test=100` |
| stop the program | `{test:0}` | `$test=0` |

The program is stored once the response to `{prog:t}` has status 0. Until then the old one is there, also after a power cut. Only if both have no room
together, the first line that needs the room deletes the old one. A program can be stored only at rest (106). Status 34 means that there is no room for it.

The program ends with M2, M30 or its last line, as a built-in job does. Once its motion is done, an exception report has status 8. If a line is
refused, the program ends, and an exception report gives the reason at once. Lines are not checked when they are stored, only when they are run.
";

/// Returns the whole text of `docs/settings.md`.
pub fn markdown() -> String {
    let groups: [(&str, &str, &[Owner], &[Meaning]); 12 + cfg!(feature = "drivers") as usize] = [
        (
            "The machine",
            "The group `sys`. The names have no prefix.",
            &[Owner::System],
            &system::MEANINGS,
        ),
        (
            "Motors",
            "The groups `1` to `4`, one for each motor: `1tr`, `2tr`. These settings can be changed only at rest (106).",
            &[0, 1, 2, 3].map(Owner::Motor),
            &motor::MEANINGS,
        ),
        (
            "Axes",
            "The groups `x` `y` `z` `a` `b` `c`, one for each axis: `xvm`, `yvm`.",
            &[0, 1, 2, 3, 4, 5].map(Owner::Axis),
            &axis::MEANINGS,
        ),
        (
            "PWM of the spindle",
            "The group `p1`: `p1frq`. A duty cycle of 1 is always high. Between the two speeds of a direction, the duty cycle changes in proportion to S. \
The defaults fit an inverter with a 0 to 10 V input behind a PWM converter: there are no pulses while \
the spindle is off, and S24000 gives 10 V. Example for a spindle of 12,000 RPM: `{p1:{csh:12000,wsh:12000}}`. Example for a hobby ESC: \
`{p1:{frq:100,csl:1000,csh:2000,cpl:0.125,cph:0.2,wsl:1000,wsh:2000,wpl:0.125,wph:0.2,pof:0.1}}`.",
            &[Owner::Pwm],
            &pwm::MEANINGS,
        ),
        ("Spindle", "The group `sp`: `spde`.", &[Owner::Spindle], &spindle::MEANINGS),
        ("Coolant", "The group `co`: `coph`.", &[Owner::Coolant], &coolant::MEANINGS),
        (
            "Squaring",
            "The group `sq`: `sqsw`. If the two motors of an axis have a homing switch each, homing squares the axis.",
            &[Owner::Squaring],
            &squaring::MEANINGS,
        ),
        (
            "Hot end",
            "The group `he1`: `he1p`. Only images that can print have it.",
            &[Owner::HotEnd],
            &hot_end::MEANINGS,
        ),
        (
            "Bed",
            "The group `he3`: `he3p`. Only images that can print have it.",
            &[Owner::Bed],
            &bed::MEANINGS,
        ),
        (
            "Input shaping",
            "The group `is`: `isx`. Only images with the capability `shaping` have it, those of boards with an RP2040. M593 of printing hosts changes them in motion.",
            &[Owner::Shaper],
            &shaper::MEANINGS,
        ),
        #[cfg(feature = "drivers")]
        (
            "Drivers",
            "The group `dr`: `drr1`. Only images for boards that configure their drivers by UART have it ([rp2040.md](rp2040.md#skr-pico)).",
            &[Owner::Drivers],
            &driver::MEANINGS,
        ),
        (
            "User data",
            "The groups `uda` `udb` `udc` `udd`: `uda0`, `udd3`. A sender may store any data here: `{uda0:\"0x2a\"}`, `$uda0=0x2a`. Kerf does not use it.",
            &[0, 1, 2, 3].map(Owner::User),
            &user::MEANINGS,
        ),
        (
            "Job",
            "The group `jid`: `jida`. A sender may store here which job it runs: `{jida:\"0x2a\"}`, `$jida=0x2a`. The values are 0 after a reset.",
            &[Owner::Job],
            &job::MEANINGS,
        ),
    ];
    let mut text = PREFACE.to_string();
    for (title, intro, owners, meanings) in groups {
        text += &format!("## {title}\n\n{intro}\n\n");
        text += "| Name | Type | Unit | Range | Default | Decimals | Meaning |\n|---|---|---|---|---|---|---|\n";
        for (row, meaning) in (0..).zip(meanings) {
            text += &line(owners, row, meaning);
        }
        text += "\n";
    }
    text + MACHINES + &machine_table() + PLACES
}

/// Returns the table of machines with their most characteristic settings.
fn machine_table() -> String {
    let mut text =
        "| `mch` | Name | Machine | Motors 1 to 4 move | `tr` | `vm` | `ac` | `jm` | Travel |\n"
            .to_string();
    text += "|---|---|---|---|---|---|---|---|---|\n";
    for (n, machine) in (0..).zip(machines::ALL) {
        let value = |name: &str| value_on(n, name);
        let moves =
            |motor: &&str| value(&format!("{motor}ma")).parse().ok().filter(|a| *a < 6usize);
        let motors = ["1", "2", "3", "4"];
        let letters = motors.map(|m| moves(&m).map_or("none", |axis| &"XYZABC"[axis..=axis]));
        let axes = ["x", "y", "z"].into_iter().filter(|axis| value(&format!("{axis}am")) != "0");
        let all = |of: &dyn Fn(&str) -> String| axes.clone().map(of).collect::<Vec<_>>().join(", ");
        let of_axes = |name: &str| all(&|axis| value(&format!("{axis}{name}")));
        let turns = motors.iter().filter(|m| moves(m).is_some_and(|axis| axis < 3));
        let turns: Vec<_> = turns.map(|motor| value(&format!("{motor}tr"))).collect();
        let travel = all(&|axis| {
            format!("{} to {}", value(&format!("{axis}tn")), value(&format!("{axis}tm")))
        });
        text += &format!(
            "| {n} | `{}` | {} | {} | {} | {} | {} | {} | {travel} |\n",
            machine.name,
            machine.about,
            letters.join(" "),
            turns.join(", "),
            of_axes("vm"),
            of_axes("ac"),
            of_axes("jm"),
        );
    }
    text + "\n"
}

/// Returns the value of a setting in the profile of a machine, as text.
fn value_on(machine: u8, name: &str) -> String {
    let setting = Name::new().with(name.as_bytes()).and_then(|name| Setting::find(&name));
    setting.map_or_else(String::new, |s| number(s.value_on(machine), s.row().stored))
}

/// Returns the table line of a setting, for all its owners.
fn line(owners: &[Owner], row: u8, meaning: &Meaning) -> String {
    let settings: Vec<_> = owners.iter().filter_map(|o| Setting::of(*o, row)).collect();
    let Some(first) = settings.first() else { return String::new() };
    let (row, Some(words)) = (first.row(), first.words()) else { return String::new() };
    let fields = [
        format!("`{}`", meaning.0),
        kind(&row).to_string(),
        unit(owners, &row, &words),
        range(*first, &row),
        defaults(&settings),
        if row.stored > 0 { row.stored.to_string() } else { String::new() },
        format!("{}{}{}", meaning.1, choices(&words), remarks(&row)),
    ];
    format!("| {} |\n", fields.join(" | "))
}

fn kind(row: &SettingRow) -> &'static str {
    match row.kind {
        Kind::Constant => "fixed",
        Kind::Text => "fixed text",
        Kind::Data | Kind::Job => "32 bits",
        Kind::Small | Kind::Large | Kind::Cold if row.stored == 0 => "integer",
        Kind::Small | Kind::Large | Kind::Cold => "number",
    }
}

fn string(text: Text) -> String {
    text.bytes().map(char::from).collect()
}

/// Returns what follows the value in text mode, in two parts: the unit, and the choices in brackets.
fn tail(words: &Words) -> (String, String) {
    let tail = string(words.tail);
    let split = tail.find(" [").or(tail.find(" (")).unwrap_or(tail.len());
    (tail[..split].to_string(), tail[split..].to_string())
}

fn unit(owners: &[Owner], row: &SettingRow, words: &Words) -> String {
    // Text mode shows the units of these two as TinyG does.
    if row.is(RADIUS) {
        return "mm".to_string();
    }
    if row.token == token("ja") {
        return "mm/min^2".to_string();
    }
    let unit = tail(words).0.replace(" * 1 million", ", in millions").replace(" Sec", " s");
    let length = match (words.length, owners.len()) {
        (false, _) => "",
        (true, 1) => "mm",
        (true, _) => "mm or deg",
    };
    format!("{length}{}", unit.trim())
}

/// Returns the choices of a numeric setting, as text mode lists them.
fn choices(words: &Words) -> String {
    let choices = tail(words).1;
    let inner = choices.strip_prefix(" [").and_then(|rest| rest.strip_suffix(']'));
    match inner {
        Some(inner) if inner.contains('=') && !inner.ends_with("...") => {
            format!(" {}.", inner.replace(',', ", ").replace('=', " "))
        }
        _ => String::new(),
    }
}

/// Returns the remarks on a setting beside its range.
fn remarks(row: &SettingRow) -> String {
    let mut text = String::new();
    for (flag, remark) in [
        (CLAMP, "A value out of range becomes the nearest limit."),
        (IDLE, "Can be changed only at rest."),
        (HOMING, "X Y Z A only."),
        (RADIUS, "A B C only. The value is a length, not an angle."),
    ] {
        if row.is(flag) {
            text += &format!(" {remark}");
        }
    }
    text
}

/// Returns a value as it is kept, without trailing zeros.
fn number(value: i32, decimals: u8) -> String {
    let mut digits = Digits::default();
    let text = Fixed { value, decimals }.render(&mut digits);
    let text: String = text.iter().copied().map(char::from).collect();
    if decimals == 0 { text } else { text.trim_end_matches('0').trim_end_matches('.').to_string() }
}

fn range(setting: Setting, row: &SettingRow) -> String {
    let shown = |value| number(value, row.stored);
    match row.kind {
        Kind::Constant | Kind::Text => String::new(),
        Kind::Data | Kind::Job => "`\"0x0\"` to `\"0xffffffff\"`".to_string(),
        _ if setting.is_baud() => "1 to 6, or a rate".to_string(),
        _ if row.is(MODE) => "0 to 2; A B C to 3".to_string(),
        _ if row.min == -i32::MAX => format!("±{}", shown(row.max)),
        _ => format!("{} to {}", shown(row.min), shown(row.max)),
    }
}

/// Returns the defaults of all owners of the setting. Owners with the same default are grouped.
fn defaults(settings: &[Setting]) -> String {
    let shown = |setting: Setting| {
        let row = setting.row();
        match row.kind {
            Kind::Text if row.max != 0 => String::new(),
            Kind::Text => "`0000-KERF`".to_string(),
            Kind::Data | Kind::Job => "`\"0x0\"`".to_string(),
            _ if row.is(JERK) || row.stored > 0 => number(setting.default_value(), row.stored),
            _ => setting.default_value().to_string(),
        }
    };
    let mut runs: Vec<(String, String)> = Vec::new();
    for setting in settings {
        let value = shown(*setting);
        let owner = String::from_utf8_lossy(setting.owner().prefix().bytes()).to_uppercase();
        match runs.last_mut() {
            Some((owners, last)) if *last == value => *owners += &format!(" {owner}"),
            _ => runs.push((owner, value)),
        }
    }
    match runs.as_slice() {
        [(_, value)] => value.clone(),
        _ => runs.iter().map(|(o, v)| format!("{o}: {v}")).collect::<Vec<_>>().join(", "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(owner: Owner) -> Vec<String> {
        let owners = match owner {
            // These owners together have all rows.
            Owner::Axis(_) => [Owner::Axis(0), Owner::Axis(3)],
            _ => [owner, owner],
        };
        let row = |row| owners.iter().find_map(|o| Setting::of(*o, row));
        let name = |s: Setting| {
            let skip = s.owner().prefix().bytes().len();
            String::from_utf8(s.name().bytes()[skip..].to_vec()).unwrap()
        };
        (0..owner.rows()).filter_map(row).map(name).collect()
    }

    #[test]
    fn every_setting_has_its_meaning() {
        for (owner, meanings) in [
            (Owner::System, &system::MEANINGS[..]),
            (Owner::Motor(0), &motor::MEANINGS),
            (Owner::Axis(0), &axis::MEANINGS),
            (Owner::Pwm, &pwm::MEANINGS),
            (Owner::Spindle, &spindle::MEANINGS),
            (Owner::Coolant, &coolant::MEANINGS),
            (Owner::Squaring, &squaring::MEANINGS),
            #[cfg(feature = "printer")]
            (Owner::HotEnd, &hot_end::MEANINGS),
            #[cfg(feature = "printer")]
            (Owner::Bed, &bed::MEANINGS),
            (Owner::Shaper, &shaper::MEANINGS),
            #[cfg(feature = "drivers")]
            (Owner::Drivers, &driver::MEANINGS),
            (Owner::User(0), &user::MEANINGS),
            (Owner::Job, &job::MEANINGS),
        ] {
            let described: Vec<_> = meanings.iter().map(|(name, _)| name.to_string()).collect();
            assert_eq!(names(owner), described);
            assert!(meanings.iter().all(|(_, text)| text.len() > 5));
        }
    }

    #[test]
    fn rows_tell_what_the_tables_say() {
        let text = markdown();
        for row in [
            "| `mt` | number | s | 0.1 to 4294967 | 2 | 2 |",
            "| `vm` | number | mm or deg/min | 0.001 to 2147483.647 | X Y Z: 800, A B C: 7200 | 3 |",
        ] {
            assert!(text.contains(row), "{row}");
        }
    }
}
