//! Motor power: decides which motors have power, and for how long. Touches no pin.
//!
//! The mode of a motor (setting `pm`) says when it has power: never, always, in a cycle, or while it moves. In the last
//! two modes power stays on for a timeout (setting `mt`) after the last use. `{me:..}` and `{md:..}` override the mode
//! until the next move. Positions do not depend on motor power.
//!
//! Exec calls [`Motors::segment`] before a segment goes to the steppers, so that power always comes on before the first
//! step. Everything else is for thread mode (`tasks::power`). Times are milliseconds since reset, modulo 2^32.

use crate::boards::MOTORS;

/// All motors, as bits.
const ALL: u8 = (1 << MOTORS) - 1;

/// The modes of all motors. Each motor has its bit in at most one of the masks; in none if it never has power.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Modes {
    /// Motors that always have power.
    pub always: u8,
    /// Motors that have power while any motor moves or the machine dwells, and for the timeout afterwards.
    pub in_cycle: u8,
    /// Motors that have power while they move themselves, and for the timeout afterwards.
    pub moving: u8,
}

impl Modes {
    /// Collects the mode of each motor: 0 never, 1 always, 2 in a cycle, 3 while it moves.
    #[small]
    pub fn new(mode: impl Fn(usize) -> u8) -> Self {
        let mut modes = Self::default();
        for motor in 0..MOTORS {
            let bit = 1 << motor;
            match mode(motor) {
                1 => modes.always |= bit,
                2 => modes.in_cycle |= bit,
                3 => modes.moving |= bit,
                _ => {}
            }
        }
        modes
    }

    fn any(&self) -> u8 {
        self.always | self.in_cycle | self.moving
    }
}

/// The state of the motors' power.
#[derive(Clone, Copy, Debug)]
pub struct Motors {
    modes: Modes,
    /// Motors that have power, as bits.
    on: u8,
    /// Motors that the last queued segment uses, as bits: all motors of mode `in_cycle`, and those of mode `moving`
    /// that step in it.
    busy: u8,
    /// Motors that have been used since the last [`Motors::pass`], as bits.
    used: u8,
    /// The time at which each motor was last used.
    last: [u32; MOTORS],
}

impl Motors {
    /// Returns the state at power-up: all motors off, and in mode `in_cycle`, the default of the settings.
    pub const fn new() -> Self {
        let modes = Modes { always: 0, in_cycle: ALL, moving: 0 };
        Self { modes, on: 0, busy: 0, used: 0, last: [0; MOTORS] }
    }

    /// Returns the motors that have power, as bits.
    pub fn on(&self) -> u8 {
        self.on
    }

    /// Powers the motors for a segment that is about to be queued. `stepping` are the motors that step in it, as bits:
    /// 0 in a dwell.
    pub fn segment(&mut self, stepping: u8) {
        self.busy = self.modes.in_cycle | self.modes.moving & stepping;
        self.used |= self.busy;
        self.on |= self.busy | self.modes.always;
    }

    /// Changes the modes. A motor that always has power is switched on now, and a motor that never has power is
    /// switched off now. Any other motor that was on stays on for the timeout.
    #[small]
    pub fn set_modes(&mut self, modes: Modes) {
        if modes == self.modes {
            return;
        }
        self.modes = modes;
        self.used |= self.on;
        self.on = (self.on | modes.always) & modes.any();
    }

    /// Powers `motors` for the timeout, except motors that never have power.
    pub fn energize(&mut self, motors: u8) {
        let motors = motors & self.modes.any();
        self.on |= motors;
        self.used |= motors;
    }

    /// Takes power from `motors` until they are used again.
    pub fn release(&mut self, motors: u8) {
        self.on &= !motors;
    }

    /// Stops the timeouts during a feedhold: `ms` milliseconds, which have passed since the last [`Motors::pass`], do
    /// not count. Call it before [`Motors::pass`].
    #[inline(never)]
    #[small]
    pub fn stand_still(&mut self, ms: u32) {
        for last in &mut self.last {
            *last = last.wrapping_add(ms);
        }
    }

    /// Takes power from the motors that have not been used for `timeout` at the time `now`. `running` says whether the
    /// machine moves or dwells. Returns whether any motor has lost power.
    #[inline(never)]
    #[small]
    pub fn pass(&mut self, now: u32, running: bool, timeout: u32) -> bool {
        if !running {
            self.busy = 0;
        }
        let used = self.used | self.busy;
        self.used = 0;
        let mut idle = 0;
        for (m, last) in self.last.iter_mut().enumerate() {
            if used & 1 << m != 0 {
                *last = now;
            } else if now.wrapping_sub(*last) >= timeout {
                idle |= 1 << m;
            }
        }
        let before = self.on;
        self.on &= !idle | self.modes.always;
        self.on != before
    }
}

impl Default for Motors {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMEOUT: u32 = 2_000;

    fn motors(modes: [u8; MOTORS]) -> Motors {
        let mut motors = Motors::new();
        motors.set_modes(Modes::new(|m| modes[m]));
        motors
    }

    #[test]
    fn each_mode_has_its_time() {
        let mut motors = motors([0, 1, 2, 3]);
        assert_eq!(motors.on(), 0b0010, "always means now");
        motors.segment(0b0001);
        assert_eq!(motors.on(), 0b0110, "in a cycle means with any segment, never means never");
        motors.segment(0b1001);
        assert_eq!(motors.on(), 0b1110);
        assert!(!motors.pass(100, true, TIMEOUT));
        assert!(!motors.pass(2_099, false, TIMEOUT) && motors.on() == 0b1110);
        assert!(motors.pass(4_099, false, TIMEOUT));
        assert_eq!(motors.on(), 0b0010);
    }

    #[test]
    fn what_moves_keeps_its_power_however_long_it_takes() {
        let mut motors = motors([3, 3, 2, 2]);
        motors.segment(0b0011);
        motors.pass(0, true, TIMEOUT);
        for now in 1..100 {
            motors.segment(0b0001);
            motors.pass(now * 1_000, true, TIMEOUT);
        }
        assert_eq!(motors.on(), 0b1101, "the second motor has stopped");
        // A dwell counts as part of the cycle.
        motors.segment(0);
        motors.pass(100_000, true, TIMEOUT);
        assert_eq!(motors.on(), 0b1100 | 0b0001);
        motors.pass(103_000, true, TIMEOUT);
        assert_eq!(motors.on(), 0b1100);
        assert!(motors.pass(106_000, false, TIMEOUT));
        assert_eq!(motors.on(), 0);
    }

    #[test]
    fn a_short_move_between_two_looks_counts_from_the_second() {
        let mut motors = motors([3; 4]);
        motors.segment(0b0001);
        motors.segment(0b0010);
        assert!(!motors.pass(1_000_000, true, TIMEOUT));
        assert_eq!(motors.on(), 0b0011);
        assert!(!motors.pass(1_001_999, false, TIMEOUT));
        assert!(motors.pass(1_003_999, false, TIMEOUT));
    }

    #[test]
    fn timeouts_stand_still_in_a_hold() {
        let mut motors = motors([3; 4]);
        motors.segment(0b0011);
        motors.segment(0b0010);
        motors.pass(0, true, TIMEOUT);
        assert!(!motors.pass(1_900, true, TIMEOUT));
        // The first motor has 100 ms left. The hold does not use them up.
        for look in 1..500 {
            motors.stand_still(20);
            assert!(!motors.pass(1_900 + look * 20, true, TIMEOUT));
        }
        assert!(!motors.pass(11_960, true, TIMEOUT));
        assert!(motors.pass(12_000, true, TIMEOUT));
        assert_eq!(motors.on(), 0b0010);
    }

    #[test]
    fn energize_and_release_overrule() {
        let mut motors = motors([0, 1, 2, 3]);
        motors.energize(ALL);
        assert_eq!(motors.on(), 0b1110, "never means never");
        motors.pass(10, false, TIMEOUT);
        motors.release(0b0110);
        assert_eq!(motors.on(), 0b1000);
        motors.pass(20, false, TIMEOUT);
        assert_eq!(motors.on(), 0b1000, "not even always brings it back");
        motors.segment(0);
        assert_eq!(motors.on(), 0b1110, "until the next move");
    }

    #[test]
    fn other_modes_act_at_once() {
        let mut motors = motors([2; 4]);
        motors.set_modes(Modes::new(|m| [1, 2, 2, 2][m]));
        assert_eq!(motors.on(), 0b0001);
        // The motor no longer has power always. It keeps its power for the timeout from now on.
        motors.pass(50_000, false, TIMEOUT);
        motors.set_modes(Modes::new(|_| 3));
        assert!(!motors.pass(100_000, false, TIMEOUT));
        assert!(motors.pass(102_000, false, TIMEOUT) && motors.on() == 0);
        motors.energize(ALL);
        motors.set_modes(Modes::new(|_| 0));
        assert_eq!(motors.on(), 0);
    }

    #[test]
    fn the_clock_may_wrap() {
        let mut motors = motors([2; 4]);
        motors.segment(1);
        motors.pass(u32::MAX - 500, true, TIMEOUT);
        motors.pass(u32::MAX, false, TIMEOUT);
        assert_eq!(motors.on(), ALL);
        assert!(!motors.pass(1_000, false, TIMEOUT));
        assert!(motors.pass(2_000, false, TIMEOUT));
    }
}
