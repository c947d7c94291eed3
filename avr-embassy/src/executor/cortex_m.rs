//! The thread-mode executor and its loop on Cortex-M.
//!
//! The executor is that of `embassy_executor::raw`. The loop is our own, because `embassy_executor::Executor` cannot
//! do two things: turn event bits into wake-ups, and tell interrupt mode when thread mode has nothing left to do.

use cortex_m::asm::wfe;
use embassy_executor::{Spawner, raw};

use crate::event::{self, flags};
use crate::{Thread, interrupt, pender};

/// The thread-mode executor. It lives in a `static_cell::StaticCell`, for example.
pub struct Executor(raw::Executor);

impl Executor {
    /// Returns an executor without tasks.
    #[expect(clippy::new_without_default, reason = "as Embassy's own executors")]
    pub fn new() -> Self {
        Self(raw::Executor::new(pender::THREAD))
    }

    /// Runs for ever. `init` spawns the tasks with interrupts off. Then interrupts are on, and the CPU sleeps
    /// whenever there is nothing to do.
    pub fn run(&'static mut self, init: impl FnOnce(Spawner, Thread)) -> ! {
        self.run_with(init, |_, _| ())
    }

    /// Runs the tasks as [`Executor::run`] does. In addition, `turn` is called with the bits of the events that have
    /// happened, each time before tasks are polled. Use it for work that is too small for a task.
    pub fn run_with(
        &'static mut self,
        init: impl FnOnce(Spawner, Thread),
        mut turn: impl FnMut(Thread, u8),
    ) -> ! {
        let executor = &self.0;
        // SAFETY: this is thread mode.
        let thread = unsafe { Thread::assume() };
        cortex_m::interrupt::disable();
        init(executor.spawner(), thread);
        // SAFETY: tasks have been spawned and no critical section is open: interrupts may come.
        unsafe { cortex_m::interrupt::enable() };
        loop {
            if flags::all() != 0 {
                let bits = flags::take();
                event::dispatch(thread, bits);
                turn(thread, bits);
                // SAFETY: only this place calls it, so it is never reentered.
                unsafe { executor.poll() };
                continue;
            }
            // The interrupt executor runs at this place if `idle` pends it.
            interrupt::idle();
            if flags::all() == 0 {
                // An event that is set after this test also sets the CPU's event register, so that `wfe` does not
                // sleep.
                wfe();
            }
        }
    }
}
