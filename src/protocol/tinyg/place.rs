//! Text mode: a line for a position on an axis: that of a coordinate system, of G92, a stored position, or a tool
//! length.
//!
//! ```text
//! [g54x] g54 x offset               0.000 mm
//! [g28z] g28 z position             0.000 mm
//! ```

use super::token::{Shown, Subject, Token};
use super::value::{Form, SHIFT, place_form};
use super::write::Writer;
use crate::config::Fixed;
use crate::config::name::{Name, axis_letter};
use crate::progmem::Text;
use crate::protocol::{Machine, Out};
use crate::text;

/// A position on an axis.
pub(super) struct Place {
    token: Token,
    axis: u8,
    title: Text,
}

#[small]
impl Place {
    /// Returns the position that a token stands for; `None` if it stands for something else.
    pub fn of(token: Token) -> Option<Place> {
        let (axis, title) = match token.subject()? {
            Subject::Member(SHIFT, _, axis) => (axis, text!(" offset")),
            Subject::TableRow(row, axis) if row.is_stored() => (axis, text!(" position")),
            Subject::TableRow(row, axis) if row.is_tool() => (axis, text!(" length")),
            Subject::TableRow(_, axis) => (axis, text!(" offset")),
            _ => return None,
        };
        Some(Place { token, axis, title })
    }

    /// Writes the title.
    #[inline(never)]
    pub fn title<O: Out>(&self, writer: &mut Writer<'_, O>) {
        let name = self.token.name();
        writer.byte(b'[');
        writer.lower(name.bytes());
        writer.byte(b']');
        writer.byte(b' ');
        writer.lower(group(&name));
        writer.byte(b' ');
        writer.byte(axis_letter(self.axis));
        writer.text(self.title);
    }

    /// Returns the column at which the title ends.
    pub fn title_end(&self) -> usize {
        2 * self.token.name().bytes().len() + 4 + self.title.len()
    }

    /// Returns the value.
    pub fn value(&self, machine: &mut impl Machine) -> Fixed {
        match self.token.read(machine) {
            Shown::Number(fixed) => fixed,
            Shown::Text(_) | Shown::Data(_) => Fixed::int(0),
        }
    }

    /// Writes the unit, and ends the line.
    pub fn unit<M: Machine, O: Out>(&self, machine: &mut M, writer: &mut Writer<'_, O>) {
        writer.text(match (place_form(self.axis), machine.inches()) {
            (Form::Length, true) => text!(" in"),
            (Form::Length, false) => text!(" mm"),
            _ => text!(" deg"),
        });
        writer.end_line();
    }
}

/// Returns a name without the letter of the axis.
#[small]
fn group(name: &Name) -> &[u8] {
    name.bytes().split_last().map_or(&[], |(_, group)| group)
}
