//! M593: the resonances of the axes.

use super::command::{has, value};
use super::host::{Step, done};
use super::write::{fixed, line_end, text};
use crate::config::Fixed;
use crate::config::shape::{DAMPING_MOST, RINGING, Resonances};
use crate::protocol::{Machine, Out};
use crate::status::Status;
use crate::text;

const AXES: [u8; RINGING] = *b"XYZ";

/// M593: F sets the frequency of X and Y, or of the axes that are named, in Hz; 0 for none. D sets the damping ratio.
/// Without words it shows them.
#[inline(never)]
#[small]
pub fn set(block: &[u8], machine: &mut impl Machine, out: &mut impl Out) -> Step {
    let Some(mut to) = machine.settings().resonances.first().copied() else {
        return Step::Refused(Status::NotBuiltIn);
    };
    if !b"FDXYZ".iter().any(|letter| has(block, *letter)) {
        tell(&to, out);
        return Step::Done;
    }
    if take(block, &mut to).is_none() || !to.fits() {
        return Step::Refused(Status::OutOfRange);
    }
    match machine.shape(to) {
        Status::Again => Step::Later(0),
        status => done(status),
    }
}

/// Takes the words of a line over; `None` if one is out of range.
fn take(block: &[u8], to: &mut Resonances) -> Option<()> {
    if has(block, b'F') {
        let hertz = u16::try_from(value(block, b'F', 1)?).ok()?;
        let names = AXES.iter().any(|axis| has(block, *axis));
        for (axis, place) in AXES.iter().zip(&mut to.hertz) {
            let is_meant = if names { has(block, *axis) } else { *axis != b'Z' };
            if is_meant {
                *place = hertz;
            }
        }
    }
    if has(block, b'D') {
        let damping = value(block, b'D', 2)?;
        to.damping = u8::try_from(damping).ok().filter(|damping| *damping <= DAMPING_MOST)?;
    }
    Some(())
}

/// Writes `echo:  M593 X40.0 Y0.0 Z0.0 D0.10`.
fn tell(now: &Resonances, out: &mut impl Out) {
    text(out, text!("echo:  M593"));
    for (axis, hertz) in AXES.into_iter().zip(now.hertz) {
        out.put(b' ');
        out.put(axis);
        fixed(out, Fixed { value: hertz.into(), decimals: 1 });
    }
    text(out, text!(" D"));
    fixed(out, Fixed { value: now.damping.into(), decimals: 2 });
    line_end(out);
}
