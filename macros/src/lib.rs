//! Attributes and macros of Kerf's source.

mod text;

use litrs::StringLit;
use proc_macro::{Delimiter, Group, Literal, TokenStream, TokenTree};

/// The attribute that is put in front of a function. The host's compiler is a stable one and does not know
/// `optimize`, so the attribute applies to AVR only.
const OPTIMIZE_SIZE: &str = "#[cfg_attr(target_arch = \"avr\", optimize(size))]";

/// Builds a function, or each function of an `impl`, for size. It is for code that runs once in many lines, or less
/// often.
///
/// The image is built for speed, which unrolls every loop over axes and digits. That is worth its flash only in code
/// that runs for each block or each segment.
///
/// A closure in the function is still built for speed, and so is code that is inlined into the closure. A function
/// with a loop that a closure calls therefore needs `#[inline(never)]` as well, and a loop over motors or axes should
/// be a `for`, not a `fold`.
#[proc_macro_attribute]
pub fn small(_: TokenStream, item: TokenStream) -> TokenStream {
    let first = item.clone().into_iter().find(|token| is(token, "fn") || is(token, "impl"));
    if first.is_none_or(|token| is(&token, "fn")) {
        return functions(item);
    }
    let inside = |token| match token {
        TokenTree::Group(body) if body.delimiter() == Delimiter::Brace => {
            TokenTree::Group(Group::new(Delimiter::Brace, functions(body.stream())))
        }
        token => token,
    };
    item.into_iter().map(inside).collect()
}

/// Marks each function among some items to be built for size.
fn functions(items: TokenStream) -> TokenStream {
    let mut marked = TokenStream::new();
    let mut item: Vec<TokenTree> = Vec::new();
    for token in items {
        let ends = match &token {
            TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
            TokenTree::Punct(punct) => punct.as_char() == ';',
            _ => false,
        };
        item.push(token);
        if ends {
            if item.iter().any(|token| is(token, "fn")) {
                marked.extend(OPTIMIZE_SIZE.parse::<TokenStream>());
            }
            marked.extend(item.drain(..));
        }
    }
    marked.extend(item);
    marked
}

fn is(token: &TokenTree, word: &str) -> bool {
    matches!(token, TokenTree::Ident(ident) if ident.to_string() == word)
}

/// Packs a text: a literal, or `env!("NAME")`. Expands to a byte string literal.
#[proc_macro]
pub fn packed(text: TokenStream) -> TokenStream {
    let Some(text) = string(text) else { return error("a literal or an `env!` is wanted") };
    let Some(bytes) = text::pack(&text) else { return error("texts are ASCII") };
    TokenTree::from(Literal::byte_string(&bytes)).into()
}

/// Expands to the pairs that the codes of [`packed!`] stand for, each two bytes or codes: an array of arrays of
/// bytes.
#[proc_macro]
pub fn pairs(_: TokenStream) -> TokenStream {
    format!("{:?}", text::pairs()).parse().expect("an array of arrays of numbers")
}

/// Returns the text of a literal, or of the environment variable that `env!` names. Tokens that another macro passes
/// on are in a group.
fn string(tokens: TokenStream) -> Option<String> {
    let tokens: Vec<_> = tokens.into_iter().collect();
    match &tokens[..] {
        [TokenTree::Group(group)] if group.delimiter() == Delimiter::None => string(group.stream()),
        [TokenTree::Literal(literal)] => {
            Some(StringLit::try_from(literal).ok()?.value().to_owned())
        }
        [name, _, TokenTree::Group(group)] if is(name, "env") => {
            std::env::var(string(group.stream())?).ok()
        }
        _ => None,
    }
}

fn error(what: &str) -> TokenStream {
    format!("compile_error!({what:?})").parse().expect("a macro with a literal")
}
