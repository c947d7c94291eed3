//! The values that can be asked of the machine, beside its settings.

use crate::gcode::overrides::Override;
use crate::gcode::tables::TableRow;

/// A value of the machine, and what [`Machine::value`](super::Machine::value) returns for it. Modes are those of the last
/// line that was read, unless stated otherwise.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Value {
    /// Line number of the block that was read last.
    BlockLine,
    /// Line number of the last block that was executed to its last step.
    FinishedLine,
    /// Line number of the moving block.
    MotionLine,
    /// Present speed, in 0.001 mm/min.
    Velocity,
    /// Feed rate, in 0.001 mm/min.
    Feed,
    /// The flow of the extruder: how far it moves, in thousandths of what its words say.
    Flow,
    /// 1 if anything is queued or runs.
    Working,
    /// 1 if the last line that was queued moves the machine, and does not pause.
    MovesLast,
    /// 1 if the last line that was queued pauses (G4).
    PausesLast,
    /// 1 if a block is being carried out.
    Running,
    /// Units: 0 inch, 1 mm.
    Units,
    /// Coordinate system of the move that runs: 1 to 9 for G54 to G59.3.
    Coordinates,
    /// See [`MotionMode`](crate::gcode::modal::MotionMode).
    MotionMode,
    /// 0 to 2 for G17 to G19.
    Plane,
    /// Path control: 0 G61, 1 G61.1, 2 G64.
    Path,
    /// Distance mode: 0 G90, 1 G91.
    Distance,
    /// Distance mode of arcs: 0 G90.1, 1 G91.1.
    ArcDistance,
    /// Feed rate mode: 0 G93, 1 G94, 2 G95.
    FeedMode,
    /// 1 if the spindle's output is on.
    SpindleOn,
    /// 1 if the output for counter-clockwise turns is on.
    SpindleDirection,
    /// The measured speed of the spindle, in thousandths of a turn per minute; without an encoder the S with which it
    /// turns, or while it is off the last S word.
    SpindleSpeed,
    /// 1 if the mist coolant's output is on.
    Mist,
    /// 1 if the flood coolant's output is on.
    Flood,
    /// Pulses of the encoder per turn; 0 without an encoder.
    PulsesPerTurn,
    /// How far the axes are ahead of the spindle in a synchronized pass, in um, at the last index pulse; 0 without a
    /// pass.
    SyncError,
    /// Whether the synchronized pass of the line has begun: a [`Status`](crate::status::Status) as a number, from
    /// `Encoder::pass`.
    Pass,
    /// Misfits: pulses of the encoder since the reset that did not fit; 255 for 255 or more.
    PulseMisfits,
    /// Why the machine has started: see [`Cause`](crate::hal::resets::Cause).
    Reset,
    /// How often the step generator has waited for the planner in mid-motion since the reset; 255 for 255 or more.
    Starvations,
    /// How often USB has been restarted since the start, because it hung; 255 for 255 or more.
    UsbRestarts,
    /// Milliseconds with errors of the USB bus since the start, modulo 2^16.
    UsbErrors,
    /// Rising edges at the pin of the hardware's counter since the start, modulo 2^16; 0 without one.
    AtCounter,
    /// 1 if all settings and tables are in EEPROM, 0 if some are still being written.
    Kept,
    /// Tool number, in the move that runs.
    Tool,
    /// The tool that the last T word has selected.
    SelectedTool,
    /// What has decided the dialect of the port: 1 a setting, 2 a received line, 0 nothing, because the image has
    /// only one.
    Choice,
    /// Homing state: 0 not homed, 1 homed, 2 homing.
    Home,
    /// How the hold began: 0 not by a door, 1 by a door, 2 by a door, and motion resumes as soon as the machine
    /// stands still.
    Door,
    /// 1 in check mode.
    Check,
    /// Free blocks of the planner as reported to senders: at least six.
    QueueFree,
    /// Free blocks of the planner, the true number.
    BlocksFree,
    /// Blocks added since this was last read.
    QueueAdded,
    /// Blocks removed since this was last read.
    QueueRemoved,
    /// Line slots that a sender may count on.
    SlotsFree,
    /// Free bytes of the receive ring buffer.
    BytesFree,
    /// How many bytes the sender may have in flight when none wait.
    BytesInAll,
    /// Position in machine coordinates, in units of a `Length`.
    MachinePosition(u8),
    /// Position in work coordinates of the move that runs, in units of a `Length`.
    Position(u8),
    /// Work offset of the move that runs, in units of a `Length`. Shown in millimetres even if the units are inches.
    Offset(u8),
    /// Tool length, in units of a `Length`.
    ToolOffset(u8),
    /// 1 if the axis is homed.
    Homed(u8),
    /// The G92 shift, in force or not, in units of a `Length`.
    Shift(u8),
    /// A value of the interpreter's tables, in units of a `Length`.
    TableRow(TableRow, u8),
    /// An override's factor, in thousandths.
    Override(Override),
    /// 1 if the override is enabled.
    OverrideOn(Override),
    /// 1 if the motor is powered.
    Powered(u8),
    /// The end of the lines read so far, in units of a `Length`.
    Target(u8),
    /// The position of a motor in exec, in steps.
    Steps(u8),
    /// An input of [`inputs`](crate::boards::inputs): 1 if the switch is actuated, 0 if not, -1 if there is no switch
    /// or its setting is 0.
    Input(u8),
    /// State of the probe: 0 no contact, 1 contact, 2 probing.
    ProbeState,
    /// 1 while the result of a probing, and the alarm that it raised, have not been told on this port.
    ProbeUntold,
    /// The position of the contact, in units of a `Length`.
    Probed(u8),
    /// The temperature of a heater, in eighths of a degree Celsius: 0 the hot end, 1 the bed. 0 if there is no
    /// heater.
    Temperature(u8),
    /// The target temperature of a heater, in the same unit; 0 for off.
    WantedTemperature(u8),
    /// The power of a heater, in thousandths of its full power.
    HeaterPower(u8),
    /// The state of a motor's driver: see [`State`](crate::drivers::watch::State).
    #[cfg(feature = "drivers")]
    Driver(u8),
    /// The register DRV_STATUS of a motor's driver.
    #[cfg(feature = "drivers")]
    DriverStatus(u8),
    /// What is done with the file of the SD card: 0 nothing, 1 it is selected, 2 its lines run, 3 lines are written to
    /// it.
    #[cfg(feature = "sd")]
    FileUse,
    /// Bytes of the file that have been read, and its length. If lines are written to it, both are its length so far.
    #[cfg(feature = "sd")]
    FileAt,
    /// See [`Value::FileAt`].
    #[cfg(feature = "sd")]
    FileLength,
    /// The axis end whose limit switch was hit, for exceptions; -1 for none.
    LimitHit,
    /// The axis that could not be homed, for exceptions.
    Blamed,
}

/// A speed as [`Machine::value`](super::Machine::value) returns it: thousandths, saturating.
#[small]
pub fn thousandths(speed: f32) -> i32 {
    (speed * 1e3 + if speed < 0.0 { -0.5 } else { 0.5 }) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_saturate() {
        assert_eq!(thousandths(1.2345), 1235);
        assert_eq!(thousandths(-0.0005), -1);
        assert_eq!(thousandths(1e30), i32::MAX);
        assert_eq!(thousandths(f32::NAN), 0);
    }
}
