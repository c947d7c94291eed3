//! A line from the host.

use super::{serial, timers};

/// Most characters of a line.
const LONGEST: usize = 40;

/// The line that was read last.
pub struct Line {
    bytes: [u8; LONGEST],
    /// Number of its characters. More than [`LONGEST`] says that it is too long.
    length: u8,
}

impl Line {
    /// No line.
    pub const fn new() -> Self {
        Self { bytes: [0; LONGEST], length: 0 }
    }

    /// Reads a line. All timers start at its end, because `count` begins there and is known only later.
    #[inline(never)]
    pub fn read(&mut self) {
        self.length = 0;
        timers::prepare();
        loop {
            match serial::next() {
                b'\n' => return timers::go(),
                b'\r' => {}
                byte => self.push(byte),
            }
        }
    }

    fn push(&mut self, byte: u8) {
        if let Some(place) = self.bytes.get_mut(usize::from(self.length)) {
            *place = byte;
        }
        self.length = (self.length + 1).min(LONGEST as u8 + 1);
    }

    /// The line without its end; `None` if it is too long.
    pub fn text(&self) -> Option<&[u8]> {
        self.bytes.get(..usize::from(self.length))
    }
}
