//! Check mode, `{chk:1}`: lines are interpreted, and refused if they are wrong, but not carried out.
//!
//! The parser drops the commands of each line, and the tables take no change. The origin is in the G-code model, so a
//! change of the coordinate system in force counts until the origin is computed from the tables again: when another
//! system is chosen, and when check mode ends.
//!
//! The planner keeps what lines may change of the G-code model, in the memory where it has arcs and chains otherwise.
//! It was idle when check mode began, has nothing to do meanwhile, and its position does not change.
//!
//! Only `{chk:0}` and a reset end check mode. Otherwise an alarm or a `^d` in the middle of a file would have the rest
//! of the file carried out. An alarm and `^d` only drop the lines received, and check mode stays on.

use kerf_macros::small;

use super::parts::Ongoing;
use super::{Begun, Planner};
use crate::machine;
use crate::tasks::links::Changes;

impl Planner {
    /// Whether the state of the model from before check mode is kept here.
    pub(super) fn checks(&self) -> bool {
        matches!(self.begun, Begun::Check(_))
    }

    /// Ends check mode, for a reset.
    pub(super) fn stop_checks(&mut self) {
        machine::carry_out(self.links.thread, machine::Event::Done);
        self.check();
    }

    /// Stores the state of the model when check mode begins, and restores it when check mode has ended.
    #[inline(never)]
    #[small]
    pub(super) fn check(&mut self) {
        let mut model = self.links.model.borrow_mut();
        if machine::is_checking() {
            if !self.checks() {
                let (modes, offsets) = model.keep();
                (self.walk, self.begun) = (Ongoing::Check(offsets), Begun::Check(modes));
            }
            return;
        }
        if let (Ongoing::Check(offsets), Begun::Check(modes)) = (&self.walk, &self.begun) {
            model.give_back(modes, offsets, &self.position);
            (self.walk, self.begun) = (Ongoing::None, Begun::Nothing);
            self.links.changes.note(Changes::ORIGIN);
        }
    }
}
