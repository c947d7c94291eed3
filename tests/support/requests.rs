//! The requests in lines of JSON: names with their groups, and values, as far as transcripts use them.

/// A pair of a request.
#[derive(Debug, PartialEq)]
pub struct Asked {
    /// The full name, in lower case.
    pub name: String,
    /// The value, without quotes.
    pub value: String,
}

impl Asked {
    /// Whether the pair only reads.
    pub fn reads(&self) -> bool {
        self.value.is_empty() || self.value.starts_with('n')
    }
}

/// Returns the pairs of a line; none if the line is not JSON. Groups without a prefix of their own are left out of
/// names.
pub fn pairs(line: &str) -> Vec<Asked> {
    let mut pairs = Vec::new();
    let mut groups: Vec<String> = Vec::new();
    let mut name = None;
    let mut word = String::new();
    let Some(rest) = line.trim().strip_prefix('{') else { return pairs };
    let mut quoted = false;
    for c in rest.chars() {
        match c {
            '"' => quoted = !quoted,
            _ if quoted => word.push(c.to_ascii_lowercase()),
            ':' => name = Some(std::mem::take(&mut word)),
            '{' => groups.push(name.take().filter(|g| g != "sys" && g != "sr").unwrap_or_default()),
            ',' | '}' => {
                if let Some(name) = name.take() {
                    let name = groups.concat() + &name;
                    pairs.push(Asked { name, value: std::mem::take(&mut word) });
                }
                if c == '}' {
                    groups.pop();
                }
            }
            ' ' | '\t' => {}
            c => word.push(c.to_ascii_lowercase()),
        }
    }
    pairs
}
