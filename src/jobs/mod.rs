//! Jobs in program memory, started by `{test:n}`, with which a machine can be tried without a sender's file. Number
//! [`STORED`] is the program that the user has stored in EEPROM.
//!
//! The parser task takes their lines in turn with the lines of the sender (`tasks::parser`): data lines wait until the
//! job is over, control lines do not. A refused line ends the job. A job is a list of pieces of text. Each piece has
//! some lines and is repeated a number of times, so that a thousand moves take no more memory than one.

mod texts;

use heapless::Vec;

use crate::progmem::Plain;
use crate::store::program::{STARTUPS, Startup};
use crate::store::{Memory, program};

/// The longest line of a job, in bytes.
pub const LINE_MAX: usize = 48;

/// The number of the program in EEPROM.
pub const STORED: u8 = 100;

/// The number of the job that runs the start-up lines.
const STARTUP: u8 = STORED + 1;

/// The value of `round` in a job that is over. No piece is repeated as often.
const OVER: u8 = u8::MAX;

/// A piece of a job.
#[derive(Clone, Copy)]
pub struct Piece {
    /// The lines, separated by line feeds.
    text: Plain,
    /// How many times the lines are run.
    times: u8,
}

/// The progress of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Job {
    /// The number of the job; 0 for none.
    number: u8,
    /// The index of the piece. For the program in EEPROM, the higher byte of `at`.
    piece: u8,
    round: u8,
    at: u8,
}

#[small]
impl Job {
    /// Returns the job with this number, at its beginning; number 0 is no job. `None` if there is no such job. The
    /// caller checks whether there is a program in EEPROM.
    pub fn new(number: u8) -> Option<Self> {
        let exists = matches!(number, 0 | STORED) || texts::piece(number, 0).is_some();
        exists.then_some(Self { number, ..Self::default() })
    }

    /// Returns the job of the start-up lines; `None` if there are none.
    pub fn of_startup(memory: &impl Memory) -> Option<Self> {
        let mut lines = (0..STARTUPS).filter_map(|n| Startup::find(memory, n));
        let any = lines.any(|line| !line.is_empty());
        any.then(|| Self { number: STARTUP, ..Self::default() })
    }

    /// Returns the number of the next start-up line; `None` for another job.
    pub fn startup(&self) -> Option<u8> {
        (self.number == STARTUP).then_some(self.piece)
    }

    /// Whether start-up lines remain to be taken.
    pub fn starts_up(&self) -> bool {
        self.startup().is_some() && !self.is_over()
    }

    /// Whether there is no job.
    pub fn is_none(&self) -> bool {
        self.number == 0
    }

    /// Ends the job: no further line is taken.
    pub fn end(&mut self) {
        self.round = OVER;
    }

    /// Whether all lines have been taken. What they have requested may still be under way.
    pub fn is_over(&self) -> bool {
        self.round == OVER
    }

    /// The number of the job.
    pub fn number(&self) -> u8 {
        self.number
    }

    /// Reads the next line; false at the end. Not returned by value, because moving a line takes twice its size on the
    /// stack.
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
                // A test checks the length of the lines.
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
    /// Reads a start-up line. An empty line has no effect.
    fn startup_line(&mut self, memory: &impl Memory, line: &mut Vec<u8, LINE_MAX>) -> bool {
        let n = self.piece;
        self.piece += 1;
        line.clear();
        if let Some(startup) = Startup::find(memory, n) {
            for at in 0..startup.len() {
                let _ = line.push(startup.byte(memory, at));
            }
        }
        n < STARTUPS
    }

    fn stored_line(&mut self, memory: &impl Memory, line: &mut Vec<u8, LINE_MAX>) -> bool {
        line.clear();
        let Some(program) = program::find(memory) else { return false };
        let mut at = u16::from_le_bytes([self.at, self.piece]);
        let mut found = false;
        while let Some(byte) = program.byte(memory, at) {
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
    use avr_embassy::host::Runtime;
    use std::string::String;

    #[test]
    fn all_jobs_are_good_programs_but_for_what_they_show() {
        let thread = Runtime::new().thread();
        let mut lines = 0;
        for number in (1..=u8::MAX).filter(|number| *number != STORED) {
            let Some(mut job) = Job::new(number) else { continue };
            let (mut state, mut out) = (Interpreter::new(), Commands::default());
            let (mut last, mut line) = (String::new(), Vec::new());
            while job.next_line(&Eeprom::of(thread), &mut line) {
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
