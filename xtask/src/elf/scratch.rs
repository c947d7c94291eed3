//! Refuses an image in which r0 is used for two things at once, which is a defect of the compiler.
//!
//! To reach a stack frame beyond 63 bytes, LLVM's AVR backend (22) moves the frame pointer there and back, and saves
//! the flags in r0 meanwhile:
//!
//! ```text
//!   mul r24, r22        the product is in r1:r0
//!   in  r0, 0x3f        saves the flags; the product is gone
//!   subi r28, 0xC0
//!   ...
//!   out 0x3f, r0        restores the flags
//!   mov r18, r0         takes the flags for the product
//! ```
//!
//! The backend assumes that r0 is free there, but the result of a multiplication may still be in it. So from each of
//! these places on, along every branch, r0 must be written before it is read.

use std::collections::HashSet;

use anyhow::Result;

use super::Image;
use super::disasm::{Code, Insn};
use super::places;

const FLAGS: &str = "0x3f";

/// Fails when some code reads r0 after flags were saved in it.
pub fn check(image: &Image, code: &Code) -> Result<()> {
    let found = misread(code);
    places::refuse(
        image,
        &found,
        "reads r0 as a result after the compiler kept the flags in it",
        "A defect of LLVM in frames over 63 bytes: put `#[inline(never)]` on parts of the function to make its frame smaller.",
    )
}

/// Returns the addresses of instructions that take the flags for something else.
fn misread(code: &Code) -> Vec<u32> {
    let mut found: Vec<_> = (0..code.len())
        .filter_map(|at| Some((at, code.get(at)?)))
        .filter_map(follow(code))
        .collect();
    found.sort_unstable();
    found.dedup();
    found
}

fn follow(code: &Code) -> impl Fn((usize, &Insn)) -> Option<u32> {
    move |(at, insn)| {
        let saves = insn.op == "in" && insn.args == ["r0", FLAGS];
        let restores = insn.op == "out" && insn.args == [FLAGS, "r0"];
        (saves || restores).then(|| first_read(code, at)).flatten()
    }
}

/// Returns the first instruction behind `at` that reads r0 before it is written, along any path that stays in the
/// function.
fn first_read(code: &Code, at: usize) -> Option<u32> {
    let mut seen = HashSet::new();
    let mut todo = vec![at + 1];
    while let Some(at) = todo.pop() {
        let Some(insn) = code.get(at).filter(|_| seen.insert(at)) else { continue };
        match effect(insn) {
            Effect::Reads => return Some(insn.address),
            Effect::Writes => {}
            Effect::None => todo.extend(successors(code, at, insn)),
        }
    }
    None
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Effect {
    Reads,
    /// Writes r0, or leaves the function: no function passes r0 on.
    Writes,
    None,
}

fn effect(insn: &Insn) -> Effect {
    let has = |place: usize| insn.args.get(place).is_some_and(|arg| arg == "r0");
    match insn.op.as_str() {
        "ret" | "reti" | "call" | "rcall" | "icall" | "eicall" | "ijmp" | "eijmp" => Effect::Writes,
        "mul" | "muls" | "mulsu" | "fmul" | "fmuls" | "fmulsu" => {
            if has(0) || has(1) {
                Effect::Reads
            } else {
                Effect::Writes
            }
        }
        "eor" if has(0) && has(1) => Effect::Writes,
        "in" | "ld" | "ldd" | "lds" | "pop" if has(0) => Effect::Writes,
        "mov" | "movw" if has(0) && !has(1) => Effect::Writes,
        // These instructions load r0 if they have no operands.
        "lpm" | "elpm" if has(0) || insn.args.iter().all(String::is_empty) => Effect::Writes,
        "spm" => Effect::Reads,
        // This instruction restores the flags. The entry of an interrupt saves them.
        "out" if insn.args == [FLAGS, "r0"] => Effect::None,
        "push" if has(0) => Effect::None,
        _ if has(0) || has(1) => Effect::Reads,
        _ => Effect::None,
    }
}

fn successors(code: &Code, at: usize, insn: &Insn) -> Vec<usize> {
    let target = insn.target.and_then(|target| code.at(target));
    match insn.op.as_str() {
        "jmp" | "rjmp" => target.into_iter().collect(),
        "sbrc" | "sbrs" | "sbic" | "sbis" | "cpse" => vec![at + 1, at + 2],
        _ => target.into_iter().chain([at + 1]).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns what is found in code with one instruction every two bytes from address 0.
    fn found(lines: &[&str]) -> Vec<u32> {
        let rows = lines.iter().enumerate().map(|(i, l)| format!(" {:x}:\t{l}\n", 2 * i));
        misread(&Code::parse(&rows.collect::<String>()))
    }

    /// Returns what is found if a frame access comes between a multiplication and `then`.
    fn frame_access(then: &[&str]) -> Vec<u32> {
        let access = ["mul\tr24, r22", "in\tr0, 0x3f", "subi\tr28, 0xC0", "sbci\tr29, 0xFF"];
        let back = ["std\tY+2, r18", "subi\tr28, 0x40", "sbci\tr29, 0x00", "out\t0x3f, r0"];
        found(&[&access[..], &back, then].concat())
    }

    #[test]
    fn a_product_that_is_gone_is_noticed() {
        assert_eq!(frame_access(&["mov\tr18, r0", "ret"]), [16]);
        assert_eq!(frame_access(&["eor\tr1, r1", "add\tr18, r0", "ret"]), [18]);
        assert_eq!(frame_access(&["movw\tr18, r0", "ret"]), [16]);
    }

    #[test]
    fn it_is_noticed_across_branches() {
        let behind = ["breq\t.+4\t; 0x16", "eor\tr0, r0", "ret", "mov\tr18, r0", "ret"];
        assert_eq!(frame_access(&behind), [22]);
        let jump = ["rjmp\t.+2\t; 0x14", "ret", "mov\tr18, r0", "ret"];
        assert_eq!(frame_access(&jump), [20]);
        assert_eq!(frame_access(&["sbrs\tr24, 1", "mul\tr24, r22", "mov\tr18, r0"]), [20]);
    }

    #[test]
    fn a_product_stored_beyond_the_frame_is_noticed() {
        assert_eq!(found(&["in\tr0, 0x3f", "subi\tr28, 0xC0", "std\tY+2, r0"]), [4]);
    }

    #[test]
    fn r0_may_be_written_anew() {
        for write in ["mul\tr2, r3", "fmulsu\tr18, r19", "in\tr0, 0x3e", "mov\tr0, r2", "lpm\t"] {
            assert!(frame_access(&[write, "mov\tr18, r0", "ret"]).is_empty(), "{write}");
        }
        for write in ["movw\tr0, r24", "ldd\tr0, Y+1", "pop\tr0", "lpm\tr0, Z+", "eor\tr0, r0"] {
            assert!(frame_access(&[write, "mov\tr18, r0", "ret"]).is_empty(), "{write}");
        }
    }

    #[test]
    fn what_is_behind_the_function_does_not_count() {
        assert!(frame_access(&["ret", "mov\tr18, r0"]).is_empty());
        assert!(frame_access(&["call\t0x100\t; 0x100", "mov\tr18, r0"]).is_empty());
    }

    #[test]
    fn an_interrupt_keeps_the_flags_on_the_stack() {
        let entry = ["push\tr0", "in\tr0, 0x3f", "push\tr0", "eor\tr1, r1"];
        let exit = ["pop\tr0", "out\t0x3f, r0", "pop\tr0", "reti"];
        assert!(found(&[&entry[..], &exit].concat()).is_empty());
    }
}
