//! The SD card, in names that are Kerf's own, because neither TinyG nor g2core has one.
//!
//! ```text
//! {sdl:n}       lists the files, each with its length in bytes: {"sdl":"PART.NC 1234\nB.NC 5"}   $sdl
//! {sdr:"NAME"}  runs a file                                                                      $sdr=NAME
//! {sdd:"NAME"}  deletes a file                                                                   $sdd=NAME
//! {sdw:"NAME"}  writes a file: the blocks of G-code that follow, up to                           $sdw=NAME
//! {sdw:t}       which completes it                                                               $sdw=t
//! {sdx:t}       gives up what is being written, or ends the file that runs                       $sdx=t
//! ```
//!
//! The first four mount the card first, because it may have been changed, and need the machine at rest.

use super::json::{Kind, Pair};
use super::request::{Context, Phase, Request};
use super::write::Writer;
use crate::capability::Capability;
use crate::card::letters;
use crate::config::Fixed;
use crate::protocol::files::{self, Files};
use crate::protocol::{Machine, Out};
use crate::status::Status;

/// The progress of an operation: the card has been mounted.
const MOUNTED: u8 = 1;

#[small]
impl Request {
    /// Carries out a pair that does something with files, but for the list. [`Status::Again`]: it goes on later.
    pub(super) fn files<M: Machine, O>(
        &mut self,
        what: Files,
        pair: &Pair,
        c: &mut Context<'_, M, O>,
    ) -> Result<(), Status> {
        let text = pair.value.of(c.line);
        // In text mode any value is parsed as a number.
        let is_text = matches!(pair.kind, Kind::Text | Kind::Number);
        let is_true = pair.kind == Kind::True
            || !matches!(pair.kind, Kind::Text) && matches!(text, [b't' | b'T']);
        let what = match what {
            // An empty string is null, too.
            _ if pair.kind == Kind::Null => return Err(Status::UnsupportedType),
            Files::Write if is_true => Files::Finish,
            Files::Drop if is_true => Files::Drop,
            Files::Run | Files::Delete | Files::Write if is_text => {
                self.mount(c.machine)?;
                what
            }
            _ => return Err(Status::UnsupportedType),
        };
        let status = files::carry_out(what, text, c.machine);
        if status != Status::Again {
            self.item = 0;
        }
        of(status)
    }

    /// Mounts the card, at rest or in an alarm.
    pub(super) fn mount(&mut self, machine: &mut impl Machine) -> Result<(), Status> {
        if self.item == MOUNTED {
            return Ok(());
        }
        of(files::mount(machine))?;
        self.item = MOUNTED;
        Ok(())
    }

    /// Starts to list the files as the value of a pair. [`Status::Again`]: the card has to be waited for.
    pub(super) fn show_files<M: Machine, O: Out>(
        &mut self,
        pair: &Pair,
        c: &mut Context<'_, M, O>,
    ) -> Result<(), Status> {
        self.mount(c.machine)?;
        self.open_string(pair, c);
        self.item = 0;
        self.phase = Phase::Files;
        Ok(())
    }

    /// Writes the next file of the list.
    pub(super) fn next_file<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let number = self.item;
        self.item += 1;
        // In text mode, wrapped in a string or not, the list ends with a prompt instead of a quote.
        let is_value = !Capability::Text.is_built_in() || self.is_json && !self.format.is_wrapped();
        let entry = c.machine.card_entry(number);
        let mut writer = Writer::body(c.out, &mut self.format);
        let entry = match entry {
            Ok(Some(entry)) if number < u8::MAX => entry,
            ended => {
                if is_value {
                    writer.byte(b'"');
                }
                self.status = ended.err().unwrap_or(Status::Ok);
                self.phase = match (is_value, self.status) {
                    (true, Status::Ok) => Phase::Pair,
                    (true, _) => Phase::Warning,
                    (false, _) => Phase::Prompt,
                };
                self.item = 0;
                return;
            }
        };
        if is_value && number > 0 {
            writer.byte(b'\\');
            writer.byte(b'n');
        }
        letters(&entry.name).for_each(|letter| writer.printable(letter));
        writer.byte(b' ');
        writer.fixed(Fixed::int(i32::try_from(entry.size).unwrap_or(i32::MAX)));
        if !is_value {
            writer.end_line();
        }
    }
}

fn of(status: Status) -> Result<(), Status> {
    if status == Status::Ok { Ok(()) } else { Err(status) }
}
