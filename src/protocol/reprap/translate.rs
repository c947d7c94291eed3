//! Translates a block for the interpreter. E becomes A, and codes with another meaning in RS274 become the codes that
//! do what is meant.
//!
//! | RepRap | the interpreter's |
//! |---|---|
//! | G0 | G1: at F, as other printer firmware does |
//! | G4 P in ms, S in s | G4 P in s |
//! | G92 without words | G92 of X, Y, Z and E |
//! | G92 X | G92 X0 |
//! | M0, M1, with a text or without | M0; with P or S G4 |
//! | M25, M226, M600, M601 | M0 |
//! | G10 P0 S | M104 S |
//! | F0 | no F: the old feed stays |
//! | G2, G3 with I, J and K of 0 | G1: a slicer has rounded the radius to nothing |
//! | M2, M30 | M2: heaters and outputs off, default modes |
//!
//! G28 and other G10 are not translated: [`host`](super::host) performs them.

use super::command;
use crate::capability::Capability;
use crate::protocol::Rewritten;
use crate::status::Status;

/// Writes the translated block to `out`.
#[inline(never)]
#[small]
pub fn block<'a>(block: &[u8], out: &'a mut Rewritten) -> Result<&'a [u8], Status> {
    out.clear();
    match command::code(block) {
        Some((b'G', 4)) if !are_times(block) => return Err(Status::OutOfRange),
        Some((b'G', 4)) => dwell(block, out)?,
        Some((b'M', 0 | 1)) if has_time(block) => dwell(block, out)?,
        Some((b'M', 0 | 1 | 25 | 226 | 600 | 601)) => put(out, b"M0")?,
        // M30 with a file name never comes here: `host` handles it.
        Some((b'M', 2 | 30)) => put(out, b"M2")?,
        Some((b'G', 92)) if !has_words(block) => put(out, b"G92X0Y0Z0A0")?,
        Some((b'G', 92)) => copy(block, b"", true, out)?,
        Some((b'G', 0)) => words(b"G1 ", block, b"", out)?,
        Some((b'G', 2 | 3)) if is_point(block) => words(b"G1 ", block, b"IJKP", out)?,
        Some((b'G', 10)) => temperature(block, out)?,
        _ => copy(block, b"", false, out)?,
    }
    // Words of printing hosts have numbers alone: in an expression an E would be no extruder.
    if Capability::Language.is_built_in() { only_numbers(out) } else { Ok(out) }
}

/// Refuses a block with a parameter, an expression or a second sign.
fn only_numbers(block: &[u8]) -> Result<&[u8], Status> {
    let mut before = 0;
    for byte in command::Bytes::of(block) {
        match (before, byte) {
            (_, b'#' | b'[') => return Err(Status::NotBuiltIn),
            (b'-' | b'+', b'-' | b'+') => return Err(Status::BadNumber),
            _ => before = byte,
        }
    }
    Ok(block)
}

/// Writes a code with the words of another block, but for those `without` which it goes.
#[inline(never)]
#[small]
fn words(code: &[u8], block: &[u8], without: &[u8], out: &mut Rewritten) -> Result<(), Status> {
    put(out, code)?;
    copy(command::words(block), without, false, out)
}

/// Whether the centre of an arc is its start.
#[small]
fn is_point(block: &[u8]) -> bool {
    let mut words = b"IJK".iter().filter(|letter| command::has(block, **letter)).peekable();
    let has_words = words.peek().is_some() && !command::has(block, b'R');
    has_words && words.all(|letter| command::value(block, *letter, 4) == Some(0))
}

/// Writes M104 for the G10 of Duet's firmware. R, a temperature for an extruder that is not in use, is left out.
#[inline(never)]
#[small]
fn temperature(block: &[u8], out: &mut Rewritten) -> Result<(), Status> {
    if b"LXYZ".iter().any(|letter| command::has(block, *letter)) {
        return Err(Status::WordUnused);
    }
    match command::value(block, b'P', 0) {
        Some(0) if command::has(block, b'S') => words(b"M104 ", block, b"PR", out),
        Some(0) => Ok(()),
        _ => Err(Status::ToolInvalid),
    }
}

/// Whether words of a code are left out here, so that it is to have no others than its own.
pub fn leaves_out(code: (u8, u16)) -> bool {
    matches!(code, (b'G', 4 | 10) | (b'M', 0 | 1 | 2 | 226 | 600 | 601))
}

/// Whether M0 is a pause of some time. If the time is none, it waits for the user.
fn has_time(block: &[u8]) -> bool {
    time_ms(block).is_some_and(|ms| ms >= 0)
}

/// Whether the words S and P of G4 are times.
#[small]
fn are_times(block: &[u8]) -> bool {
    let is_time = |letter, decimals| {
        !command::has(block, letter)
            || command::value(block, letter, decimals).is_some_and(|time| time >= 0)
    };
    is_time(b'S', 3) && is_time(b'P', 0)
}

/// Returns the time of a dwell in ms: S is in s, P in ms. `None` without either.
#[small]
fn time_ms(block: &[u8]) -> Option<i32> {
    command::value(block, b'S', 3).or_else(|| command::value(block, b'P', 0))
}

fn has_words(block: &[u8]) -> bool {
    command::Bytes::of(command::words(block)).any(|byte| byte.is_ascii_alphabetic())
}

/// Writes `G4 P` with the time in seconds, and none of the block's other words.
#[inline(never)]
#[small]
fn dwell(block: &[u8], out: &mut Rewritten) -> Result<(), Status> {
    let ms = time_ms(block).unwrap_or(0);
    put(out, b"G4P")?;
    let (mut rest, mut divisor) = (ms as u32, 1_000_000_000u32);
    while divisor > 0 {
        if divisor == 100 {
            put(out, b".")?;
        }
        put(out, &[b'0' + (rest / divisor) as u8])?;
        rest %= divisor;
        divisor /= 10;
    }
    Ok(())
}

fn put(out: &mut Rewritten, text: &[u8]) -> Result<(), Status> {
    out.extend_from_slice(text).map_err(|_| Status::InputTooLong)
}

/// Copies words, but for the text of comments, F0, and the words `without` which it goes. With `bare` an axis without a
/// number has 0. Cost on AVR: 70 cycles a byte.
#[inline(never)]
#[small]
fn copy(text: &[u8], without: &[u8], bare: bool, out: &mut Rewritten) -> Result<(), Status> {
    let mut bytes = command::Bytes::of(text);
    while let Some(byte) = bytes.next() {
        let letter = byte.to_ascii_uppercase();
        if without.contains(&letter) {
            bytes.take_number();
            continue;
        }
        if letter == b'F' && bytes.take_zero() {
            continue;
        }
        let byte = if matches!(byte, b'E' | b'e') { b'A' } else { byte };
        put(out, &[byte])?;
        if bare && matches!(letter, b'X'..=b'Z' | b'E') && bytes.is_bare() {
            put(out, b"0")?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks() {
        for (from, to) in [
            ("G1 X10 E2.5 F3000 ; outline", "G1 X10 A2.5 F3000 "),
            ("g0 x1 f9000", "G1 x1 f9000"),
            ("G92 E0", "G92 A0"),
            ("G92 X", "G92 X0"),
            ("G92 X5 yE ; Z", "G92 X5 y0A0 "),
            ("G92", "G92X0Y0Z0A0"),
            ("G4 P500", "G4P0000000.500"),
            ("G4 S2", "G4P0000002.000"),
            ("G4", "G4P0000000.000"),
            ("G92 (E is 0)", "G92X0Y0Z0A0"),
            ("G1 X1 (outer (E4) E5) E1", "G1 X1 () A1"),
            ("G1 X1 (outer; E5) E1 (", "G1 X1 () A1 ("),
            ("G4 (S 1) P500", "G4P0000000.500"),
            ("M0 Turn the part", "M0"),
            ("M1 S3", "G4P0000003.000"),
            ("M1 S-3", "M0"),
            ("G4 S2 P500", "G4P0000002.000"),
            ("G90", "G90"),
            ("X1 E1", "X1 A1"),
            ("G1 F0", "G1 "),
            ("G0 F0 X5 Y5", "G1  X5 Y5"),
            ("G1 X7 f-0.0E-1", "G1 X7 A-1"),
            ("G1 X7 F0.5 E-1", "G1 X7 F0.5 A-1"),
            ("G1 X7 F (0) 0", "G1 X7 F () 0"),
            ("G2 X1 Y2 I-0 J-0 E1", "G1 X1 Y2   A1"),
            ("G3 Z1 I0J0P1 F600", "G1 Z1  F600"),
            ("G3 X1 I0 J0.5", "G3 X1 I0 J0.5"),
            ("G2 X1 I0 R5", "G2 X1 I0 R5"),
            ("G2 X1 Y1", "G2 X1 Y1"),
            ("G2 X1 I", "G2 X1 I"),
            ("G10 P0 S205", "M104  S205"),
            ("G10 P0 R180 S205.5", "M104   S205.5"),
            ("G10 P0 R180", ""),
            ("M600 X5", "M0"),
            ("M226", "M0"),
        ] {
            let mut out = Rewritten::new();
            assert_eq!(block(from.as_bytes(), &mut out), Ok(to.as_bytes()), "{from}");
        }
        for (refused, status) in [
            ("G10 P1 S205", Status::ToolInvalid),
            ("G4 P-1", Status::OutOfRange),
            ("G4 S3000000 P500", Status::OutOfRange),
            ("G4 S", Status::OutOfRange),
            ("G10 P S205", Status::ToolInvalid),
            ("G10 L2 P1 X0", Status::WordUnused),
            ("G10 P0 Z0.2", Status::WordUnused),
        ] {
            assert_eq!(block(refused.as_bytes(), &mut Rewritten::new()), Err(status), "{refused}");
        }
        assert_eq!(block(&[b'X'; 120], &mut Rewritten::new()), Err(Status::InputTooLong));
    }
}
