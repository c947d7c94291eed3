//! Parses a line of the interpreter's output: `   12 N..... NAME(argument, argument)`.

use anyhow::{Context, Result};

/// A canonical command.
#[derive(Debug, PartialEq)]
pub struct Canon<'a> {
    /// The name of the command.
    pub name: &'a str,
    arguments: Vec<&'a str>,
}

impl<'a> Canon<'a> {
    /// Parses the command on a line; `None` if there is none.
    pub fn read(line: &'a str) -> Option<Self> {
        let (head, rest) = line.split_once('(')?;
        let name = head.split_whitespace().last()?;
        // A comment may have any text in it, but its arguments are never used.
        let inside = rest.rsplit_once(')')?.0;
        let arguments = inside.split([',', ' ']).filter(|word| !word.is_empty()).collect();
        Some(Self { name, arguments })
    }

    /// Returns an argument as text.
    pub fn word(&self, index: usize) -> Result<&'a str> {
        let word = self.arguments.get(index).copied();
        word.with_context(|| format!("{} has no argument {index}", self.name))
    }

    /// Returns an argument as a number.
    pub fn number(&self, index: usize) -> Result<f64> {
        let word = self.word(index)?;
        word.parse().with_context(|| format!("{} of {} is no number", word, self.name))
    }

    /// Returns `N` arguments as numbers, from `first` on.
    pub fn numbers<const N: usize>(&self, first: usize) -> Result<[f64; N]> {
        let mut numbers = [0.0; N];
        for (index, number) in numbers.iter_mut().enumerate() {
            *number = self.number(first + index)?;
        }
        Ok(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_a_name_and_arguments() {
        let canon = Canon::read("   12 N..... USE_IT(1.5 -2, CANON_X)").unwrap();
        assert_eq!(canon.name, "USE_IT");
        assert_eq!(canon.numbers(0).unwrap(), [1.5, -2.0]);
        assert_eq!(canon.word(2).unwrap(), "CANON_X");
        assert!(canon.number(2).is_err() && canon.word(3).is_err());
        assert_eq!(Canon::read("executing"), None);
    }
}
