//! Files on an SD card: M20 to M29, M30 with a name, M32. While a file is printed only M24 to M27 are carried out.
//! Between M28 and M29 lines are written to a file, and only lines that overtake are carried out.

use super::command::{value, words};
use super::host::{self, Step};
use super::write::{int, line_end, text};
use crate::capability::Capability;
use crate::card::{Entry, NAME_MAX, Op, letters};
use crate::progmem::Text;
use crate::protocol::{Machine, Out};
use crate::status::Status;
use crate::text;

/// Performs part `at` of a code.
#[inline(never)]
#[small]
pub fn part(
    number: u16,
    at: u8,
    block: &[u8],
    machine: &mut impl Machine,
    out: &mut impl Out,
) -> Step {
    let has_file = machine.card_progress().is_some();
    // Without a file there is nothing to pause but the program: behind the lines before, as M0.
    if number == 25 && !has_file {
        return Step::Gcode;
    }
    if number == 24 && host::go_on(machine, out) && !has_file {
        return Step::Done;
    }
    if let Err(status) = Capability::Sd.check() {
        return Step::Refused(status);
    }
    match number {
        20 => return list(at, machine, out),
        21 => match machine.card(Op::Begin) {
            Status::Again => return Step::Later(0),
            Status::Ok => text(out, text!("echo:SD card ok\n")),
            status => return Step::Refused(status),
        },
        22 => return done(machine.card(Op::Release)),
        28 | 29 => return write(number, at, block, machine, out),
        23 | 32 => return open(number, at, block, machine, out),
        24 | 26 if !has_file => text(out, text!("echo:no file selected; M23\n")),
        25 if machine.card_prints() => {
            text(out, text!("//action:paused\n"));
            return done(machine.card(Op::Print(false)));
        }
        24 | 25 => return done(machine.card(Op::Print(number == 24))),
        26 => {
            return match value(block, b'S', 0).and_then(|at| u32::try_from(at).ok()) {
                Some(at) => done(machine.card(Op::Seek(at))),
                None => Step::Refused(Status::OutOfRange),
            };
        }
        27 => progress(machine, out),
        _ => match machine.card(Op::Delete(name(block))) {
            Status::Again => return Step::Later(0),
            Status::Ok => {
                text(out, text!("File deleted:"));
                named(block, out);
                line_end(out);
            }
            Status::UnrecognizedName => missing(text!("Deletion"), block, out),
            status => return Step::Refused(status),
        },
    }
    Step::Done
}

#[small]
fn done(status: Status) -> Step {
    if status == Status::Ok { Step::Done } else { Step::Refused(status) }
}

/// Returns the name of a file, without the characters that hosts put around it.
#[small]
fn name(block: &[u8]) -> &[u8] {
    let name = words(block);
    let from = name.iter().position(|byte| !matches!(byte, b'!' | b'/')).unwrap_or(name.len());
    let name = name.get(from..).unwrap_or(&[]);
    let end = name.iter().position(|byte| matches!(byte, b'#' | b' ' | b';')).unwrap_or(name.len());
    name.get(..end).unwrap_or(&[])
}

/// Lists the files, one per part.
#[small]
fn list(at: u8, machine: &mut impl Machine, out: &mut impl Out) -> Step {
    if at == 0 {
        return match machine.card_entry(0) {
            Err(status) => Step::Refused(status),
            Ok(_) => {
                text(out, text!("Begin file list\n"));
                Step::At(1)
            }
        };
    }
    match machine.card_entry(at - 1) {
        Ok(Some(entry)) if at < u8::MAX => {
            put(&entry, out);
            Step::At(at + 1)
        }
        _ => {
            text(out, text!("End file list\n"));
            Step::Done
        }
    }
}

#[small]
fn put(entry: &Entry, out: &mut impl Out) {
    out.put_all(letters(&entry.name));
    out.put(b' ');
    size(entry.size, out);
    line_end(out);
}

#[small]
fn size(bytes: u32, out: &mut impl Out) {
    int(out, i32::try_from(bytes).unwrap_or(i32::MAX));
}

#[small]
fn named(block: &[u8], out: &mut impl Out) {
    out.put_all(name(block).iter().copied().take(NAME_MAX));
}

/// Reports that there is no file with the name of a block, in the words that hosts know.
#[small]
fn missing(what: Text, block: &[u8], out: &mut impl Out) {
    text(out, what);
    text(out, text!(" failed, File: "));
    named(block, out);
    text(out, text!(".\n"));
}

#[small]
fn open(number: u16, at: u8, block: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Step {
    if at == 0 {
        return match machine.card(Op::Open(name(block))) {
            Status::Ok => {
                text(out, text!("File opened: "));
                named(block, out);
                text(out, text!(" Size: "));
                size(machine.card_progress().map_or(0, |(_, size)| size), out);
                line_end(out);
                Step::At(1)
            }
            Status::UnrecognizedName => {
                missing(text!("open"), block, out);
                Step::Done
            }
            status => Step::Refused(status),
        };
    }
    text(out, text!("File selected\n"));
    if number == 32 { done(machine.card(Op::Print(true))) } else { Step::Done }
}

/// M28, M29: begins to write a file, and completes it.
#[small]
fn write(
    number: u16,
    at: u8,
    block: &[u8],
    machine: &mut impl Machine,
    out: &mut impl Out,
) -> Step {
    if let Err(status) = Capability::CardWrite.check() {
        return Step::Refused(status);
    }
    let done = match (number, at) {
        (28, 0) => machine.card(Op::Create(name(block))),
        (29, 0) => machine.card(Op::Finish),
        _ => {
            named(block, out);
            line_end(out);
            return Step::Done;
        }
    };
    match done {
        Status::Ok if number == 28 => {
            text(out, text!("Writing to file: "));
            Step::At(1)
        }
        Status::Ok => {
            text(out, text!("Done saving file.\n"));
            Step::Done
        }
        Status::Again => Step::Later(0),
        Status::UnrecognizedName => {
            missing(text!("open"), block, out);
            Step::Done
        }
        status => Step::Refused(status),
    }
}

/// Reports the progress. Only while a file prints: if a paused print told its bytes, OctoPrint would take it for a
/// print that was started at the printer.
#[small]
fn progress(machine: &mut impl Machine, out: &mut impl Out) {
    let prints = machine.card_prints();
    let Some((at, of)) = machine.card_progress().filter(|_| prints) else {
        return text(out, text!("Not SD printing\n"));
    };
    text(out, text!("SD printing byte "));
    size(at, out);
    out.put(b'/');
    size(of, out);
    line_end(out);
}
