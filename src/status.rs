//! Statuses: the results of lines, and the names of faults.
//!
//! A status has no number and no text here. Each dialect has its own (`protocol`).

/// The outcome of a line, or of an internal operation.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum Status {
    Ok,
    Error,
    /// The line cannot be carried out yet and is tried again later. Never sent to a sender.
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
    PulseMisfit,
    NoEncoder,
    NoIndex,
    NoSync,
    SpindleLost,
    NoEncoderInput,
    SpindleError,
    NotReversed,
    WrongWay,
    SensorOpen,
    SensorShort,
    HeatRunaway,
    HeatTooSlow,
    TooHot,
    TooCold,
    HeatersLocked,
    /// A motor's driver does not answer on its UART.
    #[cfg(feature = "drivers")]
    DriverSilent,
    /// A motor's driver has not taken its settings.
    #[cfg(feature = "drivers")]
    DriverUnset,
    /// A motor's driver has reset, so that its motor may stand elsewhere.
    #[cfg(feature = "drivers")]
    DriverReset,
    /// A motor's driver has switched its motor off.
    #[cfg(feature = "drivers")]
    DriverOff,
    #[cfg(feature = "drivers")]
    DriverHot,
    #[cfg(feature = "drivers")]
    DriverOpen,
    CardError,
    /// No room on the SD card for a file, or for its entry.
    #[cfg(feature = "card-write")]
    CardFull,
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
    KWordMissing,
    ToolInvalid,
    KWordInvalid,
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
    #[cfg(feature = "language")]
    ParameterInvalid,
    #[cfg(feature = "language")]
    ParameterReadOnly,
    #[cfg(feature = "language")]
    ParameterUnknown,
    #[cfg(feature = "language")]
    ParametersFull,
    #[cfg(feature = "language")]
    ExpressionInvalid,
    #[cfg(feature = "language")]
    ExpressionTooDeep,
    #[cfg(feature = "language")]
    ValueUndefined,
    #[cfg(feature = "language")]
    OWordInvalid,
    #[cfg(feature = "language")]
    SubUnknown,
    #[cfg(feature = "language")]
    RecordFull,
    #[cfg(feature = "language")]
    FlowTooDeep,
    #[cfg(feature = "language")]
    FlowBroken,
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
    /// The number of statuses.
    pub const COUNT: usize = Status::ProbeTooShort as usize + 1;

    /// Whether the status says why an axis could not be homed. Exception reports with such a status name the axis.
    pub fn names_axis(self) -> bool {
        let says = self as u8;
        let homing = Status::HomingFailed as u8..=Status::HomingClosed as u8;
        homing.contains(&says) && self != Status::HomingAxis
    }
}
