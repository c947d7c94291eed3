//! Lines that wait for the next one: a chain of short lines that lie on one straight line (`motion::chain`), and lines
//! of less than half a step.
//!
//! CAM files are full of short lines. Blocks cost the planner and exec the same time whether long or short. A block of
//! less than half a step that takes less than 0.75 ms would slow the path down, because exec needs longer to prepare
//! it. A line waits only while other lines run. The planner's position stays at the start of the chain, and the chain
//! stores its end. Either the next line joins the chain, or the chain becomes a block and the line begins another
//! chain. A chain of less than half a step becomes no block: the next line then begins where the chain did.
//!
//! **Blending.** On a chip that [blends](crate::motion::blend) lines also wait in its stage, while others run and at the
//! start of motion: for [`STALE_MS`] after the last of them, [`START_MS`] in all. While others run they go to the queue
//! before exec brakes for its end.
//!
//! **Nothing waits long.** A chain becomes a block when the last block runs, and before anything that is not a line.
//! [`STALE_MS`] after its last line it also becomes a block at the next block or at the next turn of the power task. So
//! positions at stops are exact, and the last line of a program is not delayed, because exec is some milliseconds ahead
//! of the motors.
//!
//! **N words.** A block has the N word of its last line: it is finished when that line is.

use embassy_futures::select::{Either, select};

use super::{Begun, Parts, Planner, Shared, Turn};
use crate::gcode::command::{Commands, Feed};
use crate::hal::after_ms;
use crate::hal::event::{Event, wait};
use crate::hal::time::millis;
use crate::motion::blend::BLENDS;
use crate::motion::chain::Chain;
use crate::motion::line::Built;
use crate::motion::queue;
use crate::tasks::links::Links;
use crate::units::{Length, PerAxis};

/// How long after its last line a chain becomes a block, ms.
const STALE_MS: u16 = 8;

/// How long the first lines are waited for, ms: a path begins that long after its first line, at the latest.
const START_MS: u16 = 24;

/// Blocks that may be needed at once: for a chain, for the position, and for the timing of drivers.
const BLOCKS: usize = 3;

/// After this many lines in a row that have not joined a chain, only one line of this many begins a chain. A power of
/// two.
const ALONE: u8 = 8;
/// After this many such lines in a row, only one line of [`SELDOM`] begins a chain. A multiple of that.
const LONG: u8 = 64;
/// See [`LONG`]. A power of two.
const SELDOM: u8 = 32;

impl Planner {
    /// Whether a chain waits for the next line.
    #[inline(always)]
    pub(super) fn has_chain(&self) -> bool {
        matches!(self.begun, Begun::Chain(_))
    }

    /// Whether lines wait for the next one: a chain, or lines to be blended.
    #[inline(always)]
    pub(super) fn has_waiting(&self) -> bool {
        self.has_chain() || self.queue.has_staged()
    }

    /// Whether a begun line or chain is still to be completed.
    pub(super) fn has_begun(&self) -> bool {
        !matches!(self.begun, Begun::Nothing)
    }

    /// Whether a line is to begin a chain, which costs 1,500 cycles. On a curve, where no line joins a chain, only
    /// every eighth line begins one, and on a long curve every 32nd.
    #[inline(always)]
    pub(super) fn is_worth_a_chain(&mut self) -> bool {
        self.alone = self.alone.checked_add(1).unwrap_or(LONG);
        let each = if self.alone <= LONG { ALONE } else { SELDOM };
        self.alone <= ALONE || self.alone & (each - 1) == 0
    }

    /// Returns how far merged moves may be off the path, as [`Commands::blend`].
    #[inline(always)]
    pub(super) fn merged(&self, commands: &Commands) -> u8 {
        match self.queue.blends() {
            true if commands.blend != 0 => self.links.model.borrow().modal().blend_where_rounded(),
            _ => commands.blend,
        }
    }

    /// Begins a chain with a line. Returns false if the line cannot be merged with lines that follow.
    #[inline(always)]
    pub(super) fn begin_chain(
        &mut self,
        target: &PerAxis<Length>,
        feed: Option<&Feed>,
        commands: &Commands,
    ) -> bool {
        let tolerance = self.merged(commands);
        if !self.has_chain() {
            self.begun = Begun::Chain(Chain::default());
        }
        if let Begun::Chain(chain) = &mut self.begun
            && chain.begin(&self.position, target, feed, tolerance)
        {
            self.wait_for_more(commands.line);
            self.note_deviation();
            return true;
        }
        self.begun = Begun::Nothing;
        false
    }

    /// Notes how far the corners of the chain that has begun may be off.
    #[inline(always)]
    pub(super) fn note_deviation(&mut self) {
        let deviation = self.rounded();
        if let Some(stage) = self.queue.stage() {
            stage.chained = deviation;
        }
    }

    /// Notes that the line with this N word waits for the next one.
    #[inline(always)]
    pub(super) fn wait_for_more(&mut self, line: u32) {
        self.line = line;
        self.waits_from_now();
        self.links.moves_wait.set(true);
    }

    /// Notes that a line waits for the next one from now on.
    #[inline(always)]
    pub(super) fn waits_from_now(&mut self) {
        self.waits_since = millis() as u16;
        let (now, runs) = (self.waits_since, queue::used_here() > 0);
        if let Some(stage) = self.queue.stage()
            && (runs || stage.is_empty())
        {
            stage.since = now;
        }
    }

    /// Makes a block of the chain, for which there is room. Only closes the chain if it is less than half a step.
    /// Returns false if the chain is to be made in parts.
    #[inline(never)]
    pub(super) fn close_chain(&mut self) -> bool {
        self.build_chain(true)
    }

    /// Queues the chain, for which there is room, or only closes it if it `may_merge`. Returns false if it is to be
    /// made in parts.
    #[inline(never)]
    fn build_chain(&mut self, may_merge: bool) -> bool {
        let Begun::Chain(chain) = &self.begun else { return true };
        if may_merge && chain.is_closed() {
            return true;
        }
        let (target, feed) = (chain.end(&self.position), chain.feed());
        match self.line(&target, feed, may_merge) {
            Built::Parts(of) => {
                self.begun = Begun::Parts(Parts::new(&target, feed, of));
                return false;
            }
            Built::Merge => {
                if let Begun::Chain(chain) = &mut self.begun {
                    chain.close();
                }
            }
            Built::Line(_) | Built::Blended(_) | Built::Nothing => {
                self.begun = Begun::Nothing;
                self.position = target;
                self.announce();
            }
        }
        true
    }

    /// Carries out the line after a chain, for which there is room: the line joins the chain, or the chain is queued
    /// first.
    #[inline(never)]
    pub(super) fn end_chain(&mut self, commands: &Commands) -> Turn {
        if commands.is_straight() && self.carry_out_at_once() {
            return Turn::Done;
        }
        self.build_chain(false);
        Turn::More
    }

    /// Queues the chain if it is not to wait any longer.
    #[inline(never)]
    pub(super) fn make_up(&mut self) {
        if self.is_due() {
            self.take_up_changes();
            while self.has_announced() {
                self.tell();
            }
            let last = self.waits_since;
            self.build_chain(false);
            // No line has come.
            self.waits_since = last;
            if self.stage_is_due() {
                self.let_go(false);
            }
        }
        self.links.moves_wait.set(self.has_waiting());
    }

    /// Whether what waits is not to wait any longer, and there is room for it and for the blocks of changed settings.
    fn is_due(&self) -> bool {
        let is_due = match &self.begun {
            Begun::Chain(chain) => {
                let is_stale = || !chain.is_closed() && self.is_stale();
                self.runs_out() || is_stale() && self.queue.free() >= BLOCKS
            }
            _ => self.stage_is_due(),
        };
        is_due && !self.is_flushed()
    }

    /// Whether lines that wait to be blended are not to wait any longer.
    #[inline(always)]
    fn stage_is_due(&self) -> bool {
        self.queue.has_staged() && self.runs_out()
    }

    /// Whether nothing runs, or soon nothing will. Where lines are blended, those that follow at once are waited for: a
    /// path that has gone to the queue is no longer rounded at its end.
    #[inline(always)]
    fn runs_out(&self) -> bool {
        let left = queue::used_here();
        if !self.queue.blends() {
            return left <= 1;
        }
        let since = (millis() as u16).wrapping_sub(self.queue.waits_since());
        left == 0 && since >= START_MS || self.is_stale() && (left <= 1 || self.queue.is_short())
    }

    #[inline(always)]
    fn is_stale(&self) -> bool {
        (millis() as u16).wrapping_sub(self.waits_since) >= STALE_MS
    }
}

/// Waits until the planner has lines that are not to wait any longer.
pub(super) async fn nothing_follows(links: &Links, shared: &'static Shared) {
    let is_due = || shared.try_lock().is_ok_and(|planner| planner.is_due());
    loop {
        let ended = wait(links.thread, Event::BlockDone, move || is_due().then_some(()));
        // Only where lines are blended may lines wait while nothing runs.
        if !BLENDS {
            return ended.await;
        }
        if let Either::First(()) = select(ended, after_ms(STALE_MS.into())).await {
            return;
        }
    }
}
