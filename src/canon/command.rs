//! The canonical commands, and their text form.

use core::fmt::{Display, Formatter, Result};
use std::string::String;

use crate::gcode::command::{Arc, Feed, Spindle};
use crate::gcode::heating::{Heat, Part};
use crate::gcode::modal::{MotionMode, Turn};
use crate::gcode::overrides::{Override, Overrides};
use crate::units::{AXES, AXIS_LETTERS, Length, PerAxis};

/// A canonical command. Positions are machine coordinates.
#[derive(Clone, Debug, PartialEq)]
pub enum Canon {
    /// A straight traverse to a position.
    Traverse(PerAxis<Length>),
    /// A straight move to a position at the feed rate.
    Feed(PerAxis<Length>),
    /// An arc to a position. A full circle has no extra turn.
    Arc(PerAxis<Length>, Arc, Turns),
    /// A straight move to a position unless the probe stops it, in one of the probing modes.
    Probe(PerAxis<Length>, MotionMode),
    /// The feed rate of the moves that follow.
    Rate(Feed),
    /// Whether the moves that follow end at standstill.
    ExactStop(bool),
    /// A straight move in step with the spindle, and the distance in a turn of the axis that moves farthest.
    Thread(PerAxis<Length>, Length),
    /// Stands still for this many milliseconds.
    Dwell(u32),
    /// The direction and speed of the spindle.
    Spindle(Spindle),
    /// Switches mist on or off.
    Mist(bool),
    /// Switches flood on or off.
    Flood(bool),
    /// The tool that is in the spindle.
    Tool(u16),
    /// The factors of rates and speeds.
    Overrides(Overrides),
    /// Sets the coordinates of the present position.
    SetPosition(PerAxis<Length>),
    /// Homes axes (as bits); the flag says whether that sets their position.
    Home(u8, bool),
    /// A message for the operator.
    Message(String),
    /// Sets heaters or the fan.
    Heat(Heat),
    /// Program stop.
    Stop,
    /// Program end.
    End,
}

/// The number of turns begun, negative if clockwise.
pub type Turns = i32;

impl Display for Canon {
    fn fmt(&self, to: &mut Formatter) -> Result {
        match self {
            Self::Traverse(place) => write!(to, "STRAIGHT_TRAVERSE({})", Place(place)),
            Self::Feed(place) => write!(to, "STRAIGHT_FEED({})", Place(place)),
            Self::Arc(place, arc, turns) => write_arc(to, place, arc, *turns),
            Self::Thread(place, lead) => write!(to, "THREAD({}, {lead})", Place(place)),
            Self::Probe(place, mode) => {
                write!(to, "STRAIGHT_PROBE({}, {})", Place(place), until(*mode))
            }
            Self::Rate(Feed::PerMinute(rate)) => write!(to, "SET_FEED_RATE({rate})"),
            Self::Rate(Feed::Minutes(time)) => write!(to, "SET_FEED_TIME({time})"),
            Self::ExactStop(true) => to.write_str("SET_MOTION_CONTROL_MODE(EXACT_STOP)"),
            Self::ExactStop(false) => to.write_str("SET_MOTION_CONTROL_MODE(CONTINUOUS)"),
            Self::Dwell(ms) => write!(to, "DWELL({}.{:03})", ms / 1_000, ms % 1_000),
            Self::Spindle(spindle) => write_spindle(to, spindle),
            Self::Mist(on) => write!(to, "MIST_{}", switched(*on)),
            Self::Flood(on) => write!(to, "FLOOD_{}", switched(*on)),
            Self::Tool(number) => write!(to, "CHANGE_TOOL({number})"),
            Self::Overrides(factors) => write_overrides(to, factors),
            Self::SetPosition(place) => write!(to, "SET_POSITION({})", Place(place)),
            Self::Home(axes, true) => write!(to, "HOME({})", Letters(*axes)),
            Self::Home(axes, false) => write!(to, "HOME_ONLY({})", Letters(*axes)),
            Self::Message(text) => write!(to, "MESSAGE({text})"),
            Self::Heat(heat) => write_heat(to, heat),
            Self::Stop => to.write_str("PROGRAM_STOP"),
            Self::End => to.write_str("PROGRAM_END"),
        }
    }
}

fn write_arc(to: &mut Formatter, place: &PerAxis<Length>, arc: &Arc, turns: Turns) -> Result {
    let plane = match arc.linear {
        0 => "YZ",
        1 => "ZX",
        _ => "XY",
    };
    let [first, second] = arc.center;
    write!(to, "ARC_FEED({plane}, {}, {first}, {second}, {turns})", Place(place))
}

fn write_spindle(to: &mut Formatter, spindle: &Spindle) -> Result {
    match spindle.turn {
        Turn::Off => to.write_str("STOP_SPINDLE_TURNING"),
        Turn::Clockwise => write!(to, "START_SPINDLE_CLOCKWISE({})", spindle.speed),
        Turn::Counterclockwise => write!(to, "START_SPINDLE_COUNTERCLOCKWISE({})", spindle.speed),
    }
}

fn write_heat(to: &mut Formatter, heat: &Heat) -> Result {
    let name = match heat.part {
        Part::HotEnd => "HOT_END",
        Part::Bed => "BED",
        Part::All => "HEATERS",
        Part::Fan => "FAN",
    };
    let waits = heat.wait;
    match heat.to {
        Some(fan) if heat.part == Part::Fan => write!(to, "{name}({fan})"),
        Some(eighths) => write!(to, "{name}({}, {waits:?})", f32::from(eighths) / 8.0),
        None => write!(to, "{name}({waits:?})"),
    }
}

fn write_overrides(to: &mut Formatter, factors: &Overrides) -> Result {
    let all = [Override::Feed, Override::Traverse, Override::Spindle];
    let [feed, traverse, spindle] = all.map(|which| f32::from(factors.in_force(which)) / 1_000.0);
    write!(to, "SET_OVERRIDES({feed}, {traverse}, {spindle})")
}

fn until(mode: MotionMode) -> &'static str {
    match mode {
        MotionMode::ProbeTowardsQuietly => "TOUCH_OR_END",
        MotionMode::ProbeAway => "RELEASE",
        MotionMode::ProbeAwayQuietly => "RELEASE_OR_END",
        _ => "TOUCH",
    }
}

fn switched(on: bool) -> &'static str {
    if on { "ON" } else { "OFF" }
}

/// Coordinates, separated by commas.
struct Place<'a>(&'a PerAxis<Length>);

impl Display for Place<'_> {
    fn fmt(&self, to: &mut Formatter) -> Result {
        for (axis, at) in self.0.iter().enumerate() {
            write!(to, "{}{at}", if axis == 0 { "" } else { ", " })?;
        }
        Ok(())
    }
}

/// Axes, as bits.
struct Letters(u8);

impl Display for Letters {
    fn fmt(&self, to: &mut Formatter) -> Result {
        for (axis, letter) in (0..AXES).zip(AXIS_LETTERS) {
            if self.0 & 1 << axis != 0 {
                write!(to, "{}", char::from(letter.to_ascii_uppercase()))?;
            }
        }
        Ok(())
    }
}

impl Display for Length {
    /// In mm or degrees, with four decimals: exact.
    fn fmt(&self, to: &mut Formatter) -> Result {
        let sign = if self.0 < 0 { "-" } else { "" };
        let (size, unit) = (self.0.unsigned_abs(), Length::PER_MM as u32);
        write!(to, "{sign}{}.{:04}", size / unit, size % unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gcode::overrides::Change;
    use std::string::ToString;

    #[test]
    fn lengths_are_exact() {
        for (units, text) in [
            (0, "0.0000"),
            (-1, "-0.0001"),
            (12_345, "1.2345"),
            (i32::MAX, "214748.3647"),
            (i32::MIN, "-214748.3648"),
        ] {
            assert_eq!(Length(units).to_string(), text);
        }
    }

    #[test]
    fn what_has_numbers() {
        let place = [1, -20_000, 0, 0, 0, 900_000].map(Length);
        let traverse = "STRAIGHT_TRAVERSE(0.0001, -2.0000, 0.0000, 0.0000, 0.0000, 90.0000)";
        assert_eq!(Canon::Traverse(place).to_string(), traverse);
        assert_eq!(Canon::Dwell(1_050).to_string(), "DWELL(1.050)");
        assert_eq!(Canon::Home(0b101, true).to_string(), "HOME(XZ)");
        let mut factors = Overrides::NONE;
        factors.change(Change::to(Override::Feed, 500));
        assert_eq!(Canon::Overrides(factors).to_string(), "SET_OVERRIDES(0.5, 1, 1)");
    }
}
