//! Constant surface speed (G96): the speed of the spindle follows the radius while X moves.
//!
//! The power task calls [`look`] every 20 ms. It costs 60 cycles without a surface speed, and 5,000 with one. It reads
//! the position of X from exec's snapshot and sets S in `tasks::common`, under the ceiling. Nothing waits. If no motor
//! moves X, S stays as the planner has set it. D limits S under the override, too.

use kerf_macros::small;

use super::links::Links;
use super::setup::counted;
use super::{common, spindle};
use crate::boards::outputs;
use crate::capability::Capability;
use crate::gcode::command::Surface;

/// The number of the X axis.
const X: usize = 0;

/// Updates S from the position of X.
#[inline(never)]
#[small]
pub fn look(links: &Links) {
    if !Capability::Lathe.is_built_in() {
        return;
    }
    let follows = common::with(links.thread, |common| {
        let motion = &common.motion;
        motion.surface.first().is_some_and(Surface::is_on) && motion.outputs & outputs::SPINDLE != 0
    });
    if follows {
        follow(links);
    }
}

#[inline(never)]
#[small]
fn follow(links: &Links) {
    let motion = common::snapshot(links.thread);
    let settings = links.settings.borrow();
    let place = counted(&settings, &motion.positions(), X, None);
    if let (Some(surface), Some(x)) = (motion.surface.first(), place) {
        spindle::turn_at(links.thread, surface.turns(x), surface.most());
    }
}
