//! Expatria PicoBOB: a Raspberry Pi Pico, or its chip, on a Mach3 breakout board for five axes.
//!
//! The pins are those of grblHAL's map (`picobob_map.h`). Two stored versions of that map have the direction of Y at GP0;
//! later ones have it at GP10, and so had the first: grblHAL's pull request 38 calls GP0 a typing error. Expatria's own
//! repository draws the outputs but gives no numbers of the chip's pins.
//!
//! The breakout board has one output for both the direction of the fifth motor and the relay of the spindle. Here it is
//! the direction; so the spindle has its PWM (0 to 10 V) alone. X and Z share a switch input, A is a third. The breakout
//! board's enable is grblHAL's coolant; the drivers are always on.

use super::{Board, MotorPins, NATIVE_USB, PICO, Pwm, Timer, gp};

/// Expatria PicoBOB with five drivers.
pub const PICOBOB: Board = Board {
    name: "picobob",
    features: &[
        "dialect-tinyg",
        "dialect-grbl",
        "dialect-reprap",
        "cycles",
        "boring",
        "probing",
        "jobs",
        "help",
        "text",
        "lathe",
        "corexy",
        "backlash",
        "shaping",
    ],
    motors: &[
        MotorPins { step: gp(17), dir: gp(9), enable: None },
        MotorPins { step: gp(18), dir: gp(10), enable: None },
        MotorPins { step: gp(19), dir: gp(11), enable: None },
        MotorPins { step: gp(20), dir: gp(12), enable: None },
        MotorPins { step: gp(21), dir: gp(13), enable: None },
    ],
    enable_all: None,
    // Spindle PWM, flood
    hazards: &[gp(14), gp(16)],
    outputs: [None, None, None, Some(gp(16))],
    pwm: Some(Pwm { timer: Timer::Slices, channel: 14, inverted: false }),
    serial: &[NATIVE_USB],
    inputs: [
        // One switch input for both ends of X and of Z
        Some(gp(2)),
        Some(gp(2)),
        Some(gp(1)),
        Some(gp(1)),
        Some(gp(2)),
        Some(gp(2)),
        Some(gp(5)),
        Some(gp(5)),
        // Probe, emergency stop
        Some(gp(4)),
        None,
        Some(gp(3)),
    ],
    encoder: None,
    ..PICO
};
