//! `$name` and `$name=value`: settings by Kerf's own names, for the dialects of grbl and of printing hosts.
//!
//! Values are in the unit of TinyG's dialect, always in millimetres, and have all decimals that are stored. Called by
//! these dialects in thread mode; the cost is that of a look-up by name, 1,000 cycles, or 3 ms if the setting is in
//! EEPROM.

use super::write::{fixed, text};
use super::{Machine, Out, Warning};
use crate::config::name::Name;
use crate::config::table::Kind;
use crate::config::{Fixed, Number, Setting, hex};
use crate::status::Status;

/// Returns the setting with a name; `None` if there is none.
#[inline(never)]
#[small]
pub fn find(name: &[u8]) -> Option<Setting> {
    Setting::find(&Name::new().with(name)?)
}

/// Writes `$name=value`, without a line end.
#[inline(never)]
#[small]
pub fn write(setting: Setting, machine: &mut impl Machine, out: &mut impl Out) {
    out.put(b'$');
    out.put_all(setting.name().bytes().iter().copied());
    out.put(b'=');
    let (row, value) = (setting.row(), machine.setting(setting));
    match row.kind {
        Kind::Text => text(out, setting.text()),
        Kind::Data | Kind::Job => out.put_all(hex(value).iter().copied()),
        _ => fixed(out, Fixed { value, decimals: row.stored }),
    }
}

/// Sets a setting to the value in `text`. [`Status::Again`] as of `Machine::set_row`: the whole call has to be
/// repeated.
#[inline(never)]
#[small]
pub fn set(setting: Setting, text: &[u8], machine: &mut impl Machine) -> Result<Warning, Status> {
    match text {
        [b'0', b'x' | b'X', digits @ ..] if setting.is_data() => {
            store(setting, parse_hex(digits)?, machine)
        }
        _ => put(setting, parse(text)?, machine),
    }
}

/// Parses up to eight hexadecimal digits.
#[small]
fn parse_hex(digits: &[u8]) -> Result<i32, Status> {
    if !(1..=8).contains(&digits.len()) {
        return Err(Status::BadNumber);
    }
    let digit = |bits: u32, byte: &u8| Some(bits << 4 | char::from(*byte).to_digit(16)?);
    let bits = digits.iter().try_fold(0, digit).ok_or(Status::BadNumber)?;
    Ok(bits.cast_signed())
}

/// Parses a number. Commas are refused, so that 1,5 is not taken for 15.
#[small]
pub fn parse(text: &[u8]) -> Result<Number, Status> {
    Number::parse(text).filter(|_| !text.contains(&b',')).ok_or(Status::BadNumber)
}

/// Checks a number and stores it.
#[inline(never)]
#[small]
pub fn put(setting: Setting, to: Number, machine: &mut impl Machine) -> Result<Warning, Status> {
    let value = machine.settings().check(setting, to, false).map_err(|status| match status {
        // grbl's error 4 is for negative values only.
        Status::BelowMinimum => Status::OutOfRange,
        other => other,
    })?;
    store(setting, value, machine)
}

/// Stores a value that has the scale of the stored setting. A value that the setting has already is set, too: a profile
/// is taken over anew, and what M92 has lent is stored. EEPROM is written only where it has another value.
#[inline(never)]
#[small]
pub fn store(setting: Setting, value: i32, machine: &mut impl Machine) -> Result<Warning, Status> {
    if !setting.accepts(value) {
        return Err(Status::OutOfRange);
    }
    machine.set(setting, value)
}
