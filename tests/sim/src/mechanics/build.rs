//! The description of a machine: plain data, with defaults for each board.

use kerf::boards::{Board, MOTORS, Pin};

use super::line::Bounce;
use crate::oracle::{MotorSetup, Setup, UNITS};

/// A machine around the chip. Lengths are in millimetres. Positions count from the lower hard end of an axis.
#[derive(Clone, Debug)]
pub struct Build {
    /// The axes X, Y, Z and A.
    pub axes: [Axis; MOTORS],
    /// Height of a plate under the tool on Z, which closes the probe's contact. `None` without a plate.
    pub plate: Option<f64>,
    /// How the probe, the door and the emergency stop are wired.
    pub probe: Wiring,
    /// How the door's switch is wired; `None` without a door.
    pub door: Option<Wiring>,
    /// How the emergency stop is wired; `None` without one.
    pub stop: Option<Wiring>,
    /// The spindle.
    pub spindle: Spindle,
    /// Seed of the random times of bounces.
    pub seed: u64,
}

/// An axis and its carriage.
#[derive(Clone, Debug)]
pub struct Axis {
    /// The motor that moves it, counted from 0.
    pub motor: usize,
    /// A second motor that moves the axis as far with each step, as on a CoreXY machine, and whether a low direction
    /// pin of this motor moves the axis down.
    pub second: Option<(usize, bool)>,
    /// Steps in a millimetre, of both motors together.
    pub steps_per_mm: f64,
    /// Whether a low direction pin of `motor` moves the axis down.
    pub reversed: bool,
    /// Distance between the hard ends, at which the motor loses steps; infinite without hard ends.
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
    /// The position from which on, outwards, the switch is worked.
    pub at: f64,
    /// How far back the carriage must move for the switch to let go.
    pub hysteresis: f64,
    /// How it is wired.
    pub wiring: Wiring,
}

/// How a switch is wired. Its contact always leads to ground, and its pin has a pull-up.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Wiring {
    /// Low when worked. Several on one pin are in parallel.
    NormallyOpen,
    /// High when worked. Several on one pin are in series.
    NormallyClosed,
}

/// A spindle, which the board's outputs switch.
#[derive(Clone, Copy, Debug)]
pub struct Spindle {
    /// Turns a minute at full drive.
    pub rpm: f64,
    /// Time constant: after so many seconds the speed has come 63 % of the way to a new speed.
    pub time_constant: f64,
    /// The pin that sets the speed by its pulse width; without it the spindle turns at full drive.
    pub pwm: Option<Pin>,
    /// The pin that gets a pulse each turn, high for a hundredth of the turn.
    pub index: Option<Pin>,
    /// Most acceleration that the motor can give, turns a minute in a second; infinite for an ideal motor.
    pub torque: f64,
    /// Its encoder.
    pub sensors: Option<Sensors>,
}

/// Sensors that pull their pins low while marks pass them. Angles are in turns.
#[derive(Clone, Copy, Debug)]
pub struct Sensors {
    /// Sees one mark in a turn, at angle 0.
    pub index: Pin,
    /// Sees `per_turn` marks; `None` if there is no such sensor, and then no second one.
    pub sync: Option<Pin>,
    /// Sees the same marks, half of a mark's width later.
    pub second: Option<Pin>,
    /// Marks in a turn of the sync sensor.
    pub per_turn: u32,
    /// Width of the index mark.
    pub index_width: f64,
    /// Width of the other marks, as a share of the distance from one mark to the next.
    pub width: f64,
    /// Angle of the first of the other marks.
    pub phase: f64,
    /// Edges come late by a random time below this, cycles.
    pub jitter: u64,
    /// How the sensors bounce after an edge.
    pub bounce: Option<Bounce>,
}

impl Sensors {
    /// The sensors of a board, with this many sync marks a turn and the index mark half way between two of them.
    /// `None` if the board has no encoder pins.
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

/// The S word that gives the full width of the spindle's pulses, by default.
const FULL_DRIVE: f64 = 24_000.0;

impl Build {
    /// A machine without hard ends and switches. By the default settings its spindle turns as fast as S says, and it
    /// has an encoder of this many pulses a turn. `None` if the board has no pins for an encoder.
    pub fn lathe(board: &Board, pulses: u32) -> Option<Build> {
        let mut build = Build::of(board);
        for axis in &mut build.axes {
            // The sensors' pins must not be shared with switches.
            (axis.min, axis.max) = (None, None);
            (axis.travel, axis.start) = (f64::INFINITY, 0.0);
        }
        build.spindle.sensors = Some(Sensors::of(board, pulses)?);
        build.spindle.pwm = board.pwm.map(|pwm| pwm.pin());
        build.spindle.rpm = FULL_DRIVE;
        Some(build)
    }

    /// A machine of 200 by 200 by 100 mm that stands in the middle of its travel, with switches at both ends of X, Y
    /// and Z, and with motors as in the firmware's defaults.
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

    /// A machine whose motors and travel match the firmware's settings. It stands in the middle of its travel, which is
    /// a third longer than that of the settings: by the default settings it is [`Build::of`]. An axis without a travel
    /// keeps that one.
    pub fn fitted(board: &Board, setup: &Setup, travels: [f64; 3]) -> Build {
        let mut build = Build::of(board);
        for (axis, travel) in build.axes.iter_mut().zip(travels).filter(|(_, travel)| *travel > 0.0)
        {
            (axis.travel, axis.start) = (travel * LONGER, travel * LONGER / 2.0);
            axis.max = axis.max.map(|max| Switch { at: axis.travel - BEFORE_END, ..max });
        }
        let per_mm = |of: &MotorSetup| of.steps(1_000 * UNITS as i64) as f64 / 1e3;
        // The first motor of an axis drives it.
        for (motor, of) in setup.motors.iter().enumerate().rev().filter(|(_, of)| of.besides == 0) {
            let Some(axis) = build.axes.get_mut(of.axis) else { continue };
            (axis.motor, axis.reversed, axis.steps_per_mm) = (motor, of.inverted, per_mm(of));
        }
        match setup.motors.iter().find(|of| of.besides != 0) {
            Some(of) => build.core_xy(per_mm(of)),
            None => build,
        }
    }

    /// A printer of 200 by 200 by 200 mm that stands near its lower ends. It has switches there, and its motors match
    /// the firmware's settings.
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

    /// This machine as a CoreXY: the sum and the difference of two motors with this many steps per millimetre drive X
    /// and Y.
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

/// How much longer a machine is than the travel of its settings.
const LONGER: f64 = 4.0 / 3.0;

/// Distance of a switch from its hard end, mm.
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
