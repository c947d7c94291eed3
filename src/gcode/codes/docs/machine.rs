//! M codes: program, spindle, coolant, overrides.

use super::{Doc, Section, g, m, no};
use crate::status::Status::{
    BadNumber, OutOfRange, PWordInvalid, PWordMissing, SWordInvalid, SWordMissing,
};

/// M6. It is documented in the section of the tools.
pub const CHANGE: Doc = m(
    60,
    "Change the tool",
    "Stops the spindle; from here on the tool of the last T is in it. The machine then waits for `~`, as with M0. \
With `{psw:0}` nothing waits. Tool lengths stay as they are until G43.",
    &[],
);

pub const PROGRAM: Section = Section {
    title: "Program",
    intro: "These come last on their line, behind its moves.",
    docs: &[
        m(
            0,
            "Stop",
            "The machine comes to rest and says so (`stat` 3, and an exception 38). It waits for `~` and then goes on. \
Lines of G-code that come meanwhile wait as well. The spindle goes on turning. With `{psw:0}` the machine goes on at once.",
            &[],
        ),
        m(10, "Stop if wanted", "The same as M0 with `{ost:1}`; without, nothing.", &[]),
        m(
            20,
            "End",
            "The machine comes to rest and says so (`stat` 4). Spindle and coolant are off, overrides on with the factors \
they had. In force: G1 with no feed, G91.1, G94, G98, no G92; plane, units, coordinate system, path and distance mode \
as the settings `gpl`, `gun`, `gco`, `gpa` and `gdi` say. Tool, tool length, tables and position stay.",
            &[],
        ),
        m(300, "End", "The same as M2.", &[]),
        m(600, "Stop", "The same as M0.", &[]),
    ],
};

pub const SPINDLE: Section = Section {
    title: "Spindle and coolant",
    intro: "Switched in turn with the moves, before a move on the same line.",
    docs: &[
        m(
            30,
            "Spindle clockwise",
            "Turns until M4, M5, M6 or the end of the program. Sets the enable and direction pins, and the PWM for S (settings `p1`); \
the speed S is reported, and G95 goes by it.",
            &[],
        ),
        m(40, "Spindle counter-clockwise", "The same the other way round.", &[]),
        g(
            960,
            "Constant surface speed",
            "S is the speed of the surface that is cut: m/min, or feet a minute with G20. The spindle turns as fast as that asks for at the radius \
where X is, and follows X each 20 ms while it moves. X 0 of the coordinates in force, with their offsets, is the axis of rotation. D is the most turns a minute, \
whatever the override; without D it is 65,535. S is needed on the line; a later S alone is a surface speed, too. The range of `p1` counts as ever.",
            &[
                no(SWordMissing, &["G96 D2000"]),
                no(OutOfRange, &["G96 S100 D0"]),
                no(OutOfRange, &["G96 S100 D-1"]),
                no(OutOfRange, &["G96 S100 D65536"]),
                no(BadNumber, &["G96 S100 D0.5"]),
                no(SWordInvalid, &["G96 S-1"]),
            ],
        ),
        g(
            970,
            "Turns a minute",
            "S is turns a minute. Without S the spindle goes on as fast as G96 asks for where the program is. In force at power-up and after M2.",
            &[],
        ),
        m(50, "Spindle off", "S is remembered. In force at power-up and after M2.", &[]),
        m(
            70,
            "Mist",
            "Mist runs, until M9 or the end of the program. Flood stays what it is.",
            &[],
        ),
        m(
            80,
            "Flood",
            "Flood runs, until M9 or the end of the program. Mist stays what it is.",
            &[],
        ),
        m(90, "No coolant", "Mist and flood are off. In force at power-up and after M2.", &[]),
    ],
};

pub const OVERRIDES: Section = Section {
    title: "Overrides",
    intro: "Factors by which rates and speeds are multiplied from here on: 1 is as programmed. Each \
has a factor and is on or off; off, it keeps its factor. At power-up and after M2 all are on; at power-up all \
factors are 1.",
    docs: &[
        m(480, "Overrides on", "All three.", &[]),
        m(
            481,
            "Feed override to",
            "Feed rates are multiplied by P, 0 to 2. 0 is carried out as 0.001.",
            &[
                no(PWordMissing, &["M48.1"]),
                no(PWordInvalid, &["M48.1 P-1"]),
                no(PWordInvalid, &["M48.1 P2.001"]),
            ],
        ),
        m(
            482,
            "Traverse override to",
            "Traverse rates are multiplied by P, 0 to 1. 0 is carried out as 0.001.",
            &[
                no(PWordMissing, &["M48.2"]),
                no(PWordInvalid, &["M48.2 P-1"]),
                no(PWordInvalid, &["M48.2 P1.001"]),
            ],
        ),
        m(490, "Overrides off", "All three.", &[]),
        m(491, "Feed override off", "Feed rates are as programmed.", &[]),
        m(492, "Traverse override off", "Traverses are as fast as the axes may.", &[]),
        m(
            500,
            "Feed override",
            "With P as M48.1; P0: off; without P: on, with the factor it has.",
            &[no(PWordInvalid, &["M50 P2.001"]), no(PWordInvalid, &["M50 P-1"])],
        ),
        m(
            501,
            "Traverse override",
            "With P as M48.2; P0: off; without P: on, with the factor it has.",
            &[no(PWordInvalid, &["M50.1 P1.001"])],
        ),
        m(
            510,
            "Spindle override",
            "As M50, of the speed of the spindle, 0.05 to 2. `{sso:n}` shows it.",
            &[no(PWordInvalid, &["M51 P0.049"]), no(PWordInvalid, &["M51 P2.001"])],
        ),
    ],
};
