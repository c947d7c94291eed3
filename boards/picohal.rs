//! Expatria PicoHAL: a board with the RP2040 for the drivers of a CNC shield. The pins are those of grblHAL's map
//! (`picohal_map.h`).
//!
//! Its Ethernet (GP0 to GP4) and its Modbus (GP8, GP9, GP27) are not used.

use super::{Board, Encoder, MotorPins, NATIVE_USB, PICO, Pwm, Serial, Timer, Usart, gp};

/// Expatria PicoHAL.
pub const PICOHAL: Board = Board {
    name: "picohal",
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
        MotorPins { step: gp(16), dir: gp(20), enable: None },
        MotorPins { step: gp(17), dir: gp(21), enable: None },
        MotorPins { step: gp(18), dir: gp(22), enable: None },
        MotorPins { step: gp(19), dir: gp(23), enable: None },
    ],
    enable_all: Some(gp(24)),
    // Spindle enable, spindle direction, spindle PWM
    hazards: &[gp(7), gp(26), gp(25)],
    outputs: [Some(gp(7)), Some(gp(26)), None, None],
    pwm: Some(Pwm { timer: Timer::Slices, channel: 25, inverted: false }),
    // USB; then transmit GP12, receive GP13
    serial: &[
        NATIVE_USB,
        Serial { usart: Usart::Uart0, pins: Some([gp(13), gp(12)]), ..NATIVE_USB },
    ],
    inputs: [
        // One switch input for both ends of an axis; A shares that of Z
        Some(gp(15)),
        Some(gp(15)),
        Some(gp(10)),
        Some(gp(10)),
        Some(gp(5)),
        Some(gp(5)),
        Some(gp(5)),
        Some(gp(5)),
        // Probe (the shield's A5); emergency stop (the shield's Hold)
        Some(gp(29)),
        None,
        Some(gp(6)),
    ],
    // The shield's A4 and Run
    encoder: Some(Encoder { index: gp(28), sync: gp(11), second: None }),
    ..PICO
};
