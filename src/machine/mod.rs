//! What the machine is doing: its states, what leads from one to another, and where that is kept.
//!
//! [`State`] has three parts, as a state chart has regions. They are three because each goes on while another changes: a
//! hold keeps the cycle that it holds, and an alarm keeps both until everything queued has been dropped. Each is one enum, so
//! that nothing can be in two states of a region at once.
//!
//! | part | states | says |
//! |---|---|---|
//! | [`Alarm`] | none, alarm, limit, shutdown, panic | whether G-code is refused, and how that ends |
//! | [`Hold`] | off, resuming, held, door, flush, drop, kill; the last three with the door open, too | whether motion goes on, and whether what is queued is being dropped |
//! | [`Cycle`] | lines, program stop, probe, homing, jog, check | what is carried out |
//!
//! [`Doing`] is all three in one word, which is what `stat` tells. `Lines` is idle as well as run: whether anything is queued or
//! moves is asked of the queue and of exec's snapshot, which count it anyway (`View::has_work`). Held is slowing as well as at
//! rest: exec's snapshot knows (`Snapshot::held`).
//!
//! Where events lead a [`Hold`]; where there is nothing, it stays. Of `Flush`, `Drop` and `Kill` there is each with the door open as well:
//! it goes on alike, with the door open.
//!
//! | | `Hold` | `Resume` | `Rested` | `Flush` | `Cut`, an alarm | `Kill` | `Dropped` | `DoorOpened` | `DoorShut` | `DoorShutIdle` |
//! |---|---|---|---|---|---|---|---|---|---|---|
//! | Off | Held | | | Flush | Drop | Kill | | Door | | |
//! | Resuming | Held | | Off | Flush | Drop | Kill | | Door | | |
//! | Held | | Resuming | | Flush | Drop | Kill | | Door | | |
//! | Door | | | | Flush | Drop | Kill | | | Held | Off |
//! | Flush | | | | | Drop | Kill | | door open | door shut | door shut |
//! | Drop | | | | | | Kill | Off, or Door | door open | door shut | door shut |
//! | Kill | | | | | | | Off, or Door; the program ends | door open | door shut | door shut |
//!
//! Where events lead the others:
//!
//! ```text
//!  Cycle   Lines   Probe, Homing, Jog, Stopped, Check: not in an alarm, nor while Drop or Kill   that cycle
//!          any     Done: not while Drop or Kill; Dropped, but for Check                          Lines
//!  Alarm   any     Alarm, Limit, Shutdown, Panic: if it is worse                            that alarm
//!          any     Cleared: not a Panic, nor while Flush, Drop or Kill                      None
//! ```
//!
//! | event | raised by | level | what comes with it |
//! |---|---|---|---|
//! | `Hold` | `!`, where there is something to hold; `tasks::hold` | thread | |
//! | `Resume` | `~`, when the reader comes to its place; `tasks::hold` | thread | `cycle_start` is signalled |
//! | `Rested` | exec, at rest while `Resuming` | exec | motion goes on |
//! | `Flush` | `{qf:1}`, `%!`, the end of a jog | thread | the reader is woken, to cut |
//! | `Cut` | `%` in a hold, the reader after `Flush` | thread | lines that have come are dropped; the planner is woken |
//! | `Kill` | `^d` | thread | as with `Cut` |
//! | `Dropped` | the planner, when exec has dropped its blocks | thread | the model starts from where the motors are |
//! | `DoorOpened`, `DoorShut`, `DoorShutIdle` | the control task; the last if nothing is held | thread | |
//! | `Stopped` | the planner, at rest at M0 | thread | it waits for `cycle_start` |
//! | `Probe`, `Homing`, `Jog`, `Check` | the planner; requests for homing, jogs and checks | thread | |
//! | `Done` | the planner: the cycle is over, the stop has been left; the request that ends a check | thread | |
//! | `Alarm`, `Limit`, `Shutdown`, `Panic` | switches, requests, a failed probing | thread | outputs off, the planner is woken |
//! | `Cleared` | `{clear:n}`, M2, M30, as far as the alarm lets them | thread | steps may be made again |
//!
//! Exec reads one byte of this at each stretch ([`is_held`]) and writes it in one case, from `Resuming` to `Off`. Thread mode
//! writes without a lock nevertheless: each of its events leads from both to the same state, or leaves both alone, and what does
//! not change is not written. Costs: a question 3 cycles, an event 50.
//!
//! Nothing of this waits. What is to be told because of it is in [`Notices`], what characters have asked for and cannot have
//! yet in [`Signs`]. Whether a jog may begin is a question of order in the stream, not of what the machine is doing: [`jog`].

pub mod alarm;
mod cycle;
mod doing;
mod event;
mod hold;
pub mod jog;
mod notices;
mod probe;
mod signs;
#[cfg(test)]
mod tests;

pub use alarm::Alarm;
pub use cycle::Cycle;
pub use doing::{Doing, doing, shows_hold};
pub use event::Event;
pub use hold::Hold;
pub use notices::Notices;
pub use probe::{Probe, ProbeState};
pub use signs::Signs;

use crate::hal::byte::SharedByte;
use crate::hal::event::Event::BlockDone;
use crate::hal::{exec, flags};
use crate::progmem;

/// What the machine is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct State {
    /// Whether G-code is refused.
    pub alarm: Alarm,
    /// Whether motion goes on.
    pub hold: Hold,
    /// What is carried out.
    pub cycle: Cycle,
}

impl State {
    /// After a reset that somebody wanted.
    pub const START: Self = Self { alarm: Alarm::None, hold: Hold::Off, cycle: Cycle::Lines };
    /// After a reset that nobody wanted: whoever sends is to look first.
    pub const AFTER_FAULT: Self = Self { alarm: Alarm::Alarm, ..Self::START };

    /// The state that an event leads to. The image keeps the parts apart, and changes each by the same functions.
    pub const fn after(self, event: Event) -> Self {
        let counts = match event.alarm() {
            Some(alarm) => self.alarm.is_exceeded_by(alarm),
            None => true,
        };
        Self {
            alarm: self.alarm.after(event, self.hold.flushes()),
            hold: if counts { self.hold.after(event) } else { self.hold },
            cycle: self.cycle.after(event, self.hold.drops(), self.alarm.is_on()),
        }
    }
}

machine_static! {
    // A `Hold`. Thread mode writes it, and exec if it is `Resuming`.
    fn hold_byte() -> SharedByte = SharedByte::new(Hold::Off as u8);
    // A `Cycle`. Thread mode alone.
    fn cycle_byte() -> SharedByte = SharedByte::new(Cycle::Lines as u8);
    // An `Alarm`. Thread mode writes it, any level reads it.
    fn alarm_byte() -> SharedByte = SharedByte::new(Alarm::None as u8);
    // The planner wants the blocks dropped: thread mode sets it, exec clears it. It is no part of the state: a probe that makes
    // contact has what is left of its move dropped while nothing is flushed.
    fn drop_wanted() -> SharedByte = SharedByte::new(0);
}

progmem! {
    /// Where each event of the first `Event::OF_HOLD` leads each [`Hold`].
    static HOLDS: [u8; Event::OF_HOLD * Hold::ALL.len()] = hold::table();
}

/// Whether G-code is refused. Any level.
pub fn alarm() -> Alarm {
    Alarm::from_bits(alarm_byte().get())
}

/// What is carried out. Thread mode.
pub fn cycle() -> Cycle {
    Cycle::from_bits(cycle_byte().get())
}

/// Whether there is an alarm. Any level.
#[inline(always)]
pub fn is_alarmed() -> bool {
    alarm_byte().get() != Alarm::None as u8
}

/// [`Hold::holds`]. Any level.
#[inline(always)]
pub fn is_held() -> bool {
    hold_byte().get() != Hold::Off as u8
}

/// [`Hold::flushes`]. Thread mode.
#[inline(always)]
pub fn is_flushing() -> bool {
    hold_byte().get() >= Hold::Flush as u8
}

/// [`Hold::drops`]. Thread mode.
#[inline(always)]
pub fn is_dropping() -> bool {
    hold_byte().get() >= Hold::Drop as u8
}

/// [`Hold::kills`]. Thread mode.
#[inline(always)]
pub fn is_killing() -> bool {
    hold_byte().get() >= Hold::Kill as u8
}

/// Whether the reader is to drop the lines that have come. Thread mode.
#[inline(always)]
pub fn is_to_cut() -> bool {
    hold_byte().get() | 1 == Hold::FlushDoor as u8
}

/// Whether the machine stands at a program stop. Thread mode.
#[inline(always)]
pub fn is_stopped() -> bool {
    cycle_byte().get() == Cycle::Stopped as u8
}

/// Whether lines are checked only. Thread mode.
#[inline(always)]
pub fn is_checking() -> bool {
    cycle_byte().get() == Cycle::Check as u8
}

/// Whether the door is open. Thread mode.
#[inline(always)]
pub fn has_open_door() -> bool {
    let byte = hold_byte().get();
    byte > Hold::Resuming as u8 && byte & 1 != 0
}

/// Whether motion goes on, or will when it has come to rest. Thread mode.
#[inline(always)]
pub fn goes_on() -> bool {
    hold_byte().get() <= Hold::Resuming as u8
}

/// Whether what is held goes on when it has come to rest. Any level.
#[inline(always)]
pub fn is_resuming() -> bool {
    hold_byte().get() == Hold::Resuming as u8
}

/// Whether a tilde has what is held go on, or what waits at a program stop. Thread mode.
#[inline(always)]
pub fn may_resume() -> bool {
    hold_byte().get() < Hold::Door as u8
}

/// Takes an event that concerns the [`Hold`] alone, and has exec look. (Of `Dropped` this is a part: [`dropped`] is the whole.) Thread mode.
#[inline(never)]
#[small]
pub fn take(event: Event) {
    let before = hold_byte().get();
    let at = usize::from(before) * Event::OF_HOLD + event as usize;
    // What has not changed is not written: exec may have written meanwhile.
    if let Some(after) = HOLDS.at(at).filter(|after| *after != before) {
        hold_byte().set(after);
    }
    exec::pend();
}

/// Takes an event that concerns the [`Cycle`] alone. Thread mode.
#[inline(never)]
#[small]
pub fn carry_out(event: Event) {
    cycle_byte().set(cycle().after(event, is_dropping(), is_alarmed()) as u8);
}

/// The queue has been dropped: what has been interrupted, and whether the program is to end. Thread mode.
#[inline(always)]
pub fn dropped() -> (Cycle, bool) {
    let before = (cycle(), is_killing());
    cycle_byte().set(before.0.after(Event::Dropped, true, true) as u8);
    take(Event::Dropped);
    before
}

/// Begins an alarm, if there is none as bad: then what is queued is dropped. `first` is done before exec comes to know. Says
/// whether it counts. Thread mode.
#[inline(always)]
pub fn raise(alarm: Alarm, first: impl FnOnce()) -> bool {
    let counts = self::alarm().is_exceeded_by(alarm);
    if counts {
        first();
        alarm_byte().set(alarm as u8);
        take(Event::Cut);
    }
    counts
}

/// Ends the alarm, if it can be. Says whether. Thread mode.
#[inline(always)]
pub fn clear() -> bool {
    let ends = !is_flushing() && alarm_byte().get() != Alarm::Panic as u8;
    if ends {
        alarm_byte().set(Alarm::None as u8);
    }
    ends
}

/// The machine has been reset by nobody, or in motion by its sender: [`State::AFTER_FAULT`]. When nothing is queued.
pub fn start_alarmed() {
    alarm_byte().set(State::AFTER_FAULT.alarm as u8);
}

/// The machine has come to rest in a hold: whether it goes on. Exec only.
#[inline(always)]
pub fn rested() -> bool {
    let resumes = is_resuming();
    if resumes {
        hold_byte().set(Hold::Resuming.after(Event::Rested) as u8);
    }
    resumes
}

/// Has exec drop its blocks; it sets `Event::BlockDone` of the [events](crate::hal::event) when it [has](has_dropped_blocks).
/// Thread mode.
pub fn drop_blocks() {
    drop_wanted().set(1);
    exec::pend();
}

/// Whether exec has dropped its blocks. Thread mode.
pub fn has_dropped_blocks() -> bool {
    drop_wanted().get() == 0
}

/// Exec, at rest, drops its blocks if that is wanted, by `drop_all`. Exec only.
#[inline(always)]
pub fn drop_if_wanted(drop_all: impl FnOnce()) {
    if drop_wanted().get() != 0 {
        drop_all();
        drop_wanted().set(0);
        flags::set(BlockDone);
    }
}
