//! The exec task: keeps the segment ring full. The only task of the exec executor.
//!
//! Reads the block ring, writes the segment ring, waits for a free segment slot, a new block, or the
//! steppers to stop (each pends the exec interrupt). One run prepares at most the free slots: 4,000 to
//! 8,000 cycles each.

use crate::boards::ACTIVE;
use crate::hal::event::Event;
use crate::hal::imp::{exec, flags, gpio, stepper};
use crate::hal::ring::Producer;
use crate::motion::dda::{SEGMENTS, Segment};
use crate::motion::exec::{Exec, Step};
use crate::motion::finished::Finished;
use crate::motion::queue::BlockSource;
use crate::tasks::{links, power};

/// Segments shorter than this, CPU cycles, may fill the ring.
const SHORT: u32 = ACTIVE.clock_hz / 800;

/// Longer ones are queued so many at a time: what is queued cannot be slowed down any more.
const LONG_QUEUED: usize = 4;

/// The task.
pub async fn run(mut blocks: BlockSource, mut segments: Producer<Segment, SEGMENTS>) -> ! {
    let mut machine = Exec::new();
    let mut segment = Segment::default();
    let mut most = LONG_QUEUED as u8;
    let mut outputs = 0;
    let mut finished = Finished::new();
    loop {
        exec::wait(|| (segments.used() < most.into()).then_some(())).await;
        let waiting = blocks.len();
        let standstill = !stepper::running();
        let step = links::update(|out| {
            if let Some(line) = finished.take(segments.used()) {
                out.finished = line;
            }
            let line = out.line;
            let step = machine.step(&mut blocks, standstill, out, &mut segment);
            if out.line != line {
                finished.end(line);
            }
            if step == Step::Segment {
                finished.queue();
                power::segment(segment.moving);
            } else if step == Step::Idle && standstill {
                finished.rest();
                out.finished = out.line;
            } else if out.outputs != outputs {
                outputs = out.outputs;
                gpio::set_outputs(outputs);
            }
            step
        });
        if step == Step::Segment {
            // There is room: this task alone fills the ring.
            let _ = segments.push_copy(&segment);
            stepper::go();
            let cycles = u32::from(segment.ticks) * u32::from(segment.period);
            most = if cycles < SHORT { SEGMENTS as u8 - 1 } else { LONG_QUEUED as u8 };
        }
        if blocks.len() != waiting {
            flags::set(Event::BlockDone);
        }
        if matches!(step, Step::Idle | Step::Standstill) {
            links::hungry(true);
            exec_asked_again().await;
            links::hungry(false);
        }
    }
}

/// Waits for the next time exec is pended.
async fn exec_asked_again() {
    let mut first = true;
    exec::wait(|| (!core::mem::replace(&mut first, false)).then_some(())).await;
}
