//! Splits a line of G-code into words.

use super::exact::Decimal;

/// A letter with its number.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Word {
    /// The letter, in upper case.
    pub letter: char,
    /// The number that follows the letter.
    pub value: Decimal,
}

impl Word {
    /// Returns the number, rounded.
    pub fn number(&self) -> f64 {
        let (up, down) = self.value.ratio();
        up as f64 / down as f64
    }

    /// Whether the word is G64, whose P says how far the path may stay away from a corner.
    pub fn is_path_mode(&self) -> bool {
        self.letter == 'G' && self.value.tenths() == 640
    }
}

/// Returns the words of a line. A line that is blank, deleted, a comment, or no G-code at all has none.
pub fn split(line: &str) -> Result<Vec<Word>, String> {
    let text = code_of(line);
    let mut words = Vec::new();
    let mut rest = text.as_str();
    while let Some(letter) = rest.chars().next() {
        if !letter.is_ascii_uppercase() {
            return Err(format!("{letter:?} where a letter belongs"));
        }
        rest = &rest[1..];
        let end = rest.find(|c: char| c.is_ascii_uppercase()).unwrap_or(rest.len());
        let (number, after) = rest.split_at(end);
        let value = Decimal::parse(number).ok_or_else(|| format!("{letter}{number}"))?;
        words.push(Word { letter, value });
        rest = after;
    }
    Ok(words)
}

/// Returns a line without comments and blanks, in upper case.
fn code_of(line: &str) -> String {
    // A file may begin with a byte order mark.
    let line = line.trim_start_matches('\u{FEFF}').trim();
    let line = match line.strip_prefix('{') {
        Some(_) => match gc_of(line) {
            Some(inner) => inner,
            None => return String::new(),
        },
        None => line.to_string(),
    };
    if line.starts_with(['/', '$', '?', '%']) {
        return String::new();
    }
    // Parentheses within a comment count in pairs.
    let mut depth: i32 = 0;
    let mut code = String::new();
    for c in line.chars() {
        match c {
            '(' => depth += 1,
            ')' => depth = (depth - 1).max(0),
            ';' if depth == 0 => break,
            c if depth == 0 && !c.is_whitespace() => code.push(c.to_ascii_uppercase()),
            _ => {}
        }
    }
    code
}

/// Returns the G-code inside `{"gc":"..."}`; `None` for other lines.
fn gc_of(line: &str) -> Option<String> {
    let value: serde_json::Value = serde_json::from_str(line).ok()?;
    Some(value.get("gc")?.as_str()?.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn letters(line: &str) -> String {
        split(line).unwrap().iter().map(|w| w.letter).collect()
    }

    #[test]
    fn words_with_and_without_blanks() {
        assert_eq!(letters("n3g1x1.5 y-.5F600"), "NGXYF");
    }

    #[test]
    fn comments_and_deleted_lines() {
        assert_eq!(letters("G1 (to the left) X1 ; go"), "GX");
        assert_eq!(letters("/G1 X1"), "");
        assert_eq!(letters("(only) ; this"), "");
        assert_eq!(letters("G1 (1/8 bit (flat) G2) X1 (open"), "GX");
        assert_eq!(letters("\u{FEFF}O0001 (PART)"), "O");
        assert_eq!(letters("%prog1"), "");
    }

    #[test]
    fn json() {
        assert_eq!(letters(r#"{"gc":"G0X1"}"#), "GX");
        assert_eq!(letters("{sr:n}"), "");
    }

    #[test]
    fn nonsense_is_refused() {
        assert!(split("G1 X").is_err());
        assert!(split("12").is_err());
    }
}
