//! As much JSON as settings need: objects of objects, numbers in their original spelling, strings. Keys may lack
//! quotes, as in the machine's answers with `js` 0.

use std::fmt::{self, Display, Formatter};

/// A value. A value that is neither object, array nor string is kept as it was written.
#[derive(Clone, PartialEq, Debug)]
pub enum Json {
    /// Its members, in their order.
    Object(Vec<(String, Json)>),
    /// Its elements.
    Array(Vec<Json>),
    /// Its characters, with escapes as they are.
    Text(String),
    /// A number, `true`, `false` or `null`.
    Plain(String),
}

impl Json {
    /// Parses a text; `None` if it is not JSON.
    pub fn parse(text: &str) -> Option<Json> {
        let mut rest = text.trim();
        let value = value(&mut rest)?;
        rest.trim().is_empty().then_some(value)
    }

    /// Returns a member of an object.
    pub fn get(&self, name: &str) -> Option<&Json> {
        self.members().iter().find(|(key, _)| key == name).map(|(_, value)| value)
    }

    /// Returns the members of an object; none for any other value.
    pub fn members(&self) -> &[(String, Json)] {
        match self {
            Json::Object(members) => members,
            _ => &[],
        }
    }

    /// Returns the value as a number; `None` if it is none.
    pub fn number(&self) -> Option<f64> {
        match self {
            Json::Plain(text) => text.parse().ok(),
            _ => None,
        }
    }

    /// Returns an element of an array.
    pub fn at(&self, index: usize) -> Option<&Json> {
        match self {
            Json::Array(elements) => elements.get(index),
            _ => None,
        }
    }

    /// Whether the values are equal. Numbers are compared as numbers.
    pub fn is_same(&self, other: &Json) -> bool {
        match (self.number(), other.number()) {
            (Some(a), Some(b)) => a == b,
            _ => self == other,
        }
    }

    fn write(&self, depth: usize, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Json::Plain(text) => f.write_str(text),
            Json::Text(text) => write!(f, "\"{text}\""),
            Json::Array(elements) => {
                f.write_str("[")?;
                for (n, element) in elements.iter().enumerate() {
                    f.write_str(if n == 0 { "" } else { ", " })?;
                    element.write(depth, f)?;
                }
                f.write_str("]")
            }
            Json::Object(members) => {
                f.write_str("{")?;
                for (n, (key, value)) in members.iter().enumerate() {
                    f.write_str(if n == 0 { "\n" } else { ",\n" })?;
                    write!(f, "{:width$}\"{key}\": ", "", width = 2 * depth + 2)?;
                    value.write(depth + 1, f)?;
                }
                write!(f, "\n{:width$}}}", "", width = 2 * depth)
            }
        }
    }
}

/// Writes the value over several lines, for readers.
impl Display for Json {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.write(0, f)
    }
}

fn take(rest: &mut &str, c: char) -> Option<()> {
    *rest = rest.trim_start().strip_prefix(c)?;
    Some(())
}

/// Parses a string up to a quote without a backslash before it.
fn text(rest: &mut &str) -> Option<String> {
    take(rest, '"')?;
    let mut escaped = false;
    let end = rest.char_indices().find(|(_, c)| {
        let ends = *c == '"' && !escaped;
        escaped = *c == '\\' && !escaped;
        ends
    });
    let (text, after) = rest.split_at(end?.0);
    *rest = &after[1..];
    Some(text.to_string())
}

fn plain(rest: &mut &str) -> Option<String> {
    *rest = rest.trim_start();
    let is_part = |c: char| c.is_ascii_alphanumeric() || "+-._".contains(c);
    let end = rest.find(|c| !is_part(c)).unwrap_or(rest.len());
    let (word, after) = rest.split_at(end);
    *rest = after;
    (!word.is_empty()).then(|| word.to_string())
}

/// The elements between brackets, separated by commas.
fn list<T>(
    rest: &mut &str,
    brackets: [char; 2],
    element: impl Fn(&mut &str) -> Option<T>,
) -> Option<Vec<T>> {
    take(rest, brackets[0])?;
    let mut elements = Vec::new();
    if take(rest, brackets[1]).is_some() {
        return Some(elements);
    }
    loop {
        elements.push(element(rest)?);
        if take(rest, ',').is_none() {
            take(rest, brackets[1])?;
            return Some(elements);
        }
    }
}

fn member(rest: &mut &str) -> Option<(String, Json)> {
    let is_quoted = rest.trim_start().starts_with('"');
    let key = if is_quoted { text(rest)? } else { plain(rest)? };
    take(rest, ':')?;
    Some((key, value(rest)?))
}

fn value(rest: &mut &str) -> Option<Json> {
    match rest.trim_start().chars().next()? {
        '{' => list(rest, ['{', '}'], member).map(Json::Object),
        '[' => list(rest, ['[', ']'], value).map(Json::Array),
        '"' => text(rest).map(Json::Text),
        _ => plain(rest).map(Json::Plain),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_read_however_they_are_written() {
        for text in [
            r#"{"r":{"x":{"vm":800.5,"am":1},"id":"a\"b"},"f":[1,0,7]}"#,
            r#" { r : {x:{vm:800.5,am:1},id:"a\"b"} , f:[1, 0,7] } "#,
        ] {
            let json = Json::parse(text).unwrap();
            let x = json.get("r").and_then(|r| r.get("x")).unwrap();
            assert_eq!(x.get("vm").and_then(Json::number), Some(800.5));
            assert_eq!(json.get("f").and_then(|f| f.at(1)).and_then(Json::number), Some(0.0));
            assert_eq!(json.get("r").unwrap().get("id"), Some(&Json::Text("a\\\"b".into())));
        }
    }

    #[test]
    fn what_is_written_is_read_again() {
        let json = Json::parse(r#"{"x":{"vm":800,"t":[1,2],"e":{}},"u":"0x1"}"#).unwrap();
        assert_eq!(Json::parse(&json.to_string()), Some(json));
    }

    #[test]
    fn rubbish_is_none() {
        for text in ["", "{", "{\"a\":}", "{\"a\":1", "tinyg [mm] ok>", "{\"a\":1} x", "\"a"] {
            assert_eq!(Json::parse(text), None, "{text}");
        }
    }
}
