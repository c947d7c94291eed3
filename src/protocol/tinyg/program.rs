//! The program that is kept in EEPROM, on the wire.
//!
//! ```text
//! {prog:f}          a new one begins        $prog=f
//! {prog:"G0 X1"}    a line of it            $prog=G0 X1
//! {prog:t}          it is complete          $prog=t
//! {prog:n}          what it is              $prog
//! {test:100}        carries it out          $test=100
//! ```

use super::json::{Kind, Pair};
use super::request::{Context, Phase, Request};
use super::write::Writer;
use crate::protocol::{Machine, Out, Store};
use crate::status::Status;

/// Bytes of it that a step shows; each may become two.
const STEP: u16 = 24;

/// Does to the program what the value of a pair says.
#[inline(never)]
#[small]
pub(super) fn store<M: Machine, O>(pair: &Pair, c: &mut Context<'_, M, O>) -> Result<(), Status> {
    let text = pair.value.of(c.line);
    let what = match (pair.kind, text) {
        (Kind::Null, _) => return Ok(()),
        (Kind::Object, _) => return Err(Status::UnsupportedType),
        // In text mode every value is a line.
        (Kind::False, _) | (Kind::Number, [b'f' | b'F']) => Store::Begin,
        (Kind::True, _) | (Kind::Number, [b't' | b'T']) => Store::End,
        // No line of G-code needs one.
        _ if text.iter().any(|byte| matches!(byte, b'\\' | b'"')) => {
            return Err(Status::JsonSyntax);
        }
        _ => Store::Line(text),
    };
    c.machine.store(what)
}

#[small]
impl Request {
    /// Begins to show the program as the value of a pair.
    pub(super) fn show_program<M: Machine, O: Out>(
        &mut self,
        pair: &Pair,
        c: &mut Context<'_, M, O>,
    ) {
        self.open_string(pair, c);
        self.item = 0;
        self.phase = Phase::Program;
    }

    /// Some of it.
    pub(super) fn program<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let start = u16::from(self.item) * STEP;
        self.item += 1;
        // That of text mode, in a string or not, ends otherwise.
        let is_value = self.is_json && !self.format.is_wrapped();
        let mut writer = Writer::body(c.out, &mut self.format);
        for at in start..start + STEP {
            match c.machine.program(at) {
                Some(b'\n') if is_value => {
                    writer.byte(b'\\');
                    writer.byte(b'n');
                }
                Some(b'\n') => writer.end_line(),
                Some(byte) => writer.printable(byte),
                None if is_value => {
                    writer.byte(b'"');
                    self.phase = Phase::Pair;
                    return;
                }
                None => {
                    self.phase = Phase::Prompt;
                    return;
                }
            }
        }
    }
}
