//! Motion: from targets to step pulses.
//!
//! ```text
//! target -> line -> block queue -> exec -> segment ring -> dda -> pins
//!    junction, curve   |   ^        governor, prep
//!                      horizon      smooth, brake, reach, halt
//! ```

pub mod block;
pub mod brake;
pub mod contact;
pub mod curve;
pub mod dda;
pub mod divide;
pub mod dynamics;
pub mod exec;
pub mod factors;
pub mod finished;
pub mod float;
pub mod follow;
pub mod governor;
mod halt;
pub mod horizon;
pub mod junction;
mod limits;
pub mod line;
pub mod pace;
mod path;
pub mod prep;
pub mod queue;
pub mod reach;
mod replan;
pub mod short;
pub mod smooth;
pub mod snapshot;
pub mod source;
pub mod state;
pub mod steps;
