//! Motion: from targets to step pulses.

pub mod block;
pub mod lookahead;
pub mod profile;
