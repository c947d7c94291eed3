//! The settings in the units that the rest of the firmware works in.
//!
//! Axes and motors are numbered from 0. For an axis or motor that does not exist a getter returns 0. A getter that
//! returns a float costs about 300 cycles on AVR, the others about 20.

use super::groups::{axis, motor, system};
use super::{Settings, StepRatio, setting::small_of};
use crate::capability::Capability;
use crate::units::Length;

/// Motors.
impl Settings {
    /// Returns what a motor drives: an axis, or X and Y together ([`kinematics`](crate::kinematics)).
    pub fn motor_axis(&self, motor: usize) -> u8 {
        self.motor(motor, motor::MA)
    }

    /// Whether the motor's direction is inverted.
    pub fn motor_reversed(&self, motor: usize) -> bool {
        self.motor(motor, motor::PO) != 0
    }

    /// Whether the driver steps on a falling edge, so that the step pin rests high.
    pub fn step_inverted(&self, motor: usize) -> bool {
        self.motor(motor, motor::SP) != 0
    }

    /// Returns when the motor is powered: 0 never, 1 always, 2 in a cycle, 3 while it moves.
    pub fn motor_power_mode(&self, motor: usize) -> u8 {
        self.motor(motor, motor::PM)
    }

    /// The microsteps of a motor.
    pub fn motor_microsteps(&self, motor: usize) -> u8 {
        self.motor(motor, motor::MI)
    }

    /// Returns how often the steps of a [`Length`] of one unit have to be halved until no motor makes more than one
    /// step; one more if a motor drives X and Y together. 15 or more stand for more than 14.
    pub fn octaves(&self) -> u8 {
        self.octaves
    }

    /// Returns the steps of a motor per length.
    pub fn step_ratio(&self, motor: usize) -> StepRatio {
        self.ratios.get(motor).copied().unwrap_or(StepRatio::NONE)
    }
}

/// The value of a travel end that is not limited.
pub const TRAVEL_NONE: Length = Length(-i32::MAX);

/// Axes.
impl Settings {
    /// Axis mode: 0 disabled, 1 standard, 2 inhibited, 3 radius.
    pub fn axis_mode(&self, axis: usize) -> u8 {
        self.small(small_of(axis as u8) + axis::AM)
    }

    /// Traverse limit, mm or degrees per minute.
    pub fn velocity_max(&self, axis: usize) -> f32 {
        self.axis(axis, axis::VM) as f32 * 1e-3
    }

    /// Feed limit, mm or degrees per minute.
    pub fn feedrate_max(&self, axis: usize) -> f32 {
        self.axis(axis, axis::FR) as f32 * 1e-3
    }

    /// The lower end of an axis's travel.
    pub fn travel_min(&self, axis: usize) -> Length {
        Length(self.axis(axis, axis::TN))
    }

    /// The upper end of an axis's travel.
    pub fn travel_max(&self, axis: usize) -> Length {
        Length(self.axis(axis, axis::TM))
    }

    /// Jerk limit, mm or degrees per minute cubed.
    pub fn jerk_max(&self, axis: usize) -> f32 {
        self.axis(axis, axis::JM) as f32 * 1e3
    }

    /// Acceleration limit, mm or degrees per minute squared; 0 for none. The setting itself is per second squared.
    pub fn accel_max(&self, axis: usize) -> f32 {
        self.axis(axis, axis::AC) as f32 * (0.1 * 3_600.0)
    }

    /// Backlash of an axis; 0 for none. On a CoreXY machine that of X or Y is the backlash of a motor.
    pub fn backlash(&self, axis: usize) -> Length {
        let built_in = Capability::Backlash.is_built_in();
        Length(if built_in { self.homing(axis, axis::BL) } else { 0 })
    }

    /// Jerk limit while homing and probing, mm or degrees per minute cubed.
    pub fn jerk_homing(&self, axis: usize) -> f32 {
        self.homing(axis, axis::JH) as f32 * 1e3
    }

    /// Junction deviation, mm.
    pub fn junction_deviation(&self, axis: usize) -> f32 {
        self.axis(axis, axis::JD) as f32 * 1e-6
    }

    /// Radius that converts a length into an angle, in nm.
    pub fn radius_nm(&self, axis: usize) -> u32 {
        self.axis(axis, axis::RA).unsigned_abs()
    }

    /// Switch at the lower end: 0 off, 1 homing, 2 limit, 3 both.
    pub fn switch_min(&self, axis: usize) -> u8 {
        self.switch(axis, axis::SN)
    }

    /// Switch at the upper end: 0 off, 1 homing, 2 limit, 3 both.
    pub fn switch_max(&self, axis: usize) -> u8 {
        self.switch(axis, axis::SX)
    }

    /// Speed towards a homing switch, mm or degrees per minute.
    pub fn search_velocity(&self, axis: usize) -> f32 {
        self.homing(axis, axis::SV) as f32 * 1e-3
    }

    /// Speed when leaving a homing switch, mm or degrees per minute.
    pub fn latch_velocity(&self, axis: usize) -> f32 {
        self.homing(axis, axis::LV) as f32 * 1e-3
    }

    /// Largest distance to leave a homing switch before its position is latched.
    pub fn latch_backoff(&self, axis: usize) -> Length {
        Length(self.homing(axis, axis::LB))
    }

    /// Distance from the latched switch to zero.
    pub fn zero_backoff(&self, axis: usize) -> Length {
        Length(self.homing(axis, axis::ZB))
    }
}

/// The machine.
impl Settings {
    /// Acceleration towards the centre of a junction, mm per minute squared.
    pub fn junction_acceleration(&self) -> f32 {
        self.system_large(system::JA) as f32 * 1e-2
    }

    /// Largest distance between a chord and its arc, mm.
    pub fn chordal_tolerance(&self) -> f32 {
        self.system_large(system::CT) as f32 * 1e-6
    }

    /// Whether M0, M1, M6, M60 and G88 wait for cycle start.
    pub fn waits_at_stop(&self) -> bool {
        self.system(system::PSW) != 0
    }

    /// Whether the machine returns to the contact after a probing.
    pub fn backs_off_probe(&self) -> bool {
        self.system(system::PBO) != 0
    }

    /// Whether moves beyond the travel are refused.
    pub fn soft_limits(&self) -> bool {
        self.system(system::SL) != 0
    }

    /// Whether switches are normally closed, so that they open when hit.
    pub fn switches_normally_closed(&self) -> bool {
        self.system(system::ST) != 0
    }

    /// The door switch: 0 off, 1 closes when the door opens, 2 opens when the door opens.
    pub fn door_switch(&self) -> u8 {
        self.system(system::SAF)
    }

    /// The emergency stop: 0 off, 1 closes when it is hit, 2 opens when it is hit.
    pub fn stop_switch(&self) -> u8 {
        self.system(system::EST)
    }

    /// How long motors stay powered after a move, in hundredths of a second.
    pub fn motor_timeout_centis(&self) -> u32 {
        self.system_large(system::MT).unsigned_abs()
    }

    /// Length of a step pulse, microseconds, 1 to 10.
    pub fn step_pulse_us(&self) -> u8 {
        self.system(system::SPW)
    }

    /// Time for which a direction pin must be stable before a step, microseconds, 0 to 100.
    pub fn direction_setup_us(&self) -> u8 {
        self.system(system::DSU)
    }

    /// Whether the machine starts in JSON mode.
    pub fn starts_in_json(&self) -> bool {
        !Capability::Text.is_built_in() || self.system(system::EJ) != 0
    }

    /// Whether lines of text mode are answered in JSON, as `txt`.
    pub fn wraps_text(&self) -> bool {
        self.is_g2core() && self.system(system::EJ) != 2
    }

    /// What JSON responses contain: 0 nothing, 1 footers, 2 also messages, 3 settings, 4 line numbers, 5 blocks.
    pub fn json_verbosity(&self) -> u8 {
        self.system(system::JV)
    }

    /// Whether keys are quoted.
    pub fn json_strict(&self) -> bool {
        self.system(system::JS) != 0
    }

    /// Prompts in text mode: 0 off, 1 on.
    pub fn text_verbosity(&self) -> u8 {
        self.system(system::TV)
    }

    /// Queue reports: 0 off, 1 free blocks, 2 and 3 also blocks added and removed.
    pub fn queue_verbosity(&self) -> u8 {
        self.system(system::QV)
    }

    /// Status reports: 0 off, 1 changes, 2 everything.
    pub fn status_verbosity(&self) -> u8 {
        self.system(system::SV)
    }

    /// Time between status reports.
    pub fn status_interval_ms(&self) -> u16 {
        self.system_large(system::SI) as u16
    }

    /// The rate of the serial line as the sender has set it: a code, or bits a second.
    pub fn baud(&self) -> i32 {
        self.system_large(system::BAUD)
    }

    /// Whether lines end in LF CR.
    pub fn expand_line_feeds(&self) -> bool {
        self.system(system::EC) != 0
    }

    /// Whether received lines are echoed.
    pub fn echo(&self) -> bool {
        self.system(system::EE) != 0
    }

    /// Flow control: 0 none, 1 XON/XOFF, 2 RTS/CTS.
    pub fn flow_control(&self) -> u8 {
        self.system(system::EX)
    }

    /// Whether the sender counts characters, not lines.
    pub fn counts_characters(&self) -> bool {
        self.system(system::RXM) == 0
    }

    /// The dialect in which ports begin: 0 undecided, until a line decides; 1 g2core's, 2 TinyG's, 3 grbl's.
    pub fn dialect(&self) -> u8 {
        self.system(system::DIA) & 3
    }

    /// The dialect in which a port begins, numbered as in [`dialect`](Self::dialect), and 4 for RepRap's. In the
    /// setting the next two bits are the choice of the second port, where 0 stands for the choice of the first port.
    /// RepRap's dialect has a bit of its own for each port.
    pub fn dialect_of(&self, port: u8) -> u8 {
        if cfg!(feature = "dialect-reprap") && self.system(system::DIA) & (16 << port) != 0 {
            return 4;
        }
        match self.system(system::DIA) >> 2 & 3 {
            own if port == 0 || own == 0 => self.dialect(),
            1 => 0,
            own => own,
        }
    }

    /// Whether the dialect of a port is decided by the first line that is valid in one dialect only. False if the user
    /// has set text mode or silence, which only TinyG's dialect has.
    pub fn lets_senders_choose(&self, port: u8) -> bool {
        self.dialect_of(port) == 0 && self.starts_in_json() && self.json_verbosity() != 0
    }

    /// Whether the machine identifies itself as a g2core.
    pub fn is_g2core(&self) -> bool {
        self.dialect() == 1
    }

    /// Whether grbl's status reports have machine positions.
    pub fn reports_machine_position(&self) -> bool {
        self.system(system::GRM) & 1 != 0
    }

    /// Whether grbl's status reports have free blocks and bytes.
    pub fn reports_buffers(&self) -> bool {
        self.system(system::GRM) & 2 != 0
    }

    /// Whether grbl's reports are in inches.
    pub fn reports_in_inches(&self) -> bool {
        self.system(system::GRM) & 4 != 0
    }

    /// Whether the machine holds after a line of G-code that is refused in grbl's dialect.
    pub fn holds_behind_errors(&self) -> bool {
        self.system(system::GRM) & 8 != 0
    }

    /// Whether reports of grbl's dialect tell the sync error of a thread.
    pub fn reports_sync_error(&self) -> bool {
        self.system(system::GRM) & 16 != 0
    }

    /// Whether the sync error of a thread is reported at each index pulse.
    pub fn reports_each_turn(&self) -> bool {
        self.system(system::GRM) & 32 != 0
    }

    /// Plane at power-up and program end: 0 G17, 1 G18, 2 G19.
    pub fn default_plane(&self) -> u8 {
        self.system(system::GPL)
    }

    /// Units at power-up and program end: 0 G20, 1 G21.
    pub fn default_units(&self) -> u8 {
        self.system(system::GUN)
    }

    /// Coordinate system at power-up and program end: 1 for G54 to 9 for G59.3.
    pub fn default_coordinates(&self) -> u8 {
        self.system(system::GCO)
    }

    /// Path control at power-up and program end: 0 G61, 1 G61.1, 2 G64.
    pub fn default_path_control(&self) -> u8 {
        self.system(system::GPA)
    }

    /// Distance mode at power-up and program end: 0 G90, 1 G91.
    pub fn default_distance_mode(&self) -> u8 {
        self.system(system::GDI)
    }
}
