//! One machine on the host: the firmware's tasks, its clock, and a sender's end of the line.

use std::vec::Vec;

use avr_embassy::host::Runtime;
use avr_embassy::{Boot, Thread};
use embassy_executor::Spawner;

use super::{card, clock, encoder, heaters, inputs, now, stepper, time, uart};
use crate::hal::event::{self, Event};
use crate::hal::serial::{AUX, USB};

/// The machine of this thread.
pub struct Machine {
    runtime: Runtime,
}

impl Machine {
    /// Makes the machine, with a millisecond count that begins at `ms`, and starts the firmware. `start` spawns its
    /// tasks, and returns `None` if it has been started before; then this returns `None`, too.
    pub fn start(
        ms: u64,
        start: impl FnOnce(Spawner, Thread, &Boot) -> Option<()>,
    ) -> Option<Self> {
        clock().set(ms * time::CYCLES_PER_MS);
        let runtime = Runtime::new();
        // SAFETY: no task has been polled, and the token is dropped before one is.
        let boot = unsafe { Boot::assume() };
        start(runtime.spawner(), runtime.thread(), &boot)?;
        let machine = Self { runtime };
        machine.settle();
        Some(machine)
    }

    /// Returns the token of thread mode. Nothing else runs between two calls of this machine's functions.
    pub fn thread(&self) -> Thread {
        self.runtime.thread()
    }

    /// Sets the rate of the sender to `baud`.
    pub fn set_baud(&self, baud: u32) {
        uart::set_sender_rate(USB, baud);
    }

    /// Makes the sender put bytes on the line. They take the time that the baud rate requires.
    pub fn send(&self, bytes: &[u8]) {
        uart::send(USB, bytes);
    }

    /// Makes a program, not the first one, open the first port.
    pub fn open_usb(&self) {
        uart::open_usb();
    }

    /// Makes the program close the first port.
    pub fn close_usb(&self) {
        uart::close_usb();
    }

    /// Makes the sender put a byte on the line that arrives damaged.
    pub fn send_damaged(&self) {
        uart::send_damaged(USB);
    }

    /// Makes the sender on the second port put bytes on the line.
    pub fn send_aux(&self, bytes: &[u8]) {
        uart::send(AUX, bytes);
    }

    /// Makes the sender on the second port stop the machine by its pin (CTS), or allow it to continue.
    pub fn set_aux_cts(&self, stop: bool) {
        uart::set_cts(AUX, stop);
    }

    /// Whether the firmware stops the sender on the second port by its pin (RTS).
    pub fn aux_rts(&self) -> bool {
        uart::rts(AUX)
    }

    /// Takes what the firmware has sent since the last call.
    pub fn received(&self) -> Vec<u8> {
        uart::received(USB)
    }

    /// Takes what the firmware has sent on the second port since the last call.
    pub fn received_aux(&self) -> Vec<u8> {
        uart::received(AUX)
    }

    /// Returns what the step pins have done so far.
    pub fn emitted(&self) -> stepper::Emitted {
        stepper::emitted()
    }

    /// Closes the contact at an input of [`inputs`](crate::boards::inputs), so that its pin goes low, or opens it.
    pub fn set_input(&self, input: usize, closed: bool) {
        inputs::set(input, !closed);
    }

    /// Makes a motor actuate the contact at an input from now on. The contact of an end is closed while the motor of
    /// its axis is at `step` or beyond; the contact of the probe while the third motor is at `step` or below. With
    /// `opens` the contact is open there instead.
    pub fn set_near(&self, input: usize, step: i64, opens: bool) {
        stepper::set_near(input, step, opens);
    }

    /// Turns the spindle at `rpm` turns a minute until the next call, with `per_turn` pulses of its encoder in each
    /// turn; backwards below 0.
    pub fn turn_spindle(&self, rpm: f64, per_turn: u16) {
        encoder::turn(rpm, per_turn);
    }

    /// Sets what the converter reads of a heater's sensor (0 hot end, 1 bed) from now on.
    pub fn set_sensor(&self, heater: usize, reading: u16) {
        heaters::set(heater, reading);
    }

    /// Returns which heaters are on: bits 0 hot end, 1 bed, 2 fan.
    pub fn heaters_on(&self) -> u8 {
        heaters::on()
    }

    /// Puts an SD card with these blocks into the slot, or takes it out.
    pub fn insert_card(&self, blocks: Option<card::Blocks>) {
        card::insert(blocks);
    }

    /// Returns the blocks of the card in the slot; `None` without a card.
    pub fn card(&self) -> Option<card::Blocks> {
        card::blocks()
    }

    /// Returns how many blocks of cards have been read so far.
    pub fn card_reads(&self) -> u32 {
        card::reads()
    }

    /// Runs for `ms` milliseconds.
    pub fn run_ms(&self, ms: u64) {
        let end = now() + ms * time::CYCLES_PER_MS;
        while self.advance(end) {}
    }

    /// Runs until `done`, for at most `ms` milliseconds. Returns whether `done` became true.
    pub fn run_until(&self, ms: u64, mut done: impl FnMut() -> bool) -> bool {
        let end = now() + ms * time::CYCLES_PER_MS;
        while !done() {
            if !self.advance(end) {
                return false;
            }
        }
        true
    }

    /// Moves the clock to the next event before `end` and lets the firmware react. Returns `false` if there is no
    /// such event; the clock is at `end` then.
    fn advance(&self, end: u64) -> bool {
        let step = stepper::next_tick();
        let bytes = uart::next_event();
        let tick = time::next_tick();
        let sample = inputs::next_sample();
        let edge = encoder::next_edge();
        let next = step.min(bytes).min(tick).min(sample).min(edge);
        if next > end {
            clock().set(end);
            return false;
        }
        clock().set(next);
        if step == next {
            stepper::tick();
        }
        if bytes == next {
            uart::advance();
        }
        if tick == next {
            time::tick();
        }
        if sample == next {
            inputs::sample();
        }
        if edge == next {
            encoder::advance();
        }
        self.settle();
        true
    }

    /// Polls until no task has anything left to do now.
    fn settle(&self) {
        let thread = self.runtime.thread();
        self.runtime.settle(|bits| {
            event::turn(thread, bits);
            if Event::Tick.is_in(bits) {
                time::wake_expired();
            }
        });
    }
}
