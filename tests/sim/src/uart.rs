//! The USARTs as asynchronous serial ports.
//!
//! A frame takes exactly as long as its bits. The receiver has a two-byte FIFO behind the shift register. A third
//! byte waits in the shift register and is lost when a fourth begins. FE and DOR are kept in the FIFO with the byte
//! that is to be read next, as in the data sheet: FE says that the byte's stop bit was low, DOR that bytes before it
//! were lost. RXC and UDRE are levels: they ask for service as long as their condition holds. So UDRIE makes a
//! software interrupt out of a transmitter that is never written to.

use std::collections::VecDeque;
use std::ops::RangeInclusive;

const NEVER: u64 = u64::MAX;

// UCSRnA
const RXC: u8 = 1 << 7;
const TXC: u8 = 1 << 6;
const UDRE: u8 = 1 << 5;
const FE: u8 = 1 << 4;
const DOR: u8 = 1 << 3;
const U2X: u8 = 1 << 1;
const MPCM: u8 = 1;
// UCSRnB. Each interrupt enable has the bit position of its flag.
const RXEN: u8 = 1 << 4;
const TXEN: u8 = 1 << 3;
// UCSRnC
const PARITY: u8 = 1 << 5;
const TWO_STOPS: u8 = 1 << 3;

// Register offsets from UCSRnA.
const UCSRB: u16 = 1;
const UCSRC: u16 = 2;
const UBRRL: u16 = 4;
const UBRRH: u16 = 5;
const UDR: u16 = 6;

/// Register offsets that are in use.
pub const OFFSETS: [u16; 6] = [0, UCSRB, UCSRC, UBRRL, UBRRH, UDR];

/// A byte on its way through a shift register.
#[derive(Clone, Copy)]
struct Frame {
    byte: u8,
    /// FE and DOR.
    errors: u8,
    done: u64,
}

/// One USART.
pub struct Uart {
    base: u16,
    vector: u8,
    status: u8,
    control: u8,
    format: u8,
    divisor: u16,
    /// Bytes received, each with its errors (FE, DOR).
    fifo: VecDeque<(u8, u8)>,
    receiving: Option<Frame>,
    /// A complete byte that found the FIFO full.
    waiting: Option<(u8, u8)>,
    sending: Option<Frame>,
    buffered: Option<u8>,
    sent: VecDeque<(u64, u8)>,
    overruns: u64,
    misframed: u64,
    overwritten: u64,
}

impl Uart {
    /// A USART in its state after reset, given its first register and its first vector: see
    /// [`Chip`](crate::chip::Chip).
    pub fn new((base, vector): (u16, u8)) -> Self {
        Uart {
            base,
            vector,
            status: UDRE,
            control: 0,
            format: 0x06,
            divisor: 0,
            fifo: VecDeque::new(),
            receiving: None,
            waiting: None,
            sending: None,
            buffered: None,
            sent: VecDeque::new(),
            overruns: 0,
            misframed: 0,
            overwritten: 0,
        }
    }

    /// Cycle at which the next frame is complete.
    pub fn due(&self) -> u64 {
        let rx = self.receiving.map_or(NEVER, |f| f.done);
        let tx = self.sending.map_or(NEVER, |f| f.done);
        rx.min(tx)
    }

    /// Vectors that ask for service, as a bit set.
    pub fn lines(&self) -> u64 {
        let active = self.status & self.control & (RXC | UDRE | TXC);
        let rx = u64::from(active & RXC != 0);
        let empty = u64::from(active & UDRE != 0);
        let done = u64::from(active & TXC != 0);
        (rx | empty << 1 | done << 2) << self.vector
    }

    /// Takes note that the interrupt is being served. Only TXC is cleared by that.
    pub fn acknowledge(&mut self, vector: u8) {
        if vector == self.vector + 2 {
            self.status &= !TXC;
        }
    }

    /// Whether the receiver is on.
    pub fn is_listening(&self) -> bool {
        self.control & RXEN != 0
    }

    /// Bytes lost because they were not read in time.
    pub fn overruns(&self) -> u64 {
        self.overruns
    }

    /// Bytes written while the transmitter had no room, which are lost.
    pub fn overwritten(&self) -> u64 {
        self.overwritten
    }

    /// Frames received at a speed too far from the receiver's own, or with a stop bit that was low.
    pub fn misframed(&self) -> u64 {
        self.misframed
    }

    /// Whether there are bytes for [`Uart::take_sent`].
    pub fn has_sent(&self) -> bool {
        !self.sent.is_empty()
    }

    /// Bytes sent, each with the cycle at which its last stop bit ended.
    pub fn take_sent(&mut self) -> Option<(u64, u8)> {
        self.sent.pop_front()
    }

    /// Cycles per bit.
    pub fn bit_cycles(&self) -> u64 {
        (u64::from(self.divisor) + 1) * if self.status & U2X != 0 { 8 } else { 16 }
    }

    /// Bits in a frame, start and stop included.
    pub fn frame_bits(&self) -> u64 {
        let size = (self.format >> 1 & 3) | (self.control & 4);
        let data = [5, 6, 7, 8, 8, 8, 8, 9][usize::from(size)];
        let parity = u64::from(self.format & PARITY != 0);
        let stops = if self.format & TWO_STOPS != 0 { 2 } else { 1 };
        1 + data + parity + stops
    }

    /// Whether the receiver reads frames of a sender with `bit_cycles` cycles per bit.
    fn understands(&self, bit_cycles: f64) -> bool {
        let stops = if self.format & TWO_STOPS != 0 { 2 } else { 1 };
        let data = (self.frame_bits() - 1 - stops) as f64;
        let limits = if self.status & U2X != 0 { limits(data, 8.0) } else { limits(data, 16.0) };
        limits.contains(&(self.bit_cycles() as f64 / bit_cycles))
    }

    /// A sender with `bit_cycles` cycles per bit begins a start bit at cycle `now`.
    pub fn start_bit(&mut self, byte: u8, bit_cycles: f64, now: u64) {
        self.advance(now);
        if self.control & RXEN == 0 || self.receiving.is_some() {
            return;
        }
        // The next byte that gets into the FIFO carries DOR.
        let lost = self.waiting.take().is_some();
        self.overruns += u64::from(lost);
        let broken = !self.understands(bit_cycles);
        self.misframed += u64::from(broken);
        let byte = if broken { !byte } else { byte };
        // The frame is complete in the middle of its stop bit.
        let done = now + self.bit_cycles() * (2 * self.frame_bits() - 1) / 2;
        let errors = (u8::from(broken) * FE) | (u8::from(lost) * DOR);
        self.receiving = Some(Frame { byte, errors, done });
    }

    /// Makes the stop bit of the frame that is being received low, as noise or a sender that lets go of the line
    /// would.
    pub fn break_frame(&mut self) {
        if let Some(frame) = &mut self.receiving {
            frame.errors |= FE;
            self.misframed += 1;
        }
    }

    /// Completes the frames that are due by `now`.
    pub fn advance(&mut self, now: u64) {
        if let Some(frame) = self.receiving.take_if(|f| f.done <= now) {
            self.waiting = Some((frame.byte, frame.errors));
            self.settle();
        }
        while let Some(frame) = self.sending.take_if(|f| f.done <= now) {
            self.sent.push_back((frame.done, frame.byte));
            match self.buffered.take() {
                Some(byte) => self.begin_frame(byte, frame.done),
                None => self.status |= TXC,
            }
            self.status |= UDRE;
        }
    }

    fn begin_frame(&mut self, byte: u8, now: u64) {
        let done = now + self.bit_cycles() * self.frame_bits();
        self.sending = Some(Frame { byte, errors: 0, done });
    }

    /// Moves a waiting byte into the FIFO if there is room.
    fn settle(&mut self) {
        if self.fifo.len() < 2 {
            self.fifo.extend(self.waiting.take());
        }
        let found = match self.fifo.front() {
            None => 0,
            Some((_, errors)) => RXC | errors,
        };
        self.status = self.status & !(RXC | FE | DOR) | found;
    }

    /// A load that samples at cycle `now`; `None` for registers without side effects.
    pub fn read(&mut self, addr: u16, now: u64) -> Option<u8> {
        self.advance(now);
        match addr - self.base {
            0 => Some(self.status),
            UDR => {
                let (byte, _) = self.fifo.pop_front().unwrap_or((0, 0));
                self.settle();
                Some(byte)
            }
            _ => None,
        }
    }

    /// A store that takes effect at cycle `now`.
    pub fn write(&mut self, addr: u16, value: u8, now: u64) {
        self.advance(now);
        match addr - self.base {
            0 => {
                let kept = self.status & !(U2X | MPCM) & !(value & TXC);
                self.status = kept | (value & (U2X | MPCM));
            }
            UCSRB => self.write_control(value),
            UCSRC => self.format = value,
            UBRRL => self.divisor = (self.divisor & 0x0F00) | u16::from(value),
            UBRRH => self.divisor = (self.divisor & 0x00FF) | u16::from(value & 0x0F) << 8,
            UDR => self.transmit(value, now),
            _ => {}
        }
    }

    fn write_control(&mut self, value: u8) {
        self.control = value;
        if value & RXEN == 0 {
            self.fifo.clear();
            self.waiting = None;
            self.receiving = None;
            self.status &= !(RXC | DOR | FE);
        }
    }

    fn transmit(&mut self, byte: u8, now: u64) {
        if self.control & TXEN == 0 {
            return;
        }
        if self.sending.is_none() {
            self.begin_frame(byte, now);
        } else if self.buffered.is_none() {
            self.buffered = Some(byte);
            self.status &= !UDRE;
        } else {
            self.overwritten += 1;
        }
    }
}

/// Returns the slowest and the fastest sender, as a share of the receiver's own speed, that a receiver understands (data
/// sheet, 22.8.3). `data` is the number of data and parity bits of a frame, and `samples` that of samples in a bit: 8 at
/// double speed, else 16. The first of the three samples that decide has the number 4 or 8.
pub fn limits(data: f64, samples: f64) -> RangeInclusive<f64> {
    let (first, middle) = (samples / 2.0, samples / 2.0 + 1.0);
    let slowest = (data + 1.0) * samples / (samples - 1.0 + data * samples + first);
    let fastest = (data + 2.0) * samples / ((data + 1.0) * samples + middle);
    slowest..=fastest
}

#[cfg(test)]
mod tests;
