//! Attributes of Kerf's source.

use proc_macro::{Delimiter, Group, TokenStream, TokenTree};

/// What is put in front of a function. The host's compiler is a stable one, and does not know `optimize`.
const OPTIMIZE_SIZE: &str = "#[cfg_attr(target_arch = \"avr\", optimize(size))]";

/// Builds a function, or each function of an `impl`, for size: for what runs once in many lines or less.
///
/// The image is built for speed, which unrolls every loop over axes and digits. That is worth its flash where each
/// block or each segment goes, and nowhere else.
///
/// A closure in the function is still built for speed, and so is what is inlined into it: a function with a loop that a closure
/// calls wants `#[inline(never)]` as well, and a loop over motors or axes is better a `for` than a `fold`.
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

/// Items, of which the functions are to be small.
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
