//! The least number of steps that a motor must make in a job.
//!
//! A move that is lost shows in no end position if a later move goes back over its way. It shows in the number of steps:
//! between two turning points a motor makes at least the steps from one to the other, less what the firmware may cut off at
//! each of them. Turns smaller than that are not counted, nor is what an arc adds to its chord.

/// Adds up the swings of one motor.
#[derive(Clone, Debug, Default)]
pub struct Swings {
    /// Steps of the turning points that are counted.
    counted: u64,
    /// The last turning point, and the farthest place since.
    from: i64,
    far: i64,
}

impl Swings {
    /// Takes the motor's place at the end of a line. At a turning point the motor may be `cut` steps short of it; the
    /// largest `cut` of a job serves all calls.
    pub fn go_to(&mut self, place: i64, cut: u64) {
        let is_on_the_way = (place - self.far).signum() * (self.far - self.from).signum() >= 0;
        if is_on_the_way {
            self.far = place;
        } else if place.abs_diff(self.far) > 2 * cut {
            self.counted += less(self.from.abs_diff(self.far), 2 * cut);
            (self.from, self.far) = (self.far, place);
        }
    }

    /// Returns the least number of steps so far, in both directions together.
    pub fn least(&self, cut: u64) -> u64 {
        self.counted + less(self.from.abs_diff(self.far), 2 * cut)
    }
}

fn less(steps: u64, by: u64) -> u64 {
    steps.saturating_sub(by)
}

#[cfg(test)]
mod tests {
    use super::Swings;

    fn least(places: &[i64], cut: u64) -> u64 {
        let mut swings = Swings::default();
        places.iter().for_each(|place| swings.go_to(*place, cut));
        swings.least(cut)
    }

    #[test]
    fn swings_add_up() {
        assert_eq!(least(&[100, 300, 0], 0), 600);
        assert_eq!(least(&[100, 300, 0], 5), 580);
        // A plunge and a retract.
        assert_eq!(least(&[-1000, 0], 10), 2 * 980);
        assert_eq!(least(&[], 3), 0);
    }

    #[test]
    fn small_turns_do_not_count() {
        assert_eq!(least(&[100, 95, 100, 95, 200], 5), 190);
        assert_eq!(least(&[3, 0, 3, 0, 3], 5), 0);
        // A slow return is a turn all the same.
        assert_eq!(least(&[100, 95, 90, 85, 0], 5), 180);
    }
}
