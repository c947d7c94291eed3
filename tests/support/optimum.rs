//! The shortest time of a move from rest to rest, in closed form.

/// Returns the seconds for `length` mm at up to `cruise` mm/s, `accel` mm/s^2 and `jerk` mm/s^3 (0 for none). A move
/// has seven phases; short moves leave out some of them.
pub fn rest_to_rest(length: f64, cruise: f64, accel: f64, jerk: f64) -> f64 {
    // The velocity that two ramps reach within this length.
    let mut peak = (length * accel).sqrt();
    if jerk > 0.0 {
        // p (p / A + A / J) = length if the acceleration reaches A; else p^3 = J length^2 / 4.
        let twice = accel * accel / jerk;
        peak = 0.5 * ((twice * twice + 4.0 * length * accel).sqrt() - twice);
        if peak < twice {
            peak = (0.25 * jerk * length * length).cbrt();
        }
    }
    if peak <= cruise {
        return 2.0 * ramp(peak, accel, jerk);
    }
    let ramp = ramp(cruise, accel, jerk);
    2.0 * ramp + (length - ramp * cruise) / cruise
}

/// Returns the seconds of a ramp from rest to `velocity`.
fn ramp(velocity: f64, accel: f64, jerk: f64) -> f64 {
    if jerk == 0.0 {
        velocity / accel
    } else if velocity >= accel * accel / jerk {
        velocity / accel + accel / jerk
    } else {
        2.0 * (velocity / jerk).sqrt()
    }
}
