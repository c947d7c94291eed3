//! The cause and the remedy of each status, for people: `docs/codes.md`, and the output of `kerf check`.

use crate::status::Status::{self, *};

/// For each status its cause and its remedy. `Status::Again` is missing, because it is never sent.
const ADVICE: &[(Status, &str, &str)] = &[
    (Ok, "The line has run or is queued.", "Nothing."),
    (
        Error,
        "An error without a number of its own, such as a built-in job that does not exist.",
        "Check the number of the job (`$test`). Else report the line.",
    ),
    (
        Noop,
        "The line begins with a slash and `bd` is 1: it was skipped.",
        "Nothing. With `{bd:0}` such lines run.",
    ),
    (
        Terminated,
        "A stop has discarded the line: `!%`, `^d`, or the end of a jog.",
        "Nothing. Send the line again if you want it.",
    ),
    (
        HardReset,
        "The board has restarted by itself: low supply voltage (`{rst:n}` 2) or the watchdog (3).",
        "Find the cause. Then `{clear:n}`, home, start the job again.",
    ),
    (EndOfFile, "A built-in job or the stored program has ended.", "Nothing."),
    (
        BufferFull,
        "Characters were lost: the sender sent too much at once, or the cable picks up noise.",
        "Stop the job. Set the sender to count lines (TinyG mode). Check the cable.",
    ),
    (
        Initializing,
        "The settings are the defaults: after `{defa:1}`, or because the memory was empty or unreadable.",
        "Load your settings again (backup.md).",
    ),
    (
        BootLoader,
        "`{boot:1}` was sent: the board starts its boot loader.",
        "Flash the board, or press reset.",
    ),
    (InternalError, "A fault of the firmware.", "Report it, with the line."),
    (ExceptionReport, "`{er:n}` asked for an exception report, to test a sender.", "Nothing."),
    (
        PersistenceError,
        "There is no room for the stored program, or EEPROM cannot be written.",
        "Make the program shorter. If the status comes for settings, replace the board.",
    ),
    (
        StepsLate,
        "Steps came late during a move: a fault of the firmware. A motor may have stalled.",
        "Stop, home, check the part. Lower `vm` or `fr`. Report the job.",
    ),
    (
        ProgramStopped,
        "The program waits at M0, M1, M6, M60 or G88.",
        "Do what the program waits for, then send `~`. With `{psw:0}` programs do not wait.",
    ),
    (
        ProgramChecked,
        "The program has reached M2 or M30 in check mode. Nothing has moved.",
        "`{chk:0}` ends check mode. Until then nothing moves.",
    ),
    (
        PulseMisfit,
        "A pulse of the spindle encoder is missing, or there is one too many; `spx` counts them.",
        "Check `spn`, the sensors and their cables. Set `spb` if contacts bounce.",
    ),
    (
        NoEncoder,
        "Threads need a spindle encoder, and `spn` is 0.",
        "Set `spn` to the number of sync pulses per turn, or to 1 for an index alone (lathe.md).",
    ),
    (
        NoIndex,
        "No index pulse came for 6 seconds at the start of a thread. Nothing has moved.",
        "Start the spindle. Check the sensor and its cable; `{sps:n}` shows the speed.",
    ),
    (
        NoSync,
        "No sync pulses came at the start of a thread, but index pulses did; or G33.1 was to use the index alone. Nothing has moved.",
        "Check the sync sensor and its cable. Without one, `{spn:1}` cuts threads by the index alone, and does not tap.",
    ),
    (
        SpindleLost,
        "The pulses of the spindle stopped in a thread, or no spindle gives such pulses. The axes have stopped and their position is known.",
        "Take the tool out of the cut, then `{clear:n}`. Find out why the spindle or its pulses stopped. If `spx` is not 0, see 40.",
    ),
    (
        NoEncoderInput,
        "The board has no pins for a spindle encoder.",
        "Use a board that has them (lathe.md).",
    ),
    (
        SpindleError,
        "In a thread the axes were farther than `spl` from the position that the spindle demands. They have stopped and their position is known.",
        "`{clear:n}`. Reduce the spindle speed, or raise `fr` and `ac` of the axis if it allows that, else `spl`.",
    ),
    (
        NotReversed,
        "In G33.1 the spindle did not reverse within the distance allowed for it.",
        "Free the tap by hand, then `{clear:n}`. Check that M4 turns the spindle backwards. Reduce the speed.",
    ),
    (
        WrongWay,
        "At the start of a thread the spindle turned against M3 or M4, according to the second sync sensor. Nothing has moved.",
        "Swap the sync sensors, or the wires of the spindle; see `spdp`. With `{spdi:0}` the direction is not checked.",
    ),
    (
        SensorOpen,
        "The sensor of a heater reads like a broken wire. All heaters are off and locked.",
        "Check the plug and the wire of the sensor (printing.md). `^x`, then heat again.",
    ),
    (
        SensorShort,
        "The sensor of a heater reads like a short circuit. All heaters are off and locked.",
        "Check the plug and the wire of the sensor (printing.md). `^x`, then heat again.",
    ),
    (
        HeatRunaway,
        "A heater's temperature does not fit its power: it fell under power, rose or stayed without power, or is far below its target. All heaters are off and locked.",
        "If it keeps heating, pull the plug: its transistor has failed. Fix the sensor to its heater. Tune again (printing.md). `^x`, then heat again.",
    ),
    (
        HeatTooSlow,
        "A heater had power and did not get hotter, or did not get colder without power. All heaters are off and locked.",
        "Check the heater, its wires, its supply and the seat of the sensor. `^x`, then heat again.",
    ),
    (
        TooHot,
        "A heater is hotter than its maximum allows. All heaters are off and locked.",
        "If it keeps heating, pull the plug: its transistor has failed. Else `^x`.",
    ),
    (
        TooCold,
        "The line moves filament, and the hot end is colder than `he1mn`. As an alarm: it got 10 degrees colder than `he1mn` while filament moved.",
        "Heat it first: `M109 S200`. If A is no extruder: `{he1k:0}`.",
    ),
    (
        HeatersLocked,
        "The line switches a heater on while a fault has locked the heaters.",
        "Find the cause; `^x` unlocks the heaters.",
    ),
    #[cfg(feature = "drivers")]
    (
        DriverSilent,
        "A motor's driver does not answer: nobody knows its microsteps. As an alarm: it fell silent while motors moved.",
        "Switch the motor supply on: without it drivers are silent. `{dr:n}` shows which one. In an alarm `{clear:n}`; home.",
    ),
    #[cfg(feature = "drivers")]
    (
        DriverUnset,
        "The driver of a motor answers, but has not taken its settings: not yet, or its line is disturbed.",
        "Wait for half a second after power-up. If it stays: `{dr:n}` shows which driver; replace the board.",
    ),
    #[cfg(feature = "drivers")]
    (
        DriverReset,
        "A motor's driver has lost its supply. It has its settings again, but the motor may stand elsewhere. An alarm, if motors moved.",
        "Check the motor supply and its plug. `{clear:n}`, then home.",
    ),
    #[cfg(feature = "drivers")]
    (
        DriverOff,
        "A motor's driver has switched it off: too hot, a coil shorted, the supply too low. An alarm, if motors moved.",
        "`{dr:n}` says which and why. Let it cool, lower `drr`, check motor and wires. `{md:1}`, `{clear:n}`, and home.",
    ),
    #[cfg(feature = "drivers")]
    (
        DriverHot,
        "The driver of a motor is above 120 degrees. It works on, and switches off at 143. Told once.",
        "Cool it with a fan, or lower its current (`drr`).",
    ),
    #[cfg(feature = "drivers")]
    (
        DriverOpen,
        "A wire of a motor seems to be open. Told once; `{dr:n}` shows which. At high speed a driver may be wrong about it.",
        "Stop, cut the power, and check the motor's plug.",
    ),
    (
        CardError,
        "The SD card, or the file that runs from it, cannot be read. The run has ended.",
        "Check the card and its wires (card.md). Then choose the file again.",
    ),
    #[cfg(feature = "card-write")]
    (
        CardFull,
        "The SD card has no room for the file, or its root folder has none for another entry. The file is not there.",
        "Delete files, or use another card.",
    ),
    (
        UnrecognizedName,
        "There is no setting or value of that name.",
        "Check the name in settings.md, and below.",
    ),
    (
        MalformedCommand,
        "The line is not G-code: a wrong character, two points in a number, text behind a comment within an open one.",
        "Correct the line. `#`, brackets and control flow (`o100 sub`) are not supported: let the CAM program write them out.",
    ),
    (
        BadNumber,
        "A letter without a number, as in `o100 sub`, or a fraction where an integer is required.",
        "Correct the number. O words with a keyword are not supported: let the CAM program write subroutines and loops out.",
    ),
    (
        UnsupportedType,
        "A string where a number is required, or a number where a string is required.",
        "Send a number; only `uda` to `udd` and `prog` take strings.",
    ),
    (
        ReadOnly,
        "The value can be read but not set.",
        "Leave it out. `g28` and `g30` are set by G28.1 and G30.1.",
    ),
    (CannotRead, "The value cannot be in a status report.", "Ask for it alone."),
    (
        NotAccepted,
        "The machine moves, or a job or another jog is running.",
        "Wait until it has ended, or stop it.",
    ),
    (InputTooLong, "The line has more than 254 characters (79 on the second port).", "Split it."),
    (BelowMinimum, "The number is too small.", "See the range in settings.md."),
    (AboveMaximum, "The number is too large.", "See the range in settings.md."),
    (
        OutOfRange,
        "The number is not one of the choices, or a position is beyond 214 m or beyond the range of the step counters.",
        "See the range in settings.md. Check units and offsets.",
    ),
    (
        JsonSyntax,
        "The line begins with `{` and is not valid JSON.",
        "Correct braces, quotes and commas.",
    ),
    (
        JsonTooManyPairs,
        "Too many values in the line, or in the list of the status report.",
        "Split the line; ask for fewer values.",
    ),
    (TextNested, "A `txt` line contains another `txt`.", "Use one `txt`."),
    (JsonTooDeep, "More than one level of groups.", "The deepest form is `{x:{vm:900}}`."),
    (
        Muted,
        "The other port runs a job.",
        "Wait for its end. Control lines such as `!` and `{..}` are accepted.",
    ),
    (NotBuiltIn, "This image was built without it.", "Flash an image that has it."),
    (
        GcodeGeneric,
        "The line is wrong for a reason without a number of its own.",
        "Report it, with the line.",
    ),
    (
        GcodeUnsupported,
        "There is no such G code, or no code has a word with this letter.",
        "Choose another postprocessor (cam.md); gcode.md lists the codes.",
    ),
    (
        McodeUnsupported,
        "There is no such M code.",
        "Choose another postprocessor (cam.md); gcode.md lists the codes.",
    ),
    (
        ModalGroupViolation,
        "Two codes of one modal group on the line, such as G0 and G1.",
        "Use two lines.",
    ),
    (AxisWordMissing, "The code needs an axis word: X, Y, Z, A, B or C.", "Add one."),
    (
        AxisNotAllowed,
        "Axis words, but no motion mode is active: after G80, homing or probing. The code before G80 does not come back.",
        "Put G0 or G1 on the line.",
    ),
    (AxisInvalid, "The code does not take this axis.", "See the code in gcode.md."),
    (AxisDisabled, "The axis is disabled (`am` 0).", "Leave the axis out, or set `am` 1."),
    (AxisTargetMissing, "A canned cycle has no depth (Z).", "Add it."),
    (PlaneMissing, "No plane is active.", "Put G17, G18 or G19 on the line."),
    (
        FeedrateMissing,
        "No feed rate: no F yet, or none since G93, G94, G95 or M2.",
        "Put an F on the line.",
    ),
    (InverseTimeNotAllowed, "The code cannot be used with G93.", "Put G94 and an F on the line."),
    (
        RotaryNotAllowed,
        "Canned cycles, probing and threads cannot move A, B or C.",
        "Move these axes on a line before.",
    ),
    (MachineCoordinatesMotion, "G53 needs a G0 or G1 move.", "Write for example `G53 G0 Z0`."),
    (
        VelocityExceeded,
        "In the thread an axis would be faster than its `fr`, or the encoder gives more than 6,000 pulses a second. Nothing has moved.",
        "Reduce the spindle speed.",
    ),
    (
        CutterCompensation,
        "G41 and G42 are not supported.",
        "Let the CAM program compensate (\"in computer\").",
    ),
    (SWordMissing, "The code needs a spindle speed S, or for heaters a temperature S.", "Add S."),
    (SWordInvalid, "S is negative.", "Use M4 for the other direction."),
    (
        SpindleMustTurn,
        "The code needs a turning spindle. As an alarm: with G95 the spindle stood still for 6 seconds.",
        "Put M3 and S on a line before.",
    ),
    (
        ArcSpecification,
        "The words of the arc conflict: R with I, J or K, or an offset outside the plane. Or start and end are not equally far from the centre.",
        "Check the plane (G17) and the words. Let the postprocessor write four decimals, or G90.1 if its centres are absolute.",
    ),
    (
        ArcAxisMissing,
        "An arc with R has no end point in its plane.",
        "Add the end point. For a full circle use I and J.",
    ),
    (
        ArcOffsetsMissing,
        "An arc has neither R nor a centre in its plane (I J for G17), or G76 or G87 lacks I, J or K.",
        "Add the words.",
    ),
    (
        ArcRadiusTolerance,
        "R is less than half the distance from start to end, or less than 0.001 mm.",
        "Check R. Let the postprocessor write four decimals.",
    ),
    (
        ArcEndpointIsStart,
        "An arc with R ends where it begins, or an arc with a centre ends almost where it begins.",
        "For a full circle use I and J without an end point.",
    ),
    (PWordMissing, "The code needs P.", "See the code in gcode.md."),
    (PWordInvalid, "The code does not accept this P.", "See the code in gcode.md."),
    (PWordNegative, "P is negative.", "P must be 0 or more."),
    (KWordMissing, "A threading code needs K on each line.", "Put a K on the line."),
    (ToolInvalid, "P is not a tool of the tool table.", "The tools are 1 to 10."),
    (KWordInvalid, "K is 0 or less.", "K must be above 0: the lead of a thread, in G76 the depth."),
    (HWordMissing, "The code needs H.", "Add the tool number."),
    (
        HWordInvalid,
        "H is above 99, in G76 above 255, or not a whole number.",
        "Tools 1 to 10 have lengths; 0 is none. Renumber the tools in the CAM program.",
    ),
    (
        NoToolLength,
        "The tool of G43 has no length in the tool table: 0 is used. The job continues.",
        "Nothing if you zero Z with each tool. Else use tools 1 to 10: `{tt1:{z:..}}`.",
    ),
    (LWordMissing, "The code needs L.", "See G10 in gcode.md."),
    (LWordInvalid, "The code does not accept this L.", "See the code in gcode.md."),
    (QWordMissing, "The cycle needs Q, the depth of a peck.", "Add Q."),
    (QWordInvalid, "Q is 0 or less; in G76 it is not from 0 to 80.", "Correct Q."),
    (RWordMissing, "The cycle needs R, the height where feeding begins.", "Add R."),
    (
        RWordInvalid,
        "R is below the bottom of the hole. In G76 R is not from 1 to 1000, or gives more than 1000 passes.",
        "Check R and Z, and G90 or G91; in G76 R and J.",
    ),
    (TWordMissing, "The code needs T.", "Add the tool number."),
    (TWordInvalid, "T is not a whole number from 0 to 65,535.", "Renumber the tool."),
    (WordUnused, "A word belongs to no code of the line.", "Remove it, or add its code."),
    (WordRepeated, "The line has two words with one letter.", "Use two lines."),
    (
        AxisConflict,
        "Two codes of the line use the axis words, such as G0 and G28 in `G0 G91 G28 Z0`.",
        "Leave out G0 or G1 beside G28 and G30: they move by themselves. Else use two lines.",
    ),
    (WordConflict, "Two codes of the line use one word.", "Use two lines."),
    #[cfg(feature = "language")]
    (
        ParameterInvalid,
        "A parameter is numbered, and its number is no whole number from 1 to 5601.",
        "Check the number, or the value that stands for it.",
    ),
    #[cfg(feature = "language")]
    (
        ParameterReadOnly,
        "The line assigns a parameter that shows the state of the machine.",
        "Use another parameter. Offsets and stored positions are set by G10, G92 and G28.1.",
    ),
    #[cfg(feature = "language")]
    (
        ParameterUnknown,
        "The line reads a named parameter that no line has assigned.",
        "Check its name. `EXISTS[#<name>]` says whether there is one.",
    ),
    #[cfg(feature = "language")]
    (
        ParametersFull,
        "All places for parameters are in use: 256 numbers above 30 that are not 0, 64 names with 768 characters together.",
        "Assign 0 to numbers that are no longer needed; use fewer or shorter names.",
    ),
    #[cfg(feature = "language")]
    (
        ExpressionInvalid,
        "A bracket, an operator or a function is wrong or missing. Operators are allowed in brackets only: `X[#1+2]`.",
        "Correct the expression.",
    ),
    #[cfg(feature = "language")]
    (
        ExpressionTooDeep,
        "More than 16 brackets are open, or too many signs follow each other.",
        "Split the expression: assign a part of it to a parameter.",
    ),
    #[cfg(feature = "language")]
    (
        ValueUndefined,
        "A division by zero, a root or a logarithm of a number that has none, or a result that is not finite.",
        "Check the values that the expression gets.",
    ),
    #[cfg(feature = "language")]
    (
        OWordInvalid,
        "The keyword is unknown or lacks something, or no block of its label is open. BREAK and CONTINUE are for WHILE and DO; no SUB may be within a block.",
        "Check the labels, and that each block has its end.",
    ),
    #[cfg(feature = "language")]
    (
        SubUnknown,
        "The line calls a subroutine that has not come since the last M2 or M30.",
        "Send the subroutine before its call.",
    ),
    #[cfg(feature = "language")]
    (
        RecordFull,
        "A loop or a subroutine has more lines than there is room for (4,096 characters), or there are more than 24 subroutines. All is refused up to its end.",
        "Make the loop shorter, or have the CAM program write the moves out. M2 forgets all subroutines.",
    ),
    #[cfg(feature = "language")]
    (
        FlowTooDeep,
        "More than 9 calls or 20 blocks are within each other, or the calls have too many arguments.",
        "Check that a subroutine that calls itself ends.",
    ),
    #[cfg(feature = "language")]
    (
        FlowBroken,
        "A line before this one was refused, so that the loop or subroutine is not complete. All its lines are refused.",
        "Correct the refused line and send the program again. M2 or the end of the loop ends the refusal.",
    ),
    (Alarmed, "An alarm is active.", "See alarms.md. Then `{clear:n}`."),
    (LimitHit, "A limit switch was hit.", "`{clear:n}`, move off the switch, home."),
    (
        ShutDown,
        "The emergency stop is or was pressed, or `{shutd:n}` was sent.",
        "Release the emergency stop, `{clear:n}`, home.",
    ),
    (Panicked, "`{panic:n}` was sent.", "`^x`, home."),
    (KillJob, "`^d` has ended the job.", "Nothing; the position is kept."),
    (
        SoftLimit,
        "The move would leave the travel (`tn` to `tm`). Nothing has moved.",
        "Check the work zero and the size of the job.",
    ),
    (
        HomingFailed,
        "The homing switch was not found, or homing was flushed.",
        "Check direction, switch and travel (alarms.md).",
    ),
    (
        HomingAxis,
        "The line names an axis that cannot be homed.",
        "Name X, Y, Z or A; its `am` must not be 0.",
    ),
    (HomingSearch, "`sv` is 0.", "Set it, for example `{xsv:500}`."),
    (HomingLatch, "`lv` is 0.", "Set it, for example `{xlv:100}`."),
    (
        HomingTravel,
        "`tn` and `tm` are equal and `lb` is 0: the search distance is 0.",
        "Set `tn` and `tm`.",
    ),
    (
        HomingSwitches,
        "The axis has no homing switch, or two.",
        "Set one of `sn` and `sx` to 1 or 3, the other to 0 or 2. For homing by a stall: set `drc1` to 1 and `sqsw` to 0.",
    ),
    (
        HomingClosed,
        "The homing switch stays closed.",
        "Check the switch and `st`; raise `lb`. For homing by a stall: check the jumper of DIAG.",
    ),
    (
        NotHomed,
        "G28 or G30 moves an axis that has to be homed, or Z, and no position was ever stored.",
        "Home: `{home:1}`. Without a switch set the position by G28.3.",
    ),
    (
        ProbeFailed,
        "G38.2 or G38.4: the probe did not change, or had its final state before the move. Or the board has no probe input.",
        "Check `{inp:n}`, then `{clear:n}`, probe again.",
    ),
    (ProbeTooShort, "The probing move is shorter than 0.254 mm.", "Make it longer."),
];

/// Returns the cause and the remedy of a status.
pub fn advice(status: Status) -> Option<(&'static str, &'static str)> {
    ADVICE.iter().find(|(of, ..)| *of == status).map(|(_, cause, cure)| (*cause, *cure))
}

/// Returns all statuses that a sender may receive, in their order.
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
