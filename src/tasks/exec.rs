//! The exec task: keeps the segment ring full. The only task of the exec executor.
//!
//! Reads the block ring, writes the segment ring, waits for a free segment slot, a new block, or the
//! steppers to stop (each pends the exec interrupt). One run prepares what is needed for the next few
//! milliseconds ([`Amount::least`]), 4,000 to 14,000 cycles each, 33,000 where much changes at once; the rest one by one, when one is used up or thread mode
//! has nothing else to do: a line that has come is answered meanwhile. When too little waits ([`WAITING_SHORT`]), stretches become twice
//! as long, and for a while more waits ([`PRESSED`]).

use crate::alarm::Alarm;
use crate::boards::ACTIVE;
use crate::hal::event::{self, Event};
use crate::hal::imp::{exec, flags, stepper};
use crate::hal::ring::Producer;
use crate::motion::contact;
use crate::motion::dda::{SEGMENTS, Segment};
use crate::motion::exec::{Exec, Step};
use crate::motion::finished::Finished;
use crate::motion::queue::BlockSource;
use crate::motion::snapshot::Program;
use crate::tasks::health::{self, Sign};
use crate::tasks::{Never, alarm, hold, links, overrides, power, spindle};

/// After so many segments without a turn of thread mode they become longer, which takes less of the CPU.
const PATIENCE: u8 = 6;

/// The task.
#[allow(clippy::manual_async_fn)] // See `tasks`.
pub fn run(
    mut blocks: BlockSource,
    mut segments: Producer<Segment, SEGMENTS>,
) -> impl Future<Output = Never> {
    async move {
        let mut machine = Exec::new();
        let mut segment = Segment::default();
        let (mut waiting, mut rests) = (Waiting::new(), true);
        let mut finished = Finished::new();
        loop {
            exec::wait(|| {
                health::answer(Sign::Exec);
                (waiting.has_room(segments.used(), rests) || stepper::is_stopped()).then_some(())
            })
            .await;
            let queued = blocks.len();
            let rested = rests;
            let standstill = !stepper::running();
            if contact::is_noted() {
                contact::catch_up(&segments);
            }
            let step = links::update(|out| {
                machine.set_hold(hold::is_wanted(out.running) || contact::is_noted(), out);
                // What has paused in a hold goes on before motion does.
                if out.outputs != spindle::on() {
                    machine.wait(spindle::switch(out, false), out);
                }
                if let Some(line) = finished.take(segments.used()) {
                    out.finished = line;
                }
                let line = out.line;
                let step = match stepper::is_stopped() {
                    true => Step::Held,
                    false => machine.step(&mut blocks, standstill, out, &mut segment),
                };
                if out.line != line {
                    finished.end(line);
                }
                if step == Step::Segment {
                    finished.queue();
                    power::segment(segment.moving);
                } else if let Step::Override(change) = step {
                    overrides::change_in_stream(change, &mut blocks);
                } else if step == Step::Idle && standstill {
                    finished.rest();
                    out.finished = out.line;
                } else if step == Step::Held {
                    spindle::switch(out, false);
                    hold::dropped(|| {
                        // What has paused stays off.
                        out.outputs = spindle::on();
                        let held = machine.drop_all(&mut blocks, out);
                        stepper::settle(held, &mut out.target);
                        finished.rest();
                        if alarm::now() >= Alarm::Shutdown {
                            out.program = Program::Ready;
                        }
                    });
                } else if step == Step::Switched {
                    machine.wait(spindle::switch(out, true), out);
                }
                // A standstill stays one until a segment leads out of it; velocity is ahead of the segments.
                rests = out.velocity.to_bits() == 0 || (rests && step != Step::Segment);
                step
            });
            if step == Step::Segment {
                // There is room: this task alone fills the ring.
                let _ = segments.push_copy(&segment);
                waiting.push(u32::from(segment.ticks) * u32::from(segment.period));
                health::moves(waiting.count);
                let short = waiting.is_short(segments.used(), rests);
                machine.set_coarse(event::pass_over() > PATIENCE || waiting.is_busy(), short);
                if contact::is_noted() {
                    contact::pushed(&segment);
                }
                if !rested {
                    health::look_for_starvation();
                }
                stepper::go();
                let used = segments.used();
                if used >= 2 && waiting.sum(used) >= waiting.limits().least {
                    exec::pend_when_idle();
                    exec_asked_again().await;
                    waiting.go_on(segments.used());
                }
            }
            if blocks.len() != queued {
                flags::set(Event::BlockDone);
            }
            if step == Step::Held && hold::passes() {
                continue;
            }
            if matches!(step, Step::Idle | Step::Standstill | Step::Held) {
                links::hungry(true);
                exec_asked_again().await;
                links::hungry(false);
            }
        }
    }
}

/// How long the segments last that wait in the ring, in units of 2^11 CPU cycles.
struct Waiting {
    /// Those of the last segments, the newest at `count - 1`, modulo their number.
    lengths: [u8; SEGMENTS],
    /// Segments queued, modulo 256.
    count: u8,
    /// How many wait, as far as that is known, and how long they take together.
    used: u8,
    sum: u16,
    /// Segments until the usual amount waits again.
    pressed: u8,
    /// Segments since the machine stood still.
    moved: u8,
    /// How many segments in a row were used up before thread mode was idle.
    busy: u8,
}

/// So many of them say that thread mode has no time left.
const BUSY: u8 = 3;

/// The unit: shifts are cheaper than divisions.
const UNIT_LOG2: u8 = 11;

/// Units in so many tenths of a millisecond.
const fn units(tenths: u32) -> u16 {
    ((ACTIVE.clock_hz / 10_000 * tenths) >> UNIT_LOG2) as u16
}

/// How much waits, in the unit.
struct Amount {
    /// What may wait.
    most: u16,
    /// What is prepared before thread mode gets a turn.
    least: u16,
}

/// With the segment that runs, which takes 2 ms or less while anything is fast, a feedhold begins within 10 ms. Three segments of 2 ms must
/// fit: where a ramp is laid out while ticks take two thirds of the CPU, exec takes up to 4.1 ms for a segment.
const USUAL: Amount = Amount { most: units(62), least: units(38) };

/// For a while after too little has been waiting: a feedhold begins within 14 ms.
const PRESSED: Amount = Amount { most: units(80), least: units(65) };

/// That while, in segments.
const PRESSED_FOR: u8 = 100;

/// With less than this exec is late, and makes longer stretches.
const WAITING_SHORT: u16 = units(25);

impl Waiting {
    const fn new() -> Self {
        Self { lengths: [0; SEGMENTS], count: 0, used: 0, sum: 0, pressed: 0, moved: 0, busy: 0 }
    }

    /// The length of the segment that was queued so many before the next one.
    fn length(&self, back: u8) -> u16 {
        let at = usize::from(self.count.wrapping_sub(back)) % SEGMENTS;
        self.lengths.get(at).copied().unwrap_or_default().into()
    }

    /// A segment of so many CPU cycles has been queued.
    fn push(&mut self, cycles: u32) {
        let units = cycles >> UNIT_LOG2;
        let length = if units > 0xFF { 0xFF } else { units as u8 };
        if let Some(place) = self.lengths.get_mut(usize::from(self.count) % SEGMENTS) {
            *place = length;
        }
        self.count = self.count.wrapping_add(1);
        self.pressed = self.pressed.saturating_sub(1);
        self.used = self.used.wrapping_add(1);
        self.sum += u16::from(length);
    }

    /// How long the `used` segments take that wait.
    fn sum(&mut self, used: usize) -> u16 {
        while usize::from(self.used) > used {
            self.sum = self.sum.saturating_sub(self.length(self.used));
            self.used -= 1;
        }
        self.sum
    }

    /// Exec has waited for thread mode to be idle, and goes on: because it is, or because a segment has been used up.
    fn go_on(&mut self, used: usize) {
        let idle = usize::from(self.used) == used;
        self.busy = if idle { 0 } else { self.busy.saturating_add(1) };
    }

    /// Whether thread mode has no time left: then stretches are longer, which leaves it more.
    fn is_busy(&self) -> bool {
        self.busy >= BUSY
    }

    fn limits(&self) -> &'static Amount {
        if self.pressed > 0 { &PRESSED } else { &USUAL }
    }

    /// Whether exec is late. Motion that has just begun, or `rests`, has not much waiting yet.
    fn is_short(&mut self, used: usize, rests: bool) -> bool {
        self.moved = if rests { 0 } else { self.moved.saturating_add(1) };
        let short = usize::from(self.moved) > SEGMENTS && self.sum(used) < WAITING_SHORT;
        if short {
            self.pressed = PRESSED_FOR;
        }
        short
    }

    /// Whether another one like the last may wait: what is queued cannot be slowed down any more. Unless the machine `rests` at
    /// the end of each, as blocks do that come late: then a hold has no speed to take away.
    fn has_room(&mut self, used: usize, rests: bool) -> bool {
        if used < 2 {
            return true;
        }
        let sum = self.sum(used) + self.length(1);
        used < SEGMENTS - 1 && (sum <= self.limits().most || rests && used < 4)
    }
}

/// Waits for the next time exec is pended.
fn exec_asked_again() -> impl Future<Output = ()> {
    let mut asked = false;
    exec::wait(move || core::mem::replace(&mut asked, true).then_some(()))
}
