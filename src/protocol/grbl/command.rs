//! Which command a line is.

use crate::units::AXES;

/// What a line asks for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Command {
    /// A block of G-code, or `$J=`.
    Gcode,
    /// Nothing: an empty line.
    Nothing,
    /// No line, but a `?`.
    Question,
    /// `$`.
    Help,
    /// `$$`.
    Settings,
    /// `$#`.
    Offsets,
    /// `$G`.
    Modes,
    /// `$I`.
    Build,
    /// `$N`.
    Startup,
    /// `$N0=`, `$N1=`: which line; its text is behind these four bytes of the [trimmed](trim) line.
    StoreStartup(u8),
    /// `$H`, of all axes, or of one.
    Home(u8),
    /// `$X`.
    Unlock,
    /// `$C`.
    Check,
    /// `$SLP`.
    Sleep,
    /// `$RST=`, with its letter: `$`, `#` or `*`.
    Restore(u8),
    /// `$x=v`: the number of the setting; its value begins with this byte of the [trimmed](trim) line.
    Set(u8, u8),
    /// `$name`, `$name=v`: a setting by Kerf's own name; its value begins with this byte of the [trimmed](trim) line, 0 if it is asked for.
    Named(u8),
    /// `$J=` with a word that is not allowed there, or without one that has to be.
    BadJog,
    /// A `$` with anything else behind it.
    Unknown,
}

/// All axes, of [`Command::Home`].
pub const ALL: u8 = u8::MAX;

/// The command of a line.
#[inline(never)]
#[small]
pub fn of(line: &[u8]) -> Command {
    let line = trim(line);
    match line {
        [] => Command::Nothing,
        [b'$', rest @ ..] => system(rest),
        _ => Command::Gcode,
    }
}

/// That of a line behind its `$`.
#[small]
fn system(rest: &[u8]) -> Command {
    let upper = |at: usize| rest.get(at).copied().unwrap_or(0).to_ascii_uppercase();
    match (rest.len(), upper(0)) {
        (0, _) => Command::Help,
        (1, b'$') => Command::Settings,
        (1, b'#') => Command::Offsets,
        (1, b'G') => Command::Modes,
        (1, b'I') => Command::Build,
        (1, b'N') => Command::Startup,
        (3.., b'N') if matches!(upper(1), b'0' | b'1') && upper(2) == b'=' => {
            Command::StoreStartup(upper(1) - b'0')
        }
        (1, b'H') => Command::Home(ALL),
        (2, b'H') => axis(upper(1)).map_or(Command::Unknown, Command::Home),
        (1, b'X') => Command::Unlock,
        (1, b'C') => Command::Check,
        (3, b'S') if upper(1) == b'L' && upper(2) == b'P' => Command::Sleep,
        (5, b'R') if upper(1) == b'S' && upper(2) == b'T' && upper(3) == b'=' => match upper(4) {
            letter @ (b'$' | b'#' | b'*') => Command::Restore(letter),
            _ => Command::Unknown,
        },
        (_, b'J') if upper(1) == b'=' => {
            if is_jog(rest.get(2..).unwrap_or(&[])) {
                Command::Gcode
            } else {
                Command::BadJog
            }
        }
        (_, b'0'..=b'9') => setting(rest).or_else(|| named(rest)).unwrap_or(Command::Unknown),
        _ => named(rest).unwrap_or(Command::Unknown),
    }
}

/// `x=v`.
#[small]
fn setting(rest: &[u8]) -> Option<Command> {
    let equals = rest.iter().position(|byte| *byte == b'=')?;
    let mut number = 0u8;
    for digit in trim(rest.get(..equals)?) {
        let digit = digit.wrapping_sub(b'0');
        if digit > 9 {
            return None;
        }
        number = number.checked_mul(10)?.checked_add(digit)?;
    }
    // The `$` counts.
    Some(Command::Set(number, equals as u8 + 2))
}

/// `name`, `name=v`.
#[small]
fn named(rest: &[u8]) -> Option<Command> {
    let equals = rest.iter().position(|byte| *byte == b'=');
    let name = trim(rest.get(..equals.unwrap_or(rest.len()))?);
    let is_name = name.len() > 1 && name.iter().all(u8::is_ascii_alphanumeric);
    is_name.then_some(Command::Named(equals.map_or(0, |equals| equals as u8 + 2)))
}

/// The axis of a letter in upper case.
#[small]
fn axis(letter: u8) -> Option<u8> {
    let axis = match letter {
        b'X'..=b'Z' => letter - b'X',
        b'A'..=b'C' => letter - b'A' + 3,
        _ => return None,
    };
    (usize::from(axis) < AXES).then_some(axis)
}

/// Whether these words are a jog: axis words and F, and besides of G only G20, G21, G53, G90, G91, and N.
#[small]
fn is_jog(words: &[u8]) -> bool {
    let (mut moves, mut feeds) = (false, false);
    let mut at = 0;
    while let Some(byte) = words.get(at) {
        at += 1;
        let letter = byte.to_ascii_uppercase();
        match letter {
            b' ' | b'\t' | b'0'..=b'9' | b'.' | b'-' | b'+' | b'N' => {}
            b';' => break,
            b'(' => {
                let rest = words.get(at..).unwrap_or(&[]);
                at += rest.iter().position(|byte| *byte == b')').map_or(rest.len(), |end| end + 1);
            }
            b'F' => feeds = true,
            b'G' => {
                let digits = [words.get(at).copied(), words.get(at + 1).copied()];
                let more = words.get(at + 2).is_some_and(|byte| matches!(byte, b'0'..=b'9' | b'.'));
                match digits {
                    [Some(b'2'), Some(b'0' | b'1')]
                    | [Some(b'5'), Some(b'3')]
                    | [Some(b'9'), Some(b'0' | b'1')]
                        if !more => {}
                    _ => return false,
                }
            }
            _ if axis(letter).is_some() => moves = true,
            _ => return false,
        }
    }
    moves && feeds
}

/// The words of a jog.
#[inline(never)]
#[small]
pub fn jog(block: &[u8]) -> Option<&[u8]> {
    match trim(block) {
        [b'$', b'J' | b'j', b'=', words @ ..] => Some(words),
        _ => None,
    }
}

/// Whether a line is said in this dialect alone. `$H`, `$X` and `$x=v` are not: TinyG's text mode answers them by a hint.
#[inline(never)]
#[small]
pub fn is_own(line: &[u8]) -> bool {
    match of(line) {
        Command::Settings
        | Command::Offsets
        | Command::Build
        | Command::Startup
        | Command::StoreStartup(_)
        | Command::Sleep
        | Command::Restore(_)
        | Command::BadJog => true,
        // In small letters they are TinyG's.
        Command::Modes | Command::Check => trim(line).last().is_some_and(u8::is_ascii_uppercase),
        Command::Gcode => jog(line).is_some(),
        _ => false,
    }
}

/// The name of [`Command::Named`].
pub fn name(line: &[u8], from: u8) -> &[u8] {
    let line = trim(line);
    let end = if from == 0 { line.len() } else { usize::from(from) - 1 };
    trim(line.get(1..end).unwrap_or(&[]))
}

/// The value of [`Command::Set`] and [`Command::Named`].
pub fn value(line: &[u8], from: u8) -> &[u8] {
    trim(trim(line).get(from.into()..).unwrap_or(&[]))
}

/// Without blanks at its ends.
pub fn trim(line: &[u8]) -> &[u8] {
    line.trim_ascii()
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn commands_are_known_by_their_letters() {
        assert_eq!(of(b"  "), Command::Nothing);
        assert_eq!(of(b"$"), Command::Help);
        assert_eq!(of(b"$hx"), Command::Home(0));
        assert_eq!(of(b"$N1="), Command::StoreStartup(1));
        assert_eq!(of(b"$N2=G54"), Command::Named(4));
        assert_eq!(of(b"$HQ"), Command::Unknown);
        assert_eq!(of(b"$110=500.5"), Command::Set(110, 5));
        assert_eq!(of(b"$999=1"), Command::Named(5));
        assert_eq!(of(b" $spr = -2 "), Command::Named(6));
        assert_eq!((name(b" $spr = -2 ", 6), value(b" $spr = -2 ", 6)), (&b"spr"[..], &b"-2"[..]));
        assert_eq!((of(b"$1sa"), name(b"$1sa", 0)), (Command::Named(0), &b"1sa"[..]));
        for none in ["$q", "$q=1", "$x y=1", "$\"xvm\"=1", "$=1"] {
            assert_eq!(of(none.as_bytes()), Command::Unknown, "{none}");
        }
        assert_eq!(of(b"$rst=*"), Command::Restore(b'*'));
        assert_eq!(of(b"$RST=x"), Command::Unknown);
        assert_eq!(of(b"$J=G91 G21 X1.5 F100"), Command::Gcode);
        for bad in ["$J=X1", "$J=F100", "$J=G1 X1 F1", "$J=M3 X1 F1", "$J=G911X1F1", "$J="] {
            assert_eq!(of(bad.as_bytes()), Command::BadJog, "{bad}");
        }
        assert_eq!(jog(b"$j=x1 f2"), Some(&b"x1 f2"[..]));
    }

    #[test]
    fn what_only_grbl_says() {
        for own in ["$$", "$I", "$G", "$#", "$N", "$C", "$J=X1F1", "$SLP"] {
            assert!(is_own(own.as_bytes()), "{own}");
        }
        for other in
            ["", "g0x1", "$", "$g", "$1sa", "$xvm=1", "{sr:n}", "$H", "$X", "$100=250", "$stat"]
        {
            assert!(!is_own(other.as_bytes()), "{other}");
        }
    }
}
