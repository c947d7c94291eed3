//! The stored program, as senders write and read it.
//!
//! ```text
//! {prog:f}       begins a new program  $prog=f
//! {prog:"G0 X1"} appends a line        $prog=G0 X1
//! {prog:t}       completes it          $prog=t
//! {prog:n}       shows it              $prog
//! {test:100}     runs it               $test=100
//! ```

use super::json::{Kind, Pair};
use super::request::{Context, Phase, Request};
use super::write::Writer;
use crate::capability::Capability;
use crate::protocol::{Machine, Out, Store};
use crate::status::Status;

/// The bytes of the program that a step shows. Each may take two bytes of output.
const STEP: u16 = 24;

/// Performs the operation on the program that the value of a pair asks for.
#[inline(never)]
#[small]
pub(super) fn store<M: Machine, O>(pair: &Pair, c: &mut Context<'_, M, O>) -> Result<(), Status> {
    let text = pair.value.of(c.line);
    let what = match (pair.kind, text) {
        (Kind::Null, _) => return Ok(()),
        (Kind::Object, _) => return Err(Status::UnsupportedType),
        // In text mode `t` and `f` are parsed as numbers.
        (Kind::False, _) | (Kind::Number, [b'f' | b'F']) => Store::Begin,
        (Kind::True, _) | (Kind::Number, [b't' | b'T']) => Store::End,
        // No line of G-code needs a backslash or a quote.
        _ if text.iter().any(|byte| matches!(byte, b'\\' | b'"')) => {
            return Err(Status::JsonSyntax);
        }
        _ => Store::Line(text),
    };
    c.machine.store(what)
}

#[small]
impl Request {
    /// Starts to show the program as the value of a pair.
    pub(super) fn show_program<M: Machine, O: Out>(
        &mut self,
        pair: &Pair,
        c: &mut Context<'_, M, O>,
    ) {
        self.open_string(pair, c);
        self.item = 0;
        self.phase = Phase::Program;
    }

    /// Writes the next part of the program.
    pub(super) fn program<M: Machine, O: Out>(&mut self, c: &mut Context<'_, M, O>) {
        let start = u16::from(self.item) * STEP;
        self.item += 1;
        // In text mode, wrapped in a string or not, the program ends with a prompt instead of a quote.
        let is_value = !Capability::Text.is_built_in() || self.is_json && !self.format.is_wrapped();
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
