//! Supervises a job: whether the firmware is alive, makes progress, and has stopped the machine.

use anyhow::{Result, bail};

use crate::host::Host;
use crate::protocol::is_idle;
use crate::runs::Runs;

/// Number of the lines that only ask for the machine state.
pub const POLL: usize = usize::MAX - 1;

/// Silence after which the firmware is queried.
const SILENCE_MS: u64 = 2_000;
/// Silence after which the firmware is considered dead.
const DEAD_MS: u64 = 30_000;
/// Time without progress, beyond the longest dwell, after which the firmware is considered stuck.
const STUCK_MS: u64 = 60_000;
/// Time without a step after which motion has ended.
const STILL_MS: u64 = 200;
/// The state in which M0 waits for a cycle start.
const PROGRAM_STOP: i64 = 3;

/// The watchdog of one job.
pub struct Watch {
    patience_ms: u64,
    polled_at: Option<u64>,
}

impl Watch {
    /// A watchdog for a job with dwells up to this long.
    pub fn new(longest_dwell_ms: u64) -> Self {
        Watch { patience_ms: STUCK_MS + longest_dwell_ms, polled_at: None }
    }

    /// Checks for life and progress. It is called now and then while lines are unanswered.
    pub fn check(&mut self, machine: &mut impl Runs, host: &mut Host, progress: u64) -> Result<()> {
        let now = machine.cycle();
        let moved = machine.last_step().unwrap_or(0);
        let since = |then: u64| now.saturating_sub(then);
        if since(moved.max(host.heard_at()).max(progress)) > machine.cycles(DEAD_MS) {
            let line = host.oldest().unwrap_or("nothing");
            bail!("no answer and no step for {} s; waiting for {line}", DEAD_MS / 1000);
        }
        if since(moved.max(progress)) > machine.cycles(self.patience_ms) {
            let stat = host.stat().unwrap_or(-1);
            let line = host.oldest().unwrap_or("nothing");
            bail!("stuck in state {stat}: no step and no line taken; waiting for {line}");
        }
        let quiet_since = moved.max(host.heard_at()).max(self.polled_at.unwrap_or(0));
        if since(quiet_since) > machine.cycles(SILENCE_MS) {
            self.poll(machine, host);
            if host.stat() == Some(PROGRAM_STOP) {
                machine.send_now(b'~');
            }
        }
        Ok(())
    }

    /// Waits until nothing moves and the firmware also reports that nothing moves.
    pub fn settle(&mut self, machine: &mut impl Runs, host: &mut Host) -> Result<()> {
        let began = machine.cycle();
        loop {
            machine.follow_pulses();
            host.run_for_ms(machine, STILL_MS / 4)?;
            let moved = machine.last_step().unwrap_or(0).max(began);
            let still = machine.cycle() - moved;
            if still < machine.cycles(STILL_MS) {
                continue;
            }
            let idle = host.stat().is_none_or(is_idle);
            if self.polled_at.is_some_and(|at| at > moved) && host.is_done() && idle {
                return Ok(());
            }
            if still > machine.cycles(DEAD_MS) && !host.is_done() {
                bail!("no answer for {} s after the last line", DEAD_MS / 1000);
            }
            if still > machine.cycles(self.patience_ms) {
                bail!("does not come to rest: state {}", host.stat().unwrap_or(-1));
            }
            let polled = self.polled_at.filter(|at| *at > moved).unwrap_or(0);
            if host.is_done() && machine.cycle() - polled > machine.cycles(2 * STILL_MS) {
                self.poll(machine, host);
            }
        }
    }

    fn poll(&mut self, machine: &mut impl Runs, host: &mut Host) {
        self.polled_at = Some(machine.cycle());
        host.poll(machine, POLL);
    }
}
