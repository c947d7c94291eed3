//! Saving and loading, over any line to the machine.
//!
//! A file has the groups as the machine reports them. Loading sends the motors first, because the speeds of axes are
//! checked against the motors' steps, and sends the settings that change the conversation last. Each value is written
//! on its own, so that a power cut leaves either the old or the new value.

use super::json::Json;

/// A line to a machine. An answer may take any time.
pub trait Line {
    /// Sends a line and returns its answer, whatever the status; `None` if the machine is silent.
    fn ask(&mut self, line: &str) -> Option<String>;
    /// Restarts the machine; returns when it is ready.
    fn restart(&mut self) -> Result<(), String>;
}

/// Longest line that is sent; the machine takes 254 characters.
const LINE: usize = 200;
/// How often the machine is asked whether everything is stored.
const KEPT: usize = 2_000;

/// The groups of settings, in the order in which they are loaded.
const GROUPS: [&str; 25] = [
    "1", "2", "3", "4", "5", "6", "x", "y", "z", "a", "b", "c", "p1", "sp", "co", "sq", "he1",
    "he3", "dr", "is", "uda", "udb", "udc", "udd", "sys",
];
/// Groups that an image may lack.
const OPTIONAL: [&str; 6] = ["5", "6", "he1", "he3", "dr", "is"];
const UNKNOWN: f64 = 100.0;
/// Coordinate systems.
const SYSTEMS: [&str; 9] = ["g54", "g55", "g56", "g57", "g58", "g59", "g591", "g592", "g593"];
const TOOLS: usize = 10;
/// Stored positions, and the code that stores each.
const STORED: [(&str, &str); 2] = [("g28", "G28.1"), ("g30", "G30.1")];

/// Settings that describe the machine, or hold for the line only. They are not sent back.
const FIXED: [&str; 8] = ["fb", "fv", "hp", "hv", "id", "net", "baud", "kerf"];
/// Settings that change how the machine answers. They are sent last, in this order.
const TALK: [&str; 12] = ["ej", "js", "tv", "ec", "ee", "ex", "rxm", "sv", "si", "qv", "dia", "jv"];
/// Settings that may stop the machine as soon as they take effect. They are sent when all other settings are stored.
const STOPPING: [&str; 2] = ["saf", "est"];
/// The machine profile. It overwrites motors and axes, so it is sent first.
const PROFILE: &str = "mch";
/// The statuses of a value that this machine cannot change. [`differ`] tells if it is not that of the file.
const CONSTANT: [f64; 2] = [104.0, 118.0];

/// Sends a line. Returns the body and the status of the answer.
fn exchange(line: &mut impl Line, request: &str) -> Result<(Json, f64), String> {
    let heard = line.ask(request).ok_or_else(|| format!("no answer to {request}"))?;
    let json = Json::parse(&heard).ok_or_else(|| format!("{request}: {heard}"))?;
    let status = json.get("f").and_then(|f| f.at(1)).and_then(Json::number);
    let (body, status) = (json.get("r"), status.ok_or_else(|| format!("{request}: {heard}"))?);
    Ok((body.cloned().unwrap_or(Json::Object(Vec::new())), status))
}

/// Sends a request that must be executed, and returns the body of its answer; an error if it is refused.
fn done(line: &mut impl Line, request: &str) -> Result<Json, String> {
    match exchange(line, request)? {
        (body, 0.0) => Ok(body),
        (_, status) => Err(format!("{request} is refused with status {status}")),
    }
}

fn number(line: &mut impl Line, name: &str) -> Result<f64, String> {
    let body = done(line, &format!("{{{name}:n}}"))?;
    body.get(name).and_then(Json::number).ok_or_else(|| format!("no {name}"))
}

/// The verbosity and the units that were in force before the conversation.
struct Before {
    verbosity: Option<String>,
    inches: bool,
}

/// Returns the verbosity of answers if it is too low to report values: 0 is silence, 1 has no messages.
fn verbosity(line: &mut impl Line) -> Option<u8> {
    let tells = |heard: Option<String>, name| {
        let json = heard.and_then(|heard| Json::parse(&heard));
        json.map(|json| json.get("r").is_some_and(|r| r.get(name).is_some()))
    };
    match tells(line.ask("{jv:n}"), "jv") {
        None => Some(0),
        Some(true) => None,
        Some(false) => match tells(line.ask("{msg:\"?\"}"), "msg") {
            Some(true) => Some(2),
            _ => Some(1),
        },
    }
}

/// Makes the machine report values, in millimetres.
fn begin(line: &mut impl Line) -> Result<Before, String> {
    let verbosity = verbosity(line);
    if verbosity.is_some() {
        ask_quietly(line, "{jv:3}");
    }
    let inches = number(line, "unit")? == 0.0;
    done(line, "G21")?;
    Ok(Before { verbosity: verbosity.map(|verbosity| verbosity.to_string()), inches })
}

/// Sends a line that may stay unanswered.
fn ask_quietly(line: &mut impl Line, request: &str) {
    let _ = line.ask(request);
}

fn end(line: &mut impl Line, before: &Before) {
    if before.inches {
        ask_quietly(line, "G20");
    }
    if let Some(verbosity) = &before.verbosity {
        ask_quietly(line, &format!("{{jv:{verbosity}}}"));
    }
}

/// Returns the names of all groups that can be saved.
fn groups() -> impl Iterator<Item = String> {
    let tools = (1..=TOOLS).map(|n| format!("tt{n}"));
    let named = GROUPS.iter().chain(&SYSTEMS).map(|name| name.to_string());
    named.chain(tools).chain(STORED.iter().map(|(name, _)| name.to_string()))
}

/// Returns all that the machine stores.
pub fn save(line: &mut impl Line) -> Result<Json, String> {
    let before = begin(line)?;
    let mut all = Vec::new();
    for group in groups() {
        let request = format!("{{{group}:n}}");
        let body = match exchange(line, &request)? {
            (_, UNKNOWN) if OPTIONAL.contains(&group.as_str()) => continue,
            (body, 0.0) => body,
            (_, status) => return Err(format!("{request} is refused with status {status}")),
        };
        let members = body.get(&group).ok_or_else(|| format!("no {group}"))?;
        let mut members = members.members().to_vec();
        for (name, value) in &mut members {
            // The machine has this value only because `begin` has set it.
            if let ("jv", Some(verbosity)) = (name.as_str(), &before.verbosity) {
                *value = Json::Plain(verbosity.clone());
            }
        }
        all.push((group, Json::Object(members)));
    }
    end(line, &before);
    Ok(Json::Object(all))
}

/// Returns a value in the spelling that the machine accepts.
fn spelled(value: &Json) -> String {
    match value {
        Json::Text(text) => format!("\"{text}\""),
        Json::Plain(text) => text.clone(),
        _ => "null".to_string(),
    }
}

/// Sends members of a group, as many at a time as a line has room for. Returns those that were refused, and why.
fn put(
    line: &mut impl Line,
    group: &str,
    members: &[(String, Json)],
    refused: &mut Vec<String>,
) -> Result<(), String> {
    let pair = |(name, value): &(String, Json)| format!("{name}:{}", spelled(value));
    // Settings of the system are sent without their group, because some of them cannot be set as a group.
    let request = |members: &[(String, Json)]| {
        let pairs = members.iter().map(pair).collect::<Vec<_>>().join(",");
        if group == "sys" { format!("{{{pairs}}}") } else { format!("{{{group}:{{{pairs}}}}}") }
    };
    let mut rest = members;
    while !rest.is_empty() {
        let fits = (1..=rest.len()).rev().find(|n| request(&rest[..*n]).len() <= LINE);
        let (some, after) = rest.split_at(fits.unwrap_or(1));
        rest = after;
        if exchange(line, &request(some))?.1 == 0.0 {
            continue;
        }
        // Sends them one by one to find the refused one.
        for member in some {
            let (_, status) = exchange(line, &request(std::slice::from_ref(member)))?;
            if status != 0.0 && !CONSTANT.contains(&status) {
                refused.push(format!("{group} {} is refused with status {status}", pair(member)));
            }
        }
    }
    Ok(())
}

/// Stores a position as it was. The machine is told that it is at that position, and nothing moves. It is not homed
/// afterwards, because it restarts.
fn store(line: &mut impl Line, code: &str, position: &Json) -> Result<(), String> {
    let here = done(line, "{mpo:n}")?;
    let here = here.get("mpo").ok_or("no mpo")?;
    let is_elsewhere =
        |(axis, value): &&(String, Json)| here.get(axis).is_some_and(|is| !is.is_same(value));
    let words = position.members().iter().filter(is_elsewhere);
    let words: Vec<_> =
        words.map(|(axis, value)| format!("{}{}", axis.to_uppercase(), spelled(value))).collect();
    if !words.is_empty() {
        done(line, &format!("G28.3 {}", words.join(" ")))?;
    }
    done(line, code).map(drop)
}

/// Sends everything back. Returns what was refused or differs afterwards. The machine restarts at the end, and must
/// be homed.
pub fn load(line: &mut impl Line, file: &Json) -> Result<Vec<String>, String> {
    let before = begin(line)?;
    let stat = number(line, "stat")?;
    if stat >= 5.0 {
        return Err(format!("the machine does not rest: stat is {stat}"));
    }
    let mut wrong = Vec::new();
    let system = file.get("sys").map(Json::members).unwrap_or_default();
    let of_system = |names: &[&str]| -> Vec<(String, Json)> {
        names.iter().filter_map(|n| system.iter().find(|(name, _)| name == n).cloned()).collect()
    };
    let profile = of_system(&[PROFILE]);
    if let [(name, value)] = &profile[..]
        && number(line, name).ok() != value.number()
    {
        put(line, "sys", &profile, &mut wrong)?;
    }
    let is_stored = |group: &str| STORED.iter().any(|(name, _)| *name == group);
    let names: Vec<_> = groups().filter(|group| !is_stored(group)).collect();
    for group in &names {
        let Some(members) = file.get(group) else { continue };
        if OPTIONAL.contains(&group.as_str())
            && exchange(line, &format!("{{{group}:n}}"))?.1 == UNKNOWN
        {
            wrong.push(format!("there is no {group}"));
            continue;
        }
        let is_meant = |(name, _): &&(String, Json)| {
            let name = name.as_str();
            let others = [&FIXED[..], &TALK, &STOPPING, &[PROFILE]].concat();
            group != "sys" || !others.contains(&name)
        };
        let members: Vec<_> = members.members().iter().filter(is_meant).cloned().collect();
        put(line, group, &members, &mut wrong)?;
        differ(line, group, &members, &mut wrong)?;
    }
    for (group, code) in STORED {
        let Some(position) = file.get(group) else { continue };
        let mut other = Vec::new();
        differ(line, group, position.members(), &mut other)?;
        if !other.is_empty() {
            store(line, code, position)?;
            differ(line, group, position.members(), &mut wrong)?;
        }
    }
    wait_until_kept(line)?;
    put(line, "sys", &of_system(&STOPPING), &mut wrong)?;
    end(line, &before);
    for (name, value) in of_system(&TALK) {
        ask_quietly(line, &format!("{{{name}:{}}}", spelled(&value)));
    }
    line.restart()?;
    Ok(wrong)
}

/// Reads a group again. Returns the values that differ from the file.
fn differ(
    line: &mut impl Line,
    group: &str,
    members: &[(String, Json)],
    wrong: &mut Vec<String>,
) -> Result<(), String> {
    let body = done(line, &format!("{{{group}:n}}"))?;
    let Some(are) = body.get(group) else { return Err(format!("no {group}")) };
    for (name, value) in members {
        match are.get(name) {
            Some(is) if is.is_same(value) => {}
            Some(is) => {
                wrong.push(format!(
                    "{group} {name} is {} instead of {}",
                    spelled(is),
                    spelled(value)
                ));
            }
            None => wrong.push(format!("there is no {group} {name}")),
        }
    }
    Ok(())
}

fn wait_until_kept(line: &mut impl Line) -> Result<(), String> {
    for _ in 0..KEPT {
        if number(line, "kept")? == 1.0 {
            return Ok(());
        }
    }
    Err("the machine does not get everything stored".to_string())
}
