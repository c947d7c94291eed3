//! G-code: from the bytes of a line to canonical commands.

pub mod arc;
pub mod command;
