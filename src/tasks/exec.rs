//! The exec task: keeps the segment ring full. The only task of the exec executor.
//!
//! Reads the block ring, writes the segment ring, waits for a free segment slot, a new block, or the
//! steppers to stop (each pends the exec interrupt). One run prepares what is needed for the next few
//! milliseconds ([`enough`]), 4,000 to 14,000 cycles each; the rest one by one, when one is used up or thread mode
//! has nothing else to do: a line that has come is answered meanwhile.

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

/// CPU cycles in so many tenths of a millisecond.
const fn tenths(of_ms: u32) -> u32 {
    ACTIVE.clock_hz / 10_000 * of_ms
}

/// The task.
#[allow(clippy::manual_async_fn)] // See `tasks`.
pub fn run(
    mut blocks: BlockSource,
    mut segments: Producer<Segment, SEGMENTS>,
) -> impl Future<Output = Never> {
    async move {
        let mut machine = Exec::new();
        let mut segment = Segment::default();
        let (mut most, mut rests, mut count) = (1u8, true, 0u8);
        let mut finished = Finished::new();
        loop {
            exec::wait(|| {
                health::answer(Sign::Exec);
                (segments.used() < most.into() || stepper::is_stopped()).then_some(())
            })
            .await;
            let waiting = blocks.len();
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
                count = count.wrapping_add(1);
                health::moves(count);
                machine.set_coarse(event::pass_over() > PATIENCE);
                if contact::is_noted() {
                    contact::pushed(&segment);
                }
                if !rested {
                    health::look_for_starvation();
                }
                stepper::go();
                let cycles = u32::from(segment.ticks) * u32::from(segment.period);
                most = queued(cycles, rests);
                if (enough(cycles)..most).contains(&(segments.used() as u8)) {
                    exec::pend_when_idle();
                    exec_asked_again().await;
                }
            }
            if blocks.len() != waiting {
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

/// How many segments are queued at a time if the last took so many CPU cycles: what is queued cannot be
/// slowed down any more. With the one that runs they take 9 ms at most; unless it `rests` at the end of each,
/// as blocks do that come late: then a hold has no speed to take away.
#[inline(always)]
fn queued(cycles: u32, rests: bool) -> u8 {
    match cycles {
        _ if cycles <= tenths(9) => SEGMENTS as u8 - 1,
        _ if cycles <= tenths(12) => 6,
        _ if rests => 4,
        _ if cycles <= tenths(21) => 3,
        _ if cycles <= tenths(29) => 2,
        _ => 1,
    }
}

/// How many segments are queued in one go if the last took so many CPU cycles: 2 ms beside the one that runs.
#[inline(always)]
fn enough(cycles: u32) -> u8 {
    if cycles <= tenths(10) { 3 } else { 2 }
}

/// Waits for the next time exec is pended.
fn exec_asked_again() -> impl Future<Output = ()> {
    let mut asked = false;
    exec::wait(move || core::mem::replace(&mut asked, true).then_some(()))
}
