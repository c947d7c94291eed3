//! The image on the simulated chip, and tests of the simulator itself. All files are one program. As separate
//! programs each would be optimised and linked on its own, which took longer than the tests.
//!
//! A name before `::` is a file here: `cargo test -p kerf-sim-tests hold::` runs the tests of `hold.rs`.

#[macro_use]
mod common;

#[path = "../../support/alarm_model.rs"]
mod alarm_model;
#[path = "../../support/crowd.rs"]
mod crowd;
#[path = "../../support/grbl_ops.rs"]
mod grbl_ops;
#[path = "../../support/grbl_session.rs"]
mod grbl_session;
#[path = "../../../xtask/src/dist/hex.rs"]
mod hex;
#[path = "../../support/ops.rs"]
mod ops;
#[path = "../../support/pages.rs"]
mod pages;
#[path = "../../support/plant.rs"]
mod plant;
#[path = "../../support/position_model.rs"]
mod position_model;
#[path = "../../support/seeds.rs"]
mod seeds;
#[path = "../../support/sender.rs"]
mod sender;
#[path = "../../support/session.rs"]
mod session;
#[path = "../../support/side.rs"]
mod side;
#[path = "../../support/stream/mod.rs"]
mod stream;
#[path = "../../support/told.rs"]
mod told_session;
#[path = "../../support/transcript.rs"]
mod transcript;

mod advance;
mod alarms;
mod answers;
mod arcs;
mod arithmetic;
mod bed;
mod bench;
mod cam;
mod card;
mod cli;
mod control;
mod embassy;
mod grbl;
mod heat;
mod hold;
mod homing;
mod interpreter;
mod jobs;
mod judged;
mod lathe;
mod loader;
mod machines;
mod mechanics;
mod models;
mod openings;
mod overrides;
mod pico;
mod pico_bench;
mod pico_boards;
mod pico_card;
mod pico_drivers;
mod pico_usb;
mod pico_usb_faults;
mod pico_verify;
mod plot;
mod ports;
mod power;
mod print;
mod probe;
mod random_jobs;
mod rates;
mod realtime;
mod run;
mod second;
mod serial;
mod serve;
mod spindle;
mod starved;
mod step_interrupt;
mod step_output;
mod stopwatch;
mod storage;
mod streams;
mod switches;
mod taps_and_feeds;
mod threads;
mod told;
mod transcripts;
mod turning_alarms;
mod turning_faults;
mod turning_holds;
mod turning_strays;
mod verify;
mod verify_chip;
mod watchdog;
mod wrap;
