//! What the dialects of TinyG and grbl do with files of an SD card, under their own names.
//!
//! A list, a run, a deletion and an upload mount the card first, because it may have been changed. Thread mode.

use crate::card::Op;
use crate::machine::Doing;
use crate::protocol::{Machine, Value};
use crate::status::Status;

/// What a name does with files.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Files {
    /// Mounts the card.
    Mount,
    /// Lists the files.
    List,
    /// Runs a file.
    Run,
    /// Deletes a file.
    Delete,
    /// Begins to write a file.
    Write,
    /// Completes the file that is being written.
    Finish,
    /// Gives up the file that is being written, or ends the one that runs.
    Drop,
}

/// Mounts the card, at rest or in an alarm, while no file is in use: else [`Status::NotAccepted`]. [`Status::Again`]: it
/// is not ready yet.
pub fn mount(machine: &mut impl Machine) -> Status {
    let rests = matches!(machine.doing(), Doing::Rests | Doing::Alarm(_));
    if !rests || machine.value(Value::FileUse) > 1 {
        return Status::NotAccepted;
    }
    machine.card(Op::Begin)
}

/// Does something with the file of a name, on a card that is mounted. [`Status::Again`]: this is to be called again.
pub fn carry_out(what: Files, name: &[u8], machine: &mut impl Machine) -> Status {
    match what {
        Files::Mount | Files::List => Status::Ok,
        Files::Run => match machine.card(Op::Open(name)) {
            Status::Ok => machine.card(Op::Print(true)),
            status => status,
        },
        Files::Delete => machine.card(Op::Delete(name)),
        Files::Write => machine.card(Op::Create(name)),
        Files::Finish => machine.card(Op::Finish),
        Files::Drop => machine.card(Op::Drop),
    }
}
