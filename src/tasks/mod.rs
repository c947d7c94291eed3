//! The tasks. Each is a thin `async fn` around a part that knows nothing of tasks; `links` lists
//! everything that connects them.

pub mod alarm;
pub mod control;
pub mod exec;
pub mod health;
pub mod hold;
mod homing;
mod jog;
pub mod lines;
pub mod links;
pub mod overrides;
pub mod parser;
pub mod planner;
pub mod ports;
pub mod power;
mod printing;
pub mod reader;
pub mod reporter;
mod setup;
pub mod spindle;
pub mod storage;
pub mod switches;
pub mod tx;
pub mod view;
pub mod wake;
