//! Heaters and fans: M104 to M190, in an image with [`Capability::Printer`].
//!
//! A line may have only one of these codes, and no move. Senders for printers write lines in this way. S is a
//! temperature in degrees Celsius, or the speed of the fan, 0 to 255. T selects the hot end and P the fan. There is one
//! of each, number 0.

use super::block::Block;
use super::codes::HeatCode;
use super::command::{Commands, Motion};
use super::setup::Setup;
use super::state::State;
use super::words::{P, R, S, T};
use crate::capability::Capability;
use crate::status::Status;

/// The heater or fan that a line is for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
#[repr(u8)]
pub enum Part {
    /// The hot end.
    #[default]
    HotEnd = 0,
    /// The bed.
    Bed = 1,
    /// All heaters, and at the end of a program the fan.
    All = 2,
    /// The fan.
    Fan = 3,
}

/// The condition that motion waits for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Wait {
    /// No wait.
    #[default]
    Nothing,
    /// Waits until the heater is at its target or hotter.
    Hot,
    /// Waits until the heater is at its target, also while it cools down.
    Reached,
    /// Waits until the factors of the heater have been found (M303).
    Tuned,
}

/// The request of a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Heat {
    /// The heater or the fan.
    pub part: Part,
    /// The new target: eighths of a degree Celsius with 0 for off, or the speed of the fan, 0 to 255. `None` leaves it
    /// as it is.
    pub to: Option<u16>,
    /// What motion waits for afterwards.
    pub wait: Wait,
}

impl Heat {
    /// Everything off.
    pub const OFF: Self = Self { part: Part::All, to: Some(0), wait: Wait::Nothing };
}

/// The highest speed of a fan.
const FULL: u32 = 255;

#[small]
impl State {
    /// Carries out M104 to M190.
    #[inline(never)]
    pub(super) fn heat(
        block: &Block,
        code: HeatCode,
        setup: &impl Setup,
        out: &mut Commands,
    ) -> Result<(), Status> {
        if !Capability::Printer.is_built_in() {
            return Err(Status::NotBuiltIn);
        }
        if block.does().is_some() || block.spindle.is_some() || block.changes_tool() {
            return Err(Status::ModalGroupViolation);
        }
        if block.rare(T).is_some_and(|word| !word.is_zero()) {
            return Err(Status::TWordInvalid);
        }
        let heat = match code {
            HeatCode::SetHotEnd => set(block, setup, Part::HotEnd)?,
            HeatCode::SetBed => set(block, setup, Part::Bed)?,
            HeatCode::ReachHotEnd => reach(block, setup, Part::HotEnd)?,
            HeatCode::ReachBed => reach(block, setup, Part::Bed)?,
            HeatCode::ReachAll => Heat { part: Part::All, to: None, wait: Wait::Reached },
            HeatCode::Fan => Heat { to: Some(fan(block)?), part: Part::Fan, wait: Wait::Nothing },
            HeatCode::FanOff => {
                fan(block)?;
                Heat { to: Some(0), part: Part::Fan, wait: Wait::Nothing }
            }
        };
        out.motion = Motion::Heat(heat);
        Ok(())
    }
}

/// Carries out M104 and M140.
#[small]
fn set(block: &Block, setup: &impl Setup, part: Part) -> Result<Heat, Status> {
    let to = temperature(block, S, setup, part)?.ok_or(Status::SWordMissing)?;
    Ok(Heat { part, to: Some(to), wait: Wait::Nothing })
}

/// Carries out M109 and M190. With S motion waits while the heater heats up, with R while it cools down as well.
/// Without both motion waits for the target that has been set before.
#[small]
fn reach(block: &Block, setup: &impl Setup, part: Part) -> Result<Heat, Status> {
    let (s, r) = (temperature(block, S, setup, part)?, temperature(block, R, setup, part)?);
    match (s, r) {
        (Some(_), Some(_)) => Err(Status::WordConflict),
        (Some(_), None) => Ok(Heat { part, to: s, wait: Wait::Hot }),
        (None, to) => Ok(Heat { part, to, wait: Wait::Reached }),
    }
}

/// Returns the temperature of a word in eighths of a degree. `None` without the word.
#[inline(never)]
#[small]
fn temperature(
    block: &Block,
    slot: u8,
    setup: &impl Setup,
    part: Part,
) -> Result<Option<u16>, Status> {
    let Some(word) = block.get(slot) else { return Ok(None) };
    let thousandths = word.milliseconds().map_err(|_| Status::OutOfRange)?;
    // Limited to 8,000 degrees, which no heater accepts, so that eighths fit 16 bits.
    let eighths = (thousandths.min(8_000_000) + 62) / 125;
    let eighths = eighths as u16;
    if eighths > 0 {
        setup.heats(part)?;
        if eighths > setup.hottest(part) {
            return Err(Status::AboveMaximum);
        }
    }
    Ok(Some(eighths))
}

/// Returns the speed of the fan. Without S it is the highest speed.
#[small]
fn fan(block: &Block) -> Result<u16, Status> {
    if block.get(P).is_some_and(|word| !word.is_zero()) {
        return Err(Status::PWordInvalid);
    }
    let Some(word) = block.get(S) else { return Ok(FULL as u16) };
    let value = word.milliseconds().map_err(|_| Status::SWordInvalid)?;
    let value = (value.min(FULL * 1_000) + 500) / 1_000;
    Ok(value as u16)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gcode::Interpreter;
    use crate::gcode::setup::Usual;

    fn heat(line: &str) -> Result<Heat, Status> {
        let mut out = Commands::default();
        Interpreter::new().interpret(line.as_bytes(), &Usual, &mut out)?;
        match out.motion {
            Motion::Heat(heat) => Ok(heat),
            other => panic!("{line}: {other:?}"),
        }
    }

    #[test]
    fn printers_say_what_is_to_be_heated() {
        if !Capability::Printer.is_built_in() {
            return;
        }
        let of = |part, to, wait| Ok(Heat { part, to, wait });
        for (line, expected) in [
            ("M104 S200", of(Part::HotEnd, Some(1_600), Wait::Nothing)),
            ("M104 T0 S0", of(Part::HotEnd, Some(0), Wait::Nothing)),
            ("M140 S60.06", of(Part::Bed, Some(480), Wait::Nothing)),
            ("M140 S60.07", of(Part::Bed, Some(481), Wait::Nothing)),
            ("M109 S210", of(Part::HotEnd, Some(1_680), Wait::Hot)),
            ("N5 M109 R210", of(Part::HotEnd, Some(1_680), Wait::Reached)),
            ("M190", of(Part::Bed, None, Wait::Reached)),
            ("M116", of(Part::All, None, Wait::Reached)),
            ("M106", of(Part::Fan, Some(255), Wait::Nothing)),
            ("M106 S127.5", of(Part::Fan, Some(128), Wait::Nothing)),
            ("M106 P0 S300", of(Part::Fan, Some(255), Wait::Nothing)),
            ("M107", of(Part::Fan, Some(0), Wait::Nothing)),
            ("M104", Err(Status::SWordMissing)),
            ("M104 S-5", Err(Status::OutOfRange)),
            ("M104 S4000000", Err(Status::AboveMaximum)),
            ("M104 S276", Err(Status::AboveMaximum)),
            ("M104 T1 S200", Err(Status::TWordInvalid)),
            ("M106 P1 S200", Err(Status::PWordInvalid)),
            ("M109 S200 R200", Err(Status::WordConflict)),
            ("M104 S200 G0 X1", Err(Status::ModalGroupViolation)),
            ("G0 M104 S200 X1", Err(Status::ModalGroupViolation)),
            ("M104 S200 M3", Err(Status::ModalGroupViolation)),
            ("M104 S200 M140", Err(Status::ModalGroupViolation)),
        ] {
            assert_eq!(heat(line), expected, "{line}");
        }
    }

    #[test]
    fn a_temperature_is_no_speed_and_a_hot_end_no_tool() {
        if !Capability::Printer.is_built_in() {
            return;
        }
        let (mut interpreter, mut out) = (Interpreter::new(), Commands::default());
        for line in ["S1000 M3 T5", "M104 T0 S200"] {
            interpreter.interpret(line.as_bytes(), &Usual, &mut out).unwrap();
        }
        assert_eq!((out.spindle, interpreter.selected_tool()), (None, 5));
        assert_eq!(interpreter.spindle_speed() as i32, 1_000);
    }
}
