//! Settings by name, `$xvm=1200`, of an image that has no dialect but that of printing hosts.

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use crate::machine::Machine;
use crate::oracle::Setup;

/// Time between two checks for an answer, ms.
const LOOK_MS: u64 = 1;
/// Longest time of an answer, ms of AVR time.
const ASK_MS: u64 = 30_000;
/// Longest time of a start, ms of AVR time.
const BOOT_MS: u64 = 5_000;

/// Waits for `start` and a little longer.
pub fn boot(machine: &mut Machine) -> Result<()> {
    hear(machine, BOOT_MS, |line| line == "start")?;
    machine.run_for_ms(100)?;
    Ok(())
}

/// Sends a line and waits for its `ok`. Returns the lines before that. A refusal is an error.
pub fn ask(machine: &mut Machine, line: &str) -> Result<Vec<String>> {
    machine.send(format!("{line}\n").as_bytes());
    let said = hear(machine, ASK_MS, |line| line.starts_with("ok"))?;
    let refusal = said.iter().find(|said| said.starts_with("Error:") || said.contains("Unknown"));
    match refusal {
        Some(refusal) => bail!("{line} is answered by {refusal}"),
        None => Ok(said),
    }
}

/// Runs until a line is the one that is waited for. Returns the lines up to it.
fn hear(machine: &mut Machine, most_ms: u64, last: impl Fn(&str) -> bool) -> Result<Vec<String>> {
    let end = machine.cycle() + machine.cycles(most_ms);
    let mut text = String::new();
    loop {
        machine.run_for_ms(LOOK_MS)?;
        text += &String::from_utf8_lossy(&machine.receive());
        let whole = text.rsplit_once('\n').map_or("", |(whole, _)| whole);
        if whole.lines().any(|line| last(line.trim())) {
            return Ok(whole.lines().map(|line| line.trim().to_owned()).collect());
        }
        ensure!(machine.cycle() < end, "no answer, only {text:?}");
    }
}

/// Returns the lines by name for what TinyG's dialect has as `{xvm:1200}`, `{x:{vm:1200,fr:1200}}` or `{xvm:n}`:
/// `$xvm=1200`, or `$xvm`. An error if a part is no pair.
pub fn lines(settings: &str) -> Result<Vec<String>> {
    let (mut group, mut lines) = ("", Vec::new());
    for part in settings.trim().split(['{', ',', '}']).filter(|part| !part.is_empty()) {
        let (name, value) = part.split_once(':').with_context(|| format!("no pair: {part}"))?;
        let name = name.trim_matches('"');
        match value {
            "" => group = name,
            "n" | "null" => lines.push(format!("${group}{name}")),
            _ => lines.push(format!("${group}{name}={value}")),
        }
    }
    Ok(lines)
}

/// Sets what [`lines`] translates.
pub fn set(machine: &mut Machine, settings: &str) -> Result<()> {
    for line in lines(settings)? {
        ask(machine, &line)?;
    }
    Ok(())
}

/// Returns the value of a setting.
pub fn value(machine: &mut Machine, name: &str) -> Result<Value> {
    let said = ask(machine, &format!("${name}"))?;
    let mark = format!("${name}=");
    let value = said.iter().find_map(|line| line.split_once(&mark)).map(|(_, value)| value);
    let value = value.with_context(|| format!("{name} is answered by {said:?}"))?;
    serde_json::from_str(value).with_context(|| format!("{name} is {value}"))
}

/// Reads motors and axes from the firmware.
pub fn read_setup(machine: &mut Machine) -> Result<Setup> {
    crate::job::setup_of(|name| value(machine, name))
}
