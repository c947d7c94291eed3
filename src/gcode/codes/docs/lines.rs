//! The rules that apply to every line.

use super::{On, Rule, no, no_on};
use crate::status::Status::{
    AxisConflict, AxisNotAllowed, BadNumber, GcodeUnsupported, InputTooLong, MalformedCommand,
    McodeUnsupported, ModalGroupViolation, OutOfRange, SWordInvalid, SoftLimit, TWordInvalid,
    WordConflict, WordRepeated, WordUnused,
};

pub const RULES: &[Rule] = &[
    Rule {
        title: "Lines",
        text: "A line is words and comments, at most 254 bytes, 79 on the second port. Upper and lower case are the same, blanks may stand \
anywhere, inside numbers too, and words in any order. An empty line does nothing, and so does `%` alone. The \
bytes `!`, 4, 5 and 24 act wherever they stand, in comments too, and `%` and `~` anywhere but in comments; none of \
them is part of any line.",
        refusals: &[no(InputTooLong, &[LONG]), no(MalformedCommand, &["G0 *X1"])],
    },
    Rule {
        title: "Words",
        text: "A letter and a number: sign, digits, point, digits. No exponents, expressions or parameters. Lengths \
are exact to a ten-thousandth of a millimetre or degree.",
        refusals: &[
            no(MalformedCommand, &["G0 X1.2.3"]),
            no(BadNumber, &["G0 X"]),
            no(OutOfRange, &["G0 X214749"]),
            no(GcodeUnsupported, &["G0 X1 U1"]),
            no(WordRepeated, &["G0 X1 X2"]),
        ],
    },
    Rule {
        title: "Codes",
        text: "A line may have one code of each modal group. Each word has to belong to a code of the line, or to the \
motion mode in force; two codes cannot use the same one.",
        refusals: &[
            no(GcodeUnsupported, &["G5"]),
            no(McodeUnsupported, &["M77"]),
            no(ModalGroupViolation, &["G0 G1 X1"]),
            no(AxisNotAllowed, &["X1"]),
            no(WordUnused, &["G0 X1 Q1"]),
            no(AxisConflict, &["G0 G92 X1"]),
            no(WordConflict, &["G4 G82 X1 Z-1 R1 P1 F100"]),
        ],
    },
    Rule {
        title: "Moves",
        text: "A move has to end within the range of a position, 214 m. With `{sl:1}` it has to stay within the travel \
of homed axes; an axis that is outside may come back in.",
        refusals: &[
            no(OutOfRange, &["G0 X200000", "G91 X200000"]),
            no_on(On::SoftLimits, SoftLimit, &["G28.3 X0", "G0 X-1"]),
        ],
    },
    Rule {
        title: "F",
        text: "The feed rate, in the units in force on its own line; see G93, G94 and G95. Stays in force until another \
F, a change of the feed mode, or M2; with G93 it is for its line alone. F0 is none. Axes that cannot \
follow lower it.",
        refusals: &[no(OutOfRange, &["F-1"])],
    },
    Rule {
        title: "S",
        text: "The speed of the spindle, turns a minute. Does not turn it on. Stays in force.",
        refusals: &[no(SWordInvalid, &["S-1"])],
    },
    Rule {
        title: "T",
        text: "The tool that the next M6 changes to, 0 to 255. Does nothing by itself.",
        refusals: &[
            no(TWordInvalid, &["T256"]),
            no(TWordInvalid, &["T1.5"]),
            no(TWordInvalid, &["T-1"]),
        ],
    },
    Rule {
        title: "N",
        text: "The number of the line, a whole one, for reports. Lines are carried out in the order they come.",
        refusals: &[
            no(BadNumber, &["N1.5"]),
            no(OutOfRange, &["N-1"]),
            no(OutOfRange, &["N16777216"]),
        ],
    },
    Rule {
        title: "Comments",
        text: "From `(` to `)`, and from `;` to the end of the line. The text behind `MSG` at the beginning of one \
comes back with the response.",
        refusals: &[no(MalformedCommand, &["G0 X1)"])],
    },
    Rule {
        title: "Block delete",
        text: "A line that begins with `/` is not carried out, nor looked at, and answered with status 3. With `{bd:0}` the \
slash means nothing.",
        refusals: &[],
    },
];

/// A line of 256 bytes.
const LONG: &str = concat!(
    "G0 X1 (0123456789012345678901234567890123456789012345678901234567890123456789",
    "01234567890123456789012345678901234567890123456789012345678901234567890123456789",
    "01234567890123456789012345678901234567890123456789012345678901234567890123456789",
    "01234567890123456789)"
);
