//! Heaters and the fan, and waits for them. Blocks switch heaters and fan at their place in the program; they do not
//! stop the machine.
//!
//! A wait begins when all moves before it have been made. It delays only the lines after it: a stop, a flush and
//! questions act at once, and [`Heaters::end_wait`](crate::tasks::heat::Heaters::end_wait) ends it.

use kerf_macros::small;

use super::Planner;
use crate::boards::MOTORS;
use crate::config::Settings;
use crate::gcode::command::Motion;
use crate::gcode::heating::{Heat, Wait};
use crate::gcode::printing::EXTRUDER;
use crate::hal::event::{Event, wait};
use crate::motion::advance::{Lead, refine};
use crate::motion::block::{Block, Line, QueuedAction};
use crate::motion::float::greater;
use crate::motion::queue;
use crate::motion::short::Short;
use crate::units::{Length, PerAxis};

/// The slowest acceleration of a lead, steps/s^2, whatever the limits of the axis: a slower lead would take minutes to
/// come back.
const ACCEL_LEAST: f32 = 1_000.0;
/// The slowest velocity of a lead, steps/s: see [`ACCEL_LEAST`].
const VELOCITY_LEAST: f32 = 100.0;
/// The fastest acceleration and velocity of a lead.
const MOST: f32 = 1e9;

impl Planner {
    /// Queues the action of a line. Returns whether motion is to wait.
    #[inline(never)]
    #[small]
    pub(super) fn heat(&mut self, heat: &Heat) -> bool {
        if heat.to.is_some() {
            self.heats = *heat != Heat::OFF;
            let _ = self.queue.push_aside(Block::action(QueuedAction::Heat(*heat), self.line));
            self.announce();
        }
        heat.wait != Wait::Nothing
    }

    /// Returns the lead that the extruder is to have: that of the first motor of its axis.
    #[inline(never)]
    #[small]
    pub(super) fn wanted_lead(&self) -> Lead {
        let settings = self.links.settings.borrow();
        let time = settings.heating.first().map_or(0, |heating| heating.advance);
        let motor = (0..MOTORS).find(|motor| settings.motor_axis(*motor) == EXTRUDER as u8);
        let mut lead = Lead::NONE;
        if time != 0
            && let (Some(motor), Some(axis)) = (motor, self.dynamics.axes.get(EXTRUDER))
        {
            let ratio = settings.step_ratio(motor);
            let steps = ratio.num as f32 / ratio.den as f32 * Length::PER_MM as f32;
            let of = |limit: f32, least| {
                let limit = if limit > 0.0 { limit * steps } else { f32::MAX };
                Short::new(greater(least, if limit < MOST { limit } else { MOST }))
            };
            lead = Lead {
                motor: motor as u8,
                time,
                accel: of(axis.accel.get(), ACCEL_LEAST),
                velocity: of(axis.feed, VELOCITY_LEAST),
                slack: Lead::slack(steps),
            };
        }
        lead
    }

    /// Tells exec the extruder's lead, if it has changed.
    #[inline(never)]
    #[small]
    pub(super) fn set_lead(&mut self) {
        let lead = self.wanted_lead();
        if lead != self.lead {
            self.lead = lead;
            if let Some(stage) = self.queue.stage() {
                stage.set_extruder(lead.motor);
            }
            let _ = self.queue.push_aside(Block::action(QueuedAction::Advance(lead), self.line));
            self.announce();
        }
    }

    /// Waits until the heaters of the line have reached their targets, or until the wait is ended.
    pub(super) async fn await_heat(&mut self) {
        let links = self.links;
        self.let_go(true);
        wait(links.thread, Event::BlockDone, || {
            (queue::used() == 0 || self.is_flushed()).then_some(())
        })
        .await;
        if let Motion::Heat(heat) = &links.command_receiver().commands().motion {
            links.heat.begin_wait(*heat);
        }
        wait(links.thread, Event::BlockDone, || {
            (!links.heat.waits() || self.is_flushed()).then_some(())
        })
        .await;
        links.heat.end_wait();
    }
}

/// Stores in a line from `from` to `to` how much filament it pushes, as exactly as the lead needs it.
#[inline(always)]
pub(super) fn refine_by(
    lead: &Lead,
    settings: &Settings,
    line: &mut Line,
    from: &PerAxis<Length>,
    to: &PerAxis<Length>,
) {
    if lead.time != 0
        && let (Some(from), Some(to)) = (from.get(EXTRUDER), to.get(EXTRUDER))
    {
        let motor = usize::from(lead.motor);
        refine(line, motor, settings.step_ratio(motor), to.0.wrapping_sub(from.0));
    }
}
