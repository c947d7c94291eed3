//! What is no word in a line: comments, and the byte order mark of a file. For every part that reads text. Called at
//! thread level.
//!
//! A comment goes from a parenthesis to the one that closes it, or from a semicolon to the end of the line. Parentheses
//! within parentheses count in pairs: `(1/8" bit (flat))`.

use kerf_macros::small;

use crate::capability::Capability;

/// Whether a place in a line is in a comment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Aside(u8);

#[small]
impl Aside {
    /// The place is in no comment.
    pub const NONE: Self = Self(0);
    /// The place is in parentheses. More parentheses within them are counted from here.
    const PARENTHESES: Self = Self(1);
    /// The place is behind a semicolon.
    const REST: Self = Self(u8::MAX);

    /// Returns whether text behind one more byte is in a comment. Cost: 10.
    pub fn after(self, byte: u8) -> Self {
        match (self, byte) {
            (_, b'\n' | b'\r') => Self::NONE,
            (Self::REST, _) | (Self::NONE, b';') => Self::REST,
            // A line is too short for as many parentheses as `REST`.
            (Self(depth), b'(') => Self(depth.saturating_add(1)),
            (Self(depth), b')') => Self(depth.saturating_sub(1)),
            (aside, _) => aside,
        }
    }
}

/// Returns the length of the text of a comment, up to the parenthesis that closes it, or to the end of the line. `text`
/// begins behind the parenthesis that opens it. Cost: 15 a byte.
#[inline(never)]
#[small]
pub fn length(text: &[u8]) -> usize {
    let mut aside = Aside::PARENTHESES;
    let ends = |byte: &u8| {
        aside = aside.after(*byte);
        aside == Aside::NONE
    };
    text.iter().position(ends).unwrap_or(text.len())
}

/// What a comment tells the sender.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// `(PRINT,..)`.
    Print,
    /// `(DEBUG,..)`, which can be switched off.
    Debug,
}

/// Returns what a comment does that tells values, and its text. `None` for any other comment.
pub fn kind(comment: &[u8]) -> Option<(Kind, &[u8])> {
    let comment = comment.trim_ascii_start();
    let begins = |word: &[u8]| {
        let (start, rest) = comment.split_at_checked(word.len())?;
        start.eq_ignore_ascii_case(word).then_some(rest)
    };
    let print = begins(b"PRINT,").map(|rest| (Kind::Print, rest));
    print.or_else(|| begins(b"DEBUG,").map(|rest| (Kind::Debug, rest)))
}

/// Whether the last comment of a text tells values. Never in an image without the language.
#[inline(always)]
pub fn is_telling(text: &[u8]) -> bool {
    let begin = || text.iter().rposition(|byte| *byte == b'(');
    Capability::Language.is_built_in()
        && begin().and_then(|at| text.get(at + 1..)).is_some_and(|text| kind(text).is_some())
}

/// Returns a line without the byte order mark of UTF-8 that editors put in front of a file.
#[inline(never)]
#[small]
pub fn skip_mark(line: &[u8]) -> &[u8] {
    match line {
        [0xEF, 0xBB, 0xBF, rest @ ..] => rest,
        rest => rest,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parentheses_count_in_pairs() {
        for (text, rest) in [
            ("", ""),
            ("a", ""),
            ("a) b", ") b"),
            ("a (b) c) d)", ") d)"),
            ("((;))) x", ") x"),
            ("(a", ""),
            ("(a) b\r", "\r"),
        ] {
            assert_eq!(&text[length(text.as_bytes())..], rest, "{text}");
        }
    }

    #[test]
    fn deep_comments_end() {
        let deep = |depth: usize| ["(".repeat(depth), ")".repeat(depth)].concat() + "x";
        for depth in [1, 100, 253] {
            let text = deep(depth);
            let aside = text.bytes().fold(Aside::NONE, Aside::after);
            assert_eq!(aside, Aside::NONE, "{depth}");
        }
    }

    #[test]
    fn kinds_of_comments() {
        assert_eq!(kind(b"  print,a"), Some((Kind::Print, &b"a"[..])));
        assert_eq!(kind(b"DEBUG, a"), Some((Kind::Debug, &b" a"[..])));
        assert_eq!(kind(b"print a"), None);
        assert_eq!(kind(b"MSG,a"), None);
    }
}
