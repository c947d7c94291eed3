//! Arduino Mega 2560 with a grbl-style shield: the pinout of grbl-Mega.

use super::Port::{A, B, C, E, H, K};
use super::{Board, Encoder, Handshake, MotorPins, Pwm, Serial, Timer, USB, Usart, pin};

/// Arduino Mega 2560 with a grbl-style shield.
pub const MEGA2560_GRBL: Board = Board {
    name: "mega2560-grbl",
    features: &["dialect-tinyg", "dialect-grbl", "probing", "text", "backlash"],
    dialect: 0,
    clock_hz: 16_000_000,
    motors: &[
        MotorPins { step: pin(A, 2), dir: pin(C, 7), enable: None }, // D24, D30
        MotorPins { step: pin(A, 3), dir: pin(C, 6), enable: None }, // D25, D31
        MotorPins { step: pin(A, 4), dir: pin(C, 5), enable: None }, // D26, D32
        MotorPins { step: pin(A, 5), dir: pin(C, 4), enable: None }, // D27, D33
    ],
    enable_all: Some(pin(B, 7)), // D13
    // D5 to D9: spindle direction, spindle enable, spindle PWM, flood, mist
    hazards: &[pin(E, 3), pin(H, 3), pin(H, 4), pin(H, 5), pin(H, 6)],
    outputs: [Some(pin(H, 3)), Some(pin(E, 3)), Some(pin(H, 6)), Some(pin(H, 5))],
    pwm: Some(Pwm { timer: Timer::T4, channel: 1, inverted: false }), // D7
    // USB; then receive D19, transmit D18, RTS D22, CTS D23
    serial: &[
        USB,
        Serial {
            usart: Usart::U1,
            handshake: Some(Handshake { rts: pin(A, 0), cts: pin(A, 1) }),
            ..USB
        },
    ],
    inputs: [
        // D10 to D12: one switch input for both ends of an axis
        Some(pin(B, 4)),
        Some(pin(B, 4)),
        Some(pin(B, 5)),
        Some(pin(B, 5)),
        Some(pin(B, 6)),
        Some(pin(B, 6)),
        None,
        None,
        // A15: probe; A11: door; A8: emergency stop, grbl's reset button
        Some(pin(K, 7)),
        Some(pin(K, 3)),
        Some(pin(K, 0)),
    ],
    // Index D11, sync A15, second sync sensor A14
    encoder: Some(Encoder { index: pin(B, 5), sync: pin(K, 7), second: Some(pin(K, 6)) }),
    drivers: None,
    registers: None,
    heaters: None,
    card: None,
    step_timer: Timer::T1,
    tick_timer: Timer::T0,
};
