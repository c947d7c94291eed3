//! A model of where the motors are, kept as an offset: the position that the machine reports, minus the steps that it
//! has made.
//!
//! The *offset* of an axis stays constant whatever moves. Only homing, a position that is set, and a reset change it.
//! If an axis was homed at a switch that the axis works itself, its offset is known to the step.

use kerf::boards::inputs::{PROBE, X_MIN, Y_MIN, Z_MAX};

/// The switches that the motors actuate: X has one at its lower end, Z at its upper end. Y has one beyond its reach,
/// which is actuated by hand. None of them opens when it is actuated.
pub const SWITCHES: [(usize, i64, bool); 4] = [
    (X_MIN, -7_680, false),
    (Z_MAX, 7_680, false),
    (PROBE, -3_840, false),
    (Y_MIN, -1_000_000_000, false),
];
/// The offset of an axis after homing. The switch lets go one step away from where it closes, and 0.1 mm further on
/// the axis is at the end of its travel, -6 mm or 6 mm.
const HOMED: [Option<i64>; 4] =
    [Some(-7_680 - (-7_679 + 128)), None, Some(7_680 - (7_679 - 128)), None];
/// Settings of the machine for this model: it is fast, and distances are short.
pub const SETTINGS: [&str; 6] = [
    "{x:{vm:3000,fr:3000,jm:2000,ac:0}}",
    "{y:{vm:3000,fr:3000,jm:2000,ac:0}}",
    "{z:{vm:3000,fr:3000,jm:2000,ac:0}}",
    "{xtn:-6,xtm:20,xsv:3000,xlv:600,xlb:1,xzb:0.1,xsx:0}",
    "{ytn:-3,ytm:3,ysv:3000,ylv:600,ylb:1,yzb:0.1,ysx:0}",
    "{ztn:-20,ztm:6,zsv:3000,zlv:600,zlb:1,zzb:0.1,zsn:0,a:{am:1,vm:100000,fr:100000,jm:100000,ac:0}}",
];

const AXES: [&str; 4] = ["x", "y", "z", "a"];
/// Steps in a unit of an axis, mm or degree.
const STEPS: [f64; 4] = [1280.0, 1280.0, 1280.0, 1600.0 / 360.0];
/// A number of steps that is a whole number of units, for each axis.
const GRID: [(i64, f64); 4] = [(32, 0.025), (32, 0.025), (32, 0.025), (40, 9.0)];
/// Position to which the motors go in the end, steps.
const HOME: i64 = 640;
/// Tolerance of a position, steps. Positions are reported to 0.001 mm, 1.28 steps, and steps are rounded.
const CLOSE: f64 = 1.2;
/// Steps that a homing axis may make until its switch is seen while other switches change: 300 us at 10 mm/s, both
/// ways.
const LATE: f64 = 10.0;

/// The known state of an axis.
#[derive(Clone, Copy, Debug)]
struct Axis {
    offset: i64,
    /// Whether the offset is known to the step.
    exact: bool,
    /// Whether the axis may have been homed at its switch since the last comparison.
    homed: bool,
    /// Whether the offset may be anything.
    doubted: bool,
}

/// The known state of all axes.
#[derive(Clone, Debug)]
pub struct PositionModel {
    axes: [Axis; 4],
    /// Whether other switches have changed since the last comparison.
    disturbed: bool,
}

/// A place that is known to the step, in cells of the grid.
pub struct Place([i64; 4]);

impl PositionModel {
    /// The model of a machine that has just started and gives the position 0 to the place where its motors are.
    pub fn at_start(steps: [i64; 4]) -> Self {
        let axis = |steps: i64| Axis { offset: -steps, exact: true, homed: false, doubted: false };
        Self { axes: steps.map(axis), disturbed: false }
    }

    /// Takes note of a line that is sent, if it may change offsets.
    pub fn expect(&mut self, line: &str) {
        let homes_all = line.contains("{home:1}");
        for (m, axis) in self.axes.iter_mut().enumerate() {
            let homes = homes_all || line.contains("g28.2") && line.contains(AXES[m]);
            axis.homed |= homes;
            // A switch that is actuated by hand may be at any place.
            axis.doubted |= homes && HOMED[m].is_none() || line.contains("g28.3");
        }
    }

    /// Takes note that a switch is actuated by hand. Meanwhile changes of other switches are noticed later.
    pub fn disturb(&mut self) {
        self.disturbed = true;
    }

    /// Compares the position that the machine reports as `mpo` with the steps that its motors have made.
    pub fn compare(&mut self, told: &str, steps: [i64; 4]) -> Result<(), String> {
        for (m, steps) in steps.into_iter().enumerate() {
            let name = format!("\"{}\":", AXES[m]);
            let position = number(told, &name).ok_or_else(|| format!("no {name} in {told}"))?;
            self.compare_axis(m, position * STEPS[m] - steps as f64)
                .map_err(|off| format!("motor {} is {off:.1} steps off what {told} says", m + 1))?;
        }
        self.disturbed = false;
        Ok(())
    }

    /// Compares the reported offset of an axis, in steps, with the known one. The error is the difference.
    fn compare_axis(&mut self, m: usize, at: f64) -> Result<(), f64> {
        let disturbed = self.disturbed;
        let axis = &mut self.axes[m];
        let homed = HOMED[m].filter(|_| axis.homed);
        let within = |close: f64, offset: i64| (at - offset as f64).abs() < close;
        let near = |offset| within(if axis.exact { CLOSE } else { 2.0 * CLOSE }, offset);
        if near(axis.offset) && !axis.doubted {
            // The offset has not changed. If it agrees with the offset after homing too, it is no longer known to the
            // step.
            axis.exact &= homed.is_none_or(|offset| offset == axis.offset || !near(offset));
        } else if let Some(offset) = homed.filter(|offset| near(*offset)) {
            (axis.offset, axis.exact) = (offset, !axis.doubted && !disturbed);
        } else if axis.doubted || disturbed && homed.is_some_and(|offset| within(LATE, offset)) {
            (axis.offset, axis.exact) = (at.round() as i64, false);
        } else {
            return Err(at - axis.offset as f64);
        }
        (axis.homed, axis.doubted) = (false, false);
        Ok(())
    }

    /// Returns a place near where the motors began, and the line that goes there.
    pub fn way_home(&self) -> (Place, String) {
        let cell = |m: usize| (self.axes[m].offset + HOME).div_euclid(GRID[m].0);
        let cells: [i64; 4] = std::array::from_fn(cell);
        let words = cells.iter().zip(GRID).zip(AXES);
        let words =
            words.map(|((cell, (_, unit)), axis)| format!(" {axis}{:.3}", *cell as f64 * unit));
        (Place(cells), format!("g21 g90 g94 g53 g0{}", words.collect::<String>()))
    }

    /// Takes note that the motors, after `steps`, rest at that place. From now on every offset is known to the step.
    pub fn arrive(&mut self, place: &Place, steps: [i64; 4]) -> Result<(), String> {
        for (m, axis) in self.axes.iter_mut().enumerate() {
            let offset = place.0[m] * GRID[m].0 - steps[m];
            if axis.exact && axis.offset != offset {
                let off = axis.offset - offset;
                return Err(format!("motor {} rests {off} steps off its place", m + 1));
            }
            (axis.offset, axis.exact) = (offset, true);
        }
        Ok(())
    }
}

/// Returns the number behind a text.
pub fn number(line: &str, text: &str) -> Option<f64> {
    let rest = &line[line.find(text)? + text.len()..];
    rest.split([',', '}']).next()?.parse().ok()
}
