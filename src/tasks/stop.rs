//! Lines that begin an alarm: they act on arrival, and are answered in order.
//!
//! Lines of one port are answered in their order, and the answers before one may take a second. So the reader checks
//! each short control line that is completed in the pool ([`LinePool::take_stop`]), and at the lines that wait in a
//! receive ring behind a full pool ([`Scan::look_for_stops`]), and raises the alarm at once. When the parser comes to
//! such a line, it begins the alarm again if a line before it has ended the alarm. It does not if another port has
//! ended the alarm ([`Port::has_stopped`](super::ports::Port::has_stopped), [`Links::cleared_by`]).
//!
//! [`asks_alarm`] recognises these lines. Thread mode.

use heapless::Vec;
use kerf_macros::small;

use super::alarm;
use super::hold;
use super::lines::LinePool;
use super::links::Links;
use super::overtake::Scan;
use super::ports::Port;
use crate::hal::ring::Window;
use crate::hal::serial::{CLEAN, CLOSE, CUT, GO, MARKS, TAKEN};
use crate::hal::uart;
use crate::machine::Alarm;
use crate::protocol::{STOP_MAX, asks_alarm};

impl Scan {
    /// Begins the alarms of lines in the pool, unless they have already begun while the lines were in the ring, which
    /// has been searched for alarms if `looked`.
    #[inline(never)]
    #[small]
    pub fn serve(&mut self, links: &Links, pool: &mut LinePool, looked: bool) {
        match pool.take_stop() {
            Alarm::None => {}
            _ if looked && self.begun > 0 => self.begun -= 1,
            alarm => {
                alarm::raise(links, alarm);
                pool.terminate(hold::dropped());
            }
        }
    }

    /// Scans complete lines after a line that waits for room, and begins their alarms. Cost: 40 cycles a byte.
    #[inline(never)]
    #[small]
    pub fn look_for_stops(
        &mut self,
        links: &Links,
        port: &Port,
        pool: &mut LinePool,
        ring: &Window<'_>,
    ) {
        if self.stops == 0 {
            self.begun = 0;
        }
        let from = self.stops.max(self.looked);
        // A line whose beginning has been scanned does not overtake, and begins no alarm.
        let mut whole = from == self.stops || !self.within;
        let mut at = if whole { from } else { self.stops };
        let mut line = Vec::<u8, STOP_MAX>::new();
        for n in from..ring.len() {
            match ring.get(n) {
                b'\n' | b'\r' => {
                    if let Some(alarm) = asks_alarm(&line, port.is_plain()).filter(|_| whole) {
                        alarm::raise(links, alarm);
                        pool.terminate(hold::dropped());
                        hold::cut_up_to(port, pool, Some(ring.slot(n)));
                        self.begun += 1;
                    }
                    line.clear();
                    (at, whole) = (n + 1, true);
                }
                CUT | GO | TAKEN => {}
                CLOSE if uart::sees_opening() => {
                    line.clear();
                    (at, whole) = (n + 1, true);
                }
                mark if mark < MARKS => {
                    if n + 1 == ring.len() {
                        // The mark may yet come to tell of more.
                        break;
                    }
                    line.clear();
                    whole = mark & CLEAN != 0;
                }
                // A question mark is a line of its own.
                b'?' | b' ' | b'\t' if line.is_empty() => {}
                byte => whole &= line.push(byte).is_ok(),
            }
        }
        self.stops = at;
    }
}
