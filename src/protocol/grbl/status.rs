//! The numbers of errors and alarms.

use crate::capability::Capability;
use crate::progmem;
use crate::status::Status;

/// The error of an unknown `$` command. The errors of these constants do not come from a [`Status`].
pub const UNSUPPORTED: u8 = 3;
/// The error of a command that needs the machine at rest.
pub const BUSY: u8 = 8;
/// The error of G-code that is locked out.
pub const LOCKED: u8 = 9;
/// The error of `$N0=` with a line that is too long.
pub const TOO_LONG: u8 = 14;
/// The error of `$J=` with words that a jog may not have.
pub const BAD_JOG: u8 = 16;

/// The alarm of a probing that begins with the probe already in its final state.
pub const PROBE_CLOSED: u8 = 4;

/// Returns the number of the error for a status; 0 for none.
#[inline(never)]
#[small]
pub fn error_number(status: Status) -> u8 {
    ERRORS.at(status as usize).unwrap_or(1)
}

/// Returns the number of the alarm for an exception; `None` if the exception is not an alarm.
#[small]
pub fn alarm_number(status: Status) -> Option<u8> {
    Some(match status {
        Status::LimitHit => 1,
        // The sender of another port hears of these.
        Status::SoftLimit => 2,
        // Steps were stopped abruptly, the machine has restarted unexpectedly, or another port has begun an alarm.
        Status::ShutDown | Status::Panicked | Status::HardReset | Status::Alarmed => 3,
        // Faults of heaters.
        Status::SensorOpen
        | Status::SensorShort
        | Status::HeatRunaway
        | Status::HeatTooSlow
        | Status::TooHot
        | Status::TooCold
            if Capability::Printer.is_built_in() =>
        {
            3
        }
        #[cfg(feature = "drivers")]
        Status::DriverSilent | Status::DriverUnset | Status::DriverReset | Status::DriverOff => 3,
        Status::ProbeFailed => 5,
        // A reset has interrupted homing.
        Status::Terminated => 6,
        Status::HomingClosed => 8,
        Status::HomingFailed => 9,
        _ => return None,
    })
}

/// A row for each status, in the order of their variants.
macro_rules! rows {
    ($($(#[$only:meta])* $name:ident = $number:literal;)+) => {
        progmem! {
            static ERRORS: [u8; Status::COUNT] = [$($(#[$only])* $number),+];
        }

        const _: () = {
            let order = [$($(#[$only])* (Status::$name as usize)),+];
            let mut row = 0;
            while row < order.len() {
                assert!(order[row] == row, "a row of the table of errors is not in its place");
                row += 1;
            }
        };
    };
}

rows! {
    Ok = 0;
    Error = 3;
    Again = 8;
    Noop = 0;
    Terminated = 0;
    HardReset = 9;
    EndOfFile = 0;
    BufferFull = 11;
    Initializing = 7;
    BootLoader = 8;
    InternalError = 3;
    ExceptionReport = 3;
    PersistenceError = 7;
    StepsLate = 3;
    ProgramStopped = 8;
    ProgramChecked = 8;
    PulseMisfit = 19;
    NoEncoder = 39;
    NoIndex = 18;
    NoSync = 19;
    SpindleLost = 9;
    NoEncoderInput = 40;
    SpindleError = 9;
    NotReversed = 9;
    WrongWay = 19;
    SensorOpen = 9;
    SensorShort = 9;
    HeatRunaway = 9;
    HeatTooSlow = 9;
    TooHot = 9;
    TooCold = 9;
    HeatersLocked = 9;
    #[cfg(feature = "drivers")]
    DriverSilent = 9;
    #[cfg(feature = "drivers")]
    DriverUnset = 9;
    #[cfg(feature = "drivers")]
    DriverReset = 9;
    #[cfg(feature = "drivers")]
    DriverOff = 9;
    #[cfg(feature = "drivers")]
    DriverHot = 9;
    #[cfg(feature = "drivers")]
    DriverOpen = 9;
    CardError = 9;
    #[cfg(feature = "card-write")]
    CardFull = 9;
    UnrecognizedName = 3;
    MalformedCommand = 1;
    BadNumber = 2;
    UnsupportedType = 2;
    ReadOnly = 3;
    CannotRead = 3;
    NotAccepted = 8;
    InputTooLong = 11;
    BelowMinimum = 4;
    AboveMaximum = 12;
    OutOfRange = 33;
    JsonSyntax = 1;
    JsonTooManyPairs = 1;
    TextNested = 1;
    JsonTooDeep = 1;
    Muted = 8;
    NotBuiltIn = 20;
    GcodeGeneric = 1;
    GcodeUnsupported = 20;
    McodeUnsupported = 20;
    ModalGroupViolation = 21;
    AxisWordMissing = 26;
    AxisNotAllowed = 31;
    AxisInvalid = 37;
    AxisDisabled = 20;
    AxisTargetMissing = 26;
    PlaneMissing = 32;
    FeedrateMissing = 22;
    InverseTimeNotAllowed = 22;
    RotaryNotAllowed = 33;
    MachineCoordinatesMotion = 30;
    VelocityExceeded = 12;
    CutterCompensation = 20;
    SWordMissing = 28;
    SWordInvalid = 4;
    SpindleMustTurn = 20;
    ArcSpecification = 33;
    ArcAxisMissing = 32;
    ArcOffsetsMissing = 35;
    ArcRadiusTolerance = 34;
    ArcEndpointIsStart = 33;
    PWordMissing = 28;
    PWordInvalid = 29;
    PWordNegative = 4;
    KWordMissing = 28;
    ToolInvalid = 38;
    KWordInvalid = 33;
    HWordMissing = 28;
    HWordInvalid = 38;
    NoToolLength = 0;
    LWordMissing = 28;
    LWordInvalid = 20;
    QWordMissing = 28;
    QWordInvalid = 4;
    RWordMissing = 28;
    RWordInvalid = 33;
    TWordMissing = 28;
    TWordInvalid = 38;
    WordUnused = 36;
    WordRepeated = 25;
    AxisConflict = 24;
    WordConflict = 24;
    #[cfg(feature = "language")]
    ParameterInvalid = 72;
    #[cfg(feature = "language")]
    ParameterReadOnly = 72;
    #[cfg(feature = "language")]
    ParameterUnknown = 72;
    #[cfg(feature = "language")]
    ParametersFull = 79;
    #[cfg(feature = "language")]
    ExpressionInvalid = 74;
    #[cfg(feature = "language")]
    ExpressionTooDeep = 74;
    #[cfg(feature = "language")]
    ValueUndefined = 75;
    #[cfg(feature = "language")]
    OWordInvalid = 70;
    #[cfg(feature = "language")]
    SubUnknown = 70;
    #[cfg(feature = "language")]
    RecordFull = 79;
    #[cfg(feature = "language")]
    FlowTooDeep = 70;
    #[cfg(feature = "language")]
    FlowBroken = 9;
    Alarmed = 9;
    LimitHit = 9;
    ShutDown = 9;
    Panicked = 9;
    KillJob = 9;
    SoftLimit = 15;
    HomingFailed = 9;
    HomingAxis = 5;
    HomingSearch = 5;
    HomingLatch = 5;
    HomingTravel = 5;
    HomingSwitches = 5;
    HomingClosed = 9;
    NotHomed = 9;
    ProbeFailed = 9;
    ProbeTooShort = 33;
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn errors_have_grbls_numbers() {
        assert_eq!(error_number(Status::Ok), 0);
        assert_eq!(error_number(Status::GcodeUnsupported), 20);
        assert_eq!(error_number(Status::ProbeTooShort), 33);
        assert_eq!(alarm_number(Status::LimitHit), Some(1));
        assert_eq!(alarm_number(Status::Alarmed), Some(3));
        assert_eq!(alarm_number(Status::NotHomed), None);
    }
}
