//! Threads, as in LinuxCNC. G33 and G32: one pass in step with the spindle. G33.1: a pass there and back, which taps a
//! hole. G76: a thread in several passes.
//!
//! A [`ThreadCycle`] (G76) goes along Z. Its *drive line* is parallel to Z, at the X where the tool is when the cycle
//! begins. Each pass goes from the drive line to its depth, cuts in step with the spindle, and goes back to the drive
//! line. `steps` expands the cycle. The cut of a pass consists of up to three [lines](ThreadCycle::line): a taper at
//! each end, and the thread between them. All passes begin at the index, so that each pass follows the groove of the
//! previous pass.
//!
//! **Depth.** The n-th pass is `J n^(1/R)` deep, measured from the peak of the thread. With R 1 all passes cut equally
//! deep, with R 2 all passes cut the same area of chip. The last of these passes is K deep, and H more passes of the
//! same depth follow. **Compound slide.** A pass of depth d begins `d tan Q` further along Z, so that only one flank
//! cuts.
//!
//! Errors are found before anything moves. Units: [`Length`]. Depths are computed as floats and rounded once. Cost on
//! AVR: 15,000 cycles for the line, 6,000 for a pass.

use kerf_macros::small;

use super::axes;
use super::block::Block;
use super::command::{Commands, Motion};
use super::modal::{Turn, XMode};
use super::setup::Setup;
use super::state::State;
use super::words::{self, AXES, E, H, I, J, K, L, P, Q, R, ROTARY};
use crate::capability::Capability;
use crate::math::{cos, pow, sin};
use crate::status::Status;
use crate::units::{Length, PerAxis};

/// The indices of X and Z among the axes.
const X: usize = 0;
const Z: usize = 2;

/// The greatest number of passes, without those of H.
const PASSES_MAX: f32 = 1_000.0;

/// The greatest Q, degrees.
const SLIDE_MAX: f32 = 80.0;

/// Bits of L: whether there is a taper (E) at the entry, and at the exit.
const ENTRY: u8 = 1;
const EXIT: u8 = 2;

/// The threading cycle of G76. Lengths are machine coordinates, and radii along X.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ThreadCycle {
    /// X of the drive line, where the tool begins and ends.
    pub drive: Length,
    /// Z where the tool begins.
    pub start: Length,
    /// Z where the tool ends.
    pub end: Length,
    /// P: the distance along Z in a turn.
    pub lead: Length,
    /// I: X of the thread's peak minus X of the drive line. A negative value means an external thread.
    pub peak: Length,
    /// J: the depth of the first pass.
    pub first: Length,
    /// K: the depth of the last pass.
    pub depth: Length,
    /// E: the length of a taper along Z.
    pub taper: Length,
    /// L: where there are tapers. 1 at the entry, 2 at the exit, 3 at both.
    pub ends: u8,
    /// 1/R.
    pub degression: f32,
    /// The tangent of Q.
    pub slide: f32,
    /// The first pass that is K deep, from 1.
    pub deepest: u16,
    /// The number of all passes, with those of H.
    pub passes: u16,
}

#[small]
impl ThreadCycle {
    /// Returns the depth of a pass. Passes are counted from 1.
    fn depth_of(&self, pass: u16) -> Length {
        if pass >= self.deepest {
            return self.depth;
        }
        let depth = self.first.0 as f32 * pow(pass.into(), self.degression);
        Length(depth as i32).min(self.depth)
    }

    /// Returns the signed value of a length towards the workpiece, along X.
    fn inwards(&self, length: Length) -> Length {
        if self.peak.0 < 0 { Length(-length.0) } else { length }
    }

    /// Returns the signed value of a length from the start towards the end, along Z.
    fn onwards(&self, length: Length) -> Length {
        if self.end < self.start { Length(-length.0) } else { length }
    }

    /// Returns X of a pass at its full depth.
    #[inline(never)]
    pub fn bottom(&self, pass: u16) -> Length {
        let depth = self.inwards(self.depth_of(pass));
        Length(self.drive.0 + self.peak.0 + depth.0)
    }

    /// Returns X outside of the cut, where a taper begins or ends. Without tapers this is X of the drive line.
    pub fn outside(&self, pass: u16) -> Length {
        if self.ends == 0 {
            return self.drive;
        }
        Length(self.bottom(pass).0 - self.inwards(self.depth).0)
    }

    /// Returns X where a pass begins.
    #[inline(never)]
    pub fn entry(&self, pass: u16) -> Length {
        if self.ends & ENTRY != 0 { self.outside(pass) } else { self.bottom(pass) }
    }

    /// Returns Z where a pass begins.
    #[inline(never)]
    pub fn begin(&self, pass: u16) -> Length {
        let slid = self.depth_of(pass).0 as f32 * self.slide;
        // Saturates, because `tapers` calls this before the cycle has been checked.
        Length(self.start.0.saturating_add(self.onwards(Length(slid as i32)).0))
    }

    /// Returns X and Z where a line of a pass ends. Lines are counted from 0. `None` beyond the last line.
    #[inline(never)]
    fn corner(&self, pass: u16, line: u8) -> Option<(Length, Length)> {
        let taper = self.onwards(self.taper);
        let flat = Length(self.end.0 - if self.ends & EXIT != 0 { taper.0 } else { 0 });
        let into = Length(self.begin(pass).0 + taper.0);
        // Without a taper at the entry, line 0 is the thread itself.
        match line + u8::from(self.ends & ENTRY == 0) {
            0 => Some((self.bottom(pass), into)),
            1 => Some((self.bottom(pass), flat)),
            2 if self.ends & EXIT != 0 => Some((self.outside(pass), self.end)),
            _ => None,
        }
    }

    /// Returns a line of a pass from `position`: where the line ends, and how far the axis that moves farther goes in a
    /// turn. Lines are counted from 0. `None` beyond the last line.
    #[inline(never)]
    pub fn line(
        &self,
        pass: u16,
        line: u8,
        position: &PerAxis<Length>,
    ) -> Option<(PerAxis<Length>, Length)> {
        let (x, z) = self.corner(pass, line)?;
        let mut target = *position;
        (target[X], target[Z]) = (x, z);
        let across = x.0.abs_diff(position[X].0) as f32;
        let along = z.0.abs_diff(position[Z].0) as f32;
        let lead = match across > along {
            true => Length((self.lead.0 as f32 * across / along) as i32),
            false => self.lead,
        };
        Some((target, lead))
    }
}

#[small]
impl State {
    /// Carries out G33 and G32, and with `returns` G33.1. K is the distance that the axis that moves farthest goes in a
    /// turn (LinuxCNC). F is ignored.
    #[inline(never)]
    pub(super) fn thread(
        &mut self,
        block: &Block,
        returns: bool,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        can_turn(setup, returns)?;
        if block.has(ROTARY) {
            return Err(Status::RotaryNotAllowed);
        }
        if !block.has(AXES) {
            return Err(Status::AxisWordMissing);
        }
        let lead = self.above_0(block, K, Status::KWordMissing, Status::KWordInvalid)?;
        if returns && self.modal.spindle == Turn::Off {
            return Err(Status::SpindleMustTurn);
        }
        let before = (self.position, self.residue);
        self.advance(block, false, setup)?;
        out.motion = Motion::Thread { target: self.position, lead, returns };
        if returns {
            (self.position, self.residue) = before;
        }
        Ok(())
    }

    /// Carries out G76.
    #[inline(never)]
    pub(super) fn thread_cycle(
        &mut self,
        block: &Block,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        can_turn(setup, false)?;
        if !block.has(words::bit(Z as u8)) {
            return Err(Status::AxisWordMissing);
        }
        // Built in its final place, because it is too large to be copied.
        out.motion = Motion::ThreadCycle(ThreadCycle::default());
        let Motion::ThreadCycle(cycle) = &mut out.motion else { return Err(Status::InternalError) };
        (cycle.drive, cycle.start) = (self.position[X], self.position[Z]);
        self.advance(block, false, setup)?;
        cycle.end = self.position[Z];
        self.profile(block, cycle)?;
        self.passes(block, cycle)?;
        self.tapers(block, cycle)
    }

    /// Carries out P, I, J and K.
    #[inline(never)]
    fn profile(&self, block: &Block, cycle: &mut ThreadCycle) -> Result<(), Status> {
        cycle.lead = self.above_0(block, P, Status::PWordMissing, Status::PWordInvalid)?;
        cycle.peak = self.across(block, I, Status::ArcOffsetsMissing)?;
        cycle.first = self.across(block, J, Status::ArcOffsetsMissing)?;
        cycle.depth = self.across(block, K, Status::KWordMissing)?;
        if cycle.first.0 <= 0 {
            return Err(Status::OutOfRange);
        }
        if cycle.depth.0 <= 0 {
            return Err(Status::KWordInvalid);
        }
        // Lengths below this limit have sums within the range.
        let far = [cycle.drive, cycle.peak, cycle.depth].iter().any(|length| is_far(*length));
        if far { Err(Status::OutOfRange) } else { Ok(()) }
    }

    /// Carries out R, Q and H.
    #[inline(never)]
    fn passes(&self, block: &Block, cycle: &mut ThreadCycle) -> Result<(), Status> {
        let number = |slot| block.get(slot).map(|word| word.to_f32());
        let degression = number(R).unwrap_or(1.0);
        if !(1.0..=PASSES_MAX).contains(&degression) {
            return Err(Status::RWordInvalid);
        }
        let slide = number(Q).unwrap_or(0.0);
        if !(0.0..=SLIDE_MAX).contains(&slide) {
            return Err(Status::QWordInvalid);
        }
        let springs = block.get(H).map_or(Ok(0), |word| word.integer());
        let springs = springs.ok().and_then(|springs| u8::try_from(springs).ok());
        let springs = springs.ok_or(Status::HWordInvalid)?;
        // The factor keeps a rounding error from becoming a pass of its own.
        let share = cycle.depth.0 as f32 / cycle.first.0 as f32 * 0.9999;
        let before = if share < 1.0 { 0.0 } else { pow(share, degression) };
        if before >= PASSES_MAX {
            return Err(Status::RWordInvalid);
        }
        cycle.degression = 1.0 / degression;
        let slide = slide.to_radians();
        cycle.slide = sin(slide) / cos(slide);
        cycle.deepest = before as u16 + 1;
        cycle.passes = cycle.deepest + u16::from(springs);
        Ok(())
    }

    /// Carries out E and L, and checks that there is room for the tapers along Z.
    #[inline(never)]
    fn tapers(&self, block: &Block, cycle: &mut ThreadCycle) -> Result<(), Status> {
        let ends = block.get(L).map_or(Ok(0), |word| word.integer());
        cycle.ends = ends.ok().and_then(|ends| u8::try_from(ends).ok()).unwrap_or(u8::MAX);
        if cycle.ends > ENTRY | EXIT {
            return Err(Status::LWordInvalid);
        }
        cycle.taper = self.word(block, E, XMode::Radius)?.unwrap_or_default();
        let whole = cycle.start.0.abs_diff(cycle.end.0);
        let slid = cycle.begin(u16::MAX).0.abs_diff(cycle.start.0);
        let most = whole.saturating_sub(slid) / 2;
        let taper = cycle.taper.0;
        let misses = cycle.ends != 0 && taper == 0;
        if taper < 0 || taper as u32 >= most || most == 0 || misses {
            return Err(Status::OutOfRange);
        }
        Ok(())
    }

    /// Returns the length of a word that the line needs. It has to be above 0.
    #[inline(never)]
    fn above_0(
        &self,
        block: &Block,
        slot: u8,
        missing: Status,
        invalid: Status,
    ) -> Result<Length, Status> {
        let length = self.word(block, slot, XMode::Radius)?.ok_or(missing)?;
        if length.0 > 0 { Ok(length) } else { Err(invalid) }
    }

    /// Returns the length of a word along X that the line needs. With G7 the word is a diameter.
    fn across(&self, block: &Block, slot: u8, missing: Status) -> Result<Length, Status> {
        self.word(block, slot, self.modal.x_mode)?.ok_or(missing)
    }

    /// Returns the length of a word, or half of it if `mode` says that the word is a diameter. `None` without the word.
    #[inline(never)]
    fn word(&self, block: &Block, slot: u8, mode: XMode) -> Result<Option<Length>, Status> {
        let Some(word) = block.get(slot) else { return Ok(None) };
        let word = if mode == XMode::Diameter { word.half() } else { *word };
        axes::length(&word, self.modal.units).map(|length| Some(length.units))
    }
}

/// Returns `Ok` if the image and the machine can cut threads, and with `taps` tap; else the reason why not. The index
/// alone tells neither a stray pulse from a true one near the reversal, nor where the spindle reverses.
#[inline(never)]
#[small]
fn can_turn(setup: &impl Setup, taps: bool) -> Result<(), Status> {
    Capability::Lathe.check()?;
    setup.encoder(taps)
}

/// Whether a length is more than 50 m.
#[small]
fn is_far(length: Length) -> bool {
    length.0.unsigned_abs() > 500_000_000
}
