//! The machine's state: what it is doing, and which events change that.
//!
//! [`State`] has three parts, like the regions of a state chart. They are separate because each continues while another
//! changes: a hold keeps the cycle that it holds, and an alarm keeps both until everything queued has been dropped.
//! Each part is an enum, so that the machine cannot be in two states of one part at once.
//!
//! | part | states | says |
//! |---|---|---|
//! | [`Alarm`] | none, alarm, limit, shutdown, panic | whether G-code is refused, and how that ends |
//! | [`Hold`] | off, resuming, held, door, flush, drop, kill; the last three also with the door open | whether motion goes on, and whether the queue is being dropped |
//! | [`Cycle`] | lines, program stop, probe, homing, jog, check | what the machine carries out |
//!
//! [`Doing`] combines all three parts in one value, which `stat` reports. `Lines` covers both an idle and a running
//! machine. The queue and exec's snapshot know whether anything is queued or moves (`View::has_work`). `Held` covers
//! both a machine that slows down and one at standstill. Exec's snapshot knows which (`Snapshot::held`).
//!
//! The transitions of [`Hold`] follow. In an empty cell the state stays. `Flush`, `Drop` and `Kill` each have a second
//! state with the door open. An event leads from it to the state in the table, with the door open.
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
//! The transitions of [`Cycle`] and [`Alarm`] (state, events with their conditions, next state):
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
//! | `Hold` | `!`, if there is something to hold; `tasks::hold` | thread | |
//! | `Resume` | `~`, when the reader reaches its place in the stream; `tasks::hold` | thread | `cycle_start` is signalled |
//! | `Rested` | exec, at rest while `Resuming` | exec | motion goes on |
//! | `Flush` | `{qf:1}`, `%!`, the end of a jog | thread | the reader is woken to drop the lines |
//! | `Cut` | `%` in a hold, the reader after `Flush` | thread | lines that have arrived are dropped; the planner is woken |
//! | `Kill` | `^d` | thread | as with `Cut` |
//! | `Dropped` | the planner, when exec has dropped its blocks | thread | the model starts from where the motors are |
//! | `DoorOpened`, `DoorShut`, `DoorShutIdle` | the control task; the last if nothing is held | thread | |
//! | `Stopped` | the planner, at rest at M0 | thread | it waits for `cycle_start` |
//! | `Probe`, `Homing`, `Jog`, `Check` | the planner; requests for homing, jogs and checks | thread | |
//! | `Done` | the planner: the cycle is over, the stop has been left; the request that ends a check | thread | |
//! | `Alarm`, `Limit`, `Shutdown`, `Panic` | switches, requests, a failed probing | thread | outputs off, the planner is woken |
//! | `Cleared` | `{clear:n}`, `$X`, `$H`, M2, M30, if the alarm permits it | thread | steps may be made again |
//!
//! Exec reads the byte of the [`Hold`] for each stretch of motion ([`is_held`]). It writes the byte in one case only,
//! from `Resuming` to `Off`. Thread mode can nevertheless write without a lock, because each of its events either leads
//! from `Resuming` and from `Off` to one state, or changes neither, and an unchanged byte is not written. Costs: a
//! query 3 cycles, an event 50.
//!
//! Nothing here waits. [`Notices`] holds what is still to be reported. [`Signs`] holds the effects of real-time
//! characters that are still pending. Whether a jog may begin depends on the order of bytes in the stream, not on the
//! state: see [`jog`].

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
use crate::hal::{Interrupt, Thread, exec, flags};
use crate::progmem;

/// The state of the machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct State {
    /// Whether G-code is refused.
    pub alarm: Alarm,
    /// Whether motion goes on.
    pub hold: Hold,
    /// What the machine carries out.
    pub cycle: Cycle,
}

impl State {
    /// The state after a wanted reset.
    pub const START: Self = Self { alarm: Alarm::None, hold: Hold::Off, cycle: Cycle::Lines };
    /// The state after an unwanted reset. The alarm makes the operator check the machine first.
    pub const AFTER_FAULT: Self = Self { alarm: Alarm::Alarm, ..Self::START };

    /// Returns the state that an event leads to. The image stores the three parts separately, and changes each of them
    /// with the functions that are called here.
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
    // A `Hold`. Thread mode writes it. Exec writes it while it is `Resuming`.
    fn hold_byte() -> SharedByte = SharedByte::new(Hold::Off as u8);
    // A `Cycle`. Only thread mode uses it.
    fn cycle_byte() -> SharedByte = SharedByte::new(Cycle::Lines as u8);
    // An `Alarm`. Thread mode writes it, any level reads it.
    fn alarm_byte() -> SharedByte = SharedByte::new(Alarm::None as u8);
    // Not 0 if the planner wants the blocks dropped. Thread mode sets it, exec clears it. It is not part of the state,
    // because the rest of a probing move is dropped after contact, although nothing is flushed then.
    fn drop_wanted() -> SharedByte = SharedByte::new(0);
}

progmem! {
    /// The next state for each [`Hold`] and each of the first `Event::OF_HOLD` events.
    static HOLDS: [u8; Event::OF_HOLD * Hold::ALL.len()] = hold::table();
}

/// Returns the alarm that is on, or `Alarm::None`. G-code is refused during an alarm. Any level.
pub fn alarm() -> Alarm {
    Alarm::from_bits(alarm_byte().get())
}

/// Returns what the machine carries out. Any level.
pub fn cycle() -> Cycle {
    Cycle::from_bits(cycle_byte().get())
}

/// Whether an alarm is on. Any level.
#[inline(always)]
pub fn is_alarmed() -> bool {
    alarm_byte().get() != Alarm::None as u8
}

/// Whether an alarm is on and everything from before it has been dropped. What has been queued since then moves
/// nothing: it is the end of a program, by a reset or a kill. Any level.
#[inline(always)]
pub fn is_locked() -> bool {
    is_alarmed() && !is_dropping()
}

/// Whether motion is held: [`Hold::holds`]. Any level.
#[inline(always)]
pub fn is_held() -> bool {
    hold_byte().get() != Hold::Off as u8
}

/// Whether lines or the queue are being dropped: [`Hold::flushes`]. Any level.
#[inline(always)]
pub fn is_flushing() -> bool {
    hold_byte().get() >= Hold::Flush as u8
}

/// Whether the queue is being dropped: [`Hold::drops`]. Any level.
#[inline(always)]
pub fn is_dropping() -> bool {
    hold_byte().get() >= Hold::Drop as u8
}

/// Whether the program ends once the queue has been dropped: [`Hold::kills`]. Any level.
#[inline(always)]
pub fn is_killing() -> bool {
    hold_byte().get() >= Hold::Kill as u8
}

/// Whether the reader has to drop the lines that have arrived. Any level.
#[inline(always)]
pub fn is_to_cut() -> bool {
    hold_byte().get() | 1 == Hold::FlushDoor as u8
}

/// Whether the machine stands at a program stop. Any level.
#[inline(always)]
pub fn is_stopped() -> bool {
    cycle_byte().get() == Cycle::Stopped as u8
}

/// Whether lines are only checked and not carried out. Any level.
#[inline(always)]
pub fn is_checking() -> bool {
    cycle_byte().get() == Cycle::Check as u8
}

/// Whether the door is open. Any level.
#[inline(always)]
pub fn has_open_door() -> bool {
    let byte = hold_byte().get();
    byte > Hold::Resuming as u8 && byte & 1 != 0
}

/// Whether motion is not held, or resumes by itself after it has come to rest. Any level.
#[inline(always)]
pub fn goes_on() -> bool {
    hold_byte().get() <= Hold::Resuming as u8
}

/// Whether held motion resumes after it has come to rest. Any level.
#[inline(always)]
pub fn is_resuming() -> bool {
    hold_byte().get() == Hold::Resuming as u8
}

/// Whether a `~` may resume what is held or what waits at a program stop. Any level.
#[inline(always)]
pub fn may_resume() -> bool {
    hold_byte().get() < Hold::Door as u8
}

/// Applies an event to the [`Hold`], and makes exec run. For events that concern only the [`Hold`]. (`Dropped` concerns
/// the [`Cycle`] too: call [`dropped`] for it.)
#[inline(never)]
#[small]
pub fn take(_: Thread, event: Event) {
    let before = hold_byte().get();
    let at = usize::from(before) * Event::OF_HOLD + event as usize;
    // An unchanged state is not written, because exec may have written the byte meanwhile.
    if let Some(after) = HOLDS.at(at).filter(|after| *after != before) {
        hold_byte().set(after);
    }
    exec::pend();
}

/// Applies an event that concerns only the [`Cycle`].
#[inline(never)]
#[small]
pub fn carry_out(_: Thread, event: Event) {
    cycle_byte().set(cycle().after(event, is_dropping(), is_alarmed()) as u8);
}

/// Applies the event `Dropped`: the queue has been dropped. Returns the cycle that has been interrupted, and whether
/// the program has to end.
#[inline(always)]
pub fn dropped(thread: Thread) -> (Cycle, bool) {
    let before = (cycle(), is_killing());
    cycle_byte().set(before.0.after(Event::Dropped, true, true) as u8);
    take(thread, Event::Dropped);
    before
}

/// Begins an alarm and drops the queue, unless an equally bad or worse alarm is on. Calls `first` before exec sees the
/// alarm. Returns whether the alarm has begun.
#[inline(always)]
pub fn raise(thread: Thread, alarm: Alarm, first: impl FnOnce()) -> bool {
    let counts = self::alarm().is_exceeded_by(alarm);
    if counts {
        first();
        // In this order, so that exec never takes what is to be dropped for what is queued in the alarm.
        take(thread, Event::Cut);
        alarm_byte().set(alarm as u8);
    }
    counts
}

/// Ends the alarm. Returns false if it cannot end: during a panic, or while lines or the queue are being dropped.
#[inline(always)]
pub fn clear(_: Thread) -> bool {
    let ends = !is_flushing() && alarm_byte().get() != Alarm::Panic as u8;
    if ends {
        alarm_byte().set(Alarm::None as u8);
    }
    ends
}

/// Puts the machine into [`State::AFTER_FAULT`], after an unwanted reset, or after a reset by the sender during motion.
/// Call it when nothing is queued.
pub fn start_alarmed(_: Thread) {
    alarm_byte().set(State::AFTER_FAULT.alarm as u8);
}

/// Records that the machine has come to rest in a hold. Returns whether motion resumes.
#[inline(always)]
pub fn rested(_: Interrupt) -> bool {
    let resumes = is_resuming();
    if resumes {
        hold_byte().set(Hold::Resuming.after(Event::Rested) as u8);
    }
    resumes
}

/// Makes exec drop its blocks. Exec sets `Event::BlockDone` of the [events](crate::hal::event) when it has done so; see
/// [`has_dropped_blocks`].
pub fn drop_blocks(_: Thread) {
    drop_wanted().set(1);
    exec::pend();
}

/// Whether exec has dropped its blocks. Any level.
pub fn has_dropped_blocks() -> bool {
    drop_wanted().get() == 0
}

/// Calls `drop_all` if the planner wants exec's blocks dropped, and reports that to the planner. Call it at standstill.
#[inline(always)]
pub fn drop_if_wanted(_: Interrupt, drop_all: impl FnOnce()) {
    if drop_wanted().get() != 0 {
        drop_all();
        drop_wanted().set(0);
        flags::set(BlockDone);
    }
}
