//! The extruder of a printer, the A axis: relative or not by itself, more or less filament than programmed, and no end to it.
//!
//! Of an image without a dialect of printing hosts there is nothing of this.

use super::command::Motion;
#[cfg(feature = "dialect-reprap")]
use super::command::{Commands, Feed};
use super::interpreter::Interpreter;
use super::modal::Distance;
#[cfg(feature = "dialect-reprap")]
use super::modal::{MotionMode, Units};
use super::setup::Setup;
use super::state::State;
use crate::status::Status;
use crate::units::{FIRST_ROTARY, Length, PerAxis};

/// The axis of the extruder.
pub const EXTRUDER: usize = FIRST_ROTARY;
/// As much filament as programmed, in thousandths.
const FULL: u16 = 1_000;
#[cfg(feature = "dialect-reprap")]
/// The feed rate until there is another, mm/min.
const FEED: f32 = 1_500.0;
#[cfg(feature = "dialect-reprap")]
/// How far from the origin the extruder gets before it is moved back, which is half of what a [`Length`] holds: 100 m.
const FAR: i32 = 1_000_000_000;

/// What of [`Printing`] a line changes that may be refused after that.
#[cfg(feature = "dialect-reprap")]
pub type Kept = Option<Distance>;
/// What of [`Printing`] a line changes that may be refused after that: nothing.
#[cfg(not(feature = "dialect-reprap"))]
pub type Kept = ();

/// How the extruder takes its words.
#[cfg(feature = "dialect-reprap")]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Printing {
    /// M82 and M83; `None`: as the other axes.
    own: Option<Distance>,
    /// M221, thousandths.
    flow: u16,
    /// The line moves no filament: that is too cold.
    dry: bool,
    /// How much farther the origin is to move along with what flows, once the line is carried out.
    more: i32,
}

/// How the extruder takes its words: as any axis.
#[cfg(not(feature = "dialect-reprap"))]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Printing;

#[cfg(feature = "dialect-reprap")]
impl Printing {
    /// The state at power-up: E moves as any other axis.
    pub const NONE: Self = Self { own: None, flow: FULL, dry: false, more: 0 };

    /// What its words are measured from, if that is not what those of the others are.
    #[inline(always)]
    pub fn distance(self) -> Option<Distance> {
        self.own
    }

    /// G90 and G91 are for the extruder, too.
    #[inline(always)]
    pub fn follow(&mut self) {
        self.own = None;
    }

    /// What a line that is refused gives back: see [`Printing::take_back`].
    #[inline(always)]
    pub fn kept(self) -> Kept {
        self.own
    }

    /// A line with G90 or G91 has been refused.
    #[inline(always)]
    pub fn take_back(&mut self, kept: Kept) {
        self.own = kept;
    }

    /// The other axes measure their words by `distance` from now on; the extruder goes on as before.
    #[inline(always)]
    pub fn compare(&mut self, distance: Distance) {
        self.own = self.own.filter(|own| *own != distance);
    }

    /// M221, thousandths.
    #[inline(always)]
    pub fn flow(self) -> u16 {
        self.flow
    }

    /// How much of the filament flows, thousandths.
    #[inline(always)]
    fn flows(self) -> u16 {
        if self.dry { 0 } else { self.flow }
    }

    /// Whether as much flows as programmed.
    #[inline(always)]
    pub fn flows_as_programmed(self) -> bool {
        self.flows() == FULL
    }
}

#[cfg(not(feature = "dialect-reprap"))]
impl Printing {
    /// The state at power-up, in an image that cannot print.
    pub const NONE: Self = Self;

    /// Never.
    #[inline(always)]
    pub fn distance(self) -> Option<Distance> {
        None
    }

    /// Does nothing in an image that cannot print.
    #[inline(always)]
    pub fn follow(&mut self) {}

    /// Nothing.
    #[inline(always)]
    pub fn kept(self) -> Kept {}

    /// Does nothing in an image that cannot print.
    #[inline(always)]
    pub fn take_back(&mut self, (): Kept) {}

    /// Does nothing in an image that cannot print.
    #[inline(always)]
    pub fn compare(&mut self, _distance: Distance) {}

    /// All of it.
    #[inline(always)]
    pub fn flow(self) -> u16 {
        FULL
    }

    /// All of it.
    #[inline(always)]
    fn flows(self) -> u16 {
        FULL
    }

    /// It does.
    #[inline(always)]
    pub fn flows_as_programmed(self) -> bool {
        true
    }
}

impl Printing {
    /// Whether the extruder takes its words as any axis does.
    #[inline(always)]
    pub fn is_usual(self) -> bool {
        self.distance().is_none() && self.flows() == FULL
    }
}

impl State {
    /// Refuses a move of the extruder where filament is too cold for that.
    #[inline(never)]
    #[small]
    pub(super) fn check_extrusion(
        &self,
        start: &PerAxis<Length>,
        motion: &Motion,
        setup: &impl Setup,
    ) -> Result<(), Status> {
        let via = match motion {
            Motion::None | Motion::SetPosition { .. } | Motion::Heat(_) => return Ok(()),
            Motion::Through { via, .. } => via,
            _ => &self.position,
        };
        let at = |place: &PerAxis<Length>| place.get(EXTRUDER).copied();
        let moves = at(start) != at(&self.position) || at(start) != at(via);
        if moves { setup.extrudes() } else { Ok(()) }
    }

    /// Where a move of the extruder to `target` ends. Its origin moves along with what flows more or less, once the line is
    /// [carried out](Self::carry_flow).
    #[inline(never)]
    #[small]
    pub(super) fn flow_to(&mut self, target: Length) -> Result<Length, Status> {
        let flow = self.printing.flows();
        let from = self.position.get(EXTRUDER).copied().unwrap_or_default();
        if flow == FULL {
            return Ok(target);
        }
        let way = i64::from(target.0) - i64::from(from.0);
        let half = if way < 0 { -500 } else { 500 };
        let flows = (way * i64::from(flow) + half) / 1_000;
        let more = i32::try_from(flows - way).map_err(|_| Status::OutOfRange)?;
        let end = target.checked_add(Length(more)).ok_or(Status::OutOfRange)?;
        self.shifted_extruder(more).ok_or(Status::OutOfRange)?;
        self.owe_flow(more);
        Ok(end)
    }

    #[cfg(feature = "dialect-reprap")]
    fn owe_flow(&mut self, more: i32) {
        self.printing.more = more;
    }

    #[cfg(not(feature = "dialect-reprap"))]
    fn owe_flow(&mut self, _more: i32) {}

    /// The line is carried out, or refused: what its filament flows more or less counts, or does not.
    #[cfg(feature = "dialect-reprap")]
    #[inline(always)]
    pub(super) fn carry_flow(&mut self, done: bool) {
        if self.printing.more != 0 {
            let more = core::mem::take(&mut self.printing.more);
            if done {
                let _ = self.shift_extruder(more);
            }
        }
    }

    /// Does nothing in an image that cannot print.
    #[cfg(not(feature = "dialect-reprap"))]
    #[inline(always)]
    pub(super) fn carry_flow(&mut self, _done: bool) {}

    /// Whether the extruder has got far from the origin.
    #[cfg(feature = "dialect-reprap")]
    #[inline(always)]
    pub(super) fn is_far(&self) -> bool {
        self.position.get(EXTRUDER).is_some_and(|at| at.0.unsigned_abs() > FAR as u32)
    }

    /// There is no dialect in which it does.
    #[cfg(not(feature = "dialect-reprap"))]
    #[inline(always)]
    pub(super) fn is_far(&self) -> bool {
        false
    }

    /// Origin and G92 of the extruder, moved.
    #[inline(never)]
    #[small]
    fn shifted_extruder(&self, by: i32) -> Option<(Length, Length)> {
        let (origin, shift) = (self.origin.get(EXTRUDER)?, self.shift.get(EXTRUDER)?);
        Some((origin.checked_add(Length(by))?, shift.checked_add(Length(by))?))
    }

    /// Moves what the words of the extruder are measured from, as G92 does.
    #[cfg(feature = "dialect-reprap")]
    #[small]
    fn shift_extruder(&mut self, by: i32) -> Option<()> {
        let moved = self.shifted_extruder(by)?;
        let (origin, shift) = (self.origin.get_mut(EXTRUDER)?, self.shift.get_mut(EXTRUDER)?);
        (*origin, *shift) = moved;
        self.shifted = true;
        Some(())
    }
}

#[cfg(feature = "dialect-reprap")]
impl<T> Interpreter<T> {
    /// Words of the extruder are measured from where it is, or not, whatever those of the others are measured from; until G90 or G91.
    pub fn set_relative(&mut self, relative: bool) {
        let own = if relative { Distance::Incremental } else { Distance::Absolute };
        self.state.printing.own = Some(own).filter(|own| *own != self.state.modal.distance);
    }

    /// The extruder moves so many thousandths of what its words say.
    pub fn set_flow(&mut self, flow: u16) {
        self.state.printing.flow = flow;
    }

    /// The next line moves no filament, whatever it says: its words count as if it had.
    pub fn leave_out(&mut self, dry: bool) {
        self.state.printing.dry = dry;
    }

    /// A block of a printing host is next: there are a motion mode and a feed rate from the beginning.
    pub fn begin_printing(&mut self) {
        let state = &mut self.state;
        if state.feed.to_bits() == 0 {
            (state.feed, state.feed_units) = (FEED, Units::Mm);
        }
        if state.modal.motion == MotionMode::None {
            state.modal.motion = MotionMode::Feed;
        }
    }

    /// Whether the extruder has got far from the origin.
    pub fn is_far(&self) -> bool {
        self.state.is_far()
    }

    /// Gives the place where the machine is another name, at which the extruder is nearer to the origin.
    #[inline(never)]
    #[small]
    pub fn move_back(&mut self, out: &mut Commands) {
        let state = &mut self.state;
        let Some(at) = state.position.get_mut(EXTRUDER) else { return };
        let by = if at.0 < 0 { FAR } else { -FAR };
        at.0 += by;
        // Relative words may have no origin within reach: then they count from another one.
        let near = state.origin.get(EXTRUDER).is_some_and(|at| at.0.unsigned_abs() <= FAR as u32);
        if near {
            let _ = state.shift_extruder(by);
        }
        out.clear();
        out.line = state.line;
        out.motion = Motion::SetPosition { position: state.position };
    }

    /// No G92 counts on these axes any more, as bits.
    #[small]
    pub fn clear_shift(&mut self, axes: u8) {
        let state = &mut self.state;
        for (axis, (origin, shift)) in state.origin.iter_mut().zip(&mut state.shift).enumerate() {
            if axes >> axis & 1 != 0 && state.shifted {
                origin.0 = origin.0.wrapping_sub(shift.0);
                *shift = Length::ZERO;
            }
        }
    }

    /// The extruder alone moves, and so does what its words are measured from.
    #[inline(never)]
    #[small]
    pub fn extrude(&mut self, by: Length, feed: f32, out: &mut Commands) -> Result<(), Status> {
        let state = &mut self.state;
        let Some(at) = state.position.get(EXTRUDER) else { return Err(Status::AxisInvalid) };
        let Some(end) = at.checked_add(by) else { return Err(Status::OutOfRange) };
        if state.shift_extruder(by.0).is_none() {
            return Err(Status::OutOfRange);
        }
        if let Some(at) = state.position.get_mut(EXTRUDER) {
            *at = end;
        }
        out.clear();
        out.line = state.line;
        out.blend = state.modal.blend();
        out.motion = Motion::Feed { target: state.position, feed: Feed::PerMinute(feed) };
        Ok(())
    }
}

impl<T> Interpreter<T> {
    /// How far the extruder moves, in thousandths of what its words say.
    pub fn flow(&self) -> u16 {
        self.state.printing.flow()
    }
}
