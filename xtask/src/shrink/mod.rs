//! Makes the image smaller: what the compiler wrote is rewritten before it is linked.
//!
//! Fat LTO gives one assembler text for the whole program, so that what repeats can be shared wherever it stands. LLVM does nothing of
//! the kind for AVR. Cold functions share all that repeats, warm ones their ends, hot ones nothing ([`hot`]); assembler of the source is never changed.
//!
//! | module | what it does | flash, bytes |
//! |---|---|---|
//! | [`text`], `dialect` | reads LLVM's text, writes it for `avr-as` | |
//! | [`tidy`] | leaves out what the compiler need not have written, and runs both to compare them | 18,200 |
//! | [`prologue`] | shares what functions begin with | 5,900 |
//! | [`repeats`] | shares any other code that repeats, ends of functions above all | 14,500 |
//! | [`branch`] | branches go where they lead, not round a jump | 2,700 |
//! | [`order`] | puts functions near those they call, which shortens calls | 2,100 |
//! | [`via`] | has calls over a long way go by one jump | 1,200 |
//! | [`verify`] | puts back what is shared, and compares with the tidied text | |
//! | [`link`] | assembles and links, as `rustc` did | |
//!
//! A shared piece costs its caller 7 to 25 cycles, and three bytes of stack while it runs. `crate::elf` checks the program that is linked
//! from the compiler's own text for the compiler's defects, and the stack in the image that was made.

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
    /// The program as the compiler wrote it, without what only a debugger reads.
    pub plain: String,
    /// What is linked: the program tidied, with what cold functions share.
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

/// The names that assembler of the source contains.
fn names_in_source(program: &Program) -> HashSet<String> {
    let words = program.functions.iter().flat_map(Function::fixed);
    let words =
        words.flat_map(|line| line.split(|c: char| !(c.is_alphanumeric() || "_.$".contains(c))));
    words.map(str::to_owned).collect()
}

/// Of each line of a function: whether it runs while assembler of the source keeps interrupts off.
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
