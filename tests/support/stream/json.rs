//! JSON exactly as its standard defines it (RFC 8259).

use std::iter::Peekable;
use std::str::Chars;

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    Null,
    Bool(bool),
    Number(f64),
    Text(String),
    List(Vec<Value>),
    Object(Vec<(String, Value)>),
}

impl Value {
    /// Returns the value of this name in an object; `None` if there is none.
    pub fn get(&self, name: &str) -> Option<&Value> {
        match self {
            Value::Object(pairs) => pairs.iter().find(|(n, _)| n == name).map(|(_, value)| value),
            _ => None,
        }
    }

    pub fn number(&self) -> Option<f64> {
        if let Value::Number(number) = self { Some(*number) } else { None }
    }

    pub fn text(&self) -> Option<&str> {
        if let Value::Text(text) = self { Some(text) } else { None }
    }
}

/// Parses a text as a value; `None` if it is none.
pub fn parse(text: &str) -> Option<Value> {
    let mut rest = text.chars().peekable();
    let value = value(&mut rest)?;
    blanks(&mut rest);
    rest.next().is_none().then_some(value)
}

type Rest<'a> = Peekable<Chars<'a>>;

fn blanks(rest: &mut Rest) {
    while rest.next_if(|c| matches!(c, ' ' | '\t' | '\r' | '\n')).is_some() {}
}

/// Takes the next character that is not blank; `None` unless it is `c`.
fn token(rest: &mut Rest, c: char) -> Option<()> {
    blanks(rest);
    rest.next_if_eq(&c).map(|_| ())
}

fn value(rest: &mut Rest) -> Option<Value> {
    blanks(rest);
    match *rest.peek()? {
        '{' => object(rest),
        '[' => list(rest),
        '"' => string(rest).map(Value::Text),
        't' => word(rest, "true", Value::Bool(true)),
        'f' => word(rest, "false", Value::Bool(false)),
        'n' => word(rest, "null", Value::Null),
        _ => number(rest),
    }
}

fn word(rest: &mut Rest, word: &str, value: Value) -> Option<Value> {
    word.chars().all(|c| rest.next() == Some(c)).then_some(value)
}

fn object(rest: &mut Rest) -> Option<Value> {
    token(rest, '{')?;
    let mut pairs = Vec::new();
    if token(rest, '}').is_some() {
        return Some(Value::Object(pairs));
    }
    loop {
        blanks(rest);
        let name = string(rest)?;
        token(rest, ':')?;
        pairs.push((name, value(rest)?));
        if token(rest, ',').is_none() {
            token(rest, '}')?;
            return Some(Value::Object(pairs));
        }
    }
}

fn list(rest: &mut Rest) -> Option<Value> {
    token(rest, '[')?;
    let mut values = Vec::new();
    if token(rest, ']').is_some() {
        return Some(Value::List(values));
    }
    loop {
        values.push(value(rest)?);
        if token(rest, ',').is_none() {
            token(rest, ']')?;
            return Some(Value::List(values));
        }
    }
}

fn string(rest: &mut Rest) -> Option<String> {
    rest.next_if_eq(&'"')?;
    let mut text = String::new();
    loop {
        match rest.next()? {
            '"' => return Some(text),
            '\\' => text.push(escape(rest)?),
            c if c < ' ' => return None,
            c => text.push(c),
        }
    }
}

fn escape(rest: &mut Rest) -> Option<char> {
    Some(match rest.next()? {
        c @ ('"' | '\\' | '/') => c,
        'b' => '\u{8}',
        'f' => '\u{c}',
        'n' => '\n',
        'r' => '\r',
        't' => '\t',
        'u' => {
            let digits: String = rest.by_ref().take(4).collect();
            let code = (digits.len() == 4).then(|| u32::from_str_radix(&digits, 16).ok())??;
            char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER)
        }
        _ => return None,
    })
}

fn number(rest: &mut Rest) -> Option<Value> {
    let mut text = String::new();
    while let Some(c) = rest.next_if(|c| matches!(c, '0'..='9' | '-' | '+' | '.' | 'e' | 'E')) {
        text.push(c);
    }
    let whole = text.trim_start_matches('-').split(['.', 'e', 'E']).next()?;
    let leads = whole.len() > 1 && whole.starts_with('0');
    let open = text.ends_with('.') || text.contains(".e") || text.contains(".E");
    if whole.is_empty() || leads || open || text.starts_with(['+', '.']) {
        return None;
    }
    text.parse().ok().map(Value::Number)
}
