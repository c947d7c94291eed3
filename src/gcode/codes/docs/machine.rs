//! M codes: program, spindle, coolant, overrides.

use super::{Doc, Section, g, m, no};
use crate::status::Status::{
    BadNumber, OutOfRange, PWordInvalid, PWordMissing, SWordInvalid, SWordMissing,
};

/// M6. It is documented in the section of the tools.
pub const CHANGE: Doc = m(
    60,
    "Tool change",
    "Stops the spindle. The tool of the last T becomes the tool in the spindle. The machine waits for `~`, as with \
M0. With `{psw:0}` it does not wait. Tool lengths do not change until G43.",
    &[],
);

pub const PROGRAM: Section = Section {
    title: "Program",
    intro: "These codes act last on their line, after its moves.",
    docs: &[
        m(
            0,
            "Program stop",
            "The machine stops and reports it (`stat` 3, exception 38). It waits for `~`, then continues. Lines of G-code \
that arrive meanwhile wait as well. The spindle keeps turning. With `{psw:0}` the machine continues at once.",
            &[],
        ),
        m(10, "Optional stop", "With `{ost:1}` as M0. With `{ost:0}` no effect.", &[]),
        m(
            20,
            "Program end",
            "The machine stops and reports it (`stat` 4). Spindle and coolant are off, on a printer also heaters and fan. \
Overrides are on and keep their factors. G1 without a feed, G91.1, G94 and G98 become active, and G92 is reset. The settings \
`gpl`, `gun`, `gco`, `gpa` and `gdi` give plane, units, coordinate system, path and distance mode. Tool, tool \
length, tables and position do not change.",
            &[],
        ),
        m(300, "Program end", "As M2.", &[]),
        m(600, "Program stop (pallet change)", "As M0.", &[]),
    ],
};

pub const SPINDLE: Section = Section {
    title: "Spindle and coolant",
    intro: "Spindle and coolant switch in sequence with the moves, before a move on the same line.",
    docs: &[
        m(
            30,
            "Spindle clockwise",
            "The spindle turns until M4, M5, M6 or the end of the program. Sets the enable and direction pins, and the PWM \
for S (settings `p1`). Reports show S, and G95 uses it.",
            &[],
        ),
        m(40, "Spindle counter-clockwise", "As M3, but counter-clockwise.", &[]),
        g(
            960,
            "Constant surface speed",
            "S is the surface speed at the tool in m/min, with G20 in feet per minute. The distance of X from 0 is the \
radius. The spindle speed follows from both, and is updated every 20 ms while X moves. X 0 in the active \
coordinates, with all offsets, must be the spindle axis. D is the maximum RPM, also under an override; without D \
it is 65,535. The line needs S. A later S alone is a surface speed, too. The range of `p1` still applies.",
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
            "RPM mode",
            "S is in RPM. Without S the spindle keeps the speed of G96 at the programmed X. Active at power-up and after M2.",
            &[],
        ),
        m(50, "Spindle off", "Keeps S. Active at power-up and after M2.", &[]),
        m(
            70,
            "Mist coolant",
            "Mist is on until M9 or the end of the program. Flood does not change.",
            &[],
        ),
        m(
            80,
            "Flood coolant",
            "Flood is on until M9 or the end of the program. Mist does not change.",
            &[],
        ),
        m(90, "Coolant off", "Mist and flood are off. Active at power-up and after M2.", &[]),
    ],
};

pub const OVERRIDES: Section = Section {
    title: "Overrides",
    intro: "An override multiplies rates or speeds by a factor; 1 is as programmed. Each override is on or off, and keeps \
its factor while it is off. At power-up and after M2 all overrides are on. At power-up all factors are 1.",
    docs: &[
        m(480, "Overrides on", "Switches all three overrides on.", &[]),
        m(
            481,
            "Set feed override",
            "Multiplies feed rates by P, 0 to 2. P0 acts as 0.001.",
            &[
                no(PWordMissing, &["M48.1"]),
                no(PWordInvalid, &["M48.1 P-1"]),
                no(PWordInvalid, &["M48.1 P2.001"]),
            ],
        ),
        m(
            482,
            "Set rapid override",
            "Multiplies rapid rates by P, 0 to 1. P0 acts as 0.001.",
            &[
                no(PWordMissing, &["M48.2"]),
                no(PWordInvalid, &["M48.2 P-1"]),
                no(PWordInvalid, &["M48.2 P1.001"]),
            ],
        ),
        m(490, "Overrides off", "Switches all three overrides off.", &[]),
        m(491, "Feed override off", "Feed rates are as programmed.", &[]),
        m(492, "Rapid override off", "Rapids are as fast as the axes can.", &[]),
        m(
            500,
            "Feed override",
            "P sets the factor, as M48.1. P0 switches the override off. Without P it is on with its present factor.",
            &[no(PWordInvalid, &["M50 P2.001"]), no(PWordInvalid, &["M50 P-1"])],
        ),
        m(
            501,
            "Rapid override",
            "P sets the factor, as M48.2. P0 switches the override off. Without P it is on with its present factor.",
            &[no(PWordInvalid, &["M50.1 P1.001"])],
        ),
        m(
            510,
            "Spindle override",
            "As M50, for the spindle speed. P is 0.05 to 2. `{sso:n}` shows the factor.",
            &[no(PWordInvalid, &["M51 P0.049"]), no(PWordInvalid, &["M51 P2.001"])],
        ),
    ],
};
