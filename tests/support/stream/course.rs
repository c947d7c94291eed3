//! A model of where the motors must be.
//!
//! All lines move one axis, by a known number of steps. Whenever lines may have been dropped, the next lines move
//! another axis. The dropped lines were not executed if their axis stands still. The lines behind them were executed
//! if their axis goes as far as their answers say.

use super::ledger::Cut;
use super::lines::AXES;

/// Longest time until the machine comes to rest when it is stopped, ms, including the time in which it notices.
const STOP_MS: u64 = 450;

/// See the module.
pub struct Course {
    /// How often lines may have been dropped.
    pub epoch: u32,
    /// The axis that lines move now, its position at the beginning, and the distance that it is to go.
    pub axis: usize,
    base: i64,
    way: i64,
    /// Whether the distance is known.
    exact: bool,
    /// Axes that may still move, although no line is to move them now.
    stirs: [bool; AXES.len()],
    watch: Option<Watch>,
    /// Positions of the motors.
    steps: [i64; 4],
}

/// What a kill has stopped, and must not move.
struct Watch {
    from: u64,
    axes: [bool; AXES.len()],
    steps: Option<[i64; 4]>,
    /// Whether the spindle must stand too.
    spindle: bool,
}

impl Course {
    /// A course for a machine at rest.
    pub fn new(steps: [i64; 4]) -> Self {
        let stirs = [false; AXES.len()];
        Self { epoch: 0, axis: 0, base: steps[0], way: 0, exact: true, stirs, watch: None, steps }
    }

    /// Takes note that lines may have been dropped, or certainly have been. `goes_on` are the axes whose lines may
    /// still be executed, and `turns` says whether the spindle may still be started.
    pub fn cut(&mut self, now: u64, cut: Cut, goes_on: [bool; AXES.len()], turns: bool) {
        self.stirs[self.axis] = true;
        self.epoch += 1;
        self.axis = (self.axis + 1) % AXES.len();
        (self.base, self.way) = (self.steps[self.axis], 0);
        self.exact = !self.stirs[self.axis];
        if cut == Cut::Surely {
            let mut axes = goes_on.map(|goes_on| !goes_on);
            axes[self.axis] = false;
            self.watch = Some(Watch { from: now + STOP_MS, axes, steps: None, spindle: !turns });
        } else if let Some(watch) = &mut self.watch {
            watch.axes[self.axis] = false;
        }
    }

    /// Takes note that it is unknown how far the present lines will be executed.
    pub fn doubt(&mut self) {
        self.exact = false;
    }

    /// Takes note that the spindle may turn.
    pub fn turns(&mut self) {
        if let Some(watch) = &mut self.watch {
            watch.spindle = false;
        }
    }

    /// Takes note that a line has moved an axis, or will. `doubtful` says that the line may have been dropped.
    pub fn moved(&mut self, axis: usize, steps: i64, epoch: u32, doubtful: bool) {
        if epoch == self.epoch {
            self.way += steps;
            self.exact &= !doubtful;
        } else if doubtful && let Some(watch) = &mut self.watch {
            watch.axes[axis] = false;
        }
    }

    /// Checks, at time `now`, that nothing moves whose motion was killed.
    pub fn see(&mut self, now: u64, steps: [i64; 4], spindle: bool) -> Result<(), String> {
        self.steps = steps;
        let Some(watch) = self.watch.as_mut().filter(|watch| now >= watch.from) else {
            return Ok(());
        };
        let was = *watch.steps.get_or_insert(steps);
        if spindle && watch.spindle {
            return Err("the spindle turns although all has been killed".to_string());
        }
        match (0..AXES.len()).find(|axis| watch.axes[*axis] && was[*axis] != steps[*axis]) {
            None => Ok(()),
            Some(axis) => Err(format!("{} moves although its lines were killed", AXES[axis])),
        }
    }

    /// Checks the distance of the present axis. The machine is at rest, and every line has been answered.
    pub fn rest(&mut self) -> Result<(), String> {
        let went = self.steps[self.axis] - self.base;
        if self.exact && went != self.way {
            let axis = AXES[self.axis];
            return Err(format!("{axis} went {went} steps, and its lines were {}", self.way));
        }
        self.start();
        Ok(())
    }

    /// Begins anew from here, where all axes rest.
    pub fn start(&mut self) {
        (self.base, self.way, self.exact) = (self.steps[self.axis], 0, true);
        self.stirs = [false; AXES.len()];
        self.watch = None;
    }
}
