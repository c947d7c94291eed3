//! Raspberry Pi Pico on a breakout board with six drivers, for example two motors each on Y and Z, and one each on X
//! and A. The other functions move to higher pins than on `pico`.

use super::{Board, Encoder, MotorPins, PICO, Pwm, Timer, gp};

/// Raspberry Pi Pico with six drivers.
pub const PICO6: Board = Board {
    name: "pico6",
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
        MotorPins { step: gp(2), dir: gp(8), enable: None },
        MotorPins { step: gp(3), dir: gp(9), enable: None },
        MotorPins { step: gp(4), dir: gp(10), enable: None },
        MotorPins { step: gp(5), dir: gp(11), enable: None },
        MotorPins { step: gp(6), dir: gp(12), enable: None },
        MotorPins { step: gp(7), dir: gp(13), enable: None },
    ],
    enable_all: Some(gp(14)),
    // Spindle enable, spindle PWM, flood
    hazards: &[gp(15), gp(16), gp(17)],
    outputs: [Some(gp(15)), None, None, Some(gp(17))],
    pwm: Some(Pwm { timer: Timer::Slices, channel: 16, inverted: false }),
    // USB; then transmit GP0, receive GP1
    serial: PICO.serial,
    inputs: [
        // One switch input for both ends of an axis
        Some(gp(18)),
        Some(gp(18)),
        Some(gp(19)),
        Some(gp(19)),
        Some(gp(20)),
        Some(gp(20)),
        None,
        None,
        // Probe, door, emergency stop
        Some(gp(21)),
        Some(gp(22)),
        Some(gp(26)),
    ],
    encoder: Some(Encoder { index: gp(27), sync: gp(28), second: None }),
    ..PICO
};
