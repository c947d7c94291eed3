//! A sender and a machine.

use kerf::hal::imp::{Machine, stepper};
use kerf::motion::queue;
use kerf::tasks::common::snapshot;

use super::ears::Ears;
use super::lines::{End, Lines};

/// Bits a second.
const BAUD: u32 = 115_200;
/// Most events (bytes, steps, milliseconds) that an input may take.
const EVENTS_MAX: u32 = 100_000;
/// Longest time that a machine with work left may be silent or stand still, unless it waits for the spindle, ms.
const PATIENCE_MS: u64 = 2_000;
/// Time between two checks, ms.
const LOOK_MS: u64 = 20;
/// Time in which the longest answer has been sent, ms.
const LAST_MS: u64 = 300;
/// Time that a thread waits for the spindle, which gives no pulses here, ms.
const SPINDLE_MS: u64 = 7_000;
/// The codes of threads.
const THREADS: [&[u8]; 3] = [b"g32", b"g33", b"g76"];
/// Settings after which the machine may send nothing, send at another rate, echo input, or use another dialect.
const MUTING: [&[u8]; 7] = [b"jv", b"tv", b"baud", b"ee0", b"ee1", b"eet", b"dia"];

/// The job takes too long.
struct TooLong;

/// A machine, and what it has sent.
pub struct Session {
    machine: Machine,
    ears: Ears,
    events: u32,
    /// Whether some lines may stay unanswered.
    mute: bool,
    /// Whether lines may wait for the spindle.
    turns: bool,
}

impl Session {
    /// Boots a machine that will be sent `text`.
    pub fn begin(text: &[u8]) -> Self {
        let machine = Machine::boot(BAUD).expect("one machine in each thread");
        let mut session = Self {
            machine,
            ears: Ears::default(),
            events: 0,
            mute: names_any(&MUTING, text),
            turns: names_any(&THREADS, text),
        };
        // The greeting comes in both dialects.
        session.ears.deaf = true;
        let greeted = session.run(LAST_MS, |ears| ears.answers == 1);
        assert!(matches!(greeted, Ok(true)), "no greeting");
        // A line of JSON settles TinyG's dialect, whose answers are counted.
        session.machine.send(b"{fv:n}\n");
        let decided = session.run(LAST_MS, |ears| ears.answers == 2);
        assert!(matches!(decided, Ok(true)), "no answer");
        session.ears.answers = 0;
        session.ears.deaf = session.mute;
        session
    }

    /// Sends `text` and checks the answers.
    pub fn hold(mut self, text: &[u8], all_at_once: bool) {
        let sent = if all_at_once { self.flood(text) } else { self.converse(text) };
        // An input that takes too long is no failure: it has been checked for the allowed time.
        let _ = sent.and_then(|expected| self.end(expected));
    }

    /// Sends all at once. Returns the least and the greatest number of answers to expect.
    fn flood(&mut self, text: &[u8]) -> Result<(usize, usize), TooLong> {
        let mut lines = Lines::default();
        let text = [text, b"\n"].concat();
        let ends: Vec<_> = text.iter().filter_map(|byte| lines.take(*byte)).collect();
        let least = ends.iter().filter(|end| **end == End::Line).count();
        self.machine.send(&text);
        // An empty line is answered if it is lost, or in text mode.
        Ok((least, ends.len()))
    }

    /// Sends each line when the line before it has been answered. Returns as [`Session::flood`].
    fn converse(&mut self, text: &[u8]) -> Result<(usize, usize), TooLong> {
        let (mut lines, mut expected) = (Lines::default(), 0);
        let text = [text, b"\n"].concat();
        for piece in text.split_inclusive(|byte| matches!(byte, b'\n' | b'\r')) {
            self.machine.send(piece);
            for byte in piece {
                let was_text = lines.is_text;
                let end = lines.take(*byte);
                expected += usize::from(end == Some(End::Line) || (end.is_some() && was_text));
            }
            self.wait_for_answers(expected)?;
        }
        Ok((expected, expected))
    }

    fn wait_for_answers(&mut self, expected: usize) -> Result<(), TooLong> {
        let mut silent = 0;
        while !self.run(LOOK_MS, |ears| ears.answers >= expected)? {
            silent = if stepper::running() || self.ears.listening() { 0 } else { silent + LOOK_MS };
            self.go_on();
            if self.mute && silent >= LAST_MS {
                break;
            }
            let heard = self.ears.answers;
            assert!(silent < self.patience_ms(), "{heard} of {expected} lines are answered");
        }
        let heard = self.ears.answers;
        assert!(self.mute || heard == expected, "{heard} answers to {expected} lines");
        Ok(())
    }

    /// Waits until the machine is idle. Checks that everything was answered, and that a further line is.
    fn end(&mut self, (least, most): (usize, usize)) -> Result<(), TooLong> {
        self.rest()?;
        if self.mute {
            return Ok(());
        }
        let heard = self.ears.answers;
        assert!((least..=most).contains(&heard), "{heard} answers to {least}..={most} lines");
        self.machine.send(b"{fb:n}\n");
        self.run(LAST_MS, |_| false)?;
        assert_eq!(self.ears.answers, heard + 1, "and another line");
        let last = String::from_utf8_lossy(&self.ears.last);
        assert!(last.contains("440.20"), "the build is {last}");
        Ok(())
    }

    /// Waits until all that was sent has arrived, been executed and been answered.
    fn rest(&mut self) -> Result<(), TooLong> {
        let (mut idle, mut still) = (0, 0);
        let enough = if self.turns { SPINDLE_MS } else { LAST_MS };
        while idle < enough {
            let said = self.ears.answers;
            self.run(LOOK_MS, |_| false)?;
            let quiet = said == self.ears.answers && !self.ears.listening();
            let busy = snapshot(self.machine.thread()).running || queue::used() > 0;
            idle = if busy || stepper::running() || !quiet { 0 } else { idle + LOOK_MS };
            self.go_on();
            still = if busy && !stepper::running() { still + LOOK_MS } else { 0 };
            assert!(still < self.patience_ms(), "stands still with {} blocks to do", queue::used());
        }
        Ok(())
    }

    fn patience_ms(&self) -> u64 {
        if self.turns { SPINDLE_MS } else { PATIENCE_MS }
    }

    /// Sends a cycle start in case a program has stopped.
    fn go_on(&self) {
        if !stepper::running() {
            self.machine.send(b"~");
        }
    }

    /// Runs until `done`, for at most `ms`. Returns whether `done` became true.
    fn run(&mut self, ms: u64, done: impl Fn(&Ears) -> bool) -> Result<bool, TooLong> {
        let Self { machine, ears, events, .. } = self;
        let came = machine.run_until(ms, || {
            *events += 1;
            ears.hear(&machine.received());
            done(ears) || *events > EVENTS_MAX
        });
        if *events > EVENTS_MAX { Err(TooLong) } else { Ok(came) }
    }
}

/// Whether `text` may contain one of these names.
fn names_any(names: &[&[u8]], text: &[u8]) -> bool {
    let letters = text.iter().filter(|byte| byte.is_ascii_alphanumeric());
    let letters: Vec<_> = letters.map(u8::to_ascii_lowercase).collect();
    names.iter().any(|name| letters.windows(name.len()).any(|part| part == *name))
}
