//! Checks that a level is a type: a function whose comment says which level may call it asks for that level's token.
//!
//! Tokens are types of [`avr-embassy`](../../avr-embassy/src/level.rs). A comment that restricts the level and a
//! signature without a token do not go together: nobody could see at the call that the level is wrong.

use crate::sources::rust_files;

/// Beginnings of a sentence that restricts the level. A full stop, a comma, a semicolon or one of [`GO_ON`] follows.
const LEVELS: [&str; 5] = ["Thread mode", "Exec", "Start-up", "Only thread mode", "Only exec"];
const GO_ON: [&str; 3] = [" only", " and thread mode", " and exec"];
/// Types whose values show a level, or hold such a type.
const TOKENS: [&str; 9] = [
    "Boot",
    "Ceiling",
    "Exclusive",
    "Interrupt",
    "InterruptEnd",
    "Level",
    "Links",
    "Thread",
    "View",
];

/// A function: the words of its comment, and its signature.
#[derive(Default)]
struct Function {
    about: String,
    signature: String,
}

/// Returns the functions of a file that have a comment.
fn functions(text: &str) -> Vec<Function> {
    let (mut found, mut about, mut signature) = (Vec::new(), String::new(), String::new());
    for line in text.lines().map(str::trim) {
        if let Some(words) = line.strip_prefix("///") {
            about = format!("{about} {}", words.trim());
        } else if !signature.is_empty() || is_function(line) {
            signature = format!("{signature} {line}");
            if line.ends_with(['{', ';', '}']) {
                let done = (std::mem::take(&mut about), std::mem::take(&mut signature));
                found.push(Function { about: done.0, signature: done.1 });
            }
        } else if !line.starts_with('#') && !line.starts_with("//") {
            about.clear();
        }
    }
    found
}

/// Whether a function begins at this line.
fn is_function(line: &str) -> bool {
    let before = line.split("fn ").next().unwrap_or_default();
    line.contains("fn ")
        && before.split_whitespace().all(|word| {
            let word = word.split('(').next().unwrap_or_default();
            matches!(word, "pub" | "const" | "unsafe" | "extern" | "\"C\"" | "async")
        })
}

/// Returns the sentence that restricts the level, if a comment has one.
fn restriction(about: &str) -> Option<&str> {
    let restricts = |sentence: &&str| {
        LEVELS.iter().any(|level| {
            sentence.strip_prefix(level).is_some_and(|rest| {
                rest.is_empty()
                    || rest.starts_with(['.', ',', ';'])
                    || GO_ON.iter().any(|more| rest.starts_with(more))
            })
        })
    };
    about.split(". ").map(|sentence| sentence.trim().trim_end_matches('.')).find(restricts)
}

/// Whether the arguments of a function have a token.
fn has_token(signature: &str) -> bool {
    let arguments = signature.split_once('(').map_or("", |(_, arguments)| arguments);
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    arguments.split(|c| !is_word(c)).any(|word| TOKENS.contains(&word))
}

#[test]
fn a_level_is_a_token() {
    let (mut wrong, mut tokens) = (String::new(), 0);
    for file in ["src", "avr-embassy/src"].into_iter().flat_map(rust_files) {
        let text = std::fs::read_to_string(&file).expect("a file of the sources");
        for Function { about, signature } in functions(&text) {
            tokens += usize::from(has_token(&signature));
            if let Some(sentence) = restriction(&about).filter(|_| !has_token(&signature)) {
                wrong += &format!("{}: {sentence}:{signature}\n", file.display());
            }
        }
    }
    assert!(wrong.is_empty(), "levels that only a comment has:\n{wrong}");
    assert!(tokens > 300, "{tokens} functions with a token");
}

#[test]
fn a_level_without_its_token_is_found() {
    let wrong = |text: &str| {
        let found = functions(text);
        found.iter().any(|it| restriction(&it.about).is_some() && !has_token(&it.signature))
    };
    assert!(wrong("/// Stops. Thread mode.\npub fn stop() {"));
    assert!(wrong(
        "/// Stops. Exec only, at rest.\n#[inline(always)]\nfn stop(\n    at: u8,\n) -> u8;"
    ));
    assert!(wrong("    /// Thread mode and exec. Cost: 3.\n    pub(super) fn stop(&self) {}"));
    assert!(!wrong("/// Stops. Thread mode.\nfn stop(_: Thread) {"));
    assert!(!wrong("/// Stops. Exec only.\nfn stop(\n    at: u8,\n    exec: Interrupt,\n) {"));
    assert!(!wrong("/// Exec calls it. Any level.\nfn stop() {"));
    assert!(!wrong("/// Exec. Of a value.\nstruct Stop;\n\nfn stop() {"));
}
