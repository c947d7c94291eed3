//! The SD card, in the words that grblHAL has for it.
//!
//! ```text
//! $FM        mounts the card
//! $F         lists its files: [FILE:/PART.NC|SIZE:1234]
//! $F=NAME    runs a file
//! $FD=NAME   deletes a file
//! $FW=NAME   writes a file: the lines of G-code that follow, up to
//! $FW        which completes it
//! $FX        gives up what is being written, or ends the file that runs
//! ```
//!
//! The last three are Kerf's own. `$F`, `$F=`, `$FD=` and `$FW=` mount the card first, because it may have been changed.

use super::request::Step;
use super::status::{LOCKED, error_number};
use super::write::{close, int, message, text};
use crate::card::letters;
use crate::machine::Doing;
use crate::protocol::files::{self, Files};
use crate::protocol::{Machine, Out, Value};
use crate::status::Status;
use crate::text;

/// The errors of a card that cannot be mounted, and of a file that cannot be read or written.
const MOUNT: u8 = 60;
const READ: u8 = 61;

/// The first part behind the mounting.
const MOUNTED: u8 = 1;

/// Returns what the letters behind a `$` do with files. `None`: something else.
pub fn of(letters: &[u8]) -> Option<Files> {
    Some(match letters {
        [b'F'] => Files::List,
        [b'F', b'M'] => Files::Mount,
        [b'F', b'W'] => Files::Finish,
        [b'F', b'X'] => Files::Drop,
        [b'F', b'=', ..] => Files::Run,
        [b'F', b'D', b'=', ..] => Files::Delete,
        [b'F', b'W', b'=', ..] => Files::Write,
        _ => return None,
    })
}

/// Performs part `at` of a command. `name` is the text behind its `=`.
#[inline(never)]
pub fn part(
    what: Files,
    at: u8,
    name: &[u8],
    machine: &mut impl Machine,
    out: &mut impl Out,
) -> Step {
    let name = name.strip_prefix(b"/").unwrap_or(name);
    let mounts = !matches!(what, Files::Finish | Files::Drop);
    let is_locked = what == Files::Run && matches!(machine.doing(), Doing::Alarm(_));
    match (at, what) {
        (0, _) if is_locked => Step::Error(LOCKED),
        (0, _) if mounts => match files::mount(machine) {
            Status::Ok => Step::Later(MOUNTED),
            Status::CardError => Step::Error(MOUNT),
            status => done(status, at, out),
        },
        (_, Files::List) => list(at, machine, out),
        _ => done(files::carry_out(what, name, machine), at, out),
    }
}

/// Lists the files, one a part.
fn list(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Step {
    match machine.card_entry(at - MOUNTED) {
        Ok(Some(entry)) if at < u8::MAX => {
            text(out, text!("[FILE:/"));
            out.put_all(letters(&entry.name));
            text(out, text!("|SIZE:"));
            int(out, i32::try_from(entry.size).unwrap_or(i32::MAX));
            close(out);
            Step::At(at + 1)
        }
        Ok(_) => Step::Done,
        Err(status) => done(status, at, out),
    }
}

fn done(status: Status, at: u8, out: &mut impl Out) -> Step {
    match status {
        Status::Ok => Step::Done,
        Status::Again => Step::Later(at),
        Status::CardError | Status::UnrecognizedName => Step::Error(READ),
        #[cfg(feature = "card-write")]
        Status::CardFull => {
            message(out, text!("SD card is full"));
            Step::Error(READ)
        }
        status => Step::Error(error_number(status)),
    }
}

/// Writes the field of a status report for a file that runs: `|SD:12.5,PART.NC`.
pub fn field(machine: &mut impl Machine, out: &mut impl Out) {
    if machine.value(Value::FileUse) < 2 {
        return;
    }
    let (at, of) = (machine.value(Value::FileAt), machine.value(Value::FileLength));
    let tenths = (i64::from(at) * 1_000 / i64::from(of.max(1))) as i32;
    text(out, text!("|SD:"));
    int(out, tenths / 10);
    out.put(b'.');
    int(out, tenths % 10);
    out.put(b',');
    out.put_all(letters(&machine.card_name()));
}
