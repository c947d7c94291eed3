//! G-code: from the bytes of a line to canonical commands.
//!
//! ```text
//! bytes -> lexer (words) -> block (codes sorted by modal group, values by letter)
//!       -> interpreter (modal state, position; order of execution) -> Commands
//!                                   Commands with an arc -> arc (chords) -> planner
//! ```
//! [`codes`] is the language: one table row per code. Everything here is pure and never waits.

pub mod arc;
pub mod axes;
mod block;
mod circle;
pub mod codes;
pub mod command;
pub mod interpreter;
mod lexer;
mod limits;
pub mod modal;
mod motion;
pub mod number;
#[cfg(test)]
mod tests;

pub use interpreter::{Info, Interpreter};
