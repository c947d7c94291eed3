//! Homing of an axis from the settings: the switch, the direction, the speeds, and the position of the axis afterwards.
//!
//! Pure functions. They are called by the interpreter before a line is taken (`Setup::homing`), by the planner at each
//! stage, and by the view for `home`. Lengths are [`Length`]s, speeds are in mm or degrees per minute.
//!
//! ```text
//!   lower switch                                          upper switch
//!      |<--lb-->|                                                |
//!  ----X========>--------------------------------------<==========----
//!      |<-zb->| here the axis is at tn                  here at tm
//! ```
//!
//! An axis needs no switch if the driver of its motor detects a stall ([`Settings::homes_by_stall`]): the pin of that
//! driver replaces the switch.
//!
//! The final position of the axis, `zb` off the switch, is the end of its travel, so that machine coordinates and soft
//! limits fit the machine: `tn` at a lower switch, `tm` at an upper one. The position is 0 if that end is not set, or
//! if both ends are equal.

use super::switches;
use crate::boards::{ACTIVE, inputs};
use crate::config::Settings;
use crate::config::getters::TRAVEL_NONE;
use crate::status::Status;
use crate::units::Length;

/// A bit of the settings `sn` and `sx`: the switch is a homing switch.
const HOMING: u8 = 1;

/// The axes that may have switches: X Y Z A.
pub const AXES: u8 = inputs::ENDS as u8 / 2;

/// The ends that share a pin with the other end of their axis.
const SHARED: u8 = {
    let (mut bits, mut end) = (0, 0);
    while end < inputs::ENDS {
        if let (Some(this), Some(other)) = (ACTIVE.inputs[end], ACTIVE.inputs[end ^ 1])
            && this.port as u8 == other.port as u8
            && this.bit == other.bit
        {
            bits |= 1 << end;
        }
        end += 1;
    }
    bits
};

/// The parameters of homing an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homing {
    /// The input of the axis's switch.
    pub end: u8,
    /// The speed of the search.
    pub search: f32,
    /// The speed of the latching.
    pub latch: f32,
    /// The longest distance of the search.
    pub way: Length,
    /// How far the axis backs off the switch.
    pub backoff: Length,
    /// Distance from the switch at which the axis ends.
    pub zero: Length,
    /// The position of the axis there.
    pub place: Length,
    /// The switch at the other end of the axis is on the same pin.
    pub shared: bool,
}

impl Homing {
    /// Returns the bit of the switch.
    pub fn switch(&self) -> u16 {
        1 << self.end
    }

    /// Whether the switch is on the pin of this input.
    pub fn has_pin(&self, input: u8) -> bool {
        input == self.end || (input == self.end ^ 1 && SHARED >> self.end & 1 != 0)
    }

    /// Returns both ends of the axis, as bits.
    pub fn ends(&self) -> u8 {
        3 << (self.end & !1)
    }

    /// Returns the position at the distance `way` from `from`, towards the switch.
    pub fn towards(&self, from: Length, way: Length) -> Length {
        let upper = self.end & 1 != 0;
        if upper { from.saturating_add(way) } else { from.saturating_sub(way) }
    }

    /// Returns the position at the distance `way` from `from`, away from the switch.
    pub fn away(&self, from: Length, way: Length) -> Length {
        self.towards(from, Length(-way.0))
    }
}

/// Returns the switch that homes an axis, if exactly one does.
fn switch_of(settings: &Settings, axis: u8) -> Option<u8> {
    let homes =
        |end: u8| switches::WIRED >> end & 1 != 0 && switches::mode(settings, end) & HOMING != 0;
    let lower = 2 * axis;
    match (homes(lower), homes(lower + 1)) {
        (true, false) => Some(lower),
        (false, true) => Some(lower + 1),
        _ => None,
    }
}

/// Returns the axes that have a homing switch, as bits.
#[small]
pub fn axes(settings: &Settings) -> u8 {
    (0..AXES)
        .filter(|axis| switch_of(settings, *axis).is_some())
        .fold(0, |bits, axis| bits | 1 << axis)
}

/// Returns the homing parameters of an axis, or why it cannot be homed. TinyG's status 245, `lb` below 0, never occurs,
/// because no setting has such a value.
#[inline(never)]
#[small]
pub fn of(settings: &Settings, axis: u8) -> Result<Homing, Status> {
    let a = usize::from(axis);
    let (search, latch) = (settings.search_velocity(a), settings.latch_velocity(a));
    if search <= 0.0 {
        return Err(Status::HomingSearch);
    }
    if latch <= 0.0 {
        return Err(Status::HomingLatch);
    }
    let (low, high) = (settings.travel_min(a), settings.travel_max(a));
    let backoff = settings.latch_backoff(a);
    let travel = high.saturating_sub(low).0.saturating_abs();
    let way = Length(travel).saturating_add(backoff);
    if way == Length::ZERO {
        return Err(Status::HomingTravel);
    }
    let end = switch_of(settings, axis).ok_or(Status::HomingSwitches)?;
    if settings.homes_by_stall(axis) && !settings.drives.get(a).is_some_and(|drive| drive.quiet) {
        return Err(Status::HomingSwitches);
    }
    let place = if end & 1 == 0 { low } else { high };
    let unset = low == high || place == TRAVEL_NONE;
    let place = if unset { Length::ZERO } else { place };
    let zero = settings.zero_backoff(a);
    Ok(Homing { end, search, latch, way, backoff, zero, place, shared: shares(settings, end) })
}

/// Whether the switch at the other end is on the same pin and in use.
fn shares(settings: &Settings, end: u8) -> bool {
    SHARED >> end & 1 != 0 && switches::mode(settings, end ^ 1) != 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Name, Number, Setting};

    fn settings(pairs: &[(&str, &str)]) -> Settings {
        let mut settings = Settings::new();
        for (name, value) in pairs {
            let setting = Setting::find(&Name::new().with(name.as_bytes()).unwrap()).unwrap();
            let number = Number::parse(value.as_bytes()).unwrap();
            let value = settings.check(setting, number, false).unwrap();
            settings.store(setting, value);
        }
        settings
    }

    #[test]
    fn each_wrong_setting_has_its_status() {
        let of = |pairs: &[(&str, &str)]| of(&settings(pairs), 0).map(|_| ());
        assert_eq!(of(&[]), Ok(()));
        assert_eq!(of(&[("xsv", "0")]), Err(Status::HomingSearch));
        assert_eq!(of(&[("xlv", "0")]), Err(Status::HomingLatch));
        assert_eq!(of(&[("xlb", "0"), ("xtm", "0")]), Err(Status::HomingTravel));
        assert_eq!(of(&[("xsn", "0")]), Err(Status::HomingSwitches));
        assert_eq!(of(&[("xsn", "2")]), Err(Status::HomingSwitches));
        assert_eq!(of(&[("xsx", "3")]), Err(Status::HomingSwitches));
        assert_eq!(of(&[("xam", "0")]), Err(Status::HomingSwitches));
        assert_eq!(of(&[("xsn", "2"), ("xsx", "3")]), Ok(()));
    }

    #[test]
    fn the_place_is_the_end_of_travel() {
        let lower = of(&settings(&[("xtn", "-20")]), 0).unwrap();
        assert_eq!((lower.end, lower.place), (0, Length(-200_000)));
        assert_eq!(lower.way, Length(1_750_000));
        assert_eq!(lower.towards(Length(5), Length(3)), Length(2));
        let upper = of(&settings(&[]), 2).unwrap();
        assert_eq!((upper.end, upper.place), (5, Length::ZERO));
        assert_eq!(upper.away(Length(5), Length(3)), Length(2));
        assert_eq!(upper.ends(), 0b11_0000);
        let none = of(&settings(&[("xtn", "150")]), 0).unwrap();
        assert_eq!(none.place, Length::ZERO);
    }

    #[test]
    fn axes_without_a_wire_have_no_switch() {
        assert_eq!(axes(&settings(&[])), 0b111);
        assert_eq!(axes(&settings(&[("ysn", "2")])), 0b101);
    }
}
