//! Motion: from target positions to step pulses.
//!
//! ```text
//! target -> line -> block queue -> exec -> segment ring -> dda -> pins
//!    junction, curve   |   ^        governor, sampler, smooth, prep
//!                speed_constraints  trapezoid, halt
//! ```

pub mod advance;
pub mod backlash;
pub mod blend;
pub mod block;
pub mod chain;
pub mod curve;
pub mod divide;
pub mod dynamics;
pub mod exec;
pub mod factors;
pub mod finished;
pub mod float;
pub mod governor;
mod halt;
pub mod junction;
mod limits;
pub mod line;
pub mod pace;
mod path;
pub mod prep;
pub mod queue;
mod replan;
pub mod retract;
mod sampler;
pub mod shaper;
pub mod short;
pub mod smooth;
pub mod snapshot;
pub mod source;
pub mod speed_constraints;
pub mod steps;
mod tail;
pub mod thread;
mod trapezoid;
