//! M codes of printers.

use super::{Section, m, no};
use crate::status::Status::{
    AboveMaximum, ModalGroupViolation, OutOfRange, PWordInvalid, SWordInvalid, SWordMissing,
    TWordInvalid, WordConflict,
};

pub const HEATING: Section = Section {
    title: "Heaters and fan",
    intro: "Of printers ([printing.md](printing.md)). Each has a line without moves. Switched in turn with the moves, which go on over it; \
a wait begins when the moves before it have been made, and keeps the lines behind it back. Stops and questions act meanwhile. Temperatures are in degrees \
Celsius, of which eighths are kept.",
    docs: &[
        m(
            1_040,
            "Heat the hot end",
            "To S degrees; S0: off. T0 may name it. Refused above the maximum of its settings, and while a fault has locked the heaters (54).",
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
            "Heat the hot end and wait",
            "To S degrees, until it is as hot or hotter; or to R degrees, until it has come to it from either side. Without both it waits for what has been set. \
0 waits for nothing.",
            &[no(WordConflict, &["M109 S200 R200"]), no(AboveMaximum, &["M109 S300"])],
        ),
        m(
            1_400,
            "Heat the bed",
            "As M104.",
            &[no(SWordMissing, &["M140"]), no(AboveMaximum, &["M140 S300"])],
        ),
        m(
            1_900,
            "Heat the bed and wait",
            "As M109.",
            &[no(WordConflict, &["M190 S60 R60"]), no(AboveMaximum, &["M190 S300"])],
        ),
        m(1_160, "Wait for all heaters", "Until each that is on has come to its temperature.", &[]),
        m(
            1_060,
            "Fan",
            "As fast as S says, 0 to 255 for all it can, which it is without S and above 255. P0 may name it.",
            &[no(PWordInvalid, &["M106 P1"]), no(SWordInvalid, &["M106 S-1"])],
        ),
        m(1_070, "Fan off", "As M106 S0.", &[no(PWordInvalid, &["M107 P1"])]),
    ],
};
