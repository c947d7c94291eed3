//! The rules of parameters and expressions.

use super::{Rule, no};
use crate::status::Status::{
    BadNumber, ExpressionInvalid, ExpressionTooDeep, GcodeUnsupported, MalformedCommand,
    OWordInvalid, ParameterInvalid, ParameterReadOnly, ParameterUnknown, SubUnknown,
    ValueUndefined,
};

pub const PARAMETERS: Rule = Rule {
    title: "Parameters",
    text: "With the capability `language`, `#5` is the value of a numbered parameter, 1 to 5601, and `#<name>` that of a named \
one. `#5=2` and `#<name>=2` assign. A number that was never assigned is 0; a name must be assigned before it is read. \
Case and blanks in names do not count. `##5` and `#[#5+1]` are parameters whose number is a value. All values of a line are \
read before anything is assigned: `#1=2 X#1` moves to the old value. What a line assigns twice has the last value. A \
refused line assigns nothing. Parameters last until power-off: no reset and no end of a program changes them. There is \
room for 256 numbers above 30 that are not 0, and for 64 names of together 768 characters. A whole number may be off \
by 0.0001.",
    refusals: &[
        no(ParameterInvalid, &["#5602=1"]),
        no(ParameterInvalid, &["#1=#1.5"]),
        no(ParameterUnknown, &["G0 X#<width>"]),
        no(ExpressionInvalid, &["#<width"]),
        no(BadNumber, &["#1=5 N#1"]),
    ],
};

pub const LIVE: Rule = Rule {
    title: "Parameters of the machine",
    text: "These show the state after the line before, and cannot be assigned. In mm: #5081 to #5086 the tool length in force, \
#5161 and #5181 the positions of G28 and G30, #5211 the offsets of G92 (#5210: whether in force), #5221, #5241 to #5381 the \
coordinate systems (#5220: the number of the active one), #5401 the offsets of the tool in the spindle (#5400: its number); \
each for X, and the numbers behind it for the other axes. In the units in force, X in diameters with G7: #5021 the position in \
machine coordinates, #5420 in the active system. After a probing #5061 to #5066 are the contact, and #5070 is 1 if there was \
one. Names: `_x` to `_c`, `_abs_x` to `_abs_c`, `_feed`, `_rpm`, `_current_tool`, `_selected_tool`, `_motion_mode`, `_plane`, \
`_coord_system`, `_metric`, `_imperial`, `_absolute`, `_incremental`, `_inverse_time`, `_units_per_minute`, `_units_per_rev`, \
`_retract_old_z` (G98), `_retract_r_plane` (G99), `_ijk_absolute_mode`, `_lathe_diameter_mode`, `_lathe_radius_mode`, \
`_spindle_on`, `_spindle_cw`, `_spindle_rpm_mode`, `_spindle_css_mode`, `_mist`, `_flood`, `_tool_offset`, `_ccomp`, `_task`, \
`_metric_machine`; in a call `_value`, `_value_returned`, `_call_level`.",
    refusals: &[no(ParameterReadOnly, &["#5221=10"]), no(ParameterReadOnly, &["#<_x>=1"])],
};

pub const EXPRESSIONS: Rule = Rule {
    title: "Expressions",
    text: "With the capability `language`, `[..]` is an expression: `X[#1+2]`, `G[54+#2]`. Operators, those that bind tightest \
first: `**`; `*` `/` `MOD`; `+` `-`; `EQ` `NE` `GT` `GE` `LT` `LE`; `AND` `OR` `XOR`. Those of one group apply from left to \
right. Outside of brackets there are none. A sign before a number is a part of it: `[-2**2]` is 4. Functions: `ABS[..]`, \
`SQRT`, `EXP`, `LN`, `ROUND` (halves away from 0), `FIX` (down), `FUP` (up), `SIN`, `COS`, `TAN`, `ASIN`, `ACOS` in degrees, \
`ATAN[y]/[x]` from -180 to 180, and `EXISTS[#<name>]`. True is 1 and false is 0; any value but 0 counts as true. Values that \
differ by less than 0.000001 are equal. `MOD` is never negative. A result that is no finite number is refused. At most 16 \
brackets may be open. Words take eight decimals of a value; codes, and T, H, L and D, may be off by 0.0001.",
    refusals: &[
        no(ExpressionInvalid, &["G0 X[1+]"]),
        no(ExpressionInvalid, &["#1=SIN30"]),
        no(MalformedCommand, &["#1=2", "G0 X#1+2"]),
        no(ValueUndefined, &["G0 X[1/#1]"]),
        no(ValueUndefined, &["G0 XSQRT[-1]"]),
        no(ExpressionTooDeep, &["G0 X[[[[[[[[[[[[[[[[[1]]]]]]]]]]]]]]]]]"]),
        no(GcodeUnsupported, &["G[54.15]"]),
    ],
};

pub const FLOW: Rule = Rule {
    title: "O words",
    text: "With the capability `language`, O words make conditions, loops and subroutines: `O1 IF [#1 GT 2]`, `O1 ELSEIF [..]`, \
`O1 ELSE`, `O1 ENDIF`; `O1 WHILE [..]` to `O1 ENDWHILE`; `O1 DO` to `O1 WHILE [..]`; `O1 REPEAT [3]` to `O1 ENDREPEAT`; \
`O1 BREAK` and `O1 CONTINUE` in WHILE and DO; `O1 SUB` to `O1 ENDSUB`, `O1 CALL [1] [2]`, `O1 RETURN`. A label is a number, a \
value (`O[#1+2]`) or a name (`O<hole>`). A subroutine must come before its call. Its arguments are `#1` to `#30`, those that are \
missing 0; the caller has its own back at the return, and names without a leading `_` are known in one call only. \
`O1 ENDSUB [..]` and `O1 RETURN [..]` set `#<_value>`. Lines that do not run need not be valid. A subroutine is recorded, and so \
is a loop while its first pass runs: the response to its last line comes when all passes are over. Records have room for 4,096 \
characters without blanks and plain comments, and for 24 subroutines; 20 blocks and 9 calls may be within each other. If a line \
of a loop or a subroutine is refused, all others up to its end are. If a line of a later pass or of a call is refused, \
all loops and calls end, and the line that has begun them has its status. M2, M30, a queue flush, `^d`, `^x`, an alarm and a \
built-in job end all loops and calls, and forget subroutines.",
    refusals: &[
        no(SubUnknown, &["O1 CALL"]),
        no(OWordInvalid, &["O1 ENDIF"]),
        no(OWordInvalid, &["O1 IF #1"]),
        no(OWordInvalid, &["O1 IF [1]", "O1 IF [1]"]),
    ],
};

pub const TELLING: Rule = Rule {
    title: "Comments that tell values",
    text: "With the capability `language`, the response to a line whose last comment is `(PRINT,text)` or `(DEBUG,text)` has the \
text, up to 100 characters, with the values of `#5` and `#<name>` in it. `%d`, `%f` and `%.2f` choose no decimals, four or two \
for the values behind them; without they have six. A value that does not exist is `######`. `#5599=0` switches `(DEBUG,)` off. \
Values are those after the assignments of the line and before its moves. In grbl's dialect the text comes before `ok` as \
`[MSG:text]`. A line of a later pass or of a call tells at once, as `{\"msg\":\"text\"}` or `[MSG:text]`. Built-in jobs and files of an SD card tell nothing. Lines of printing hosts have neither parameters nor expressions.",
    refusals: &[],
};
