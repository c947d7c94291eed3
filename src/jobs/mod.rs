//! Jobs in program memory, started by `{test:n}`: to try a machine out without a sender's file; and, as number
//! [`STORED`], the program that the user keeps in EEPROM.
//!
//! The parser task takes their lines in turn with those of the sender (`tasks::parser`): data lines wait until the job
//! is over, control lines do not. A line that is refused ends the job. A job is a row of pieces of text, each
//! of some lines and carried out so many times, so that a thousand moves need no more memory than one.

mod texts;

use heapless::Vec;

use crate::progmem::Plain;
use crate::store::program::STARTUPS;
use crate::store::{Memory, program};

/// The longest line of a job, in bytes.
pub const LINE_MAX: usize = 48;

/// The number of the program in EEPROM.
pub const STORED: u8 = 100;

/// The number of the lines that are carried out after a start.
const STARTUP: u8 = STORED + 1;

/// The round of a job that is over; no piece has as many.
const OVER: u8 = u8::MAX;

/// A piece of a job.
#[derive(Clone, Copy)]
pub struct Piece {
    /// Lines, parted by line feeds.
    text: Plain,
    /// How many times they are carried out.
    times: u8,
}

/// Where a job has come to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Job {
    /// The number of the job; 0 is none.
    number: u8,
    /// Of the program in EEPROM, the higher byte of `at`.
    piece: u8,
    round: u8,
    at: u8,
}

#[small]
impl Job {
    /// The job of that number, from its start; number 0 is none. `None` for one that does not exist; whether there is a
    /// program in EEPROM is for the caller to see.
    pub fn new(number: u8) -> Option<Self> {
        let exists = matches!(number, 0 | STORED) || texts::piece(number, 0).is_some();
        exists.then_some(Self { number, ..Self::default() })
    }

    /// The lines that are carried out after a start; `None` if there is none.
    pub fn of_startup(memory: &impl Memory) -> Option<Self> {
        let any = (0..STARTUPS).any(|n| program::startup_len(memory, n) != 0);
        any.then(|| Self { number: STARTUP, ..Self::default() })
    }

    /// The number of the startup line that comes next; `None` for another job.
    pub fn startup(&self) -> Option<u8> {
        (self.number == STARTUP).then_some(self.piece)
    }

    /// Whether start-up lines are still to be taken.
    pub fn starts_up(&self) -> bool {
        self.startup().is_some() && !self.is_over()
    }

    /// Whether there is none.
    pub fn is_none(&self) -> bool {
        self.number == 0
    }

    /// All of its lines have been taken.
    pub fn end(&mut self) {
        self.round = OVER;
    }

    /// Whether they have; what they asked for may still be under way.
    pub fn is_over(&self) -> bool {
        self.round == OVER
    }

    /// The number of the job.
    pub fn number(&self) -> u8 {
        self.number
    }

    /// Reads the next line; false at the end. Not by value: a line moved is twice its size of stack.
    pub fn next_line(&mut self, memory: &impl Memory, line: &mut Vec<u8, LINE_MAX>) -> bool {
        if self.number == STORED {
            return self.stored_line(memory, line);
        }
        if self.number == STARTUP {
            return self.startup_line(memory, line);
        }
        loop {
            let Some(piece) = texts::piece(self.number, self.piece) else { return false };
            line.clear();
            while let Some(byte) = piece.text.at(self.at) {
                self.at += 1;
                if byte == b'\n' {
                    return true;
                }
                // A test holds the lines to their length.
                let _ = line.push(byte);
            }
            self.at = 0;
            self.round += 1;
            if self.round >= piece.times {
                self.round = 0;
                self.piece += 1;
            }
        }
    }
}

#[small]
impl Job {
    /// An empty line has none: it does nothing.
    fn startup_line(&mut self, memory: &impl Memory, line: &mut Vec<u8, LINE_MAX>) -> bool {
        let n = self.piece;
        self.piece += 1;
        line.clear();
        for at in 0..program::startup_len(memory, n) {
            let _ = line.push(program::startup_byte(memory, n, at));
        }
        n < STARTUPS
    }

    fn stored_line(&mut self, memory: &impl Memory, line: &mut Vec<u8, LINE_MAX>) -> bool {
        line.clear();
        let len = program::len(memory).unwrap_or(0);
        let mut at = u16::from_le_bytes([self.at, self.piece]);
        let mut found = false;
        while let Some(byte) = program::byte(memory, len, at) {
            at += 1;
            found = true;
            if byte == b'\n' {
                break;
            }
            // Longer lines are not stored.
            let _ = line.push(byte);
        }
        [self.at, self.piece] = at.to_le_bytes();
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gcode::Interpreter;
    use crate::gcode::command::Commands;
    use crate::gcode::setup::Usual;
    use crate::hal::eeprom::Eeprom;
    use std::string::String;

    #[test]
    fn all_jobs_are_good_programs_but_for_what_they_show() {
        let mut lines = 0;
        for number in (1..=u8::MAX).filter(|number| *number != STORED) {
            let Some(mut job) = Job::new(number) else { continue };
            let (mut state, mut out) = (Interpreter::new(), Commands::default());
            let (mut last, mut line) = (String::new(), Vec::new());
            while job.next_line(&Eeprom::take(), &mut line) {
                assert!(line.len() < LINE_MAX, "{number}");
                let done = state.interpret(&line, &Usual, &mut out);
                last = String::from_utf8(line.to_vec()).unwrap();
                assert!(done.is_ok(), "job {number}: {last}");
                lines += 1;
            }
            assert!(last.starts_with("M2") || last.starts_with("M30"), "{number}: {last}");
        }
        assert!(lines > 2_000, "{lines}");
        assert_eq!(Job::new(200), None);
        assert_eq!(Job::new(0), Some(Job::default()));
    }
}
