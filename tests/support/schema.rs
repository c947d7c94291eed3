//! `docs/settings.schema.json`: the settings as a JSON schema, for programs. A file of `cargo xtask settings save`
//! conforms to it.

use std::collections::HashMap;

use kerf::config::docs;
use kerf::config::table::{Kind, MODE};
use kerf::config::{Owner, Setting};

/// Returns the groups of settings that are stored; settings of a job are left out.
fn owners() -> Vec<(String, Owner)> {
    let named = |owner: Owner| {
        let name = String::from_utf8_lossy(owner.prefix().bytes()).into_owned();
        (if name.is_empty() { "sys".to_string() } else { name }, owner)
    };
    let motors = (0..4).map(Owner::Motor);
    let axes = (0..6).map(Owner::Axis);
    let outputs = [
        Owner::Pwm,
        Owner::Spindle,
        Owner::Coolant,
        Owner::Squaring,
        Owner::HotEnd,
        Owner::Bed,
        #[cfg(feature = "drivers")]
        Owner::Drivers,
    ];
    let user = (0..4).map(Owner::User);
    [Owner::System]
        .into_iter()
        .chain(motors)
        .chain(axes)
        .chain(outputs)
        .chain(user)
        .map(named)
        .collect()
}

/// Returns the meaning and the unit of each setting, from the tables of `docs/settings.md`, by the title of the
/// section.
fn meanings() -> HashMap<(String, String), (String, String)> {
    let page = docs::markdown();
    let mut title = String::new();
    let mut meanings = HashMap::new();
    for line in page.lines() {
        if let Some(text) = line.strip_prefix("## ") {
            title = text.to_string();
        }
        let cells: Vec<_> = line.split('|').map(str::trim).collect();
        if let [_, name, _, unit, _, _, _, meaning, _] = cells[..]
            && name.starts_with('`')
        {
            let name = name.trim_matches('`').to_string();
            meanings.insert((title.clone(), name), (unit.to_string(), meaning.to_string()));
        }
    }
    meanings
}

fn title(owner: Owner) -> &'static str {
    match owner {
        Owner::System => "The machine",
        Owner::Motor(_) => "Motors",
        Owner::Axis(_) => "Axes",
        Owner::Pwm => "PWM of the spindle",
        Owner::Spindle => "Spindle",
        Owner::Coolant => "Coolant",
        Owner::Squaring => "Squaring",
        Owner::HotEnd => "Hot end",
        Owner::Bed => "Bed",
        Owner::Shaper => "Input shaping",
        #[cfg(feature = "drivers")]
        Owner::Drivers => "Drivers",
        Owner::User(_) => "User data",
        Owner::Job => "Job",
    }
}

/// Returns a number as it is stored, in decimal.
fn decimal(value: i32, decimals: u8) -> String {
    let (sign, digits) = (if value < 0 { "-" } else { "" }, value.unsigned_abs());
    let one = 10u32.pow(decimals.into());
    let text = format!("{sign}{}.{:0width$}", digits / one, digits % one, width = decimals.into());
    if decimals == 0 {
        return format!("{value}");
    }
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

fn property(setting: Setting, unit: &str, meaning: &str) -> String {
    let row = setting.row();
    let shown = |value| decimal(value, row.stored);
    let mut parts = match row.kind {
        Kind::Text => vec!["\"type\": \"string\"".to_string(), "\"readOnly\": true".to_string()],
        Kind::Constant => {
            vec!["\"type\": \"number\"".to_string(), "\"readOnly\": true".to_string()]
        }
        Kind::Data | Kind::Job => vec![
            "\"type\": \"string\"".to_string(),
            "\"pattern\": \"^0x[0-9a-fA-F]{1,8}$\"".to_string(),
            "\"default\": \"0x0\"".to_string(),
        ],
        _ => {
            let kind = if row.stored == 0 { "integer" } else { "number" };
            let linear_mode = row.is(MODE) && !setting.owner().is_rotary();
            vec![
                format!("\"type\": \"{kind}\""),
                format!("\"minimum\": {}", shown(row.min)),
                format!("\"maximum\": {}", shown(row.max - i32::from(linear_mode))),
                format!("\"default\": {}", shown(setting.default_value())),
            ]
        }
    };
    if setting.is_baud() {
        parts.retain(|part| !part.contains("maximum"));
        parts.push("\"maximum\": 1000000".to_string());
    }
    if !unit.is_empty() {
        parts.push(format!("\"unit\": {}", quoted(unit)));
    }
    parts.push(format!("\"description\": {}", quoted(meaning)));
    format!("{{ {} }}", parts.join(", "))
}

/// Returns a group of lengths.
fn lengths(members: &str, what: &str, is_read_only: bool) -> String {
    let read_only = if is_read_only { ", \"readOnly\": true" } else { "" };
    let member = |name| {
        format!(
            "        \"{name}\": {{ \"type\": \"number\", \"unit\": \"mm or deg\"{read_only} }}"
        )
    };
    let members: Vec<_> = members.chars().map(member).collect();
    format!(
        "{{\n      \"type\": \"object\",\n      \"additionalProperties\": false,\n      \"description\": {},\n      \"properties\": {{\n{}\n      }}\n    }}",
        quoted(what),
        members.join(",\n")
    )
}

/// Returns the whole schema.
pub fn json() -> String {
    let meanings = meanings();
    let mut groups = Vec::new();
    for (group, owner) in owners() {
        let settings = (0..owner.rows()).filter_map(|row| Setting::of(owner, row));
        let properties: Vec<_> = settings
            .map(|setting| {
                let name = String::from_utf8_lossy(setting.name().bytes()).into_owned();
                let name = name[owner.prefix().bytes().len()..].to_string();
                let (unit, meaning) = &meanings[&(title(owner).to_string(), name.clone())];
                format!("        \"{name}\": {}", property(setting, unit, meaning))
            })
            .collect();
        groups.push(format!(
            "    \"{group}\": {{\n      \"type\": \"object\",\n      \"additionalProperties\": false,\n      \"properties\": {{\n{}\n      }}\n    }}",
            properties.join(",\n")
        ));
    }
    let systems = (54..=59).map(|n| n.to_string()).chain((591..=593).map(|n| n.to_string()));
    for system in systems {
        let what = "origin of a coordinate system, in machine coordinates";
        groups.push(format!("    \"g{system}\": {}", lengths("xyzabc", what, false)));
    }
    for tool in 1..=10 {
        groups.push(format!("    \"tt{tool}\": {}", lengths("xz", "length of a tool", false)));
    }
    for stored in ["g28", "g30"] {
        let what = "stored position, in machine coordinates; G28.1 and G30.1 set it";
        groups.push(format!("    \"{stored}\": {}", lengths("xyzabc", what, true)));
    }
    format!(
        "{{\n  \"$schema\": \"https://json-schema.org/draft/2020-12/schema\",\n  \"title\": \"Settings of Kerf\",\n  \"description\": \"Groups as `{{x:n}}` tells them, in millimetres. Made from the tables by `cargo xtask docs`.\",\n  \"type\": \"object\",\n  \"properties\": {{\n{}\n  }}\n}}\n",
        groups.join(",\n")
    )
}
