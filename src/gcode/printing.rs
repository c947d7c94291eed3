//! The extruder of a printer, which is the A axis. It differs from other axes in three ways: it may have its own
//! distance mode (M82, M83), it may extrude more or less filament than programmed (M221), and its position may grow
//! without an end.
//!
//! An image without a dialect of printing hosts has none of this.

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
/// The flow at which as much filament is extruded as programmed, in thousandths.
const FULL: u16 = 1_000;
#[cfg(feature = "dialect-reprap")]
/// The feed rate until a line sets another, mm/min.
const FEED: f32 = 1_500.0;
#[cfg(feature = "dialect-reprap")]
/// How far from the origin the extruder may get before its coordinate is moved back: 100 m, half of the range of a
/// [`Length`].
const FAR: i32 = 1_000_000_000;

/// The part of [`Printing`] that a line may change before it is refused.
#[cfg(feature = "dialect-reprap")]
pub type Kept = Option<Distance>;
/// The part of [`Printing`] that a line may change before it is refused: nothing in this image.
#[cfg(not(feature = "dialect-reprap"))]
pub type Kept = ();

/// How the extruder interprets its words.
#[cfg(feature = "dialect-reprap")]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Printing {
    /// The distance mode of M82 or M83. `None` if it is that of the other axes.
    own: Option<Distance>,
    /// The flow of M221, thousandths.
    flow: u16,
    /// Whether the line extrudes nothing, because the filament is too cold.
    dry: bool,
    /// The difference between extruded and programmed filament. The origin moves by it when the line is carried out.
    more: i32,
    /// How far the origin has moved by all such differences, modulo 2^32.
    flowed: i32,
}

/// How the extruder interprets its words: like any axis in this image.
#[cfg(not(feature = "dialect-reprap"))]
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Printing;

#[cfg(feature = "dialect-reprap")]
impl Printing {
    /// The state at power-up: E moves like any other axis.
    pub const NONE: Self = Self { own: None, flow: FULL, dry: false, more: 0, flowed: 0 };

    /// Returns the distance mode of the extruder if it differs from that of the other axes, else `None`.
    #[inline(always)]
    pub fn distance(self) -> Option<Distance> {
        self.own
    }

    /// Notes G90 or G91, which apply to the extruder as well.
    #[inline(always)]
    pub fn follow(&mut self) {
        self.own = None;
    }

    /// Returns what [`Printing::take_back`] has to restore if the line is refused.
    #[inline(always)]
    pub fn kept(self) -> Kept {
        self.own
    }

    /// Restores the state after a line has been refused.
    #[inline(always)]
    pub fn take_back(&mut self, kept: Kept) {
        self.own = kept;
    }

    /// Notes that the distance mode of the other axes is `distance` from now on. An own mode of the extruder stays in
    /// force.
    #[inline(always)]
    pub fn compare(&mut self, distance: Distance) {
        self.own = self.own.filter(|own| *own != distance);
    }

    /// Returns the flow of M221, thousandths.
    #[inline(always)]
    pub fn flow(self) -> u16 {
        self.flow
    }

    /// Returns the flow of the present line, thousandths. 0 if it extrudes nothing.
    #[inline(always)]
    fn flows(self) -> u16 {
        if self.dry { 0 } else { self.flow }
    }

    /// Whether as much filament is extruded as programmed.
    #[inline(always)]
    pub fn flows_as_programmed(self) -> bool {
        self.flows() == FULL
    }

    /// Returns how far the flow has moved the origin of the extruder.
    #[inline(always)]
    fn flowed(self) -> i32 {
        self.flowed
    }
}

#[cfg(not(feature = "dialect-reprap"))]
impl Printing {
    /// The state at power-up, in an image that cannot print.
    pub const NONE: Self = Self;

    /// Returns `None`: in this image the extruder has the distance mode of the other axes.
    #[inline(always)]
    pub fn distance(self) -> Option<Distance> {
        None
    }

    /// Does nothing in an image that cannot print.
    #[inline(always)]
    pub fn follow(&mut self) {}

    /// Returns nothing in an image that cannot print.
    #[inline(always)]
    pub fn kept(self) -> Kept {}

    /// Does nothing in an image that cannot print.
    #[inline(always)]
    pub fn take_back(&mut self, (): Kept) {}

    /// Does nothing in an image that cannot print.
    #[inline(always)]
    pub fn compare(&mut self, _distance: Distance) {}

    /// Returns a flow of 100 %.
    #[inline(always)]
    pub fn flow(self) -> u16 {
        FULL
    }

    /// Returns a flow of 100 %.
    #[inline(always)]
    fn flows(self) -> u16 {
        FULL
    }

    /// Always true in an image that cannot print.
    #[inline(always)]
    pub fn flows_as_programmed(self) -> bool {
        true
    }

    /// Returns 0 in an image that cannot print.
    #[inline(always)]
    fn flowed(self) -> i32 {
        0
    }
}

impl Printing {
    /// Whether the extruder interprets its words like any axis.
    #[inline(always)]
    pub fn is_usual(self) -> bool {
        self.distance().is_none() && self.flows() == FULL
    }
}

impl State {
    /// Refuses a move of the extruder if the filament is too cold.
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

    /// Returns where a move of the extruder to `target` ends at the present flow. When the line is
    /// [carried out](Self::carry_flow), the origin moves by the difference to `target`.
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

    /// Ends a line. If it is carried out (`done`), moves the origin of the extruder by the difference that
    /// [`Self::flow_to`] has noted. If it is refused, forgets the difference.
    #[cfg(feature = "dialect-reprap")]
    #[inline(always)]
    pub(super) fn carry_flow(&mut self, done: bool) {
        if self.printing.more != 0 {
            let more = core::mem::take(&mut self.printing.more);
            if done && self.shift_extruder(more).is_some() {
                self.printing.flowed = self.printing.flowed.wrapping_add(more);
            }
        }
    }

    /// Does nothing in an image that cannot print.
    #[cfg(not(feature = "dialect-reprap"))]
    #[inline(always)]
    pub(super) fn carry_flow(&mut self, _done: bool) {}

    /// Whether the extruder is farther from the origin than [`FAR`].
    #[cfg(feature = "dialect-reprap")]
    #[inline(always)]
    pub(super) fn is_far(&self) -> bool {
        self.position.get(EXTRUDER).is_some_and(|at| at.0.unsigned_abs() > FAR as u32)
    }

    /// Always false: this image has no dialect of printing hosts.
    #[cfg(not(feature = "dialect-reprap"))]
    #[inline(always)]
    pub(super) fn is_far(&self) -> bool {
        false
    }

    /// Returns origin and G92 offset of the extruder, moved by `by`. `None` beyond the range.
    #[inline(never)]
    #[small]
    fn shifted_extruder(&self, by: i32) -> Option<(Length, Length)> {
        let (origin, shift) = (self.origin.get(EXTRUDER)?, self.shift.get(EXTRUDER)?);
        Some((origin.checked_add(Length(by))?, shift.checked_add(Length(by))?))
    }

    /// Moves the origin of the extruder, as G92 does. `None` beyond the range.
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
impl<T, L> Interpreter<T, L> {
    /// Makes the words of the extruder relative or absolute (M83, M82), independently of the other axes. This lasts
    /// until G90 or G91.
    pub fn set_relative(&mut self, relative: bool) {
        let own = if relative { Distance::Incremental } else { Distance::Absolute };
        self.state.printing.own = Some(own).filter(|own| *own != self.state.modal.distance);
    }

    /// Sets the flow: the distance of the extruder in thousandths of what its words say.
    pub fn set_flow(&mut self, flow: u16) {
        self.state.printing.flow = flow;
    }

    /// Sets whether the next line extrudes nothing. Its E word counts as if the filament had been extruded.
    pub fn leave_out(&mut self, dry: bool) {
        self.state.printing.dry = dry;
    }

    /// Prepares for a block of a printing host, which needs no motion mode and no feed rate before its first move.
    pub fn begin_printing(&mut self) {
        let state = &mut self.state;
        if state.feed.to_bits() == 0 {
            (state.feed, state.feed_units) = (FEED, Units::Mm);
        }
        if state.modal.motion == MotionMode::None {
            state.modal.motion = MotionMode::Feed;
        }
    }

    /// Whether the extruder is so far from the origin that [`Self::move_back`] is due.
    pub fn is_far(&self) -> bool {
        self.state.is_far()
    }

    /// Redefines the present position, so that the extruder is nearer to the origin of machine coordinates. Nothing
    /// moves.
    #[inline(never)]
    #[small]
    pub fn move_back(&mut self, out: &mut Commands) {
        let state = &mut self.state;
        let Some(at) = state.position.get_mut(EXTRUDER) else { return };
        let by = if at.0 < 0 { FAR } else { -FAR };
        at.0 += by;
        // With relative words the origin may be too far away to be moved. It then stays, and the work coordinate
        // changes.
        let near = state.origin.get(EXTRUDER).is_some_and(|at| at.0.unsigned_abs() <= FAR as u32);
        if near {
            let _ = state.shift_extruder(by);
            state.moves_origin = true;
        }
        out.clear();
        out.line = state.line;
        out.motion = Motion::SetPosition { position: state.position };
    }

    /// Clears the G92 offsets of these axes. `axes` is a set of bits.
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

    /// Moves the extruder alone, together with its origin, so that the coordinates of its words do not change.
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

impl<T, L> Interpreter<T, L> {
    /// Returns the flow: the distance of the extruder in thousandths of what its words say.
    pub fn flow(&self) -> u16 {
        self.state.printing.flow()
    }

    /// Returns how far lines at another flow than 100 % have moved the origin of the extruder, in units of a
    /// [`Length`].
    pub fn flowed(&self) -> i32 {
        self.state.printing.flowed()
    }
}
