//! Raspberry Pi Pico on a breakout board: four drivers, spindle, switches. The pins are those of grblHAL's generic map for
//! four axes, which is what most Picos are wired by.

use super::{Board, Encoder, MotorPins, NATIVE_USB, Pwm, Serial, Timer, Usart, gp};

/// Raspberry Pi Pico on a breakout board.
pub const PICO: Board = Board {
    name: "pico",
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
    dialect: 0,
    clock_hz: 128_000_000,
    // The step pins are adjacent and the direction pins follow them, so that one PIO state machine drives all of
    // them.
    motors: &[
        MotorPins { step: gp(2), dir: gp(6), enable: None },
        MotorPins { step: gp(3), dir: gp(7), enable: None },
        MotorPins { step: gp(4), dir: gp(8), enable: None },
        MotorPins { step: gp(5), dir: gp(9), enable: None },
    ],
    enable_all: Some(gp(10)),
    // Spindle enable, spindle direction, spindle PWM, mist, flood
    hazards: &[gp(26), gp(27), gp(15), gp(17), gp(16)],
    outputs: [Some(gp(26)), Some(gp(27)), Some(gp(17)), Some(gp(16))],
    pwm: Some(Pwm { timer: Timer::Slices, channel: 15, inverted: false }),
    // USB; then transmit GP0, receive GP1
    serial: &[NATIVE_USB, Serial { usart: Usart::Uart0, ..NATIVE_USB }],
    inputs: [
        // One switch input for both ends of an axis
        Some(gp(11)),
        Some(gp(11)),
        Some(gp(12)),
        Some(gp(12)),
        Some(gp(13)),
        Some(gp(13)),
        Some(gp(14)),
        Some(gp(14)),
        // Probe, door, emergency stop (grblHAL's reset)
        Some(gp(22)),
        Some(gp(21)),
        Some(gp(18)),
    ],
    // Inputs there, too: feed hold and an auxiliary one. GP20, cycle start, is left alone.
    encoder: Some(Encoder { index: gp(28), sync: gp(19), second: None }),
    drivers: None,
    registers: None,
    heaters: None,
    card: None,
    step_timer: Timer::Pio,
    tick_timer: Timer::SysTick,
};
