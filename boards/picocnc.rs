//! PicoCNC of Phil Barrett: a Raspberry Pi Pico on a board whose steps, enables and outputs are behind shift registers.
//!
//! The pins are those of grblHAL's map (`pico_cnc_map.h`), and of the netlist of version 1.55eth of the board, which its
//! repository has (phil-barrett/PicoCNC, `Release/production/netlist.ipc`): U14 is the register of steps, U15 and U16 are
//! the register of outputs. They are 74HCT595 at 5 V, always enabled. A transistor (Q5) inverts the spindle's PWM.
//!
//! The SD card is on SPI1. Not used: the outputs AUX0 to
//! AUX6 and the reset of the Ethernet module (outputs 8 to 15, low), GP2, GP20, GP21, GP26.

use super::Port::{Outputs, Steps};
use super::{
    Board, Encoder, MotorPins, PICO, Pwm, Registers, SdCard, ShiftRegister, Timer, gp, pin,
};

/// PicoCNC.
pub const PICOCNC: Board = Board {
    name: "picocnc",
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
        "sd",
        "card-write",
    ],
    registers: Some(Registers {
        steps: ShiftRegister { data: gp(14), clock: gp(15), latch: gp(16), outputs: 8 },
        outputs: ShiftRegister { data: gp(17), clock: gp(18), latch: gp(19), outputs: 16 },
    }),
    motors: &[
        MotorPins { step: pin(Steps, 0), dir: pin(Steps, 4), enable: Some(pin(Outputs, 0)) },
        MotorPins { step: pin(Steps, 1), dir: pin(Steps, 5), enable: Some(pin(Outputs, 1)) },
        MotorPins { step: pin(Steps, 2), dir: pin(Steps, 6), enable: Some(pin(Outputs, 2)) },
        MotorPins { step: pin(Steps, 3), dir: pin(Steps, 7), enable: Some(pin(Outputs, 3)) },
    ],
    enable_all: None,
    // Spindle enable, spindle direction, mist, flood, spindle PWM
    hazards: &[pin(Outputs, 5), pin(Outputs, 4), pin(Outputs, 6), pin(Outputs, 7), gp(27)],
    outputs: [
        Some(pin(Outputs, 5)),
        Some(pin(Outputs, 4)),
        Some(pin(Outputs, 6)),
        Some(pin(Outputs, 7)),
    ],
    pwm: Some(Pwm { timer: Timer::Slices, channel: 27, inverted: true }),
    // USB; then transmit GP0, receive GP1
    serial: PICO.serial,
    inputs: [
        // One switch input for both ends of an axis
        Some(gp(6)),
        Some(gp(6)),
        Some(gp(5)),
        Some(gp(5)),
        Some(gp(4)),
        Some(gp(4)),
        Some(gp(3)),
        Some(gp(3)),
        // Probe, door, emergency stop
        Some(gp(28)),
        Some(gp(9)),
        Some(gp(22)),
    ],
    // Inputs that Kerf has no other use for: cycle start and feed hold
    encoder: Some(Encoder { index: gp(8), sync: gp(7), second: None }),
    card: Some(SdCard { select: gp(13), bus: [gp(10), gp(11), gp(12)] }),
    ..PICO
};
