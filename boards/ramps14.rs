//! Arduino Mega 2560 with RAMPS 1.4: X, Y, Z and the first extruder.

use super::Port::{A, B, D, E, F, G, H, J, K, L};
use super::{Board, Encoder, Heater, Heaters, MotorPins, Pwm, Timer, USB, pin};

/// Arduino Mega 2560 with RAMPS 1.4.
pub const RAMPS14: Board = Board {
    name: "ramps14",
    features: &["dialect-tinyg", "dialect-reprap", "probing", "printer", "corexy", "bed-plane"],
    dialect: 0,
    clock_hz: 16_000_000,
    motors: &[
        MotorPins { step: pin(F, 0), dir: pin(F, 1), enable: Some(pin(D, 7)) }, // X: A0, A1, D38
        MotorPins { step: pin(F, 6), dir: pin(F, 7), enable: Some(pin(F, 2)) }, // Y: A6, A7, A2
        MotorPins { step: pin(L, 3), dir: pin(L, 1), enable: Some(pin(K, 0)) }, // Z: D46, D48, A8
        MotorPins { step: pin(A, 4), dir: pin(A, 6), enable: Some(pin(A, 2)) }, // E0: D26, D28, D24
    ],
    enable_all: None,
    // D10, D8, D9: hot end, bed, fan; then the outputs
    hazards: &[
        pin(B, 4),
        pin(H, 5),
        pin(H, 6),
        pin(G, 5),
        pin(E, 3),
        pin(F, 3),
        pin(B, 5),
        pin(H, 3),
    ],
    // D4, D5, A3 of AUX-1, D11; the others are servo headers, for nobody wants M8 to heat
    outputs: [Some(pin(G, 5)), Some(pin(E, 3)), Some(pin(F, 3)), Some(pin(B, 5))],
    pwm: Some(Pwm { timer: Timer::T4, channel: 0 }), // D6, a servo header
    // The pins of USART1 and USART3 are those of the limit switches.
    serial: &[USB],
    inputs: [
        // D3, D2, D14, D15, D18, D19
        Some(pin(E, 5)),
        Some(pin(E, 4)),
        Some(pin(J, 1)),
        Some(pin(J, 0)),
        Some(pin(D, 3)),
        Some(pin(D, 2)),
        None,
        None,
        // A10, A12, A9 of AUX-2: probe, door, emergency stop
        Some(pin(K, 2)),
        Some(pin(K, 4)),
        Some(pin(K, 1)),
    ],
    // D2 and D3
    encoder: Some(Encoder { index: pin(E, 4), sync: pin(E, 5), second: None }),
    drivers: None,
    // D10 and A13, or a MAX6675 at D50, D52 and, of AUX-2, D40; D8 and A14; D9
    heaters: Some(Heaters {
        heaters: [
            Heater { pin: pin(B, 4), channel: 13, select: Some(pin(G, 1)) },
            Heater { pin: pin(H, 5), channel: 14, select: None },
        ],
        fan: pin(H, 6),
    }),
    // D53, as on the displays for RAMPS
    card: Some(pin(B, 0)),
    step_timer: Timer::T1,
    tick_timer: Timer::T0,
};
