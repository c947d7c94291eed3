//! Recognizes which command a line is.

#[cfg(feature = "sd")]
use super::card;
use crate::gcode::comment;
#[cfg(feature = "sd")]
use crate::protocol::files::Files;
use crate::units::AXES;

/// The command of a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Command {
    /// A block of G-code, or `$J=`.
    Gcode,
    /// An empty line, which has no command.
    Nothing,
    /// A `?`, which is taken out of the stream and is not a line.
    Question,
    /// `$`.
    Help,
    /// `h` or `help`, which a user of TinyG types.
    Hint,
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
    /// `$N0=`, `$N1=`, with the number of the start-up line. Its text is [behind](behind_equals) the `=`.
    StoreStartup(u8),
    /// `$H` for all axes, or for one.
    Home(u8),
    /// `$X`.
    Unlock,
    /// `$C`.
    Check,
    /// `$SLP`.
    Sleep,
    /// `$F` and the commands that begin with it.
    #[cfg(feature = "sd")]
    Files(Files),
    /// `$RST=`, with its letter: `$`, `#` or `*`.
    Restore(u8),
    /// `$x=v`: the number of the setting, and the offset of the value behind the `$`.
    Set(u8, u8),
    /// `$name`, `$name=v`: a setting by Kerf's own name, and the offset of the value behind the `$`; 0 if the setting
    /// is only read.
    Named(u8),
    /// `$J=` with a word that is not allowed in a jog, or without a required word.
    BadJog,
    /// A `$` with any other text behind it.
    Unknown,
}

/// Stands for all axes in [`Command::Home`].
pub const ALL: u8 = u8::MAX;

/// Returns the command of a line.
#[inline(never)]
#[small]
pub fn of(line: &[u8]) -> Command {
    let line = trim(line);
    match line {
        b"h" | b"H" | b"help" if cfg!(feature = "dialect-tinyg") => Command::Hint,
        line if is_empty(line) && !comment::is_telling(line) => Command::Nothing,
        [b'$', rest @ ..] => system(rest),
        _ => Command::Gcode,
    }
}

/// Whether a line has nothing but comments, so that no alarm refuses it.
#[small]
pub fn is_empty(line: &[u8]) -> bool {
    let mut line = trim(line);
    while let [b'(', text @ ..] = line {
        line = trim(text.get(comment::length(text) + 1..).unwrap_or(&[]));
    }
    matches!(line, [] | [b';', ..])
}

/// Returns the command of the text behind a `$`. Comments and blanks are ignored.
#[small]
fn system(rest: &[u8]) -> Command {
    let words = without_comment(rest);
    let (mut count, mut letters) = (0usize, [0; 5]);
    for byte in words.iter().filter(|byte| !is_blank(**byte)) {
        if let Some(letter) = letters.get_mut(count) {
            *letter = byte.to_ascii_uppercase();
        }
        count += 1;
    }
    #[cfg(feature = "sd")]
    if let Some(files) = card::of(letters.get(..count.min(letters.len())).unwrap_or(&[])) {
        return Command::Files(files);
    }
    match (count, letters) {
        (0, _) => Command::Help,
        (1, [b'$', ..]) => Command::Settings,
        (1, [b'#', ..]) => Command::Offsets,
        (1, [b'G', ..]) => Command::Modes,
        (1, [b'I', ..]) => Command::Build,
        (1, [b'N', ..]) => Command::Startup,
        (3.., [b'N', line @ (b'0' | b'1'), b'=', ..]) => Command::StoreStartup(line - b'0'),
        (1, [b'H', ..]) => Command::Home(ALL),
        (2, [b'H', letter, ..]) => axis(letter).map_or(Command::Unknown, Command::Home),
        (1, [b'X', ..]) => Command::Unlock,
        (1, [b'C', ..]) => Command::Check,
        (3, [b'S', b'L', b'P', ..]) => Command::Sleep,
        (5, [b'R', b'S', b'T', b'=', letter]) => match letter {
            b'$' | b'#' | b'*' => Command::Restore(letter),
            _ => Command::Unknown,
        },
        (_, [b'J', b'=', ..]) if is_jog(behind_equals(rest)) => Command::Gcode,
        (_, [b'J', b'=', ..]) => Command::BadJog,
        (_, [b'0'..=b'9', ..]) => {
            setting(words).or_else(|| named(words)).unwrap_or(Command::Unknown)
        }
        _ => named(words).unwrap_or(Command::Unknown),
    }
}

fn is_blank(byte: u8) -> bool {
    byte == b' ' || byte == b'\t'
}

/// Returns the text up to a comment, without blanks at its ends.
#[small]
fn without_comment(text: &[u8]) -> &[u8] {
    let end = text.iter().position(|byte| matches!(byte, b'(' | b';'));
    trim(text.get(..end.unwrap_or(text.len())).unwrap_or(&[]))
}

/// Returns the text behind the first `=`; empty if there is none.
#[small]
pub fn behind_equals(text: &[u8]) -> &[u8] {
    let equals = text.iter().position(|byte| *byte == b'=');
    equals.and_then(|equals| text.get(equals + 1..)).unwrap_or(&[])
}

/// Parses `x=v`. `None` if `x` is not a number up to 255.
#[small]
fn setting(rest: &[u8]) -> Option<Command> {
    let equals = rest.iter().position(|byte| *byte == b'=')?;
    // In 16 bits, because on AVR a checked 8-bit product does not detect its overflow.
    let mut number = 0u16;
    for digit in rest.get(..equals)?.iter().filter(|byte| !is_blank(**byte)) {
        let digit = digit.wrapping_sub(b'0');
        if digit > 9 {
            return None;
        }
        number = number * 10 + u16::from(digit);
        if number > u16::from(u8::MAX) {
            return None;
        }
    }
    Some(Command::Set(number as u8, equals as u8 + 1))
}

/// Parses `name` or `name=v`. `None` if there is no name.
#[small]
fn named(rest: &[u8]) -> Option<Command> {
    let equals = rest.iter().position(|byte| *byte == b'=');
    let name = trim(rest.get(..equals.unwrap_or(rest.len()))?);
    let is_name = name.len() > 1 && name.iter().all(u8::is_ascii_alphanumeric);
    is_name.then_some(Command::Named(equals.map_or(0, |equals| equals as u8 + 1)))
}

/// Returns the axis of an upper-case letter; `None` if there is no such axis.
#[small]
fn axis(letter: u8) -> Option<u8> {
    let axis = match letter {
        b'X'..=b'Z' => letter - b'X',
        b'A'..=b'C' => letter - b'A' + 3,
        _ => return None,
    };
    (usize::from(axis) < AXES).then_some(axis)
}

/// Whether these words are a valid jog: axis words and F are required; N and, of G, only G20, G21, G53, G90 and G91
/// are allowed.
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
                at += comment::length(rest) + 1;
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

/// Whether a line of G-code has an axis word and is not a jog. A letter in a comment may be mistaken for an axis
/// word.
#[small]
pub fn moves(line: &[u8]) -> bool {
    line.iter().any(|byte| axis(byte.to_ascii_uppercase()).is_some()) && jog(line).is_none()
}

/// Returns the words of a jog; `None` if the block is not a jog.
#[inline(never)]
#[small]
pub fn jog(block: &[u8]) -> Option<&[u8]> {
    let mut letters = block.iter().filter(|byte| !is_blank(**byte));
    let mut next = || letters.next().map(u8::to_ascii_uppercase);
    let is_jog = next() == Some(b'$') && next() == Some(b'J') && next() == Some(b'=');
    is_jog.then(|| behind_equals(block))
}

/// Whether a line is a command of this dialect alone: in lower case it is one of TinyG.
#[inline(never)]
#[small]
pub fn is_own(line: &[u8]) -> bool {
    let line = without_comment(line);
    line.first() == Some(&b'$') && !line.iter().any(u8::is_ascii_lowercase)
}

/// Returns the name in a [`Command::Named`].
pub fn name(line: &[u8], from: u8) -> &[u8] {
    let words = behind_dollar(line);
    let end = if from == 0 { words.len() } else { usize::from(from) - 1 };
    trim(words.get(..end).unwrap_or(&[]))
}

/// Returns the value in a [`Command::Set`] or [`Command::Named`].
pub fn value(line: &[u8], from: u8) -> &[u8] {
    trim(behind_dollar(line).get(from.into()..).unwrap_or(&[]))
}

fn behind_dollar(line: &[u8]) -> &[u8] {
    without_comment(trim(line).get(1..).unwrap_or(&[]))
}

/// Returns the line without blanks at its ends.
pub fn trim(line: &[u8]) -> &[u8] {
    line.trim_ascii()
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn commands_are_known_by_their_letters() {
        for nothing in ["", "  ", "(a)", " (a) (b); c", ";", "(a"] {
            assert_eq!(of(nothing.as_bytes()), Command::Nothing, "{nothing}");
        }
        assert_eq!((of(b"(a) g0"), of(b")")), (Command::Gcode, Command::Gcode));
        assert_eq!(of(b"$"), Command::Help);
        assert_eq!(of(b"$hx"), Command::Home(0));
        assert_eq!(of(b"$N1="), Command::StoreStartup(1));
        assert_eq!(of(b"$N2=G54"), Command::Named(3));
        assert_eq!(of(b"$HQ"), Command::Unknown);
        assert_eq!(of(b"$110=500.5"), Command::Set(110, 4));
        assert_eq!(of(b"$999=1"), Command::Named(4));
        assert_eq!(of(b" $ spr = -2 ; down"), Command::Named(5));
        let line = b" $ spr = -2 ; down";
        assert_eq!((name(line, 5), value(line, 5)), (&b"spr"[..], &b"-2"[..]));
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
        assert_eq!(jog(b" $ J = X1 F2"), Some(&b" X1 F2"[..]));
        for (line, command) in [
            ("$X (Use current location.)", Command::Unlock),
            ("$ X", Command::Unlock),
            ("$G ; modes", Command::Modes),
            ("$#;c", Command::Offsets),
            ("$ (help)", Command::Help),
            ("$h (Home)", Command::Home(ALL)),
            ("$ H x", Command::Home(0)),
            ("$ 1 1 1 = 1500 (c)", Command::Set(111, 7)),
            ("$ R S T = *", Command::Restore(b'*')),
            ("$ J = G91 X1 F1000", Command::Gcode),
            ("$N 0 = G54 (c)", Command::StoreStartup(0)),
        ] {
            assert_eq!(of(line.as_bytes()), command, "{line}");
        }
    }

    #[test]
    fn what_only_grbl_says() {
        for own in [
            "$$",
            "$I",
            "$G",
            "$#",
            "$N",
            "$C",
            "$J=X1F1",
            "$SLP",
            "$",
            "$H",
            "$X",
            "$100=250",
            "$X (home)",
        ] {
            assert!(is_own(own.as_bytes()), "{own}");
        }
        for other in ["", "g0x1", "$g", "$1sa", "$xvm=1", "{sr:n}", "$stat", "G0 ($X)"] {
            assert!(!is_own(other.as_bytes()), "{other}");
        }
    }
}
