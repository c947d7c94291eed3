//! Arduino Mega 2560 with RAMPS 1.4, as a printer: X, Y, Z and the first extruder, for the dialect of printing hosts.

use super::Port::{A, B, D, E, F, G, H, J, K, L};
use super::{Board, Encoder, Heater, Heaters, MotorPins, Pwm, SdCard, Timer, USB, pin};

/// Arduino Mega 2560 with RAMPS 1.4, as a printer.
pub const RAMPS14: Board = Board {
    name: "ramps14",
    features: &["dialect-reprap", "probing", "printer", "corexy", "sd", "bed-plane"],
    dialect: 0,
    clock_hz: 16_000_000,
    motors: &[
        MotorPins { step: pin(F, 0), dir: pin(F, 1), enable: Some(pin(D, 7)) }, // X: A0, A1, D38
        MotorPins { step: pin(F, 6), dir: pin(F, 7), enable: Some(pin(F, 2)) }, // Y: A6, A7, A2
        MotorPins { step: pin(L, 3), dir: pin(L, 1), enable: Some(pin(K, 0)) }, // Z: D46, D48, A8
        MotorPins { step: pin(A, 4), dir: pin(A, 6), enable: Some(pin(A, 2)) }, // E0: D26, D28, D24
    ],
    enable_all: None,
    // D10: hot end; D8: bed; D9: fan; then the outputs
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
    // D4, D5, A3 of AUX-1, D11: servo headers except A3, so that codes such as M8 never switch a heater output
    outputs: [Some(pin(G, 5)), Some(pin(E, 3)), Some(pin(F, 3)), Some(pin(B, 5))],
    pwm: Some(Pwm { timer: Timer::T4, channel: 0, inverted: false }), // D6, a servo header
    // The pins of USART1 and USART3 are used by the limit switches.
    serial: &[USB],
    inputs: [
        // Switches of X, Y and Z, the lower end first: D3, D2, D14, D15, D18, D19
        Some(pin(E, 5)),
        Some(pin(E, 4)),
        Some(pin(J, 1)),
        Some(pin(J, 0)),
        Some(pin(D, 3)),
        Some(pin(D, 2)),
        None,
        None,
        // On AUX-2: probe A10, door A12, emergency stop A9
        Some(pin(K, 2)),
        Some(pin(K, 4)),
        Some(pin(K, 1)),
    ],
    // Index D2, sync D3
    encoder: Some(Encoder { index: pin(E, 4), sync: pin(E, 5), second: None }),
    drivers: None,
    registers: None,
    // Hot end: D10, sensor A13 or a MAX6675 at D50, D52 and D40 (AUX-2). Bed: D8, sensor A14. Fan: D9
    heaters: Some(Heaters {
        heaters: [
            Heater { pin: pin(B, 4), channel: 13, select: Some(pin(G, 1)) },
            Heater { pin: pin(H, 5), channel: 14, select: None },
        ],
        fan: pin(H, 6),
        cooler: None,
    }),
    // Chip select D53, as on the displays for RAMPS
    card: Some(SdCard::on_spi(pin(B, 0))),
    step_timer: Timer::T1,
    tick_timer: Timer::T0,
};
