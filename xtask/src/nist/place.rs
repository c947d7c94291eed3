//! The position of the machine. The interpreter uses the program's unit and coordinates. A position here is in
//! machine coordinates, in millimetres and degrees.

use std::fmt::Write;

/// X Y Z A B C.
pub type Axes = [f64; 6];

/// Number of axes that are lengths.
const LENGTHS: usize = 3;

/// The difference between the program's coordinates and the machine's, in millimetres.
pub struct Frame {
    /// The program's unit in millimetres.
    unit: f64,
    system: Axes,
    shift: Axes,
    tool: Axes,
}

impl Frame {
    /// A frame in millimetres without offsets.
    pub const fn new() -> Self {
        Self { unit: 1.0, system: [0.0; 6], shift: [0.0; 6], tool: [0.0; 6] }
    }

    /// Sets the unit of all that follows; offsets keep their size.
    pub fn set_unit(&mut self, millimetres: f64) {
        self.unit = millimetres;
    }

    /// Sets the origin of the coordinate system in use.
    pub fn set_system(&mut self, offset: Axes) {
        self.system = self.scaled(offset);
    }

    /// Sets the shift by G92.
    pub fn set_shift(&mut self, offset: Axes) {
        self.shift = self.scaled(offset);
    }

    /// Sets the tool's length.
    pub fn set_tool(&mut self, offset: Axes) {
        self.tool = self.scaled(offset);
    }

    /// Converts a coordinate of the program on an axis to a machine coordinate.
    pub fn machine(&self, axis: usize, value: f64) -> f64 {
        let unit = if axis < LENGTHS { self.unit } else { 1.0 };
        value * unit + self.system[axis] + self.shift[axis] + self.tool[axis]
    }

    fn scaled(&self, mut offset: Axes) -> Axes {
        offset[..LENGTHS].iter_mut().for_each(|length| *length *= self.unit);
        offset
    }
}

/// Formats numbers for a motion: four decimals, no negative zero, each after a blank.
pub fn written(numbers: &[f64]) -> String {
    numbers.iter().fold(String::new(), |mut text, number| {
        let shown = format!("{number:.4}");
        let shown = if shown == "-0.0000" { "0.0000" } else { &shown };
        write!(text, " {shown}").expect("a string takes everything");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_keep_the_unit_they_were_given_in() {
        let mut frame = Frame::new();
        frame.set_unit(25.4);
        frame.set_system([1.0, 0.0, 0.0, 5.0, 0.0, 0.0]);
        frame.set_unit(1.0);
        frame.set_shift([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        frame.set_tool([0.0, 0.0, 3.0, 0.0, 0.0, 0.0]);
        assert_eq!(frame.machine(0, 2.0), 28.4);
        assert_eq!(frame.machine(2, 2.0), 5.0);
        assert_eq!(frame.machine(3, 1.0), 6.0);
    }

    #[test]
    fn no_zero_is_negative() {
        assert_eq!(written(&[-0.00001, -1.0]), " 0.0000 -1.0000");
    }
}
