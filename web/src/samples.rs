//! The positions of the motors at equal intervals.
//!
//! At first there is one sample each 2 ms. When there are [`MOST`] samples, every other one is dropped and the interval
//! is doubled. So the memory is at most 16 MB however long a job takes, and a job of more than half an hour has between
//! half a million and a million samples. Cost: a store.

use kerf::boards::MOTORS;

/// Milliseconds between two samples at first.
const FINEST_MS: u32 = 2;
/// The greatest number of samples, of 16 bytes each.
const MOST: usize = 1 << 20;

/// The steps of each motor at one time.
pub type Place = [i32; MOTORS];

/// Samples at equal intervals.
pub struct Samples {
    places: Vec<Place>,
    interval_ms: u32,
    /// Milliseconds since the last sample.
    waited: u32,
}

impl Samples {
    /// No samples.
    pub const NONE: Self = Self { places: Vec::new(), interval_ms: FINEST_MS, waited: 0 };

    /// Returns samples of which the first is `position`.
    pub fn from(position: [i64; MOTORS]) -> Self {
        Self { places: vec![place(position)], ..Self::NONE }
    }

    /// Takes the position of the motors after another millisecond.
    pub fn tick(&mut self, position: [i64; MOTORS]) {
        self.waited += 1;
        if self.waited < self.interval_ms {
            return;
        }
        self.waited = 0;
        self.places.push(place(position));
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

    /// Returns all samples.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// Returns all samples as bytes.
    pub fn bytes(&self) -> Vec<u8> {
        self.places.iter().flatten().flat_map(|steps| steps.to_le_bytes()).collect()
    }
}

/// Limits the steps to 32 bits. No axis has 2^31 steps.
fn place(position: [i64; MOTORS]) -> Place {
    position.map(|steps| steps.clamp(i32::MIN.into(), i32::MAX.into()) as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_bounded_and_the_ends_are_kept() {
        let mut samples = Samples::from([0; MOTORS]);
        let ms = MOST as i64 * 5;
        (1..=ms).for_each(|t| samples.tick([t, 0, 0, 0]));
        assert!((MOST / 2..=MOST).contains(&samples.len()));
        assert_eq!(samples.interval_ms(), 8);
        assert!(samples.places().iter().zip(0..).all(|(place, n)| place[0] == n * 8));
    }
}
