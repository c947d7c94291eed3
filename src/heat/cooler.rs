//! The fan that cools the heatbreak of a hot end. Without it filament melts too far up, and clogs the hot end.
//!
//! Pure. The heat task asks at each reading of the hot end, on boards that have such a fan: 300 cycles.

use super::sensor::{Broken, UNIT};

/// From this temperature on the fan turns, 1/64 degree.
const WARM: i16 = 50 * UNIT;
/// Below this temperature it stops, 1/64 degree.
const COOL: i16 = 45 * UNIT;

/// Whether the fan is to turn. `was` is whether it turns now, `to` the target of the hot end (0 is off), and `felt`
/// its temperature, 1/64 degree; `None` if there was no reading. A hot end whose sensor is broken counts as warm.
pub fn turns(was: bool, to: u16, felt: Option<Result<i16, Broken>>) -> bool {
    let warm = match felt {
        None => was,
        Some(Err(_)) => true,
        Some(Ok(now)) => now >= if was { COOL } else { WARM },
    };
    to != 0 || warm
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fan_turns_while_the_hot_end_is_warm_or_may_be() {
        let degrees = |degrees: i16| Some(Ok(degrees * UNIT));
        for (was, to, felt, wanted) in [
            (false, 0, degrees(22), false),
            (false, 1, degrees(22), true),
            (false, 0, degrees(49), false),
            (false, 0, degrees(50), true),
            (true, 0, degrees(46), true),
            (true, 0, degrees(44), false),
            (true, 0, None, true),
            (false, 0, None, false),
            (false, 0, Some(Err(Broken::Open)), true),
            (false, 0, Some(Err(Broken::Short)), true),
        ] {
            assert_eq!(turns(was, to, felt), wanted, "{was} {to} {felt:?}");
        }
    }
}
