//! Lines that wait for the next one: a chain of short lines that lie on one straight line (`motion::chain`), and lines
//! of less than half a step.
//!
//! CAM files are full of short lines. Blocks cost the planner and exec the same time whether long or short. A block of
//! less than half a step that takes less than 0.75 ms would slow the path down, because exec needs longer to prepare
//! it. A line waits only while other lines run. The planner's position stays at the start of the chain, and the chain
//! stores its end. Either the next line joins the chain, or the chain becomes a block and the line begins another
//! chain. A chain of less than half a step becomes no block: the next line then begins where the chain did.
//!
//! **Nothing waits long.** A chain becomes a block when the last block runs, and before anything that is not a line.
//! [`STALE_MS`] after its last line it also becomes a block at the next block or at the next turn of the power task. So
//! positions at stops are exact, and the last line of a program is not delayed, because exec is some milliseconds ahead
//! of the motors.
//!
//! **N words.** A block has the N word of its last line: it is finished when that line is.

use super::{Begun, Parts, Planner, Shared, Turn};
use crate::gcode::command::{Commands, Feed};
use crate::hal::event::{Event, wait};
use crate::hal::time::millis;
use crate::motion::chain::Chain;
use crate::motion::line::Built;
use crate::motion::queue;
use crate::tasks::links::Links;
use crate::units::{Length, PerAxis};

/// How long after its last line a chain becomes a block, ms.
const STALE_MS: u16 = 8;

/// Blocks that may be needed at once: for a chain, for the position, and for the timing of drivers.
const BLOCKS: usize = 3;

/// After this many lines in a row that have not joined a chain, only one line of this many begins a chain. A power of
/// two.
const ALONE: u8 = 8;
/// After this many such lines in a row, only one line of [`SELDOM`] begins a chain. A multiple of that.
const LONG: u8 = 64;
/// See [`LONG`]. A power of two.
const SELDOM: u8 = 32;

/// Returns how much of P is for moves that are merged, where corners are rounded within P.
pub(super) fn share(deviation: u16) -> u16 {
    deviation / 4
}

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

    /// Returns how far merged moves may be off the path, as [`Commands::blend`]: less where corners are rounded within P.
    #[inline(always)]
    pub(super) fn merged(&self, commands: &Commands) -> u8 {
        match commands.blend {
            wide if wide > 4 && self.queue.blends() => {
                let deviation = self.links.model.borrow().modal().deviation();
                wide.min(u8::try_from(share(deviation) + 1).unwrap_or(u8::MAX))
            }
            other => other,
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
            return true;
        }
        self.begun = Begun::Nothing;
        false
    }

    /// Notes that the line with this N word waits for the next one.
    #[inline(always)]
    pub(super) fn wait_for_more(&mut self, line: u32) {
        self.line = line;
        self.waits_since = millis() as u16;
        self.links.chain_waits.set(true);
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
            Built::Line(_) | Built::Nothing => {
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
            self.build_chain(false);
            if self.stage_is_due() {
                self.let_go(false);
            }
        }
        self.links.chain_waits.set(self.has_waiting());
    }

    /// Whether what waits is not to wait any longer, and there is room for it and for the blocks of changed settings.
    fn is_due(&self) -> bool {
        let is_due = match &self.begun {
            Begun::Chain(chain) => {
                let is_stale = || !chain.is_closed() && self.is_stale();
                queue::used_here() <= 1 || is_stale() && self.queue.free() >= BLOCKS
            }
            _ => self.stage_is_due(),
        };
        is_due && !self.is_flushed()
    }

    /// Whether lines that wait to be blended are not to wait any longer: nothing runs, or soon nothing will.
    #[inline(always)]
    fn stage_is_due(&self) -> bool {
        let left = queue::used_here();
        self.queue.has_staged() && (left == 0 || left == 1 && self.is_stale())
    }

    #[inline(always)]
    fn is_stale(&self) -> bool {
        (millis() as u16).wrapping_sub(self.waits_since) >= STALE_MS
    }
}

/// Waits until the planner has a chain that is not to wait any longer.
pub(super) fn nothing_follows(links: &Links, shared: &'static Shared) -> impl Future<Output = ()> {
    let is_due = || shared.try_lock().is_ok_and(|planner| planner.is_due());
    wait(links.thread, Event::BlockDone, move || is_due().then_some(()))
}
