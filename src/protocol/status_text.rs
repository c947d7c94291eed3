//! The texts of status codes, for people.

use crate::progmem;
use crate::progmem::Text;
use crate::status::Status;
use crate::text;

/// The text of a status; `None` for one that prints its number.
pub fn status_text(status: Status) -> Option<Text> {
    (0..TEXTS.len()).find_map(|i| TEXTS.at(i).filter(|(code, _)| *code == status)).map(|(_, t)| t)
}

const ENTRIES: usize = 82;

progmem! {
    static TEXTS: [(Status, Text); ENTRIES] = [
        (Status::Ok, text!("OK")),
        (Status::Error, text!("Error")),
        (Status::Noop, text!("Noop")),
        (Status::Terminated, text!("Terminated")),
        (Status::EndOfFile, text!("End of file")),
        (Status::BufferFull, text!("Buffer full")),
        (Status::Initializing, text!("Initializing")),
        (Status::BootLoader, text!("Entering boot loader")),
        (Status::InternalError, text!("Internal error")),
        (Status::ExceptionReport, text!("Generic exception report")),
        (Status::PersistenceError, text!("Persistence error")),
        (Status::UnrecognizedName, text!("Unrecognized command or config name")),
        (Status::MalformedCommand, text!("Invalid or malformed command")),
        (Status::BadNumber, text!("Bad number format")),
        (Status::UnsupportedType, text!("Unsupported number or JSON type")),
        (Status::ReadOnly, text!("Parameter is read-only")),
        (Status::CannotRead, text!("Parameter cannot be read")),
        (Status::NotAccepted, text!("Command not accepted at this time")),
        (Status::InputTooLong, text!("Input exceeds max length")),
        (Status::BelowMinimum, text!("Input less than minimum value")),
        (Status::AboveMaximum, text!("Input exceeds maximum value")),
        (Status::OutOfRange, text!("Input value range error")),
        (Status::JsonSyntax, text!("JSON syntax error")),
        (Status::JsonTooManyPairs, text!("JSON input has too many pairs")),
        (Status::TextNested, text!("JSON txt fields cannot be nested")),
        (Status::JsonTooDeep, text!("JSON maximum nesting depth exceeded")),
        (Status::Muted, text!("Another port feeds the machine")),
        (Status::GcodeGeneric, text!("Generic Gcode input error")),
        (Status::GcodeUnsupported, text!("Gcode command unsupported")),
        (Status::McodeUnsupported, text!("M code unsupported")),
        (Status::ModalGroupViolation, text!("Gcode modal group violation")),
        (Status::AxisWordMissing, text!("Axis word missing")),
        (Status::AxisNotAllowed, text!("Axis cannot be present")),
        (Status::AxisInvalid, text!("Axis is invalid for this command")),
        (Status::AxisDisabled, text!("Axis is disabled")),
        (Status::AxisTargetMissing, text!("Axis target position is missing")),
        (Status::PlaneMissing, text!("Selected plane is missing")),
        (Status::FeedrateMissing, text!("Feedrate not specified")),
        (
            Status::InverseTimeNotAllowed,
            text!("Inverse time mode cannot be used with this command"),
        ),
        (Status::RotaryNotAllowed, text!("Rotary axes cannot be used with this command")),
        (Status::MachineCoordinatesMotion, text!("G0 or G1 must be active for G53")),
        (Status::VelocityExceeded, text!("Requested velocity exceeds limits")),
        (Status::CutterCompensation, text!("Cutter compensation cannot be enabled")),
        (Status::SWordMissing, text!("Spindle S word is missing")),
        (Status::SWordInvalid, text!("Spindle S word is invalid")),
        (Status::SpindleMustTurn, text!("Spindle must be turning for this command")),
        (Status::ArcSpecification, text!("Arc specification error")),
        (Status::ArcAxisMissing, text!("Arc specification error - missing axis(es)")),
        (Status::ArcOffsetsMissing, text!("Arc specification error - missing offset(s)")),
        (
            Status::ArcRadiusTolerance,
            text!("Arc specification error - radius arc out of tolerance"),
        ),
        (
            Status::ArcEndpointIsStart,
            text!("Arc specification error - endpoint is starting point"),
        ),
        (Status::PWordMissing, text!("P word is missing")),
        (Status::PWordInvalid, text!("P word is invalid")),
        (Status::PWordNegative, text!("P word is negative")),
        (Status::ToolInvalid, text!("P word is not a valid tool number")),
        (Status::HWordMissing, text!("H word is missing")),
        (Status::HWordInvalid, text!("H word is invalid")),
        (Status::LWordMissing, text!("L word is missing")),
        (Status::LWordInvalid, text!("L word is invalid")),
        (Status::QWordMissing, text!("Q word is missing")),
        (Status::QWordInvalid, text!("Q word is invalid")),
        (Status::RWordMissing, text!("R word is missing")),
        (Status::RWordInvalid, text!("R word is invalid")),
        (Status::TWordMissing, text!("T word is missing")),
        (Status::TWordInvalid, text!("T word is invalid")),
        (Status::WordUnused, text!("Word belongs to no code of the line")),
        (Status::WordRepeated, text!("Word repeated")),
        (Status::AxisConflict, text!("Two codes of the line use axis words")),
        (Status::WordConflict, text!("Two codes of the line use the same word")),
        (Status::Alarmed, text!("Machine is alarmed - Command not processed")),
        (Status::LimitHit, text!("Limit switch hit - Shutdown occurred")),
        (Status::KillJob, text!("Kill job")),
        (Status::SoftLimit, text!("Soft limit exceeded")),
        (Status::HomingFailed, text!("Homing cycle failed")),
        (Status::HomingAxis, text!("Homing Error - Bad or no axis specified")),
        (Status::HomingSearch, text!("Homing Error - Search velocity is zero")),
        (Status::HomingLatch, text!("Homing Error - Latch velocity is zero")),
        (Status::HomingTravel, text!("Homing Error - Travel min & max are the same")),
        (Status::HomingSwitches, text!("Homing Error - Homing switches misconfigured")),
        (Status::HomingClosed, text!("Homing Error - Homing switch stays closed")),
        (Status::ProbeFailed, text!("Probe cycle failed")),
        (Status::ProbeTooShort, text!("Probe endpoint is starting point")),
    ];
}
