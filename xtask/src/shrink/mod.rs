//! Makes the image smaller: a post-compiler optimizer that rewrites LLVM's assembler text before it is linked.
//!
//! Fat LTO gives one assembler text for the whole program, so repeated code can be outlined across functions, which
//! LLVM does not do for AVR. In cold functions all repeated code is outlined, warm functions share only their tails
//! (tail merging), and hot functions are not changed ([`hot`]). Inline assembler is never changed.
//!
//! | module | what it does | flash, bytes |
//! |---|---|---|
//! | [`text`], `dialect` | reads LLVM's text, writes it for `avr-as` | |
//! | [`tidy`] | peephole and data-flow optimizations; runs old and new code to compare them | 18,200 |
//! | [`prologue`] | shares function prologues | 5,900 |
//! | [`repeats`] | outlining and tail merging of other repeated code | 14,500 |
//! | [`branch`] | branch shortening: branches go directly to their destination, not around a jump | 2,700 |
//! | [`order`] | function placement: functions near the functions that they call have short calls | 2,100 |
//! | [`via`] | trampolines: several long calls share one jump | 1,200 |
//! | [`verify`] | inlines shared code again, and compares the result with the tidied text | |
//! | [`link`] | assembles and links, as `rustc` did | |
//! | [`restart`] | puts a jump to 0 where the boot loader goes after a reset by the watchdog | |
//!
//! Shared code costs its caller 7 to 25 cycles, and three bytes of stack while it runs. `crate::elf` searches LLVM's
//! unchanged output for known compiler defects, and analyses the stack of the final image.

mod branch;
mod dialect;
pub mod hot;
pub mod link;
mod order;
pub mod prologue;
mod repeats;
pub mod restart;
pub mod text;
mod tidy;
mod verify;
mod via;

use std::collections::HashSet;

use anyhow::{Context, Result};

use hot::Heat;
use text::{Function, Insn, Line, Program};

/// A program twice.
pub struct Texts {
    /// The compiler's program, without debug information, for the assembler.
    pub plain: String,
    /// The program that is linked: tidied, with shared code.
    pub small: Program,
}

/// Parses the compiler's text, and optimizes it.
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
    Ok(Texts { plain: text::without_debug(&plain.text()), small })
}

/// How much of a function may be shared.
fn heat(function: &Function) -> Heat {
    if function.insns().any(|insn| insn.op == "reti") {
        return Heat::Hot;
    }
    hot::heat(&format!("{:#}", rustc_demangle::demangle(&function.name)))
}

/// Returns the names that inline assembler contains.
fn names_in_source(program: &Program) -> HashSet<String> {
    let words = program.functions.iter().flat_map(Function::fixed);
    let words =
        words.flat_map(|line| line.split(|c: char| !(c.is_alphanumeric() || "_.$".contains(c))));
    words.map(str::to_owned).collect()
}

/// Returns for each line of a function whether it runs while inline assembler keeps interrupts off.
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
