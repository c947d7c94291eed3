//! The bed of a printer: moves follow its plane ([`Bed`](crate::config::bed::Bed)).
//!
//! The planner's position is in machine coordinates, in which the bed is flat. The line builder, which works for
//! motors, gets positions to which the height of the plane is added; positions counted from steps have it subtracted.
//! So limits apply to the motors, and a straight move is still one block. When following the plane begins or ends, no
//! motor moves: the position gets another Z.

use kerf_macros::small;

use super::Planner;
use crate::boards::MOTORS;
use crate::config::Settings;
use crate::tasks::setup::counted;
use crate::units::{Length, PerAxis};

const Z: usize = 2;

impl Planner {
    /// Makes moves follow the plane from here on, if the plane is known, or ends that. The machine stands still,
    /// because reports use the plane, too.
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

    /// Shifts the plane when G28.3 redefines the position. The bed stays where it is.
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
