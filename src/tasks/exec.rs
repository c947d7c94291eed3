//! The exec task: keeps the segment ring full. The only task of the exec executor.
//!
//! Reads the block ring, writes the segment ring, waits for a free segment slot, a new block, or the
//! steppers to stop (each pends the exec interrupt). One run prepares at most the free slots: about
//! 13,000 cycles each.

use crate::hal::event::Event;
use crate::hal::imp::{exec, flags, stepper};
use crate::hal::ring::Producer;
use crate::motion::dda::{SEGMENTS, Segment};
use crate::motion::exec::{Exec, Step};
use crate::motion::queue::BlockSource;
use crate::tasks::{links, power};

/// The task.
pub async fn run(mut blocks: BlockSource, mut segments: Producer<Segment, SEGMENTS>) -> ! {
    let mut machine = Exec::new();
    loop {
        exec::wait(|| (segments.free() > 0).then_some(())).await;
        let waiting = blocks.len();
        let step = machine.step(&mut blocks, !stepper::running());
        if let Step::Segment(segment) = step {
            power::segment(&segment, &machine.snapshot().steps);
            // There is room: this task alone fills the ring.
            let _ = segments.push(segment);
            stepper::go();
        }
        announce(&machine, blocks.len() != waiting);
        if matches!(step, Step::Idle | Step::Standstill) {
            exec_asked_again().await;
        }
    }
}

/// Tells thread mode what changed.
fn announce(machine: &Exec, released: bool) {
    links::publish(*machine.snapshot());
    if released {
        flags::set(Event::BlockDone);
    }
}

/// Waits for the next time exec is pended.
async fn exec_asked_again() {
    let mut first = true;
    exec::wait(|| (!core::mem::replace(&mut first, false)).then_some(())).await;
}
