//! The numbers and texts of statuses. Senders rely on the numbers, so they never change.

use crate::progmem;
use crate::progmem::Text;
use crate::status::Status;
use crate::text;

/// Returns the number of a status.
#[small]
#[inline(never)]
pub fn number(status: Status) -> u8 {
    ROWS.at(status as usize).map_or(0, |(number, _)| number)
}

/// Returns the text of a status; `None` for a status that is shown as its number.
#[small]
pub fn status_text(status: Status) -> Option<Text> {
    ROWS.at(status as usize).map(|(_, text)| text).filter(|text| !text.is_empty())
}

/// A row for each status, in the order of their variants.
macro_rules! rows {
    ($($(#[$only:meta])* $name:ident = $number:literal, $text:literal;)+) => {
        progmem! {
            static ROWS: [(u8, Text); Status::COUNT] = [$($(#[$only])* ($number, text!($text))),+];
        }

        const _: () = {
            let order = [$($(#[$only])* (Status::$name as usize)),+];
            let mut row = 0;
            while row < order.len() {
                assert!(order[row] == row, "a row of the table of statuses is not in its place");
                row += 1;
            }
        };
    };
}

// Senders never see `Again`.
rows! {
    Ok = 0, "OK";
    Error = 1, "Error";
    Again = 2, "";
    Noop = 3, "Noop";
    Terminated = 5, "Terminated";
    HardReset = 6, "Hard reset";
    EndOfFile = 8, "End of file";
    BufferFull = 13, "Buffer full";
    Initializing = 15, "Initializing";
    BootLoader = 16, "Entering boot loader";
    InternalError = 20, "Internal error";
    ExceptionReport = 29, "Generic exception report";
    PersistenceError = 34, "Persistence error";
    StepsLate = 37, "Steps came late";
    ProgramStopped = 38, "Program stopped [~ to resume]";
    ProgramChecked = 39, "Program checked [{chk:0} to end]";
    PulseMisfit = 40, "Spindle pulses do not fit";
    NoEncoder = 41, "No spindle encoder is set up";
    NoIndex = 42, "No index pulse of the spindle";
    NoSync = 43, "No sync pulse of the spindle";
    SpindleLost = 44, "Spindle lost in a thread";
    NoEncoderInput = 45, "The board has no input for a spindle encoder";
    SpindleError = 46, "Thread further off than spl";
    NotReversed = 47, "Spindle did not turn round";
    WrongWay = 55, "Spindle turns the wrong way";
    SensorOpen = 48, "Temperature sensor open";
    SensorShort = 49, "Temperature sensor shorted";
    HeatRunaway = 50, "Heater out of control";
    HeatTooSlow = 51, "Heater does not heat";
    TooHot = 52, "Heater too hot";
    TooCold = 53, "Too cold to extrude";
    HeatersLocked = 54, "Heaters are locked [^x to reset]";
    #[cfg(feature = "drivers")]
    DriverSilent = 57, "Motor driver does not answer";
    #[cfg(feature = "drivers")]
    DriverUnset = 58, "Motor driver without its settings";
    #[cfg(feature = "drivers")]
    DriverReset = 59, "Motor driver was reset: home again";
    #[cfg(feature = "drivers")]
    DriverOff = 60, "Motor driver has switched off";
    #[cfg(feature = "drivers")]
    DriverHot = 61, "Motor driver is hot";
    #[cfg(feature = "drivers")]
    DriverOpen = 62, "Motor wire seems open";
    CardError = 56, "SD card cannot be read";
    #[cfg(feature = "card-write")]
    CardFull = 63, "SD card is full";
    UnrecognizedName = 100, "Unrecognized command or config name";
    MalformedCommand = 101, "Invalid or malformed command";
    BadNumber = 102, "Bad number format";
    UnsupportedType = 103, "Unsupported number or JSON type";
    ReadOnly = 104, "Parameter is read-only";
    CannotRead = 105, "Parameter cannot be read";
    NotAccepted = 106, "Command not accepted at this time";
    InputTooLong = 107, "Input exceeds max length";
    BelowMinimum = 108, "Input less than minimum value";
    AboveMaximum = 109, "Input exceeds maximum value";
    OutOfRange = 110, "Input value range error";
    JsonSyntax = 111, "JSON syntax error";
    JsonTooManyPairs = 112, "JSON input has too many pairs";
    TextNested = 114, "JSON txt fields cannot be nested";
    JsonTooDeep = 115, "JSON maximum nesting depth exceeded";
    Muted = 117, "Another port feeds the machine";
    NotBuiltIn = 118, "Not built into this image";
    GcodeGeneric = 130, "Generic Gcode input error";
    GcodeUnsupported = 131, "Gcode command unsupported";
    McodeUnsupported = 132, "M code unsupported";
    ModalGroupViolation = 133, "Gcode modal group violation";
    AxisWordMissing = 134, "Axis word missing";
    AxisNotAllowed = 135, "Axis cannot be present";
    AxisInvalid = 136, "Axis is invalid for this command";
    AxisDisabled = 137, "Axis is disabled";
    AxisTargetMissing = 138, "Axis target position is missing";
    PlaneMissing = 140, "Selected plane is missing";
    FeedrateMissing = 142, "Feedrate not specified";
    InverseTimeNotAllowed = 143, "Inverse time mode cannot be used with this command";
    RotaryNotAllowed = 144, "Rotary axes cannot be used with this command";
    MachineCoordinatesMotion = 145, "G0 or G1 must be active for G53";
    VelocityExceeded = 146, "Requested velocity exceeds limits";
    CutterCompensation = 147, "Cutter compensation cannot be enabled";
    SWordMissing = 151, "Spindle S word is missing";
    SWordInvalid = 152, "Spindle S word is invalid";
    SpindleMustTurn = 154, "Spindle must be turning for this command";
    ArcSpecification = 155, "Arc specification error";
    ArcAxisMissing = 156, "Arc specification error - missing axis(es)";
    ArcOffsetsMissing = 157, "Arc specification error - missing offset(s)";
    ArcRadiusTolerance = 158, "Arc specification error - radius arc out of tolerance";
    ArcEndpointIsStart = 159, "Arc specification error - endpoint is starting point";
    PWordMissing = 160, "P word is missing";
    PWordInvalid = 161, "P word is invalid";
    PWordNegative = 163, "P word is negative";
    KWordMissing = 164, "K word is missing";
    ToolInvalid = 165, "P word is not a valid tool number";
    KWordInvalid = 166, "K word is invalid";
    HWordMissing = 170, "H word is missing";
    HWordInvalid = 171, "H word is invalid";
    NoToolLength = 180, "Tool has no length - 0 in force";
    LWordMissing = 172, "L word is missing";
    LWordInvalid = 173, "L word is invalid";
    QWordMissing = 174, "Q word is missing";
    QWordInvalid = 175, "Q word is invalid";
    RWordMissing = 176, "R word is missing";
    RWordInvalid = 177, "R word is invalid";
    TWordMissing = 178, "T word is missing";
    TWordInvalid = 179, "T word is invalid";
    WordUnused = 182, "Word belongs to no code of the line";
    WordRepeated = 183, "Word repeated";
    AxisConflict = 184, "Two codes of the line use axis words";
    WordConflict = 185, "Two codes of the line use the same word";
    #[cfg(feature = "language")]
    ParameterInvalid = 186, "No such parameter";
    #[cfg(feature = "language")]
    ParameterReadOnly = 187, "Parameter cannot be assigned";
    #[cfg(feature = "language")]
    ParameterUnknown = 188, "Parameter was never assigned";
    #[cfg(feature = "language")]
    ParametersFull = 189, "No room for another parameter";
    #[cfg(feature = "language")]
    ExpressionInvalid = 190, "Expression cannot be read";
    #[cfg(feature = "language")]
    ExpressionTooDeep = 191, "Expression is too deep";
    #[cfg(feature = "language")]
    ValueUndefined = 192, "Expression has no value";
    #[cfg(feature = "language")]
    OWordInvalid = 193, "O word cannot be read or is out of place";
    #[cfg(feature = "language")]
    SubUnknown = 194, "No subroutine of this label";
    #[cfg(feature = "language")]
    RecordFull = 195, "No room to record the line";
    #[cfg(feature = "language")]
    FlowTooDeep = 196, "Too many blocks or calls within each other";
    #[cfg(feature = "language")]
    FlowBroken = 197, "A line of this loop or subroutine was refused";
    Alarmed = 203, "Machine is alarmed - Command not processed";
    LimitHit = 204, "Limit switch hit - Shutdown occurred";
    ShutDown = 205, "Shut down [$clear to reset]";
    Panicked = 206, "Panic [^x to reset]";
    KillJob = 207, "Kill job";
    SoftLimit = 220, "Soft limit exceeded";
    HomingFailed = 240, "Homing cycle failed";
    HomingAxis = 241, "Homing Error - Bad or no axis specified";
    HomingSearch = 242, "Homing Error - Search velocity is zero";
    HomingLatch = 243, "Homing Error - Latch velocity is zero";
    HomingTravel = 244, "Homing Error - Travel min & max are the same";
    HomingSwitches = 246, "Homing Error - Homing switches misconfigured";
    HomingClosed = 247, "Homing Error - Homing switch stays closed";
    NotHomed = 248, "Position was never stored - home first";
    ProbeFailed = 250, "Probe cycle failed";
    ProbeTooShort = 251, "Probe endpoint is starting point";
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn each_status_has_a_number_of_its_own() {
        let numbers: HashSet<u8> = ROWS.get().iter().map(|(number, _)| *number).collect();
        assert_eq!(numbers.len(), Status::COUNT);
        assert_eq!((number(Status::Ok), number(Status::ProbeTooShort)), (0, 251));
        assert!(status_text(Status::Again).is_none());
    }
}
