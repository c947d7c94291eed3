//! BTT SKR Pico v1.0: four TMC2209 drivers on board. One UART configures their current and microsteps.

use super::{
    Board, Heater, Heaters, MotorPins, NATIVE_USB, Pwm, Serial, Timer, Tmc2209, Usart, gp,
};

/// BTT SKR Pico v1.0. Its driver E is motor 4.
pub const SKR_PICO: Board = Board {
    name: "skr-pico",
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
        "printer",
        "drivers",
        "bed-plane",
    ],
    dialect: 0,
    clock_hz: 128_000_000,
    motors: &[
        MotorPins { step: gp(11), dir: gp(10), enable: Some(gp(12)) },
        MotorPins { step: gp(6), dir: gp(5), enable: Some(gp(7)) },
        MotorPins { step: gp(19), dir: gp(28), enable: Some(gp(2)) },
        MotorPins { step: gp(14), dir: gp(13), enable: Some(gp(15)) },
    ],
    enable_all: None,
    // Fans 1 and 3, servo, bed heater, hot-end heater
    hazards: &[gp(17), gp(20), gp(29), gp(21), gp(23)],
    // Spindle FAN3
    outputs: [Some(gp(20)), None, None, None],
    pwm: Some(Pwm { timer: Timer::Slices, channel: 29, inverted: false }),
    // USB; then transmit GP0, receive GP1
    serial: &[NATIVE_USB, Serial { usart: Usart::Uart0, ..NATIVE_USB }],
    inputs: [
        // X-STOP, Y-STOP, Z-STOP: one switch input for both ends of an axis
        Some(gp(4)),
        Some(gp(4)),
        Some(gp(3)),
        Some(gp(3)),
        Some(gp(25)),
        Some(gp(25)),
        None,
        None,
        // PROBE; E0-STOP is used as the emergency stop
        Some(gp(22)),
        None,
        Some(gp(16)),
    ],
    encoder: None,
    // Hot end: HE, sensor TH0. Bed: HB, sensor THB. Fans: FAN1 for the print, FAN2 for the heatbreak
    heaters: Some(Heaters {
        heaters: [
            Heater { pin: gp(23), channel: 1, select: None },
            Heater { pin: gp(21), channel: 0, select: None },
        ],
        fan: gp(17),
        cooler: Some(gp(18)),
    }),
    drivers: Some(Tmc2209 { tx: gp(8), rx: gp(9), addresses: &[0, 2, 1, 3] }),
    registers: None,
    card: None,
    step_timer: Timer::Pio,
    tick_timer: Timer::SysTick,
};
