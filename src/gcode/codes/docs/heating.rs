//! M codes of printers.

use super::{Section, m, no};
use crate::status::Status::{
    AboveMaximum, ModalGroupViolation, OutOfRange, PWordInvalid, SWordInvalid, SWordMissing,
    TWordInvalid, WordConflict,
};

pub const HEATING: Section = Section {
    title: "Heaters and fan",
    intro: "For printers ([printing.md](printing.md)). Each code needs a line without moves. It acts in sequence with the \
moves and does not stop them. A wait begins after the earlier moves and holds back the later lines. Stops and \
queries act during a wait. Temperatures are in degrees Celsius and stored in eighths.",
    docs: &[
        m(
            1_040,
            "Set hot end temperature",
            "Sets the target to S degrees; S0 is off. T0 is allowed. Refused above the maximum of the settings, and while a \
fault has locked the heaters (54).",
            &[
                no(SWordMissing, &["M104"]),
                no(OutOfRange, &["M104 S-1"]),
                no(AboveMaximum, &["M104 S300"]),
                no(TWordInvalid, &["M104 T1 S200"]),
                no(ModalGroupViolation, &["M104 S200 G0 X1"]),
            ],
        ),
        m(
            1_090,
            "Set hot end temperature and wait",
            "With S, sets the target and waits until the temperature reaches or exceeds it. With R, sets the target and waits \
for heating or cooling to it. Without both, waits for the present target. With a target of 0 there is no wait.",
            &[no(WordConflict, &["M109 S200 R200"]), no(AboveMaximum, &["M109 S300"])],
        ),
        m(
            1_400,
            "Set bed temperature",
            "As M104.",
            &[no(SWordMissing, &["M140"]), no(AboveMaximum, &["M140 S300"])],
        ),
        m(
            1_900,
            "Set bed temperature and wait",
            "As M109.",
            &[no(WordConflict, &["M190 S60 R60"]), no(AboveMaximum, &["M190 S300"])],
        ),
        m(
            1_160,
            "Wait for all heaters",
            "Waits until each heater that is on has reached its target.",
            &[],
        ),
        m(
            1_060,
            "Fan speed",
            "S is the speed, 0 to 255. The fan runs at full speed without S and with S above 255. P0 is allowed.",
            &[no(PWordInvalid, &["M106 P1"]), no(SWordInvalid, &["M106 S-1"])],
        ),
        m(1_070, "Fan off", "As M106 S0.", &[no(PWordInvalid, &["M107 P1"])]),
    ],
};
