//! How a machine is built: plain data, with defaults for each board.

use kerf::boards::{Board, MOTORS, Pin};

use super::line::Bounce;
use crate::oracle::{Setup, UNITS};

/// A machine around the chip. Lengths are in millimetres from the lower hard end of an axis.
#[derive(Clone, Debug)]
pub struct Build {
    /// X, Y, Z and A.
    pub axes: [Axis; MOTORS],
    /// The height of a plate under the tool of Z, which closes the probe's contact.
    pub plate: Option<f64>,
    /// How the probe, the door and the emergency stop are wired.
    pub probe: Wiring,
    /// See `probe`; `None` where there is none.
    pub door: Option<Wiring>,
    /// See `probe`; `None` where there is none.
    pub stop: Option<Wiring>,
    /// The spindle.
    pub spindle: Spindle,
    /// Where the times of bounces come from.
    pub seed: u64,
}

/// An axis and its carriage.
#[derive(Clone, Debug)]
pub struct Axis {
    /// The motor that moves it, counted from 0.
    pub motor: usize,
    /// A second one that moves it as far with each step, as on a CoreXY machine; and whether a low direction pin of that moves it down.
    pub second: Option<(usize, bool)>,
    /// Steps in a millimetre, of both motors together.
    pub steps_per_mm: f64,
    /// Whether a low direction pin moves it down.
    pub reversed: bool,
    /// Between the hard ends, at which the motor loses its steps; infinite if there are none.
    pub travel: f64,
    /// Where the carriage stands at power-up.
    pub start: f64,
    /// The switch at the lower end.
    pub min: Option<Switch>,
    /// The switch at the upper end.
    pub max: Option<Switch>,
}

/// A switch that a carriage works.
#[derive(Clone, Copy, Debug)]
pub struct Switch {
    /// Worked from here on outwards.
    pub at: f64,
    /// How far back the carriage must be for it to let go.
    pub hysteresis: f64,
    /// How it is wired.
    pub wiring: Wiring,
}

/// How a switch is wired: to ground in any case, with a pull-up.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Wiring {
    /// Low when worked. Several on one pin are in parallel.
    NormallyOpen,
    /// High when worked. Several on one pin are in series.
    NormallyClosed,
}

/// A spindle: the board's outputs switch it.
#[derive(Clone, Copy, Debug)]
pub struct Spindle {
    /// Turns a minute at full drive.
    pub rpm: f64,
    /// Seconds to 63 % of the way to another speed.
    pub time_constant: f64,
    /// The pin that drives it by its pulses' width; without one it turns at full drive.
    pub pwm: Option<Pin>,
    /// The pin that sees a pulse a turn, high for a hundredth of a turn.
    pub index: Option<Pin>,
    /// What its motor can do: turns a minute in a second; infinite if it is as strong as it need be.
    pub torque: f64,
    /// Its encoder.
    pub sensors: Option<Sensors>,
}

/// Sensors that pull their pins low while marks pass. Angles are in turns.
#[derive(Clone, Copy, Debug)]
pub struct Sensors {
    /// Sees a mark in a turn, at angle 0.
    pub index: Pin,
    /// Sees so many; `None` if there is no such sensor, and no second one.
    pub sync: Option<Pin>,
    /// Sees the same marks half of their width behind it.
    pub second: Option<Pin>,
    /// See `sync`.
    pub per_turn: u32,
    /// How wide the mark of the index is.
    pub index_width: f64,
    /// How wide the other marks are: a share of the way from one to the next.
    pub width: f64,
    /// Where the first of them is.
    pub phase: f64,
    /// Edges come late by up to so many cycles.
    pub jitter: u64,
    /// What edges do behind them.
    pub bounce: Option<Bounce>,
}

impl Sensors {
    /// Those of a board, with so many marks, the index half way between two of them.
    pub fn of(board: &Board, per_turn: u32) -> Option<Sensors> {
        let encoder = board.encoder?;
        Some(Sensors {
            index: encoder.index,
            sync: Some(encoder.sync),
            second: encoder.second,
            per_turn,
            index_width: 0.02,
            width: 0.3,
            phase: 0.5 / f64::from(per_turn),
            jitter: 0,
            bounce: None,
        })
    }
}

/// S that is the whole width of the spindle's pulses, by default.
const FULL_DRIVE: f64 = 24_000.0;

impl Build {
    /// A machine without ends and switches, with a spindle that turns as fast as S says by the default settings, and has an encoder of so many pulses a turn.
    /// `None` if the board has no pins for that.
    pub fn lathe(board: &Board, pulses: u32) -> Option<Build> {
        let mut build = Build::of(board);
        for axis in &mut build.axes {
            // The pins of the sensors are theirs alone.
            (axis.min, axis.max) = (None, None);
            (axis.travel, axis.start) = (f64::INFINITY, 0.0);
        }
        build.spindle.sensors = Some(Sensors::of(board, pulses)?);
        build.spindle.pwm = board.pwm.map(|pwm| pwm.pin());
        build.spindle.rpm = FULL_DRIVE;
        Some(build)
    }

    /// A machine of 200 by 200 by 100 mm that stands in the middle, with switches at both ends of X, Y and Z, and
    /// motors as the firmware's defaults have them.
    pub fn of(_: &Board) -> Build {
        Build {
            axes: [linear(0, 200.0), linear(1, 200.0), linear(2, 100.0), rotary(3)],
            plate: None,
            probe: Wiring::NormallyOpen,
            door: Some(Wiring::NormallyOpen),
            stop: Some(Wiring::NormallyOpen),
            spindle: Spindle {
                rpm: 12_000.0,
                time_constant: 0.5,
                pwm: None,
                index: None,
                torque: f64::INFINITY,
                sensors: None,
            },
            seed: 1,
        }
    }

    /// A printer of 200 by 200 by 200 mm whose motors are as the firmware has them, not far from its lower ends, with switches there.
    pub fn printer(board: &Board, setup: &Setup) -> Build {
        const START: [f64; 3] = [20.0, 15.0, 5.0];
        let mut build = Build::of(board);
        for (motor, of) in setup.motors.iter().enumerate() {
            let Some(axis) = build.axes.get_mut(of.axis) else { continue };
            axis.steps_per_mm = of.steps(1_000 * UNITS as i64) as f64 / 1e3;
            (axis.motor, axis.reversed, axis.max) = (motor, of.inverted, None);
            if let Some(start) = START.get(of.axis) {
                (axis.travel, axis.start) = (200.0, *start);
            }
        }
        build
    }

    /// This machine with X and Y driven by the sum and the difference of two motors of so many steps in a millimetre.
    pub fn core_xy(mut self, steps_per_mm: f64) -> Build {
        for (axis, reversed) in self.axes.iter_mut().zip([false, true]) {
            (axis.motor, axis.second, axis.steps_per_mm) =
                (0, Some((1, reversed)), 2.0 * steps_per_mm);
        }
        self
    }

    /// This machine with all switches of axes wired as `wiring` says.
    pub fn wired(mut self, wiring: Wiring) -> Build {
        let ends = self.axes.iter_mut().flat_map(|axis| [&mut axis.min, &mut axis.max]);
        ends.flatten().for_each(|switch| switch.wiring = wiring);
        self
    }
}

/// How far from a hard end its switch is.
const BEFORE_END: f64 = 2.0;

fn linear(motor: usize, travel: f64) -> Axis {
    let switch = |at| Switch { at, hysteresis: 0.2, wiring: Wiring::NormallyOpen };
    Axis {
        motor,
        second: None,
        steps_per_mm: 1_280.0,
        reversed: false,
        travel,
        start: travel / 2.0,
        min: Some(switch(BEFORE_END)),
        max: Some(switch(travel - BEFORE_END)),
    }
}

fn rotary(motor: usize) -> Axis {
    let (min, max) = (None, None);
    let (second, travel) = (None, f64::INFINITY);
    let steps_per_mm = 1_600.0 / 360.0;
    Axis { motor, second, steps_per_mm, reversed: false, travel, start: 0.0, min, max }
}
