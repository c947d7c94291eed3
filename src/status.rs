//! Statuses: what comes of a line, and what a fault is called.
//!
//! Numbers and texts are the dialects': each spells a status in its own way (`protocol`).

/// The outcome of a line, or of an internal operation.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum Status {
    Ok,
    Error,
    /// Not now: the line is tried again. No sender gets to see it.
    Again,
    Noop,
    Terminated,
    HardReset,
    EndOfFile,
    BufferFull,
    Initializing,
    BootLoader,
    InternalError,
    ExceptionReport,
    PersistenceError,
    StepsLate,
    ProgramStopped,
    ProgramChecked,
    UnrecognizedName,
    MalformedCommand,
    BadNumber,
    UnsupportedType,
    ReadOnly,
    CannotRead,
    NotAccepted,
    InputTooLong,
    BelowMinimum,
    AboveMaximum,
    OutOfRange,
    JsonSyntax,
    JsonTooManyPairs,
    TextNested,
    JsonTooDeep,
    Muted,
    NotBuiltIn,
    GcodeGeneric,
    GcodeUnsupported,
    McodeUnsupported,
    ModalGroupViolation,
    AxisWordMissing,
    AxisNotAllowed,
    AxisInvalid,
    AxisDisabled,
    AxisTargetMissing,
    PlaneMissing,
    FeedrateMissing,
    InverseTimeNotAllowed,
    RotaryNotAllowed,
    MachineCoordinatesMotion,
    VelocityExceeded,
    CutterCompensation,
    SWordMissing,
    SWordInvalid,
    SpindleMustTurn,
    ArcSpecification,
    ArcAxisMissing,
    ArcOffsetsMissing,
    ArcRadiusTolerance,
    ArcEndpointIsStart,
    PWordMissing,
    PWordInvalid,
    PWordNegative,
    ToolInvalid,
    HWordMissing,
    HWordInvalid,
    NoToolLength,
    LWordMissing,
    LWordInvalid,
    QWordMissing,
    QWordInvalid,
    RWordMissing,
    RWordInvalid,
    TWordMissing,
    TWordInvalid,
    WordUnused,
    WordRepeated,
    AxisConflict,
    WordConflict,
    Alarmed,
    LimitHit,
    ShutDown,
    Panicked,
    KillJob,
    SoftLimit,
    HomingFailed,
    HomingAxis,
    HomingSearch,
    HomingLatch,
    HomingTravel,
    HomingSwitches,
    HomingClosed,
    NotHomed,
    ProbeFailed,
    ProbeTooShort,
}

impl Status {
    /// How many there are.
    pub const COUNT: usize = Status::ProbeTooShort as usize + 1;

    /// Whether it says why an axis, which exceptions name, could not be homed.
    pub fn names_axis(self) -> bool {
        let says = self as u8;
        let homing = Status::HomingFailed as u8..=Status::HomingClosed as u8;
        homing.contains(&says) && self != Status::HomingAxis
    }
}
