//! Motion: from targets to step pulses.

pub mod block;
pub mod junction;
pub mod line;
pub mod lookahead;
pub mod profile;
