//! G-code: converts the bytes of a line to canonical commands.
//!
//! ```text
//! bytes -> lexer (words) -> block (codes sorted by modal group, values by letter)
//!       -> interpreter (modal state, position; order of execution) -> Commands
//!                                   Commands with an arc -> arc (chords) -> planner
//! ```
//! A plain move takes none of these steps: `fast_path` reads and carries it out in one pass.
//! [`codes`] defines the language, with one table row per code. Everything here is pure and never waits.

pub mod arc;
mod axes;
mod block;
mod circle;
pub mod codes;
pub mod command;
pub mod comment;
mod cycle;
pub mod decimal;
mod digits;
pub mod fast_path;
pub mod heating;
pub mod interpreter;
#[cfg(feature = "language")]
pub mod language;
#[cfg(not(feature = "language"))]
#[path = "language/absent.rs"]
pub mod language;
mod lexer;
pub mod limits;
pub mod modal;
mod motion;
pub mod number;
mod offsets;
pub mod overrides;
pub mod printing;
pub mod setup;
mod speed;
mod state;
pub mod steps;
mod sticky;
pub mod tables;
#[cfg(test)]
mod tests;
pub mod threading;
pub mod words;

pub use interpreter::{Info, Interpreter};
