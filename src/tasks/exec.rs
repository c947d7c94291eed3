//! The exec task: keeps the segment ring full. The only task of the exec executor.
//!
//! Reads the block ring, writes the segment ring, waits for a free segment slot, a new block, or the
//! steppers to stop (each pends the exec interrupt). One run prepares at most the free slots: 4,000 to
//! 8,000 cycles each.

use crate::alarm::Alarm;
use crate::boards::ACTIVE;
use crate::hal::event::Event;
use crate::hal::imp::{exec, flags, gpio, stepper};
use crate::hal::ring::Producer;
use crate::motion::contact;
use crate::motion::dda::{SEGMENTS, Segment};
use crate::motion::exec::{Exec, Program, Step};
use crate::motion::finished::Finished;
use crate::motion::queue::BlockSource;
use crate::tasks::{alarm, hold, links, power};

/// CPU cycles in so many tenths of a millisecond.
const fn tenths(of_ms: u32) -> u32 {
    ACTIVE.clock_hz / 10_000 * of_ms
}

/// The task.
pub async fn run(mut blocks: BlockSource, mut segments: Producer<Segment, SEGMENTS>) -> ! {
    let mut machine = Exec::new();
    let mut segment = Segment::default();
    let (mut most, mut rests) = (1u8, true);
    let mut outputs = 0;
    let mut finished = Finished::new();
    loop {
        let has_room = || segments.used() < most.into();
        exec::wait(|| (has_room() || hold::darkened() || stepper::is_stopped()).then_some(()))
            .await;
        if hold::darkened() {
            hold::has_darkened();
            outputs = 0;
            gpio::set_outputs(outputs);
            links::update(|out| out.outputs = outputs);
            continue;
        }
        let waiting = blocks.len();
        let standstill = !stepper::running();
        if contact::is_noted() {
            contact::catch_up(&segments);
        }
        let step = links::update(|out| {
            machine.set_hold(hold::is_wanted(out.running) || contact::is_noted(), out);
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
                rests = out.velocity.to_bits() == 0;
                finished.queue();
                power::segment(segment.moving);
            } else if step == Step::Idle && standstill {
                finished.rest();
                out.finished = out.line;
            } else if step == Step::Held {
                hold::dropped(|| {
                    let held = machine.drop_all(&mut blocks, out);
                    stepper::settle(held, &mut out.target);
                    finished.rest();
                    if alarm::now() >= Alarm::Shutdown {
                        out.program = Program::Ready;
                    }
                });
            } else if out.outputs != outputs {
                outputs = out.outputs;
                gpio::set_outputs(outputs);
            }
            step
        });
        if step == Step::Segment {
            // There is room: this task alone fills the ring.
            let _ = segments.push_copy(&segment);
            if contact::is_noted() {
                contact::pushed(&segment);
            }
            stepper::go();
            let cycles = u32::from(segment.ticks) * u32::from(segment.period);
            most = queued(cycles, rests);
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

/// Waits for the next time exec is pended.
async fn exec_asked_again() {
    let mut first = true;
    exec::wait(|| (!core::mem::replace(&mut first, false)).then_some(())).await;
}
