//! Probing, G38.2 to G38.5: straight towards the work until the probe touches it, or away until it lets go.
//!
//! The result is the contact ([`seek`](super::seek)), in machine coordinates: `prbe` 1 and `prbx`.., which the
//! reporter tells at once. The machine comes to rest behind it, and stays there. Without contact `prbe` is 0 and the
//! place is where the move ended; G38.2 and G38.4 take that for a failure, and so is a probe that is as it is to
//! become before anything moves, in which case nothing does. A failure is an alarm: what comes next in a program would
//! go by a place that nobody knows.

use kerf_macros::small;

use super::Planner;
use super::seek::Sought;
use crate::boards::inputs::PROBE;
use crate::gcode::command::Motion;
use crate::gcode::modal::MotionMode;
use crate::hal::event::{Event, wait};
use crate::hal::inputs;
use crate::machine::{self, Alarm, ProbeState};
use crate::status::Status;
use crate::tasks::alarm;

/// The probe, of the inputs.
const SWITCH: u16 = 1 << PROBE;

impl Planner {
    /// Carries out the line's probing.
    pub(super) async fn probe(&mut self) {
        self.enter(machine::Event::Probe);
        if self.standstill().await && self.begin_probe() {
            match self.sought().await {
                Sought::Contact(steps) => {
                    let at = self.located(&steps);
                    self.links.probe.tell(ProbeState::Touched, &at);
                }
                Sought::End => self.probe_failed(),
                Sought::Flushed => {}
            }
        }
        self.enter(machine::Event::Done);
        // The result comes before the response to the next line. In an alarm that line, whose response may be half
        // written, may itself wait for this task.
        let told = || !self.links.probe.is_news() || self.is_flushed();
        wait(self.links.thread, Event::BlockDone, || told().then_some(())).await;
    }

    /// Begins the move. False if the probe is there already.
    #[inline(never)]
    #[small]
    fn begin_probe(&mut self) -> bool {
        let links = self.links;
        let commands = links.commands.borrow();
        let Motion::Probe { target, feed, mode } = &commands.motion else { return false };
        links.probe.begin();
        let awaited = match mode {
            MotionMode::ProbeAway | MotionMode::ProbeAwayQuietly => 0,
            _ => SWITCH,
        };
        if inputs::worked() & SWITCH == awaited {
            drop(commands);
            // The line says that the machine is at its end.
            links.model.borrow_mut().set_position(&self.position);
            self.probe_failed();
            return false;
        }
        self.brake_hard();
        self.seek(target, *feed, SWITCH, awaited);
        true
    }

    #[small]
    fn probe_failed(&self) {
        let links = self.links;
        links.probe.tell(ProbeState::Failed, &self.position);
        let loudly = match &links.commands.borrow().motion {
            Motion::Probe { mode, .. } => {
                matches!(mode, MotionMode::ProbeTowards | MotionMode::ProbeAway)
            }
            _ => false,
        };
        if loudly {
            alarm::raise_for(links, Alarm::Alarm, Status::ProbeFailed);
        }
    }
}
