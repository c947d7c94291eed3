//! The beginning of a line with an O word: its label and its keyword.

use super::expression::{Scope, value};
use super::number;
use super::text::{Name, Text};
use crate::status::Status;

/// What names a block or a subroutine: a number, or a name by its hash.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Label(u64);

impl Label {
    /// No label, in places that are not in use.
    pub const NONE: Self = Self(0);

    fn number(number: u32) -> Self {
        Self(u64::from(number) + 1)
    }

    /// Returns the label of a name: its hash, FNV-1a of 64 bits, beyond all numbers.
    fn name(name: Name) -> Self {
        let hash = name.bytes().fold(0xCBF2_9CE4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01B3)
        });
        Self(hash | 1 << 63)
    }
}

/// What an O word does.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Keyword {
    Sub,
    Endsub,
    Call,
    Return,
    If,
    Elseif,
    Else,
    Endif,
    While,
    Endwhile,
    Do,
    Repeat,
    Endrepeat,
    Break,
    Continue,
}

/// The keywords as they are written. One that begins like another stands before it.
const KEYWORDS: [(&[u8], Keyword); 15] = [
    (b"SUB", Keyword::Sub),
    (b"ENDSUB", Keyword::Endsub),
    (b"CALL", Keyword::Call),
    (b"RETURN", Keyword::Return),
    (b"IF", Keyword::If),
    (b"ELSEIF", Keyword::Elseif),
    (b"ELSE", Keyword::Else),
    (b"ENDIF", Keyword::Endif),
    (b"WHILE", Keyword::While),
    (b"ENDWHILE", Keyword::Endwhile),
    (b"DO", Keyword::Do),
    (b"REPEAT", Keyword::Repeat),
    (b"ENDREPEAT", Keyword::Endrepeat),
    (b"BREAK", Keyword::Break),
    (b"CONTINUE", Keyword::Continue),
];

/// The beginning of a line with an O word.
#[derive(Clone, Copy)]
pub struct Head<'a> {
    /// The label.
    pub label: Label,
    /// The keyword.
    pub keyword: Keyword,
    /// What stands behind the keyword.
    pub rest: Text<'a>,
}

/// Whether a line begins with an O word.
pub fn is_next(mut text: Text) -> bool {
    skip_number(&mut text);
    text.peek() == Some(b'O')
}

/// Reads the beginning of a line. `None` for a line without an O word, and for the number of a program.
pub fn head<'a>(line: &'a [u8], scope: &dyn Scope) -> Result<Option<Head<'a>>, Status> {
    let mut text = Text::new(line);
    skip_number(&mut text);
    if !text.eat(b'O') {
        return Ok(None);
    }
    let label = match text.peek() {
        Some(b'<') => {
            text.eat(b'<');
            Label::name(text.name()?)
        }
        Some(b'0'..=b'9' | b'[' | b'#') => {
            let number = number::whole(value(&mut text, scope)?);
            Label::number(number.and_then(|n| u32::try_from(n).ok()).ok_or(Status::OWordInvalid)?)
        }
        _ => return Err(Status::OWordInvalid),
    };
    let Some((_, keyword)) = KEYWORDS.iter().find(|(name, _)| text.eat_word(name)) else {
        return if is_end(text) { Ok(None) } else { Err(Status::OWordInvalid) };
    };
    Ok(Some(Head { label, keyword: *keyword, rest: text }))
}

/// Whether nothing but a comment follows.
pub fn is_end(mut text: Text) -> bool {
    matches!(text.peek(), None | Some(b'(' | b';'))
}

/// Skips the number of a line.
fn skip_number(text: &mut Text) {
    if text.eat(b'N') {
        while text.digit().is_some() || text.eat(b'.') {}
    }
}
