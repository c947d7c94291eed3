//! The positions of the motors at equal intervals.
//!
//! A step is the moment at which a motor passes the middle between two positions. Between steps the motor is taken to
//! move evenly, so a position is known to a fraction of a step. When no step comes for [`STILL_MS`], the motor has
//! stood still, except for the half steps at both ends of the standstill.
//!
//! At first there is one sample each 2 ms. When there are [`MOST`] samples, every other one is dropped and the interval
//! is doubled. So the memory is at most 16 MB however long a job takes, and a job of more than half an hour has between
//! half a million and a million samples. Cost: a store a sample; a step that comes late writes the samples since the
//! step before it again, a hundred at most.

use kerf::boards::MOTORS;

/// Milliseconds between two samples at first.
const FINEST_MS: u32 = 2;
/// The greatest number of samples, of 16 bytes each.
const MOST: usize = 1 << 20;
/// A motor that makes no step for so long stands still, ms.
const STILL_MS: f64 = 200.0;
/// The time of the first half step of a motor that has stood still, ms.
const LEAD_MS: f64 = 10.0;
/// Parts of a step in which positions are kept.
const PARTS: f64 = 64.0;

/// The positions of all motors at one time, in parts of a step.
type Place = [i32; MOTORS];

/// What is known of a motor between its steps.
#[derive(Clone, Copy)]
struct Track {
    /// Steps up minus steps down.
    steps: i64,
    /// The position at the last step, in steps: in the middle between two whole ones.
    middle: f64,
    /// When the last step came, ms.
    ms: f64,
    /// The time from the step before it to the last step, ms.
    pace: f64,
}

impl Track {
    /// A motor at rest.
    const fn at(steps: i64) -> Self {
        Self { steps, middle: steps as f64, ms: f64::NEG_INFINITY, pace: 1.0 }
    }

    /// Returns the position at a time if no step comes any more: the last half step takes as long as the step before.
    fn ending(&self, ms: f64) -> f64 {
        let share = ((ms - self.ms) / self.pace).min(1.0);
        self.middle + (self.steps as f64 - self.middle) * share
    }
}

/// Samples at equal intervals.
pub struct Samples {
    places: Vec<Place>,
    interval_ms: u32,
    /// Milliseconds since the first sample.
    ms: u32,
    tracks: [Track; MOTORS],
}

impl Samples {
    /// No samples.
    pub const NONE: Self =
        Self { places: Vec::new(), interval_ms: FINEST_MS, ms: 0, tracks: [Track::at(0); MOTORS] };

    /// Returns samples of which the first is `position`.
    pub fn from(position: [i64; MOTORS]) -> Self {
        let tracks = position.map(Track::at);
        let places = vec![position.map(|steps| parts(steps as f64))];
        Self { places, tracks, ..Self::NONE }
    }

    /// Takes note of a step that leads a motor to `steps`, at so many milliseconds since the first sample. Steps of a
    /// motor come in the order of time.
    pub fn step(&mut self, motor: usize, steps: i64, ms: f64) {
        let Some(track) = self.tracks.get_mut(motor) else { return };
        let before = *track;
        let still = ms - before.ms > STILL_MS;
        let pace = if still { LEAD_MS } else { ms - before.ms };
        let middle = (before.steps + steps) as f64 / 2.0;
        *track = Track { steps, middle, ms, pace };
        let from = if still { before.steps as f64 } else { before.middle };
        let began = ms - pace;
        // The samples after the step before this one.
        let first = (began / f64::from(self.interval_ms)).floor().max(-1.0) + 1.0;
        for n in first as usize..self.places.len() {
            let share = (n as f64 * f64::from(self.interval_ms) - began) / pace;
            self.places[n][motor] = parts(from + (middle - from) * share);
        }
    }

    /// Lets another millisecond pass.
    pub fn tick(&mut self) {
        self.ms += 1;
        if !self.ms.is_multiple_of(self.interval_ms) {
            return;
        }
        let ms = f64::from(self.ms);
        self.places.push(self.tracks.map(|track| parts(track.ending(ms))));
        // The number of samples is odd, so that the first and the last one are kept.
        if self.places.len() > MOST {
            self.places = self.places.iter().copied().step_by(2).collect();
            self.interval_ms *= 2;
        }
    }

    /// Returns the number of samples.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Returns the milliseconds between two samples.
    pub fn interval_ms(&self) -> u32 {
        self.interval_ms
    }

    /// Returns the positions of a motor in all samples, in steps.
    pub fn places(&self, motor: usize) -> impl Iterator<Item = f64> {
        let motor = motor.min(MOTORS - 1);
        self.places.iter().map(move |place| f64::from(place[motor]) / PARTS)
    }

    /// Returns all samples as bytes: whole steps, four numbers for each sample.
    pub fn bytes(&self) -> Vec<u8> {
        let whole = |parts: &i32| (f64::from(*parts) / PARTS).round() as i32;
        self.places.iter().flatten().flat_map(|parts| whole(parts).to_le_bytes()).collect()
    }
}

/// Converts steps to parts, within 32 bits. No axis has 2^25 steps.
fn parts(steps: f64) -> i32 {
    (steps * PARTS).round() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of a motor that makes a step at each of these times.
    fn samples(ms: u32, steps: impl Iterator<Item = f64>) -> Samples {
        let (mut samples, mut at, mut steps) = (Samples::from([0; MOTORS]), 0, steps.peekable());
        for now in 1..=ms {
            while let Some(time) = steps.next_if(|time| *time <= f64::from(now)) {
                at += 1;
                samples.step(0, at, time);
            }
            samples.tick();
        }
        samples
    }

    #[test]
    fn memory_is_bounded_and_the_ends_are_kept() {
        let mut samples = Samples::from([0; MOTORS]);
        let ms = MOST as i64 * 5;
        for t in 1..=ms {
            samples.step(0, t, t as f64);
            samples.tick();
        }
        assert!((MOST / 2..=MOST).contains(&samples.len()));
        assert_eq!(samples.interval_ms(), 8);
        // At a step the motor is half a step before the position that it leads to.
        let mut places = samples.places(0).zip(0..).skip(1);
        assert!(places.all(|(place, n)| place == f64::from(n) * 8.0 - 0.5));
    }

    #[test]
    fn slow_steps_are_an_even_motion() {
        let samples = samples(1_000, (0..).map(|n| 20.0 + 30.0 * f64::from(n)));
        for (place, n) in samples.places(0).zip(0..).take(490).skip(10) {
            let want = (f64::from(n) * 2.0 - 20.0) / 30.0 + 0.5;
            assert!((place - want).abs() < 0.02, "{n}: {place} instead of {want}");
        }
    }

    #[test]
    fn a_motor_stands_between_two_moves() {
        let samples = samples(1_400, [100.0, 110.0, 900.0, 910.0].into_iter());
        let at = |ms: usize| samples.places(0).nth(ms / 2).unwrap();
        assert_eq!([at(88), at(122), at(888), at(1_400)], [0.0, 2.0, 2.0, 4.0]);
        assert!((at(106) - 1.1).abs() < 0.02);
    }

    #[test]
    fn the_last_sample_has_the_whole_steps() {
        let samples = samples(500, [10.0, 12.0, 14.0].into_iter());
        assert_eq!(samples.bytes()[4 * MOTORS * 250..][..4], 3i32.to_le_bytes());
    }
}
