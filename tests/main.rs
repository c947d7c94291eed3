//! The firmware and its parts on the host. All files are one program. As separate programs each would be optimised
//! and linked on its own, which took longer than the tests.
//!
//! Each test has a thread, and each thread has its own machine (`avr_embassy::machine_static`), so tests share no
//! machine.
//!
//! A name before `::` is a file here: `cargo test --test host hold::` runs the tests of `hold.rs`.

#[path = "support/alarm_model.rs"]
mod alarm_model;
#[path = "support/apart.rs"]
mod apart;
#[path = "support/cases.rs"]
mod cases;
#[path = "support/codes.rs"]
mod codes;
#[path = "support/crowd.rs"]
mod crowd;
#[path = "support/differences.rs"]
mod differences;
#[path = "support/extremes.rs"]
mod extremes;
#[path = "support/grbl_ops.rs"]
mod grbl_ops;
#[path = "support/grbl_session.rs"]
mod grbl_session;
#[path = "support/host.rs"]
mod host;
#[path = "support/jobs.rs"]
mod jobs;
#[path = "support/keeps.rs"]
mod keeps;
#[path = "support/kept.rs"]
mod kept_machine;
#[path = "support/motion_text.rs"]
mod motion_text;
#[path = "support/ops.rs"]
mod ops;
#[path = "support/optimum.rs"]
mod optimum;
#[path = "support/plain.rs"]
mod plain;
#[path = "support/plant.rs"]
mod plant;
#[path = "support/position_model.rs"]
mod position_model;
#[path = "support/requests.rs"]
mod requests;
#[path = "support/rig.rs"]
mod rig;
#[path = "support/schema.rs"]
mod schema;
#[path = "support/sd_image.rs"]
mod sd_image;
#[path = "support/seeds.rs"]
mod seeds;
#[path = "support/sender.rs"]
mod sender;
#[path = "support/session.rs"]
mod session;
#[path = "support/side.rs"]
mod side;
#[path = "support/stream/mod.rs"]
mod stream;
#[path = "support/tables.rs"]
mod tables;
#[path = "support/told.rs"]
mod told_session;
#[path = "support/transcript.rs"]
mod transcript;
#[path = "support/wiring.rs"]
mod wiring;

mod advance;
mod alarm_packets;
mod arc_props;
mod backlash;
mod bed;
mod blend;
mod builder;
mod cam_files;
mod canon_props;
mod card;
mod card_files;
mod chain;
mod check;
mod control;
mod corexy;
mod cuts;
mod docs;
mod dwells;
mod fine_steps;
mod gcode_props;
mod grbl;
mod grbl_alarms;
mod grbl_random;
mod grbl_resets;
mod heat;
mod heat_hosts;
mod heat_lines;
mod heat_patterns;
mod hold;
mod jogs;
mod limits;
mod line;
mod machine;
mod machines;
mod motion;
mod moves;
mod nist;
mod offsets;
mod open_port;
mod openings;
mod overrides;
mod pages;
mod path;
mod probe_order;
mod realtime;
mod reprap;
mod reprap_lines;
mod settings;
mod squaring;
mod streams;
mod told;
mod transcripts;
mod two_ports;
mod usb_opens;
mod wrap;
