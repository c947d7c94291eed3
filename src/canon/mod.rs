//! What Kerf makes of a G-code program, written down: canonical commands, one on a line. For the host
//! alone; `kerf canon FILE` prints them.
//!
//! Coordinates are the machine's, in mm, and degrees for A B C, with four decimals, which is exact: they
//! are printed from integers. Rates, speeds and factors are the shortest numbers that stand for
//! what the machine reckons with. Names are those of RS274/NGC where it has one.
//!
//! | command | |
//! |---|---|
//! | `STRAIGHT_TRAVERSE(x, y, z, a, b, c)` | to this place, as fast as it goes |
//! | `STRAIGHT_FEED(x, y, z, a, b, c)` | to this place at the feed rate |
//! | `ARC_FEED(plane, x, y, z, a, b, c, first, second, turns)` | plane `XY`, `ZX` or `YZ`; the end; the centre along the plane's first and second axis; turns begun, below zero if clockwise |
//! | `STRAIGHT_PROBE(x, y, z, a, b, c, until)` | until `TOUCH` or `RELEASE`, each with `_OR_END` if it may fail |
//! | `SET_FEED_RATE(rate)` | mm/min; where it changes, before the move that it is for |
//! | `SET_FEED_TIME(minutes)` | the same with G93: the time of each move |
//! | `SET_MOTION_CONTROL_MODE(mode)` | `EXACT_STOP` or `CONTINUOUS`; where it changes, before a move |
//! | `DWELL(seconds)` | three decimals, exact |
//! | `START_SPINDLE_CLOCKWISE(speed)`, `START_SPINDLE_COUNTERCLOCKWISE(speed)`, `STOP_SPINDLE_TURNING` | turns per minute |
//! | `MIST_ON`, `FLOOD_ON`, `MIST_OFF`, `FLOOD_OFF` | what a line changes |
//! | `CHANGE_TOOL(number)` | the spindle has been stopped |
//! | `SET_OVERRIDES(feed, traverse, spindle)` | factors |
//! | `SET_POSITION(x, y, z, a, b, c)` | G28.3: the place is called this |
//! | `HOME(axes)`, `HOME_ONLY(axes)` | G28.2, and G28.4, which sets no position; letters of axes. What the switches say is not known: coordinates go on from those before |
//! | `MESSAGE(text)` | of `(MSG ...)`, before what else its line does |
//! | `PROGRAM_STOP`, `PROGRAM_END` | the end turns spindle and coolant off before, and overrides to 1 |
//!
//! A canned cycle is told move by move; moves to where the machine stands are left out in cycles alone.
//! The program is a stream: `%` means nothing, and lines after M2 or M30 are read.

mod advice;
mod command;
mod program;
mod reader;

pub use advice::{advice, statuses};
pub use command::Canon;
pub use program::{Refusal, by_number, commands, text};
pub use reader::Reader;
