//! Check mode, `{chk:1}`: lines are interpreted, and refused as they would be; what they ask for is not carried out.
//!
//! The parser drops the commands of a line, and the tables take no change. The planner has what lines may change of the G-code model, where
//! it has arcs and chains otherwise: it was at rest when check mode began, has nothing to do meanwhile, and is where it was when that ends.
//!
//! Nothing but `{chk:0}` and a reset ends it: who streams a file to be checked is not to have the rest of it carried out because of an
//! alarm or a `^d` on the way. Those drop the lines that have come, and check mode goes on.

use kerf_macros::small;

use super::parts::Ongoing;
use super::{Begun, Planner};
use crate::machine;

impl Planner {
    /// Whether the model's state of before is kept here.
    pub(super) fn checks(&self) -> bool {
        matches!(self.begun, Begun::Check(_))
    }

    /// Ends check mode, for a reset.
    pub(super) fn stop_checks(&mut self) {
        machine::carry_out(machine::Event::Done);
        self.check();
    }

    /// Keeps the model's state when check mode begins, and gives it back when that has ended.
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
        }
    }
}
