//! Probing, G38.2 to G38.5: a straight move towards the work until the probe makes contact, or away until it loses
//! contact.
//!
//! The result is the contact ([`seek`](super::seek)), in machine coordinates: `prbe` 1 and `prbx`... The machine stops
//! beyond the contact and moves back to it, at the feed of the line. So G10 L20 and G92 in the next line refer to the
//! contact. Then the reporter reports the result. With `pbo` 0 the machine stays where it has stopped. Without contact,
//! `prbe` is 0 and the result is the end of the move.
//!
//! For G38.2 and G38.4, a move without contact is a failure. So is a probe that is already in the state that ends the
//! move: nothing moves then. A failure is an alarm, because the next lines of a program would use a wrong position.

use kerf_macros::small;

use super::Planner;
use super::seek::Sought;
use crate::boards::MOTORS;
use crate::boards::inputs::PROBE;
use crate::gcode::command::Motion;
use crate::gcode::modal::MotionMode;
use crate::hal::event::{Event, wait};
use crate::hal::inputs;
use crate::machine::{self, Alarm, ProbeState};
use crate::status::Status;
use crate::tasks::alarm;

/// The bit of the probe among the inputs.
const SWITCH: u16 = 1 << PROBE;

impl Planner {
    /// Carries out the probing of the line.
    pub(super) async fn probe(&mut self) {
        self.enter(machine::Event::Probe);
        if self.standstill().await && self.begin_probe() {
            let mut touched = false;
            loop {
                match self.sought().await {
                    Sought::Contact(steps) => {
                        touched = true;
                        if !self.back_off(&steps) {
                            break;
                        }
                    }
                    Sought::End if !touched => {
                        self.probe_failed();
                        break;
                    }
                    _ => break,
                }
            }
            if touched {
                self.probe_touched();
            }
        }
        self.enter(machine::Event::Done);
        // The result comes before the response to the next line. In an alarm, that line may wait for this task while
        // its response is half written, so that the result is not waited for.
        let told = || !self.links.probe.is_news() || self.is_flushed();
        wait(self.links.thread, Event::BlockDone, || told().then_some(())).await;
    }

    /// Begins the move. Returns false if the probe is already in the state that ends the move.
    #[inline(never)]
    #[small]
    fn begin_probe(&mut self) -> bool {
        let links = self.links;
        let commands = links.command_receiver().commands();
        let Motion::Probe { target, feed, mode } = &commands.motion else { return false };
        links.probe.begin();
        let awaited = match mode {
            MotionMode::ProbeAway | MotionMode::ProbeAwayQuietly => 0,
            _ => SWITCH,
        };
        if inputs::worked(self.links.thread.level()) & SWITCH == awaited {
            drop(commands);
            // The model is at the end of the line, but the machine is not.
            links.set_position(&self.position);
            self.probe_failed();
            return false;
        }
        self.brake_hard();
        self.seek(target, *feed, SWITCH, awaited);
        true
    }

    /// Goes back to the contact. Returns false if the machine is to stay.
    #[inline(never)]
    #[small]
    fn back_off(&mut self, contact: &[i32; MOTORS]) -> bool {
        let links = self.links;
        let at = self.located(contact);
        links.probe.found(&at);
        let commands = links.command_receiver().commands();
        let Motion::Probe { feed, .. } = commands.motion else { return false };
        if !links.settings.borrow().backs_off_probe() {
            return false;
        }
        drop(commands);
        self.seek(&at, feed, 0, 0);
        true
    }

    /// Reports the contact, whether or not the machine is back at it.
    #[small]
    fn probe_touched(&self) {
        // In a flush, the position is not known yet.
        if !self.is_flushed() {
            self.links.set_position(&self.position);
        }
        self.links.probe.tell(ProbeState::Touched);
    }

    #[small]
    fn probe_failed(&self) {
        let links = self.links;
        links.probe.found(&self.position);
        links.probe.tell(ProbeState::Failed);
        let loudly = match &links.command_receiver().commands().motion {
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
