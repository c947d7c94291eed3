//! Makes the image smaller: rewrites the compiler's program before it is linked.
//!
//! Fat LTO gives one assembler text for the whole program, so repeated code can be shared wherever it stands. LLVM
//! does not do that for AVR. Cold functions share all code that repeats, warm functions share their ends, and hot
//! functions share nothing ([`hot`]). Assembler from the source is never changed.
//!
//! | module | what it does | flash, bytes |
//! |---|---|---|
//! | [`text`], `dialect` | reads LLVM's text, writes it for `avr-as` | |
//! | [`tidy`] | removes what the compiler need not have written, and runs old and new code to compare them | 18,200 |
//! | [`prologue`] | shares the beginnings of functions | 5,900 |
//! | [`repeats`] | shares any other code that repeats, above all ends of functions | 14,500 |
//! | [`branch`] | lets branches go directly to their destination, not around a jump | 2,700 |
//! | [`order`] | puts functions near the functions that they call, which shortens calls | 2,100 |
//! | [`via`] | lets several calls over a long distance go by one jump | 1,200 |
//! | [`verify`] | puts shared code back, and compares the result with the tidied text | |
//! | [`link`] | assembles and links, as `rustc` did | |
//!
//! A shared piece costs its caller 7 to 25 cycles, and three bytes of stack while it runs. `crate::elf` searches the
//! compiler's own program for the compiler's defects, and analyses the stack of the final image.

mod branch;
mod dialect;
pub mod hot;
pub mod link;
mod order;
pub mod prologue;
mod repeats;
pub mod text;
mod tidy;
mod verify;
mod via;

use std::collections::HashSet;

use anyhow::{Context, Result};

use hot::Heat;
use text::{Function, Insn, Line, Program};

/// Two texts for the assembler.
pub struct Texts {
    /// The program as the compiler wrote it, without debug information.
    pub plain: String,
    /// The program that is linked: tidied, with shared code.
    pub small: String,
}

/// Reads what the compiler wrote, and makes it smaller.
pub fn shrink(text: &str) -> Result<Texts> {
    let plain = Program::parse(text);
    let mut tidy = plain.clone();
    tidy::tidy(&mut tidy).context("the program that was tidied is another one")?;
    let mut small = tidy.clone();
    prologue::share(&mut small);
    repeats::share(&mut small);
    branch::shorten(&mut small);
    order::arrange(&mut small);
    via::share(&mut small);
    verify::check(&tidy, &small).context("the program that was made smaller is another one")?;
    Ok(Texts { plain: text::without_debug(&plain.text()), small: small.text() })
}

/// How much of a function may be shared.
fn heat(function: &Function) -> Heat {
    if function.insns().any(|insn| insn.op == "reti") {
        return Heat::Hot;
    }
    hot::heat(&format!("{:#}", rustc_demangle::demangle(&function.name)))
}

/// Returns the names that assembler from the source contains.
fn names_in_source(program: &Program) -> HashSet<String> {
    let words = program.functions.iter().flat_map(Function::fixed);
    let words =
        words.flat_map(|line| line.split(|c: char| !(c.is_alphanumeric() || "_.$".contains(c))));
    words.map(str::to_owned).collect()
}

/// Returns for each line of a function whether it runs while assembler from the source keeps interrupts off.
fn quiet(function: &Function) -> Vec<bool> {
    let mut off = false;
    let mut line = |line: &Line| {
        if let Line::Fixed(text) = line {
            let insn = Insn::new(text);
            off = match insn.op.as_str() {
                "cli" => true,
                "sei" => false,
                "out" if insn.args.starts_with("63") => false,
                _ => off,
            };
        }
        off
    };
    function.lines.iter().map(&mut line).collect()
}
