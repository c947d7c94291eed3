//! Where the motors were, at equal distances in time.
//!
//! A sample each 2 ms at first. When there are [`MOST`] of them every other one is dropped and the distance is doubled: memory is bounded however
//! long a job takes, 16 MB, and any job of more than half an hour has between half a million and a million of them. Cost: a store.

use kerf::boards::MOTORS;

/// Milliseconds between two samples at first.
const FINEST_MS: u32 = 2;
/// Samples of 16 bytes at most.
const MOST: usize = 1 << 20;

/// The steps of each motor at a time.
pub type Place = [i32; MOTORS];

/// Samples at equal distances.
pub struct Samples {
    places: Vec<Place>,
    interval_ms: u32,
    /// Milliseconds since the last one.
    waited: u32,
}

impl Samples {
    /// Without any.
    pub const NONE: Self = Self { places: Vec::new(), interval_ms: FINEST_MS, waited: 0 };

    /// With the first one.
    pub fn from(position: [i64; MOTORS]) -> Self {
        Self { places: vec![place(position)], ..Self::NONE }
    }

    /// A millisecond has passed, and the motors are here.
    pub fn tick(&mut self, position: [i64; MOTORS]) {
        self.waited += 1;
        if self.waited < self.interval_ms {
            return;
        }
        self.waited = 0;
        self.places.push(place(position));
        // An odd number, so that the first and the last are kept.
        if self.places.len() > MOST {
            self.places = self.places.iter().copied().step_by(2).collect();
            self.interval_ms *= 2;
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Milliseconds between two.
    pub fn interval_ms(&self) -> u32 {
        self.interval_ms
    }

    /// All of them.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// All of them, as bytes.
    pub fn bytes(&self) -> Vec<u8> {
        self.places.iter().flatten().flat_map(|steps| steps.to_le_bytes()).collect()
    }
}

/// Steps that 32 bits hold; 2^31 of them are more than any axis has.
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
