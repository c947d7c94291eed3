//! Temperatures of a print: peaks, and how well they were held.

use std::fmt::{self, Display, Formatter};

use serde::Serialize;

use crate::machine::Machine;
use crate::thermal::{BED, HOT_END};

/// A heater of a print.
#[derive(Clone, PartialEq, Serialize, Debug)]
pub struct Heat {
    /// The name of the heater.
    pub heater: &'static str,
    /// The highest target, degrees.
    pub asked: f64,
    /// The highest temperature of its sensor.
    pub peak: f64,
    /// Time from the first line until the sensor was within a degree of `asked`, s; `None` if it never was.
    pub seconds_to_reach: Option<f64>,
    /// The lowest and the highest temperature that its sensor felt, from the first step behind homing until the
    /// heater was switched off.
    pub held: Option<(f64, f64)>,
    /// The temperature of its sensor at the end.
    pub last: f64,
}

/// The measurements of one heater.
#[derive(Clone, Copy, Default)]
struct One {
    asked: f64,
    /// Cycle at which the heater was switched off after it had been on.
    off: Option<u64>,
}

/// The measurements of a print while it runs.
#[derive(Default)]
pub struct Meter {
    heaters: [One; 2],
}

/// A temperature that is this near to the target counts as reached, degrees.
const NEAR: f64 = 1.0;

impl Meter {
    /// Records that a line, sent at `cycle`, sets a target.
    pub fn asked(&mut self, heater: usize, degrees: i64, cycle: u64) {
        let one = &mut self.heaters[heater];
        one.asked = one.asked.max(degrees as f64);
        one.off = (degrees == 0 && one.asked > 0.0).then_some(cycle);
    }

    /// Returns the results for the heaters that lines have asked for.
    pub fn heat(&self, machine: &Machine, began: u64) -> Vec<Heat> {
        let Some(thermal) = machine.thermal() else { return Vec::new() };
        let printing = machine.recorder().span().map_or(u64::MAX, |((first, _), _)| first);
        let of = |heater: usize| {
            let One { asked, off } = self.heaters[heater];
            let felt = || thermal.samples().iter().map(|s| (s.cycle, s.degrees[heater]));
            let reached = felt().find(|(_, degrees)| *degrees >= asked - NEAR);
            let held = printing..off.unwrap_or(u64::MAX);
            let during = felt().filter(|(cycle, _)| held.contains(cycle)).map(|(_, d)| d);
            let (low, high) =
                during.fold((f64::MAX, f64::MIN), |(low, high), d| (low.min(d), high.max(d)));
            let heat = Heat {
                heater: ["hot end", "bed"][heater],
                asked,
                peak: felt().map(|(_, degrees)| degrees).fold(0.0, f64::max),
                seconds_to_reach: reached
                    .map(|(cycle, _)| machine.seconds(cycle.saturating_sub(began))),
                held: (low <= high).then_some((low, high)),
                last: thermal.plant(heater).sensor,
            };
            (asked > 0.0).then_some(heat)
        };
        [HOT_END, BED].into_iter().filter_map(of).collect()
    }
}

impl Display for Heat {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Heat { asked, peak, last, .. } = self;
        write!(f, "{peak:.1} °C at most, {:+.1} of the {asked:.0} asked for", peak - asked)?;
        if let Some(seconds) = self.seconds_to_reach {
            write!(f, "; there after {seconds:.0} s")?;
        }
        if let Some((low, high)) = self.held {
            write!(f, ", {low:.1} to {high:.1} while it moved")?;
        }
        write!(f, "; {last:.1} at the end")
    }
}
