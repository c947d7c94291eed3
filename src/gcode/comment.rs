//! What is no word in a line: comments, and the byte order mark of a file. For every part that reads text. Called at
//! thread level.
//!
//! A comment goes from a parenthesis to the one that closes it, or from a semicolon to the end of the line. Parentheses
//! within parentheses count in pairs: `(1/8" bit (flat))`.

use kerf_macros::small;

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
}
