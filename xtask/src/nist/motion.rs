//! The normalised motion: one line for each move and for every other action of the machine.

use anyhow::{Result, bail};

use super::canon::Canon;
use super::place::{Axes, Frame, written};

/// The plane of arcs: its name, its first and second axis, and its third axis.
type Plane = (&'static str, [usize; 3]);
const XY: Plane = ("XY", [0, 1, 2]);
const ZX: Plane = ("ZX", [2, 0, 1]);
const YZ: Plane = ("YZ", [1, 2, 0]);

/// Follows the interpreter's output and writes the motion.
pub struct Motion {
    frame: Frame,
    plane: Plane,
    /// The position as text, to recognise a move that goes nowhere.
    place: String,
    spindle: &'static str,
    mist: bool,
    flood: bool,
    text: String,
}

impl Motion {
    /// Returns the motion of the interpreter's output.
    pub fn of(canon: &str) -> Result<String> {
        let mut motion = Self {
            frame: Frame::new(),
            plane: XY,
            place: written(&[0.0; 6]),
            spindle: "OFF",
            mist: false,
            flood: false,
            text: String::new(),
        };
        for canon in canon.lines().filter_map(Canon::read) {
            motion.take(&canon)?;
        }
        Ok(motion.text)
    }

    fn take(&mut self, canon: &Canon) -> Result<()> {
        match canon.name {
            "STRAIGHT_TRAVERSE" => self.line("TRAVERSE", canon.numbers(0)?),
            "STRAIGHT_FEED" => self.line("FEED", canon.numbers(0)?),
            "STRAIGHT_PROBE" => self.probe(canon.numbers(0)?),
            "ARC_FEED" => self.arc(canon)?,
            "DWELL" => self.say(&format!("DWELL{}", written(&[canon.number(0)?]))),
            "CHANGE_TOOL" => self.say(&format!("TOOL {}", canon.word(0)?)),
            "PROGRAM_STOP" | "OPTIONAL_PROGRAM_STOP" => self.say("STOP"),
            "PROGRAM_END" => self.say("END"),
            name if self.set(canon)? || self.switch(name) || is_silent(name) => {}
            name => bail!("{name} is not known"),
        }
        Ok(())
    }

    /// Executes commands for units, offsets and planes. Returns whether it was such a command.
    fn set(&mut self, canon: &Canon) -> Result<bool> {
        match canon.name {
            "USE_LENGTH_UNITS" => self.frame.set_unit(unit(canon.word(0)?)?),
            "SELECT_PLANE" => self.plane = plane(canon.word(0)?)?,
            "SET_G5X_OFFSET" => self.frame.set_system(canon.numbers(1)?),
            "SET_G92_OFFSET" => self.frame.set_shift(canon.numbers(0)?),
            "USE_TOOL_LENGTH_OFFSET" => self.frame.set_tool(canon.numbers(0)?),
            "SET_XY_ROTATION" if canon.number(0)? != 0.0 => bail!("a turned system"),
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Executes commands for spindle and coolant. Writes changes only, no repetitions.
    fn switch(&mut self, name: &str) -> bool {
        match name {
            "START_SPINDLE_CLOCKWISE" => self.turn("CW"),
            "START_SPINDLE_COUNTERCLOCKWISE" => self.turn("CCW"),
            "STOP_SPINDLE_TURNING" => self.turn("OFF"),
            "MIST_ON" => self.cool(true, self.flood, "MIST"),
            "FLOOD_ON" => self.cool(self.mist, true, "FLOOD"),
            "MIST_OFF" => self.cool(false, self.flood, "OFF"),
            "FLOOD_OFF" => self.cool(self.mist, false, "OFF"),
            _ => return false,
        }
        true
    }

    fn turn(&mut self, to: &'static str) {
        if self.spindle != to {
            self.say(&format!("SPINDLE {to}"));
        }
        self.spindle = to;
    }

    /// Writes that coolant is off when neither kind is left on.
    fn cool(&mut self, mist: bool, flood: bool, told: &str) {
        let changed = (mist, flood) != (self.mist, self.flood);
        (self.mist, self.flood) = (mist, flood);
        if changed && (told != "OFF" || !(mist || flood)) {
            self.say(&format!("COOLANT {told}"));
        }
    }

    /// Writes a straight move, unless it goes nowhere.
    fn line(&mut self, kind: &str, end: Axes) {
        let place = self.written_place(end);
        if place != self.place {
            self.say(&format!("{kind}{place}"));
            self.place = place;
        }
    }

    /// Writes a probing move, even if it ends where it begins.
    fn probe(&mut self, end: Axes) {
        self.place = self.written_place(end);
        self.say(&format!("PROBE{}", self.place));
    }

    /// Writes an arc: the end and the centre along the plane's axes, the turns, the end along the third axis, and A B
    /// C.
    fn arc(&mut self, canon: &Canon) -> Result<()> {
        let [first_end, second_end, first_centre, second_centre] = canon.numbers(0)?;
        let [third_end, a, b, c] = canon.numbers(5)?;
        let (name, [first, second, third]) = self.plane;
        let mut end = [0.0, 0.0, 0.0, a, b, c];
        (end[first], end[second], end[third]) = (first_end, second_end, third_end);
        let centre =
            [self.frame.machine(first, first_centre), self.frame.machine(second, second_centre)];
        self.place = self.written_place(end);
        let turns = canon.word(4)?;
        self.say(&format!("ARC {name}{}{} {turns}", self.place, written(&centre)));
        Ok(())
    }

    fn written_place(&self, mut end: Axes) -> String {
        for (axis, value) in end.iter_mut().enumerate() {
            *value = self.frame.machine(axis, *value);
        }
        written(&end)
    }

    fn say(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }
}

fn unit(name: &str) -> Result<f64> {
    match name {
        "CANON_UNITS_MM" => Ok(1.0),
        "CANON_UNITS_INCHES" => Ok(25.4),
        _ => bail!("{name} is no unit"),
    }
}

fn plane(name: &str) -> Result<Plane> {
    match name {
        "CANON_PLANE_XY" => Ok(XY),
        "CANON_PLANE_XZ" => Ok(ZX),
        "CANON_PLANE_YZ" => Ok(YZ),
        _ => bail!("{name} is no plane"),
    }
}

/// Whether a command moves nothing and is not part of a motion.
fn is_silent(name: &str) -> bool {
    const NAMES: [&str; 24] = [
        "CLEAR_AUX_OUTPUT_BIT",
        "COMMENT",
        "DISABLE_FEED_OVERRIDE",
        "DISABLE_SPEED_OVERRIDE",
        "ENABLE_FEED_OVERRIDE",
        "ENABLE_SPEED_OVERRIDE",
        "FINISH",
        "MESSAGE",
        "ON_RESET",
        "ORIENT_SPINDLE",
        "PALLET_SHUTTLE",
        "SELECT_TOOL",
        "SET_FEED_MODE",
        "SET_FEED_RATE",
        "SET_FEED_REFERENCE",
        "SET_MOTION_CONTROL_MODE",
        "SET_NAIVECAM_TOLERANCE",
        "SET_SPINDLE_MODE",
        "SET_SPINDLE_SPEED",
        "SET_TOOL_TABLE_ENTRY",
        "SET_XY_ROTATION",
        "START_CHANGE",
        "TURN_PROBE_OFF",
        "TURN_PROBE_ON",
    ];
    NAMES.contains(&name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(canon: &str) -> String {
        Motion::of(canon).unwrap()
    }

    #[test]
    fn moves_are_in_machine_millimetres() {
        let canon = "1 N1 USE_LENGTH_UNITS(CANON_UNITS_INCHES)\n\
            2 N1 USE_TOOL_LENGTH_OFFSET(0.0 0.0 1.0, 0.0 0.0 0.0, 0.0 0.0 0.0)\n\
            3 N1 STRAIGHT_TRAVERSE(1.0, 0.0, -1.0, 90.0, 0.0, 0.0)\n\
            4 N1 STRAIGHT_FEED(1.0, 0.0, -1.0, 90.0, 0.0, 0.0)\n";
        assert_eq!(motion(canon), "TRAVERSE 25.4000 0.0000 0.0000 90.0000 0.0000 0.0000\n");
    }

    #[test]
    fn an_arc_has_the_axes_of_its_plane() {
        let canon = "1 N1 SET_G5X_OFFSET(1, 10.0, 20.0, 30.0, 0.0, 0.0, 0.0)\n\
            2 N1 SELECT_PLANE(CANON_PLANE_XZ)\n\
            3 N1 ARC_FEED(1.0, 2.0, 3.0, 4.0, -1, 5.0, 6.0, 7.0, 8.0)\n";
        let arc = "ARC ZX 12.0000 25.0000 31.0000 6.0000 7.0000 8.0000 33.0000 14.0000 -1\n";
        assert_eq!(motion(canon), arc);
    }

    #[test]
    fn switches_are_told_when_they_change() {
        let canon = "1 N1 STOP_SPINDLE_TURNING(0)\n2 N1 START_SPINDLE_CLOCKWISE(0)\n\
            3 N1 START_SPINDLE_CLOCKWISE(0)\n4 N1 MIST_ON()\n5 N1 FLOOD_ON()\n\
            6 N1 MIST_OFF()\n7 N1 FLOOD_OFF()\n8 N1 MIST_OFF()\n9 N1 PROGRAM_END()\n";
        assert_eq!(motion(canon), "SPINDLE CW\nCOOLANT MIST\nCOOLANT FLOOD\nCOOLANT OFF\nEND\n");
    }

    #[test]
    fn the_unknown_is_an_error() {
        assert!(Motion::of("1 N1 NURBS_FEED(1)").is_err());
    }
}
