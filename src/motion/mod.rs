//! Motion: from targets to step pulses.
//!
//! ```text
//! target -> line -> block ring -> exec -> segment ring -> dda -> pins
//!           junction   |  ^        profile, prep
//!                      lookahead
//! ```

pub mod block;
pub mod dda;
pub mod exec;
pub mod junction;
pub mod line;
pub mod lookahead;
pub mod prep;
pub mod profile;
pub mod queue;
pub mod running;
