//! Threads: G33 and G32, a pass in step with the spindle; G33.1, there and back, which taps a hole; G76, a thread in several passes (LinuxCNC).
//!
//! A [`ThreadCycle`] goes along Z. Its *drive line* is parallel to Z through where X is when it begins. Each pass goes from the drive line to its depth, cuts
//! in step with the spindle, and goes back to the drive line. `steps` spells it out; one pass is up to three [lines](ThreadCycle::line), with a taper at
//! each end. All passes begin at the index, so that each lies in the one before.
//!
//! **Depth.** The n-th pass is `J n^(1/R)` deep, counted from the peak of the thread: R 1 is as much each time, R 2 the same area of chip. The last is K deep,
//! and H more passes as deep. **Compound slide.** A pass of depth d begins `d tan Q` further along Z, so that one flank cuts.
//!
//! Everything is refused before anything moves. Units: [`Length`]; depths go by floats and are rounded once. Cost on AVR: 15,000 cycles for the line, 6,000 for a pass.

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

/// X and Z among the axes.
const X: usize = 0;
const Z: usize = 2;

/// The most passes without those of H.
const PASSES_MAX: f32 = 1_000.0;

/// The greatest Q, degrees.
const SLIDE_MAX: f32 = 80.0;

/// E is at the entry, at the exit: bits of L.
const ENTRY: u8 = 1;
const EXIT: u8 = 2;

/// G76. Machine coordinates and radii.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ThreadCycle {
    /// X of the drive line, where the tool begins and ends.
    pub drive: Length,
    /// Z where the tool begins.
    pub start: Length,
    /// Z where it ends.
    pub end: Length,
    /// P: the way of Z in a turn.
    pub lead: Length,
    /// I: X of the thread's peak less that of the drive line. Below 0 the thread is an outer one.
    pub peak: Length,
    /// J: the depth of the first pass.
    pub first: Length,
    /// K: the depth of the last.
    pub depth: Length,
    /// E: how long a taper is, along Z.
    pub taper: Length,
    /// L: where tapers are. 1 at the entry, 2 at the exit, 3 both.
    pub ends: u8,
    /// 1/R.
    pub degression: f32,
    /// The tangent of Q.
    pub slide: f32,
    /// The first pass that is K deep, from 1.
    pub deepest: u16,
    /// All passes, with those of H.
    pub passes: u16,
}

#[small]
impl ThreadCycle {
    /// How deep a pass is, counted from 1.
    fn depth_of(&self, pass: u16) -> Length {
        if pass >= self.deepest {
            return self.depth;
        }
        let depth = self.first.0 as f32 * pow(pass.into(), self.degression);
        Length(depth as i32).min(self.depth)
    }

    /// A length towards the work, along X.
    fn inwards(&self, length: Length) -> Length {
        if self.peak.0 < 0 { Length(-length.0) } else { length }
    }

    /// A length from the start to the end, along Z.
    fn onwards(&self, length: Length) -> Length {
        if self.end < self.start { Length(-length.0) } else { length }
    }

    /// X of a pass at its depth.
    #[inline(never)]
    pub fn bottom(&self, pass: u16) -> Length {
        let depth = self.inwards(self.depth_of(pass));
        Length(self.drive.0 + self.peak.0 + depth.0)
    }

    /// X outside of the cut, where a taper begins or ends. Without one it is where the tool is on its way in or out.
    pub fn outside(&self, pass: u16) -> Length {
        if self.ends == 0 {
            return self.drive;
        }
        Length(self.bottom(pass).0 - self.inwards(self.depth).0)
    }

    /// X where a pass begins.
    #[inline(never)]
    pub fn entry(&self, pass: u16) -> Length {
        if self.ends & ENTRY != 0 { self.outside(pass) } else { self.bottom(pass) }
    }

    /// Z where a pass begins.
    #[inline(never)]
    pub fn begin(&self, pass: u16) -> Length {
        let slid = self.depth_of(pass).0 as f32 * self.slide;
        // Before it is checked it may be far away.
        Length(self.start.0.saturating_add(self.onwards(Length(slid as i32)).0))
    }

    /// X and Z where a line of a pass ends, counted from 0; `None` beyond the last.
    #[inline(never)]
    fn corner(&self, pass: u16, line: u8) -> Option<(Length, Length)> {
        let taper = self.onwards(self.taper);
        let flat = Length(self.end.0 - if self.ends & EXIT != 0 { taper.0 } else { 0 });
        let into = Length(self.begin(pass).0 + taper.0);
        // Without a taper at the entry its line is left out.
        match line + u8::from(self.ends & ENTRY == 0) {
            0 => Some((self.bottom(pass), into)),
            1 => Some((self.bottom(pass), flat)),
            2 if self.ends & EXIT != 0 => Some((self.outside(pass), self.end)),
            _ => None,
        }
    }

    /// A line of a pass from `position`, counted from 0: where it ends, and the way in a turn of the axis that moves farther. `None` beyond the last.
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
    /// G33 and G32, and G33.1, which `returns`: K is the way in a turn of the axis that moves farthest (LinuxCNC). F does not count.
    #[inline(never)]
    pub(super) fn thread(
        &mut self,
        block: &Block,
        returns: bool,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        can_turn(setup)?;
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

    /// G76.
    #[inline(never)]
    pub(super) fn thread_cycle(
        &mut self,
        block: &Block,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        can_turn(setup)?;
        if !block.has(words::bit(Z as u8)) {
            return Err(Status::AxisWordMissing);
        }
        // In its place from the beginning: it is too large to be carried about.
        out.motion = Motion::ThreadCycle(ThreadCycle::default());
        let Motion::ThreadCycle(cycle) = &mut out.motion else { return Err(Status::InternalError) };
        (cycle.drive, cycle.start) = (self.position[X], self.position[Z]);
        self.advance(block, false, setup)?;
        cycle.end = self.position[Z];
        self.profile(block, cycle)?;
        self.passes(block, cycle)?;
        self.tapers(block, cycle)
    }

    /// P, I, J and K.
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
        // So all sums are within the range.
        let far = [cycle.drive, cycle.peak, cycle.depth].iter().any(|length| is_far(*length));
        if far { Err(Status::OutOfRange) } else { Ok(()) }
    }

    /// R, Q and H.
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
        // What rounding leaves is no pass of its own.
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

    /// E and L, and whether there is room along Z.
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

    /// A length above 0 that the line needs.
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

    /// A length across, which is a diameter with G7.
    fn across(&self, block: &Block, slot: u8, missing: Status) -> Result<Length, Status> {
        self.word(block, slot, self.modal.x_mode)?.ok_or(missing)
    }

    /// The length of a word, of which half counts if it is a diameter.
    #[inline(never)]
    fn word(&self, block: &Block, slot: u8, mode: XMode) -> Result<Option<Length>, Status> {
        let Some(word) = block.get(slot) else { return Ok(None) };
        let word = if mode == XMode::Diameter { word.half() } else { *word };
        axes::length(&word, self.modal.units).map(|length| Some(length.units))
    }
}

/// Whether threads can be cut.
#[inline(never)]
#[small]
fn can_turn(setup: &impl Setup) -> Result<(), Status> {
    Capability::Lathe.check()?;
    setup.encoder()
}

/// More than 50 m.
#[small]
fn is_far(length: Length) -> bool {
    length.0.unsigned_abs() > 500_000_000
}
