//! The rules that apply to every line.

#[cfg(feature = "language")]
use super::language;
use super::{On, Rule, no, no_on};
use crate::status::Status::{
    AxisConflict, AxisNotAllowed, BadNumber, GcodeUnsupported, InputTooLong, MalformedCommand,
    McodeUnsupported, ModalGroupViolation, OutOfRange, SWordInvalid, SoftLimit, TWordInvalid,
    WordConflict, WordRepeated, WordUnused,
};

pub const RULES: &[Rule] = &[
    Rule {
        title: "Lines",
        text: "A line consists of words and comments. It has at most 254 bytes, on the second port 79. Upper and lower case \
mean the same. Blanks may stand anywhere, even inside numbers. Words may stand in any order. An empty line has \
no effect. A byte order mark of UTF-8 at the beginning of a line is ignored. The bytes `!`, 4 (`^d`), 5 and 24 (`^x`) act anywhere in a line, even \
in comments. `%` and `~` act anywhere except in comments. None of these bytes is part of a line.",
        refusals: &[no(InputTooLong, &[LONG]), no(MalformedCommand, &["G0 *X1"])],
    },
    Rule {
        title: "Program names",
        text: "`%` at the beginning of a line marks the beginning or the end of a program and has no effect. Text behind it \
that is no G-code is a name, as in `%prog1`, and has no effect either; G-code behind it runs. O and a number, as in \
`O0001 (PART)`, have no effect. O words with a keyword, such as `O100 SUB`, need the capability `language`. In a hold `%` discards the \
queue, and what follows is a line of its own.",
        refusals: &[no(MalformedCommand, &["G0 X1 %"])],
    },
    Rule {
        title: "Words",
        text: "A word is a letter and a decimal number, such as `X-1.5`, without an exponent. With the capability `language` a \
parameter or an expression may stand in place of the number, except after N. Lengths are exact to 0.0001 mm or degree.",
        refusals: &[
            no(MalformedCommand, &["G0 X1.2.3"]),
            no(BadNumber, &["G0 X"]),
            no(OutOfRange, &["G0 X214749"]),
            no(GcodeUnsupported, &["G0 X1 U1"]),
            no(WordRepeated, &["G0 X1 X2"]),
        ],
    },
    #[cfg(feature = "language")]
    language::PARAMETERS,
    #[cfg(feature = "language")]
    language::LIVE,
    #[cfg(feature = "language")]
    language::EXPRESSIONS,
    Rule {
        title: "Codes",
        text: "A line may have one code of each modal group. A modal code stays active until another code of its group comes. \
Each word must belong to a code of the line or to the active motion mode. No word may belong to two codes.",
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
        text: "A move must end within 214 m of machine zero. With `{sl:1}` a move must stay within the travel of each homed \
axis that it moves. An axis outside its travel may move back in.",
        refusals: &[
            no(OutOfRange, &["G0 X200000", "G91 X200000"]),
            no_on(On::SoftLimits, SoftLimit, &["G28.3 X0", "G0 X-1"]),
        ],
    },
    Rule {
        title: "F",
        text: "The feed rate, in the active units of its own line; see G93, G94 and G95. F stays active until another F, a \
change of the feed mode, or M2. With G93 F applies to its own line only. F0 means no feed rate. A move is slower \
than F if an axis cannot follow.",
        refusals: &[no(OutOfRange, &["F-1"])],
    },
    Rule {
        title: "S",
        text: "The spindle speed in RPM. S does not switch the spindle on. S stays active.",
        refusals: &[no(SWordInvalid, &["S-1"])],
    },
    Rule {
        title: "T",
        text: "The tool for the next M6, 0 to 65,535. T has no other effect. Tools 1 to 10 have lengths; see G43.",
        refusals: &[
            no(TWordInvalid, &["T65536"]),
            no(TWordInvalid, &["T1.5"]),
            no(TWordInvalid, &["T-1"]),
        ],
    },
    Rule {
        title: "N",
        text: "The line number for reports, a whole number. Lines run in the order of arrival, whatever their numbers.",
        refusals: &[
            no(BadNumber, &["N1.5"]),
            no(OutOfRange, &["N-1"]),
            no(OutOfRange, &["N16777216"]),
        ],
    },
    Rule {
        title: "Comments",
        text: "A comment goes from `(` to `)`, or from `;` to the end of the line. Parentheses within parentheses count in \
pairs: `(1/8 bit (flat))`. A comment that is not closed goes to the end of the line; it is refused if text stands \
behind a comment within it, because that text may be words. If a comment begins with `MSG`, the response contains \
the text after it.",
        refusals: &[no(MalformedCommand, &["G0 X1)"]), no(MalformedCommand, &["G0 X1 (a (b) Y1"])],
    },
    #[cfg(feature = "language")]
    language::FLOW,
    #[cfg(feature = "language")]
    language::TELLING,
    Rule {
        title: "Block delete",
        text: "A line that begins with `/` is skipped without a check and answered with status 3. With `{bd:0}` the slash has \
no effect.",
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
