//! What can be asked of the machine beside its settings.

use crate::gcode::overrides::Override;
use crate::gcode::tables::TableRow;

/// A value of the machine, and what [`Machine::value`](super::Machine::value) returns for it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Value {
    /// Line number of the block read last.
    BlockLine,
    /// Line number of the block finished last, to its last step.
    FinishedLine,
    /// Line number of the block that moves.
    MotionLine,
    /// Speed now, in 0.001 mm/min.
    Velocity,
    /// Feed rate, in 0.001 mm/min.
    Feed,
    /// How far the extruder moves, in thousandths of what its words say.
    Flow,
    /// 1 if anything is queued or runs.
    Working,
    /// 1 if a block is being carried out.
    Running,
    /// 0 inch, 1 mm.
    Units,
    /// 0 G53, 1 to 9 G54 to G59.3.
    Coordinates,
    /// See [`MotionMode`](crate::gcode::modal::MotionMode).
    MotionMode,
    /// 0 to 2 G17 to G19.
    Plane,
    /// 0 G61, 1 G61.1, 2 G64.
    Path,
    /// 0 G90, 1 G91.
    Distance,
    /// 0 G90.1, 1 G91.1.
    ArcDistance,
    /// 0 G93, 1 G94, 2 G95.
    FeedMode,
    /// 1 if the spindle turns.
    SpindleOn,
    /// 1 if it turns counter-clockwise.
    SpindleDirection,
    /// What an encoder measures or, without one, S, in thousandths of a turn per minute.
    SpindleSpeed,
    /// 1 after M7.
    Mist,
    /// 1 after M8.
    Flood,
    /// S, in thousandths of a turn per minute.
    SpindleProgrammed,
    /// Pulses of the encoder in a turn; 0 without one.
    PulsesPerTurn,
    /// How far the axes of a pass in step with the spindle are ahead of it, um, at the last index; 0 without a pass.
    SyncError,
    /// Whether the pass of the line has begun: a [`Status`](crate::status::Status) as a number, as `Encoder::pass` has it.
    Pass,
    /// Pulses of the encoder that did not fit since the reset, 255 for more.
    PulseMisfits,
    /// Why the machine has started, see [`Cause`](crate::hal::resets::Cause).
    Reset,
    /// How many times steps have waited for the planner in mid-motion since the reset, 255 for more.
    Starvations,
    /// 1 if all settings and tables are in EEPROM, 0 if some are on their way.
    Kept,
    /// Tool number.
    Tool,
    /// The tool of the last T.
    SelectedTool,
    /// What has decided in which dialect the port is spoken to: 1 a setting, 2 what was said, 0 nothing, for there is one alone.
    Choice,
    /// 0 not homed, 1 homed, 2 homing.
    Home,
    /// How the hold came about: 0 if no door has begun it, 1 if one has, 2 if one has and it is over as soon as the machine stands.
    Door,
    /// 1 while lines are checked only.
    Check,
    /// Free blocks of the planner; never told as less than six.
    QueueFree,
    /// Free blocks of the planner, as they are.
    BlocksFree,
    /// Blocks added since this was last read.
    QueueAdded,
    /// Blocks removed since this was last read.
    QueueRemoved,
    /// Line slots that a sender may count on.
    SlotsFree,
    /// Bytes that the receive ring has room for.
    BytesFree,
    /// Position in machine coordinates, in units of a `Length`.
    MachinePosition(u8),
    /// Position in work coordinates, in units of a `Length`.
    Position(u8),
    /// Work offset, in units of a `Length`; shown in millimetres in any units.
    Offset(u8),
    /// Tool length, in units of a `Length`.
    ToolOffset(u8),
    /// 1 if the axis is homed.
    Homed(u8),
    /// G92, in force or not, in units of a `Length`.
    Shift(u8),
    /// A value of the interpreter's tables, in units of a `Length`.
    TableRow(TableRow, u8),
    /// An override's factor, in thousandths.
    Override(Override),
    /// 1 if it counts.
    OverrideOn(Override),
    /// 1 if the motor is powered.
    Powered(u8),
    /// Where the lines read so far end, in units of a `Length`.
    Target(u8),
    /// Where exec has brought a motor, in steps.
    Steps(u8),
    /// An input of [`inputs`](crate::boards::inputs): 1 if the switch is worked, 0 if not, -1 if there is none or its
    /// setting is 0.
    Input(u8),
    /// 0 no contact, 1 contact, 2 probing.
    ProbeState,
    /// 1 while what a probing has come to, and the alarm that it has raised, is still to be told on this port.
    ProbeUntold,
    /// Where the contact was, in units of a `Length`.
    Probed(u8),
    /// How hot a heater is, eighths of a degree Celsius: 0 the hot end, 1 the bed. 0 without it.
    Temperature(u8),
    /// How hot it is to be, likewise; 0 for off.
    WantedTemperature(u8),
    /// How much of its power it has, in thousandths.
    HeaterPower(u8),
    /// The end whose limit has been hit, which exceptions tell; -1 for none.
    LimitHit,
    /// The axis that could not be homed, which exceptions tell.
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
