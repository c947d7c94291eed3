//! Status codes: what a line's response carries, and what a fault is called.
//!
//! The numbers are TinyG's (dialect A); senders know them by heart, so they never change. Texts are
//! for people; they live in program memory (`protocol`).

/// The outcome of a line, or of an internal operation.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum Status {
    Ok = 0,
    Error = 1,
    Noop = 3,
    BufferFull = 13,
    Initializing = 15,
    InternalError = 20,
    ExceptionReport = 29,
    UnrecognizedName = 100,
    MalformedCommand = 101,
    BadNumber = 102,
    UnsupportedType = 103,
    ReadOnly = 104,
    CannotRead = 105,
    NotAccepted = 106,
    InputTooLong = 107,
    BelowMinimum = 108,
    AboveMaximum = 109,
    OutOfRange = 110,
    JsonSyntax = 111,
    JsonTooManyPairs = 112,
    GcodeGeneric = 130,
    GcodeUnsupported = 131,
    McodeUnsupported = 132,
    ModalGroupViolation = 133,
    AxisWordMissing = 134,
    AxisNotAllowed = 135,
    AxisInvalid = 136,
    AxisDisabled = 137,
    AxisTargetMissing = 138,
    PlaneMissing = 140,
    FeedrateMissing = 142,
    InverseTimeNotAllowed = 143,
    VelocityExceeded = 146,
    ArcSpecification = 155,
    ArcAxisMissing = 156,
    ArcOffsetsMissing = 157,
    ArcRadiusTolerance = 158,
    ArcEndpointIsStart = 159,
    PWordMissing = 160,
    PWordInvalid = 161,
    PWordNegative = 163,
    Alarmed = 203,
    LimitHit = 204,
    SoftLimit = 220,
}
