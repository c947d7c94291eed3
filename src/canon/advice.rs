//! What a status means, and what to do about it, for people: `docs/codes.md`, and what `check` says of a line.

use crate::status::Status::{self, *};

/// For each status why it comes and what to do. `Status::Again` is missing: it never leaves the machine.
const ADVICE: &[(Status, &str, &str)] = &[
    (Ok, "The line was carried out, or has been queued.", "Nothing."),
    (
        Error,
        "Something that has no number of its own, such as a built-in job that does not exist.",
        "Check the number of the job (`$test`). Of anything else, report the line.",
    ),
    (
        Noop,
        "The line begins with a slash and `bd` is 1: it was passed over.",
        "Nothing. `{bd:0}` has such lines carried out.",
    ),
    (
        Terminated,
        "The line was dropped by a stop: `!%`, `^d`, or the end of a jog.",
        "Nothing. Send the line again if you want it.",
    ),
    (
        HardReset,
        "The board has started by itself: a dip of the supply (`{rst:n}` 2) or the watchdog (3).",
        "Find the cause. `{clear:n}`, home, start the job anew.",
    ),
    (EndOfFile, "A built-in job, or your own program, has come to its end.", "Nothing."),
    (
        BufferFull,
        "Characters were lost: the sender sent more than there was room for, or the line is noisy.",
        "Stop the job. Let the sender count lines (TinyG mode). Check the cable.",
    ),
    (
        Initializing,
        "The settings are the defaults: after `{defa:1}`, or because the memory was empty or unreadable.",
        "Load your settings again (backup.md).",
    ),
    (
        BootLoader,
        "The board goes to its boot loader, as asked for by `{boot:1}`.",
        "Flash it, or press reset.",
    ),
    (InternalError, "The firmware contradicts itself.", "Report it, with the line."),
    (ExceptionReport, "`{er:n}` asked for a report, to try a sender with.", "Nothing."),
    (
        PersistenceError,
        "The program of your own has no room, or EEPROM cannot be written.",
        "Make the program shorter. If it comes for settings, replace the board.",
    ),
    (
        StepsLate,
        "Steps came late in mid-motion: a fault of the firmware. A motor may have stalled.",
        "Stop, home, check the part. Lower `vm` or `fr`. Report the job.",
    ),
    (
        ProgramStopped,
        "The program has come to M0, M1, M6, M60 or G88, and waits.",
        "Do what it waits for, then `~`. `{psw:0}` has it go on by itself.",
    ),
    (
        ProgramChecked,
        "In check mode the program has come to M2 or M30. Nothing has moved.",
        "`{chk:0}` ends check mode. Until then nothing moves.",
    ),
    (
        PulseMisfit,
        "A pulse of the spindle's encoder is missing, or there is one too many; `spx` counts them.",
        "Check `spn`, the sensors and their cables, and `spb` if contacts bounce.",
    ),
    (
        NoEncoder,
        "G33 needs an encoder at the spindle, and `spn` is 0.",
        "Set `spn` to its sync pulses a turn, 1 for an index alone (lathe.md).",
    ),
    (
        NoIndex,
        "A thread was to begin, and the index gave no pulse for 6 seconds. Nothing has moved.",
        "Start the spindle. Check the sensor and its cable; `{sps:n}` tells the speed.",
    ),
    (
        NoSync,
        "A thread was to begin, and sync gave no pulses while the index did. Nothing has moved.",
        "Check the sync sensor and its cable, or set `{spn:1}` to go by the index alone.",
    ),
    (
        SpindleLost,
        "The pulses of the spindle ended in a thread. The axes have stopped, and know where they are.",
        "Take the tool out of the cut, `{clear:n}`. Find out why the spindle stopped, or the pulses.",
    ),
    (
        NoEncoderInput,
        "The board has no pins for the sensors of a spindle.",
        "Take a board that has (lathe.md).",
    ),
    (
        SpindleError,
        "In a thread the axes were further from where the spindle says than `spl`. They have stopped, and know where they are.",
        "`{clear:n}`. Turn slower, or raise `fr` and `ac` of the axis, if the axis can; else `spl`.",
    ),
    (
        NotReversed,
        "G33.1 has told the spindle to turn round, and it has not within the way that it has for that.",
        "Free the tap by hand, `{clear:n}`. Check that M4 turns the spindle backwards; turn slower.",
    ),
    (
        WrongWay,
        "A thread was to begin, and the second sync sensor says that the spindle turns the other way than M3 or M4 has asked for. Nothing has moved.",
        "Swap the sync sensors, or the spindle's wires; see `spdp`. `{spdi:0}` has the direction not looked at.",
    ),
    (
        SensorOpen,
        "The sensor of a heater reads as if its wire were broken. All heaters are off and locked.",
        "Look at plug and wire of the sensor (printing.md). `^x`, then heat again.",
    ),
    (
        SensorShort,
        "The sensor of a heater reads as if its wires touched. All heaters are off and locked.",
        "Look at plug and wire of the sensor (printing.md). `^x`, then heat again.",
    ),
    (
        HeatRunaway,
        "A heater that was hot has got far from where it was to be: its sensor may have come loose. All heaters are off and locked.",
        "Fix the sensor to its heater; tune it again (printing.md). `^x`, then heat again.",
    ),
    (
        HeatTooSlow,
        "A heater with all its power has not got hotter. All heaters are off and locked.",
        "Check heater, its wires, its supply, and whether the sensor sits in it. `^x`, then heat again.",
    ),
    (
        TooHot,
        "A heater is hotter than its maximum allows. All heaters are off and locked.",
        "Pull the plug if it goes on heating: its transistor has failed. Else `^x`.",
    ),
    (
        TooCold,
        "The line moves filament, and the hot end is colder than `he1mn` says. As an alarm: it has got colder, by 10 degrees, than filament that is being moved asks for.",
        "Heat it first: `M109 S200`. Where A is no extruder: `{he1k:0}`.",
    ),
    (
        HeatersLocked,
        "The line switches a heater on, and a fault has locked them.",
        "Look for the cause; `^x` unlocks them.",
    ),
    (
        CardError,
        "The SD card, or the file that is printed from it, cannot be read. The print has ended.",
        "Look at card and wires (printing.md); M21, then M23 and M24 again.",
    ),
    (
        UnrecognizedName,
        "There is no setting or value of that name.",
        "Check the name in settings.md, and below.",
    ),
    (
        MalformedCommand,
        "The line is not G-code: a wrong character, two points in a number, a control character.",
        "Mend the line. O words, `#` and brackets are not known.",
    ),
    (
        BadNumber,
        "A letter without a number, or a fraction where an integer is due.",
        "Mend the number.",
    ),
    (
        UnsupportedType,
        "A string where a number is due, or the other way round.",
        "Give a number; only `uda` to `udd` and `prog` take strings.",
    ),
    (
        ReadOnly,
        "The value can be read, not set.",
        "Leave it out. `g28` and `g30` are set by G28.1 and G30.1.",
    ),
    (CannotRead, "The value cannot be in a status report.", "Ask for it by itself."),
    (
        NotAccepted,
        "Not now: the machine moves, or a job or another jog goes on.",
        "Wait until it rests, or stop it.",
    ),
    (InputTooLong, "The line has more than 254 characters (79 on the second port).", "Split it."),
    (BelowMinimum, "The number is too small.", "See the range in settings.md."),
    (AboveMaximum, "The number is too large.", "See the range in settings.md."),
    (
        OutOfRange,
        "No such choice; or a place that is beyond 214 m, or that the motors cannot count to.",
        "See the range in settings.md; check units and offsets.",
    ),
    (JsonSyntax, "The line begins with `{` and is not JSON.", "Mend it: braces, quotes, commas."),
    (
        JsonTooManyPairs,
        "Too many values in one line, or in the list of the status report.",
        "Split the line; ask for fewer values.",
    ),
    (TextNested, "`txt` in a line of `txt`.", "Send one."),
    (JsonTooDeep, "More than one level of groups.", "`{x:{vm:900}}` is as deep as it goes."),
    (
        Muted,
        "The other port runs a job.",
        "Wait for its end. Control lines such as `!` and `{..}` are taken.",
    ),
    (NotBuiltIn, "This image was built without it.", "Flash an image that has it."),
    (
        GcodeGeneric,
        "The line is not right, and nothing more is known.",
        "Report it, with the line.",
    ),
    (
        GcodeUnsupported,
        "There is no such G code, or a letter that no code takes.",
        "Choose another post (cam.md); gcode.md lists the codes.",
    ),
    (
        McodeUnsupported,
        "There is no such M code.",
        "Choose another post (cam.md); gcode.md lists the codes.",
    ),
    (
        ModalGroupViolation,
        "Two codes of one group on the line, such as G0 and G1.",
        "Use two lines.",
    ),
    (AxisWordMissing, "The code needs an axis: X, Y, Z, A, B or C.", "Name one."),
    (
        AxisNotAllowed,
        "Axis words, and no motion is in force: G80, or after homing or probing.",
        "Put G0 or G1 on the line.",
    ),
    (AxisInvalid, "The code does not take this axis.", "See the code in gcode.md."),
    (AxisDisabled, "The axis is switched off (`am` 0).", "Leave the axis out, or set `am` 1."),
    (AxisTargetMissing, "A cycle has no depth (Z), or a move no end.", "Name it."),
    (PlaneMissing, "No plane is in force.", "Put G17, G18 or G19 on the line."),
    (
        FeedrateMissing,
        "No feed: no F so far, or none since G93, G94, G95 or M2.",
        "Put an F on the line.",
    ),
    (InverseTimeNotAllowed, "The code does not go with G93.", "Put G94 and an F on the line."),
    (
        RotaryNotAllowed,
        "A cycle or probing does not turn A, B or C.",
        "Move them on a line before.",
    ),
    (MachineCoordinatesMotion, "G53 without G0 or G1.", "`G53 G0 Z0`."),
    (VelocityExceeded, "The axes cannot be that fast.", "Lower the feed."),
    (
        CutterCompensation,
        "G41 and G42 are not there.",
        "Have the CAM program compensate (\"in computer\").",
    ),
    (SWordMissing, "The code needs a speed S.", "Put S on a line before."),
    (SWordInvalid, "S is negative.", "Use M4 for the other direction."),
    (SpindleMustTurn, "The code needs a spindle that turns.", "M3 S.. before it."),
    (
        ArcSpecification,
        "The arc's words do not go together: R and I J K both, or a centre that is no place in the plane.",
        "Check plane (G17) and words; have the post write lines.",
    ),
    (
        ArcAxisMissing,
        "An arc with R has no end in its plane.",
        "Name the end, or use I and J for a full circle.",
    ),
    (
        ArcOffsetsMissing,
        "An arc has neither R nor a centre in its plane (I J for G17).",
        "Name one.",
    ),
    (
        ArcRadiusTolerance,
        "The end is not as far from the centre as the start.",
        "Have the post write four decimals, or absolute centres (G90.1) if it means them.",
    ),
    (
        ArcEndpointIsStart,
        "An arc with R that ends where it begins.",
        "Use I and J for a full circle.",
    ),
    (PWordMissing, "The code needs P.", "See the code in gcode.md."),
    (PWordInvalid, "P is not one that the code knows.", "See the code in gcode.md."),
    (PWordNegative, "P is negative.", "A time is 0 or more."),
    (KWordMissing, "G33 needs K, on each line.", "Put a K on the line."),
    (ToolInvalid, "P is not a tool of the table.", "Tools are 1 to 10."),
    (KWordInvalid, "K of G33 is 0 or less.", "K is the lead of the thread, above 0."),
    (HWordMissing, "The code needs H.", "Name the tool."),
    (
        HWordInvalid,
        "H is above 99, or no whole number.",
        "Tools with lengths are 1 to 10; 0 is none. Renumber the tools in the CAM program.",
    ),
    (
        NoToolLength,
        "The tool of G43 has no length in the table: 0 is in force. A note; the job goes on.",
        "Nothing if you zero Z with each tool; else `{tt1:{z:..}}`.",
    ),
    (LWordMissing, "The code needs L.", "See G10 in gcode.md."),
    (LWordInvalid, "L is not one that the code knows.", "See the code in gcode.md."),
    (QWordMissing, "The cycle needs Q, the depth of a peck.", "Name it."),
    (QWordInvalid, "Q is not above 0.", "Give a depth above 0."),
    (RWordMissing, "The cycle needs R, the height from which it feeds.", "Name it."),
    (RWordInvalid, "R is below the bottom of the hole.", "Check R and Z, and G90 or G91."),
    (TWordMissing, "The code needs T.", "Name the tool."),
    (TWordInvalid, "T is not a whole number from 0 to 255.", "Renumber the tool."),
    (WordUnused, "A word belongs to no code of the line.", "Leave it out, or add its code."),
    (WordRepeated, "A letter stands twice on the line.", "Use two lines."),
    (AxisConflict, "Two codes of the line want the axis words.", "Use two lines."),
    (WordConflict, "Two codes of the line want the same word.", "Use two lines."),
    (Alarmed, "There is an alarm.", "See alarms.md; then `{clear:n}`."),
    (LimitHit, "A limit switch was hit.", "`{clear:n}`, move off the switch, home."),
    (
        ShutDown,
        "The emergency stop input is or was hit, or `{shutd:n}` came.",
        "Let it go, `{clear:n}`, home.",
    ),
    (Panicked, "`{panic:n}` came.", "`^x`, home."),
    (KillJob, "`^d` has ended the job.", "Nothing; the position is kept."),
    (
        SoftLimit,
        "The move would leave the travel (`tn` to `tm`).",
        "Check work zero and the size of the job. Nothing has moved.",
    ),
    (
        HomingFailed,
        "The homing switch was not found, or homing was flushed.",
        "Check direction, switch and travel (alarms.md).",
    ),
    (HomingAxis, "No axis that can be homed is named.", "Name X, Y, Z or A; `am` is not 0."),
    (HomingSearch, "`sv` is 0.", "Set it, for example `{xsv:500}`."),
    (HomingLatch, "`lv` is 0.", "Set it, for example `{xlv:100}`."),
    (HomingTravel, "`tn` and `tm` are the same: there is no way to search.", "Set the travel."),
    (
        HomingSwitches,
        "The axis has no homing switch, or two.",
        "One of `sn` and `sx` is 1 or 3, the other 0 or 2. By a stall: `drc1` is 1, and no `sqsw`.",
    ),
    (
        HomingClosed,
        "The homing switch stays closed.",
        "Check the switch and `st`; raise `lb`. By a stall: the jumper for DIAG.",
    ),
    (
        NotHomed,
        "G28 or G30 moves an axis that is not homed, and no position was ever stored.",
        "Home: `{home:1}`. G28.3 says where an axis without a switch is.",
    ),
    (
        ProbeFailed,
        "G38.2 or G38.4 has found nothing, or the probe was closed before.",
        "Check `{inp:n}`, `{clear:n}`, probe again.",
    ),
    (ProbeTooShort, "Probing that ends where it begins.", "Give it a distance."),
];

/// Why a status comes, and what to do about it.
pub fn advice(status: Status) -> Option<(&'static str, &'static str)> {
    ADVICE.iter().find(|(of, ..)| *of == status).map(|(_, cause, cure)| (*cause, *cure))
}

/// All statuses that a sender may get to see, in their order.
pub fn statuses() -> impl Iterator<Item = Status> {
    ADVICE.iter().map(|(status, ..)| *status)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_status_has_its_advice_in_its_place() {
        let after = |status: Status| if (status as usize) < Again as usize { 0 } else { 1 };
        assert_eq!(statuses().count(), Status::COUNT - 1);
        for (at, status) in statuses().enumerate() {
            assert_eq!(status as usize, at + after(status), "{status:?}");
        }
    }
}
