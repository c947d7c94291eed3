//! The bed of a printer: moves follow its plane ([`Bed`](crate::config::bed::Bed)).
//!
//! The planner's position is in machine coordinates, in which the bed is flat. The line builder, which knows of
//! motors, gets places that are lifted by the plane, and what is counted from steps is lowered. So limits hold for
//! what motors do, and a straight move is one block as before. When the plane begins or ceases to be followed, no
//! motor moves: the place of the machine gets another Z.

use kerf_macros::small;

use super::Planner;
use crate::boards::MOTORS;
use crate::config::Settings;
use crate::tasks::setup::counted;
use crate::units::{Length, PerAxis};

const Z: usize = 2;

impl Planner {
    /// Has moves follow the plane from here on, if the plane is known, or not any more. The machine rests, because
    /// reports go by the plane, too.
    #[inline(never)]
    #[small]
    pub(super) fn follow_bed(&mut self, follows: bool) {
        let mut settings = self.links.settings.borrow_mut();
        let Some(bed) = settings.bed.first_mut() else { return };
        if bed.follows() == follows {
            return;
        }
        let [x, y, z, ..] = &mut self.position;
        if bed.follows() {
            *z = bed.lifted_z(*x, *y, *z);
        }
        bed.follow(follows);
        if bed.follows() {
            *z = bed.lowered_z(*x, *y, *z);
        }
        self.links.set_position(&self.position);
    }

    /// Takes over other coordinates that G28.3 gives to the place of the machine. The bed stays where it is.
    #[inline(never)]
    #[small]
    pub(super) fn rename_bed(&self, position: &PerAxis<Length>) {
        if let Some(bed) = self.links.settings.borrow_mut().bed.first_mut() {
            bed.rename(&self.position, position);
        }
    }

    /// Finds Z in machine coordinates; X and Y have been located.
    #[inline(never)]
    #[small]
    pub(super) fn lower(
        &self,
        settings: &Settings,
        steps: &[i32; MOTORS],
        located: &mut PerAxis<Length>,
    ) {
        let Some(bed) = settings.followed_bed() else { return };
        let [x, y, z, ..] = located;
        let end = bed.lifted(&self.position);
        if let Some(counted) = counted(settings, steps, Z, Some(&end)) {
            *z = bed.lowered_z(*x, *y, counted);
        }
    }
}

/// Whether a brief move of the motors is brief in machine coordinates, too: a chain keeps it in 16 bits.
#[small]
pub(super) fn is_near(from: &PerAxis<Length>, to: &PerAxis<Length>) -> bool {
    let ([_, _, from, ..], [_, _, to, ..]) = (from, to);
    i16::try_from(to.0.wrapping_sub(from.0)).is_ok()
}
