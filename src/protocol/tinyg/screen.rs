//! Text mode: a line of the status report that answers `?`, or of any value that is not a setting.
//!
//! Counts end in column 22, numbers with decimals in column 26. Texts begin in column 22.

use super::token::{Shown, Subject, Token};
use super::value::Form;
use super::write::Writer;
use crate::config::Fixed;
use crate::config::name::axis_letter;
use crate::progmem::Text;
use crate::protocol::{Machine, Out};
use crate::text;
use crate::units::FIRST_ROTARY;

const COUNT_END: usize = 22;
const DECIMALS_END: usize = 26;
const TEXT_START: usize = 21;

/// The label before a value.
pub(super) struct Label {
    letter: Option<u8>,
    text: Text,
}

#[small]
impl Label {
    pub fn of(token: Token) -> Label {
        match token.subject() {
            Some(Subject::Single(single)) => Label { letter: None, text: single.label },
            Some(Subject::Member(_, vector, index)) if !vector.label.is_empty() => {
                let letter = axis_letter(index).to_ascii_uppercase();
                Label { letter: Some(letter), text: vector.label }
            }
            _ => Label { letter: None, text: text!("") },
        }
    }

    pub fn write<O: Out>(&self, token: Token, writer: &mut Writer<'_, O>) {
        if self.text.is_empty() {
            writer.lower(token.name().bytes());
            writer.byte(b':');
        }
        if let Some(letter) = self.letter {
            writer.byte(letter);
        }
        writer.text(self.text);
    }

    fn len(&self, token: Token) -> usize {
        match self.text.len() {
            0 => token.name().bytes().len() + 1,
            len => len + usize::from(self.letter.is_some()),
        }
    }

    pub fn value<M: Machine, O: Out>(
        &self,
        token: Token,
        machine: &mut M,
        writer: &mut Writer<'_, O>,
    ) {
        let len = self.len(token);
        match (choice(token, machine), read(token, machine)) {
            (Some((choices, index)), _) => {
                writer.blanks(TEXT_START.saturating_sub(len));
                write_choice(choices, index, writer);
            }
            (None, Shown::Number(fixed)) => {
                let end = if fixed.decimals == 0 { COUNT_END } else { DECIMALS_END };
                writer.aligned(fixed, end.saturating_sub(len));
            }
            (None, Shown::Data(bits)) => {
                writer.blanks(TEXT_START.saturating_sub(len));
                writer.bits(bits);
            }
            (None, Shown::Text(text)) => {
                writer.blanks(TEXT_START.saturating_sub(len));
                writer.text(text);
            }
        }
        write_unit(token, machine.inches(), writer);
        writer.end_line();
    }
}

/// Returns the names of a value's numbers, and the index of the present one; `None` if its numbers have no names.
#[small]
fn choice<M: Machine>(token: Token, machine: &mut M) -> Option<(Text, i32)> {
    match token.subject() {
        Some(Subject::Single(single)) if !single.choices.is_empty() => {
            Some((single.choices, single.source.choice(machine)))
        }
        _ => None,
    }
}

/// Writes entry `index` of `choices`, or the number if there is no such entry.
#[small]
fn write_choice<O: Out>(choices: Text, index: i32, writer: &mut Writer<'_, O>) {
    let (mut entry, mut found) = (0, false);
    for byte in choices.bytes() {
        if byte == b'|' {
            entry += 1;
        } else if entry == index {
            writer.byte(byte);
            found = true;
        }
    }
    if !found {
        writer.fixed(Fixed::int(index));
    }
}

/// Returns the value as text reports show it, where speeds have a third decimal.
#[small]
fn read<M: Machine>(token: Token, machine: &mut M) -> Shown {
    let inches = machine.inches();
    match token.subject() {
        Some(Subject::Single(single)) if single.form == Form::Speed => {
            let speed = Fixed { value: single.source.read(machine), decimals: 3 };
            Shown::Number(if inches { speed.inches(3) } else { speed })
        }
        _ => token.read(machine),
    }
}

#[small]
fn write_unit<O: Out>(token: Token, inches: bool, writer: &mut Writer<'_, O>) {
    let length = |inches| if inches { text!(" in") } else { text!(" mm") };
    match token.subject() {
        Some(Subject::Single(single)) if single.form == Form::Speed => {
            writer.text(length(inches));
            writer.text(text!("/min"));
        }
        Some(Subject::Member(_, vector, index))
            if !matches!(vector.form, Form::Count | Form::Steps) =>
        {
            let rotary = usize::from(index) >= FIRST_ROTARY;
            let inches = inches && vector.form(index) == Form::Length;
            writer.text(if rotary { text!(" deg") } else { length(inches) });
        }
        _ => {}
    }
}
