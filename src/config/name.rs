//! Names of settings and values: at most five bytes, lower case, as senders write them.

use crate::progmem::Plain;

/// The longest name, in bytes.
pub const LONGEST: usize = 5;

/// A name, padded with zeros.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Name {
    bytes: [u8; LONGEST],
    len: u8,
}

#[small]
impl Name {
    /// The empty name.
    pub fn new() -> Name {
        Name::default()
    }

    /// Appends `text` in lower case. `None` if the name is too long then.
    pub fn with(mut self, text: &[u8]) -> Option<Name> {
        for &byte in text {
            *self.bytes.get_mut(usize::from(self.len))? = byte.to_ascii_lowercase();
            self.len += 1;
        }
        Some(self)
    }

    /// Returns the start of `text` as a name, in lower case and without commas, as far as it fits.
    pub fn beginning(text: &[u8]) -> Name {
        let mut name = Name::new();
        for byte in text.iter().filter(|byte| **byte != b',') {
            name = name.with(core::slice::from_ref(byte)).unwrap_or(name);
        }
        name
    }

    /// Appends a table's `token`, up to its zeros.
    pub fn with_token(self, token: [u8; 4]) -> Name {
        let len = token.iter().position(|&b| b == 0).unwrap_or(token.len());
        self.with(token.get(..len).unwrap_or(&[])).unwrap_or(self)
    }

    /// Returns the bytes of the name.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or(&[])
    }

    /// Whether the name is `text`.
    pub fn is(&self, text: Plain) -> bool {
        text.bytes().eq(self.bytes().iter().copied())
    }

    /// Returns the first byte; 0 if the name is empty.
    pub fn first(&self) -> u8 {
        self.bytes[0]
    }

    /// Returns the last byte; 0 if the name is empty.
    pub fn last(&self) -> u8 {
        self.bytes().last().copied().unwrap_or(0)
    }

    /// Returns the bytes, padded with zeros.
    pub fn padded(&self) -> [u8; LONGEST] {
        self.bytes
    }

    /// Returns the name without its first `skip` bytes, zero-padded as in tables. `None` if the rest is too long.
    pub fn row_name(&self, skip: usize) -> Option<[u8; 4]> {
        let rest = self.bytes().get(skip..)?;
        let mut padded = [0; 4];
        padded.get_mut(..rest.len())?.copy_from_slice(rest);
        Some(padded)
    }
}

/// Returns the letter of an axis, X Y Z A B C in lower case.
#[small]
pub fn axis_letter(axis: u8) -> u8 {
    if axis < 3 { b'x' + axis } else { b'a' + (axis - 3) }
}

/// Returns the axis of a lower-case letter; `None` for other letters.
#[small]
pub fn axis_of(letter: u8) -> Option<u8> {
    match letter {
        b'x'..=b'z' => Some(letter - b'x'),
        b'a'..=b'c' => Some(letter - b'a' + 3),
        _ => None,
    }
}

/// Makes a table's zero-padded name from a literal.
pub const fn token(text: &str) -> [u8; 4] {
    padded(text)
}

/// Makes a zero-padded name from a literal.
#[small]
pub const fn padded<const N: usize>(text: &str) -> [u8; N] {
    let text = text.as_bytes();
    assert!(text.len() <= N, "a table's name is too long");
    let mut bytes = [0; N];
    let mut i = 0;
    while i < text.len() {
        bytes[i] = text[i];
        i += 1;
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_as_in_tables() {
        let name = Name::new().with(b"XVm").unwrap();
        assert_eq!(name.bytes(), b"xvm");
        assert_eq!((name.row_name(0), name.row_name(1)), (Some(*b"xvm\0"), Some(token("vm"))));
        assert_eq!((name.row_name(3), name.row_name(4)), (Some([0; 4]), None));
        assert!(Name::new().with(b"posxyz").is_none());
        assert_eq!(Name::new().with(b"abaud").unwrap().row_name(1), Some(token("baud")));
        assert_eq!(Name::beginning(b"X,velocity").bytes(), b"xvelo");
        assert_eq!(Name::new().with(b"bauds").unwrap().row_name(0), None);
    }

    #[test]
    fn axes_have_letters() {
        for axis in 0..6 {
            assert_eq!(axis_letter(axis), crate::units::AXIS_LETTERS[usize::from(axis)]);
            assert_eq!(axis_of(axis_letter(axis)), Some(axis));
        }
        assert_eq!(axis_of(b'd'), None);
    }
}
