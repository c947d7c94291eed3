//! The canonical commands of a G-code program as text, one command on a line. Only on the host; `kerf canon FILE`
//! prints them.
//!
//! Coordinates are machine coordinates in mm, and in degrees for A B C, with four decimals. They are printed from
//! integers and are therefore exact. Rates, speeds and factors are the shortest numbers that stand for the values that
//! the machine uses. Names are those of RS274/NGC where it has one.
//!
//! | command | |
//! |---|---|
//! | `STRAIGHT_TRAVERSE(x, y, z, a, b, c)` | to this position at the traverse rate |
//! | `STRAIGHT_FEED(x, y, z, a, b, c)` | to this position at the feed rate |
//! | `ARC_FEED(plane, x, y, z, a, b, c, first, second, turns)` | plane `XY`, `ZX` or `YZ`; the end; the centre along the plane's first and second axis; turns begun, below zero if clockwise |
//! | `STRAIGHT_PROBE(x, y, z, a, b, c, until)` | until `TOUCH` or `RELEASE`, each with `_OR_END` if it may fail |
//! | `SET_FEED_RATE(rate)` | mm/min; before the first move with a new rate |
//! | `SET_FEED_TIME(minutes)` | with G93: the time of each move |
//! | `SET_MOTION_CONTROL_MODE(mode)` | `EXACT_STOP` or `CONTINUOUS`; before the first move with a new mode |
//! | `DWELL(seconds)` | three decimals, exact |
//! | `START_SPINDLE_CLOCKWISE(speed)`, `START_SPINDLE_COUNTERCLOCKWISE(speed)`, `STOP_SPINDLE_TURNING` | turns per minute |
//! | `MIST_ON`, `FLOOD_ON`, `MIST_OFF`, `FLOOD_OFF` | only changes |
//! | `CHANGE_TOOL(number)` | the spindle has been stopped |
//! | `SET_OVERRIDES(feed, traverse, spindle)` | factors |
//! | `SET_POSITION(x, y, z, a, b, c)` | G28.3: the new coordinates of the present position |
//! | `HOME(axes)`, `HOME_ONLY(axes)` | G28.2, and G28.4, which sets no position; letters of axes. What the switches say is not known: coordinates go on from those before |
//! | `MESSAGE(text)` | of `(MSG ...)`, before all other commands of its line |
//! | `PROGRAM_STOP`, `PROGRAM_END` | before the end spindle and coolant are switched off, and overrides set to 1 |
//!
//! A canned cycle is written move by move. Only in cycles moves to the present position are left out. The program is a
//! stream: `%` has no effect, and lines after M2 or M30 are read.

mod advice;
mod command;
mod program;
mod reader;

pub use advice::{advice, statuses};
pub use command::Canon;
pub use program::{Refusal, by_number, commands, of_alarm, of_error, text};
pub use reader::Reader;
