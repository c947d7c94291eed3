//! Texts for people: why a line was refused.

use super::command;
use crate::progmem::Text;
use crate::status::Status;
use crate::text;

/// Whether the status means that a block is unknown. A move that cannot be read is not: it is an error. Nor is the
/// value of a setting.
#[small]
pub fn is_unknown(status: Status, block: &[u8]) -> bool {
    let unknown = matches!(
        status,
        Status::GcodeUnsupported
            | Status::McodeUnsupported
            | Status::MalformedCommand
            | Status::BadNumber
            | Status::NotBuiltIn
            | Status::UnrecognizedName
    );
    let is_value = status == Status::BadNumber && block.first() == Some(&b'$');
    unknown && !is_value && !command::may_move(block)
}

/// Whether a print continues after the refusal of this line: the line is no move, no heater stays cold because of it,
/// and there is no alarm. Such a refusal is not reported as `Error:`, because hosts disconnect when they read that.
#[inline(never)]
#[small]
pub fn is_passed_over(status: Status, block: &[u8]) -> bool {
    let moves = match command::code(block) {
        // The temperature of an extruder that is not there.
        Some((b'G', 10)) => status != Status::ToolInvalid,
        Some((b'G', _)) => true,
        _ => block.is_empty() || command::may_move(block),
    };
    let of_words = Status::CardError as u8..=Status::WordConflict as u8;
    let stops = matches!(status, Status::AboveMaximum | Status::AxisConflict);
    !moves && of_words.contains(&(status as u8)) && !stops
}

/// Returns the reason as text.
#[inline(never)]
#[small]
pub fn reason(status: Status) -> Text {
    match status {
        Status::ShutDown => text!("stopped; M999 goes on"),
        Status::Alarmed => text!("alarm; M999 goes on"),
        Status::LimitHit => text!("limit switch hit; M999 goes on"),
        Status::Panicked => text!("internal fault; reset"),
        Status::SoftLimit => text!("beyond a soft limit, not carried out"),
        Status::OutOfRange
        | Status::BelowMinimum
        | Status::AboveMaximum
        | Status::SWordInvalid
        | Status::PWordInvalid
        | Status::PWordNegative
        | Status::KWordInvalid
        | Status::HWordInvalid
        | Status::LWordInvalid
        | Status::QWordInvalid
        | Status::RWordInvalid => {
            text!("number out of range, not carried out")
        }
        Status::MalformedCommand | Status::BadNumber | Status::GcodeGeneric => {
            text!("malformed, not carried out")
        }
        Status::HomingSwitches => text!("no homing switch"),
        Status::HomingFailed | Status::HomingClosed => text!("homing failed"),
        Status::NotAccepted => text!("not possible now"),
        Status::Terminated | Status::KillJob => text!("dropped"),
        Status::InputTooLong => text!("line too long"),
        Status::BufferFull => text!("bytes were lost"),
        Status::Muted => text!("another port prints"),
        Status::WordUnused
        | Status::WordRepeated
        | Status::WordConflict
        | Status::AxisNotAllowed
        | Status::AxisInvalid
        | Status::AxisDisabled => text!("a word belongs to no code"),
        Status::ToolInvalid | Status::TWordInvalid => text!("no such extruder"),
        Status::SensorOpen => text!("temperature sensor open"),
        Status::SensorShort => text!("temperature sensor shorted"),
        Status::HeatRunaway => text!("heater out of control"),
        Status::HeatTooSlow => text!("heater does not heat"),
        Status::TooHot => text!("heater too hot"),
        Status::TooCold => text!("too cold to extrude"),
        Status::HeatersLocked => text!("heaters are locked; M999 unlocks them"),
        Status::CardError => text!("SD card cannot be read"),
        #[cfg(feature = "card-write")]
        Status::CardFull => text!("SD card is full"),
        #[cfg(feature = "drivers")]
        Status::DriverSilent => text!("motor driver does not answer; no motor power?"),
        #[cfg(feature = "drivers")]
        Status::DriverUnset => text!("motor driver has not taken its settings"),
        #[cfg(feature = "drivers")]
        Status::DriverReset => text!("motor driver was reset, position lost"),
        #[cfg(feature = "drivers")]
        Status::DriverOff => text!("motor driver has switched off; M122"),
        #[cfg(feature = "drivers")]
        Status::DriverHot => text!("motor driver is hot; M122"),
        #[cfg(feature = "drivers")]
        Status::DriverOpen => text!("motor wire seems open; M122"),
        Status::ProbeFailed | Status::ProbeTooShort => text!("probing failed"),
        Status::AxisConflict | Status::ModalGroupViolation => {
            text!("more than one code in the line")
        }
        Status::GcodeUnsupported | Status::McodeUnsupported | Status::NotBuiltIn => {
            text!("unknown code")
        }
        Status::AxisWordMissing
        | Status::AxisTargetMissing
        | Status::FeedrateMissing
        | Status::SWordMissing
        | Status::ArcAxisMissing
        | Status::ArcOffsetsMissing
        | Status::PWordMissing
        | Status::KWordMissing
        | Status::HWordMissing
        | Status::LWordMissing
        | Status::QWordMissing
        | Status::RWordMissing
        | Status::TWordMissing => text!("a word is missing"),
        Status::ArcSpecification | Status::ArcRadiusTolerance | Status::ArcEndpointIsStart => {
            text!("impossible arc")
        }
        Status::MachineCoordinatesMotion
        | Status::InverseTimeNotAllowed
        | Status::RotaryNotAllowed
        | Status::PlaneMissing
        | Status::CutterCompensation => text!("not possible in this mode"),
        Status::NoEncoder => text!("no spindle encoder"),
        Status::SpindleMustTurn => text!("spindle must turn"),
        Status::NotHomed => text!("not homed"),
        Status::PersistenceError => text!("memory is full"),
        _ => text!("not carried out"),
    }
}
