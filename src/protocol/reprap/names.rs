//! `$name`, `$name=value` and `$$`: settings by Kerf's own names.
//!
//! This dialect has codes for the settings that hosts change ([`settings`](super::settings)). All others, such as
//! switches, sensors and directions, are set by name, so that an image with this dialect alone can be set up. A line
//! that sets something runs at rest, and is answered when the value is in memory. The lines of `$$` can be sent back.

use super::host::Step;
use super::write::{line_end, text};
use crate::config::Setting;
use crate::protocol::{Machine, Out, Value, by_name};
use crate::status::Status;
use crate::text;

/// The part that waits until the value is in memory.
const STORES: u8 = u8::MAX;
const _: () = assert!(Setting::NUMBERS < STORES);

/// Performs part `at` of a line that begins with `$`.
#[inline(never)]
#[small]
pub fn part(at: u8, block: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Step {
    // A comment behind the line is no part of the name or the value.
    let line = block.split(|byte| *byte == b';').next().unwrap_or(block);
    let line = line.get(1..).unwrap_or(&[]).trim_ascii();
    if line == b"$" {
        return list(at, machine, out);
    }
    let mut parts = line.splitn(2, |byte| *byte == b'=');
    let name = parts.next().unwrap_or(&[]).trim_ascii();
    let Some(setting) = by_name::find(name) else {
        return Step::Refused(Status::UnrecognizedName);
    };
    match parts.next() {
        None => {
            put(setting, machine, out);
            Step::Done
        }
        Some(value) => set(at, setting, value.trim_ascii(), machine),
    }
}

/// Writes one setting of `$$`: all that are kept, so that the list is a copy of the machine.
#[small]
fn list(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Step {
    if at >= Setting::NUMBERS {
        return Step::Done;
    }
    let setting = Setting::from_number(at);
    if let Some(setting) = setting.filter(|one| one.is_kept() || one.is_cold()) {
        put(setting, machine, out);
    }
    Step::At(at + 1)
}

#[small]
fn put(setting: Setting, machine: &mut impl Machine, out: &mut impl Out) {
    text(out, text!("echo:  "));
    by_name::write(setting, machine, out);
    line_end(out);
}

#[small]
fn set(at: u8, setting: Setting, value: &[u8], machine: &mut impl Machine) -> Step {
    if at == STORES {
        return if machine.value(Value::Kept) == 0 { Step::Later(at) } else { Step::Done };
    }
    if machine.value(Value::Working) != 0 {
        return Step::Later(at);
    }
    match by_name::set(setting, value, machine) {
        Ok(_) => Step::Later(STORES),
        Err(Status::Again) => Step::Later(at),
        Err(status) => Step::Refused(status),
    }
}
