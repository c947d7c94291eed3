//! Raspberry Pi Pico on a breakout board: four drivers, spindle, switches.

use super::{Board, Encoder, MotorPins, NATIVE_USB, Pwm, Serial, Timer, Usart, gp};

/// Raspberry Pi Pico on a breakout board.
pub const PICO_CNC: Board = Board {
    name: "pico-cnc",
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
    hazards: &[gp(11), gp(12), gp(13), gp(14), gp(15)],
    outputs: [Some(gp(11)), Some(gp(12)), Some(gp(14)), Some(gp(15))],
    pwm: Some(Pwm { timer: Timer::Slices, channel: 13 }),
    // USB; then transmit GP0, receive GP1
    serial: &[
        NATIVE_USB,
        Serial { usart: Usart::Uart0, rate: 115_200, handshake: None, driver_enable: None },
    ],
    inputs: [
        // One switch input for both ends of an axis
        Some(gp(16)),
        Some(gp(16)),
        Some(gp(17)),
        Some(gp(17)),
        Some(gp(18)),
        Some(gp(18)),
        None,
        None,
        // Probe, door, emergency stop
        Some(gp(19)),
        Some(gp(22)),
        Some(gp(26)),
    ],
    encoder: Some(Encoder { index: gp(27), sync: gp(28), second: None }),
    drivers: None,
    heaters: None,
    card: None,
    step_timer: Timer::Pio,
    tick_timer: Timer::SysTick,
};
