//! The serial line between the host and a USART, at the host's exact speed.

use std::collections::VecDeque;

use crate::mechanics::Random;
use crate::uart::{Uart, limits};

const NEVER: u64 = u64::MAX;

/// Bits of a frame as the host sends it: start, eight data, stop.
const FRAME_BITS: f64 = 10.0;
/// Samples that the host's receiver takes in a bit, as most do.
const SAMPLES: f64 = 16.0;

/// Both directions of the line.
pub struct Wire {
    bit_cycles: f64,
    outgoing: VecDeque<u8>,
    /// When the next start bit may begin.
    free_at: u64,
    due: u64,
    received: VecDeque<u8>,
    lines_waiting: usize,
    garbled: u64,
    sent: u64,
    /// Whether the host's speed follows when the machine changes its own, and the machine's cycles per bit before the
    /// change.
    follows: bool,
    own_before: f64,
    /// One in so many bytes gets a bit flipped on its way to the machine.
    spoils: Option<(u64, Random)>,
    /// One in so many bytes loses its stop bit on its way to the machine.
    breaks: Option<(u64, Random)>,
}

impl Wire {
    /// An idle line.
    pub fn new(clock_hz: u32, baud: u32) -> Self {
        Wire {
            bit_cycles: f64::from(clock_hz) / f64::from(baud),
            outgoing: VecDeque::new(),
            free_at: 0,
            due: NEVER,
            received: VecDeque::new(),
            lines_waiting: 0,
            garbled: 0,
            sent: 0,
            follows: false,
            own_before: 0.0,
            spoils: None,
            breaks: None,
        }
    }

    /// Changes the host's speed.
    pub fn set_baud(&mut self, clock_hz: u32, baud: u32) {
        self.bit_cycles = f64::from(clock_hz) / f64::from(baud);
    }

    /// Makes the host's speed follow the machine's from now on, provided that both had the same speed before. This
    /// models a line that has no speed, such as USB or a pseudo-terminal.
    pub fn follow(&mut self) {
        self.follows = true;
    }

    fn understands(&self, own: f64) -> bool {
        limits(FRAME_BITS - 2.0, SAMPLES).contains(&(self.bit_cycles / own))
    }

    /// Cycle of the next start bit towards the machine.
    pub fn due(&self) -> u64 {
        self.due
    }

    /// Number of bytes that still wait to be sent.
    pub fn backlog(&self) -> usize {
        self.outgoing.len()
    }

    /// Bytes sent so far.
    pub fn sent(&self) -> u64 {
        self.sent
    }

    /// Number of bytes that came at a speed the host cannot read.
    pub fn garbled(&self) -> u64 {
        self.garbled
    }

    /// Queues bytes for the machine.
    pub fn send(&mut self, bytes: &[u8], now: u64) {
        self.outgoing.extend(bytes);
        self.due = if self.outgoing.is_empty() { NEVER } else { self.free_at.max(now) };
    }

    /// Queues a byte ahead of the bytes that still wait.
    pub fn send_first(&mut self, byte: u8, now: u64) {
        self.outgoing.push_front(byte);
        self.due = self.free_at.max(now);
    }

    /// From now on flips a bit in one of `one_in` bytes on their way to the machine; `None` ends that.
    pub fn spoil(&mut self, one_in: Option<u64>, seed: u64) {
        self.spoils = one_in.map(|n| (n.max(1), Random::new(seed)));
    }

    /// From now on removes the stop bit of one of `one_in` bytes on their way to the machine; `None` ends that.
    pub fn break_frames(&mut self, one_in: Option<u64>, seed: u64) {
        self.breaks = one_in.map(|n| (n.max(1), Random::new(seed)));
    }

    fn breaks(&mut self) -> bool {
        self.breaks.as_mut().is_some_and(|(one_in, random)| random.below(*one_in) == 0)
    }

    fn spoilt(&mut self, byte: u8) -> u8 {
        let Some((one_in, random)) = &mut self.spoils else { return byte };
        let spoils = random.below(*one_in) == 0;
        if spoils { byte ^ 1 << random.below(8) } else { byte }
    }

    /// Takes the machine's speed if it has changed and this side follows. Returns the machine's cycles per bit.
    fn follow_speed(&mut self, uart: &Uart) -> f64 {
        let own = uart.bit_cycles() as f64;
        if own != self.own_before {
            if self.follows && self.understands(self.own_before) {
                self.bit_cycles = own;
            }
            self.own_before = own;
        }
        own
    }

    /// Begins the frame that is due.
    pub fn pump(&mut self, uart: &mut Uart) {
        self.follow_speed(uart);
        if let Some(byte) = self.outgoing.pop_front() {
            let byte = self.spoilt(byte);
            uart.start_bit(byte, self.bit_cycles, self.due);
            if self.breaks() {
                uart.break_frame();
            }
            self.free_at = self.due + (self.bit_cycles * FRAME_BITS).round() as u64;
            self.sent += 1;
        }
        self.due = if self.outgoing.is_empty() { NEVER } else { self.free_at };
    }

    /// Takes the bytes that the machine has sent.
    pub fn listen(&mut self, uart: &mut Uart) {
        let own = self.follow_speed(uart);
        while let Some((_, byte)) = uart.take_sent() {
            if !self.understands(own) {
                self.garbled += 1;
                continue;
            }
            self.lines_waiting += usize::from(byte == b'\n');
            self.received.push_back(byte);
        }
    }

    /// Whether a whole line has come and was not taken yet.
    pub fn has_line(&self) -> bool {
        self.lines_waiting > 0
    }

    /// Takes all bytes that have come.
    pub fn take_received(&mut self) -> Vec<u8> {
        self.lines_waiting = 0;
        self.received.drain(..).collect()
    }
}
