//! The thread-mode executor and its loop.

use core::arch::asm;

use embassy_executor::{Spawner, raw};

use crate::chip::{SLEEP_IDLE, SMCR};
use crate::event::{self, Event, flags};
use crate::{Thread, interrupt, pender, time};

/// The thread-mode executor. It lives in a `static_cell::StaticCell`, for example.
pub struct Executor(raw::Executor);

impl Executor {
    /// Returns an executor without tasks.
    #[expect(clippy::new_without_default, reason = "as Embassy's own executors")]
    pub fn new() -> Self {
        Self(raw::Executor::new(pender::THREAD))
    }

    /// Runs for ever. `init` spawns the tasks; interrupts stay as they are meanwhile. Then interrupts are switched
    /// on, and the CPU sleeps (idle mode) whenever there is nothing to do.
    ///
    /// Cost: from an event to the first instruction of the task that waits for it, see the README.
    pub fn run(&'static mut self, init: impl FnOnce(Spawner, Thread)) -> ! {
        self.run_with(init, |_, _| ())
    }

    /// Runs the tasks as [`Executor::run`] does. In addition, `turn` is called with the bits of the events that have
    /// happened, each time before tasks are polled. Use it for work that is too small for a task.
    #[inline(always)]
    pub fn run_with(
        &'static mut self,
        init: impl FnOnce(Spawner, Thread),
        mut turn: impl FnMut(Thread, u8),
    ) -> ! {
        let executor = &self.0;
        // SAFETY: this is thread mode.
        let thread = unsafe { Thread::assume() };
        init(executor.spawner(), thread);
        // SAFETY: without its lowest bit `sleep` does nothing; nobody else uses the register. Tasks have been spawned
        // and no critical section is open: interrupts may come.
        unsafe {
            asm!("cli");
            (SMCR as *mut u8).write_volatile(SLEEP_IDLE);
            asm!("sei");
        }
        loop {
            if flags::all() != 0 {
                let bits = flags::take();
                // Embassy polls tasks in the reverse order of their wake-ups. Tasks that wait for a time are woken
                // first, so they are polled last.
                if bits & 1 << Event::TICK.bit() != 0 {
                    time::wake_expired(thread);
                }
                event::dispatch(thread, bits);
                turn(thread, bits);
                // SAFETY: only this place calls it, so it is never reentered.
                unsafe { executor.poll() };
                continue;
            }
            // Interrupts are on here, so the interrupt executor runs at this place if `idle` pends it.
            interrupt::idle();
            // SAFETY: interrupts are on again a few instructions further on.
            unsafe { asm!("cli") };
            if flags::all() == 0 {
                // The CPU executes one instruction after `reti` before it serves the next interrupt. That instruction
                // is `nop`, not `cli`: a handler that is due when another one ends must not wait for this loop as
                // well.
                // SAFETY: plain instructions. They must stay together: an interrupt cannot come between
                // `sei` and `sleep`, so an event set after the test above still ends the sleep.
                unsafe { asm!("sei", "sleep", "nop") };
                continue;
            }
            // SAFETY: as above.
            unsafe { asm!("sei") };
        }
    }
}
