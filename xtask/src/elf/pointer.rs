//! Refuses an image in which a pointer is overwritten while it is still needed, which is a defect of the compiler.
//!
//! LLVM's AVR backend (22) may load an atomic 16-bit word into the registers that point to it:
//!
//! ```text
//!   ld  r30, Z          overwrites the low half of the pointer
//!   ldd r31, Z+1        reads from a wrong address
//! ```
//!
//! After a load into one half of its own pointer, up to the next branch or call, the pointer must not be used until
//! one of its halves has been written again.

use anyhow::Result;

use super::Image;
use super::disasm::{Code, Insn};
use super::places;

/// A pointer of the chip: its name, and its halves.
type Pointer = (char, [&'static str; 2]);

const POINTERS: [Pointer; 3] =
    [('X', ["r26", "r27"]), ('Y', ["r28", "r29"]), ('Z', ["r30", "r31"])];

/// Fails when some code uses a pointer of which a half was overwritten.
pub fn check(image: &Image, code: &Code) -> Result<()> {
    let found = misused(code);
    places::refuse(
        image,
        &found,
        "uses a pointer of which half has been overwritten",
        "A defect of LLVM in atomic loads of 16 bits: load it a byte at a time, or out of line.",
    )
}

/// Returns the addresses of instructions that use such a pointer.
fn misused(code: &Code) -> Vec<u32> {
    (0..code.len()).filter_map(|at| first_use(code, at)).collect()
}

/// If the instruction at `at` overwrites half of its own pointer, returns the address of the first use behind it.
fn first_use(code: &Code, at: usize) -> Option<u32> {
    let pointer = overwritten(code.get(at)?)?;
    for insn in (at + 1..).map_while(|at| code.get(at)) {
        if uses(insn, pointer) {
            return Some(insn.address);
        }
        // When a half is written again, the pointer may be whole again.
        if ends(insn) || writes(insn, pointer) {
            return None;
        }
    }
    None
}

/// Returns the pointer of which an instruction overwrites a half by a load through it.
fn overwritten(insn: &Insn) -> Option<Pointer> {
    if !matches!(insn.op.as_str(), "ld" | "ldd") {
        return None;
    }
    let (target, through) = (insn.args.first()?, insn.args.get(1)?);
    let pointer = POINTERS.into_iter().find(|(name, _)| through.starts_with(*name))?;
    pointer.1.contains(&target.as_str()).then_some(pointer)
}

/// Whether the instruction accesses memory through the pointer.
fn uses(insn: &Insn, (name, _): Pointer) -> bool {
    let through = |place: usize| {
        insn.args.get(place).is_some_and(|arg| arg.trim_start_matches('-').starts_with(name))
    };
    match insn.op.as_str() {
        "ld" | "ldd" => through(1),
        "st" | "std" => through(0),
        "ijmp" | "eijmp" | "icall" | "eicall" | "lpm" | "elpm" => name == 'Z',
        _ => false,
    }
}

/// Whether the instruction writes to the pointer, as far as that is known.
fn writes(insn: &Insn, (_, halves): Pointer) -> bool {
    let only_reads = matches!(
        insn.op.as_str(),
        "push" | "cp" | "cpc" | "cpi" | "cpse" | "sbrc" | "sbrs" | "bst" | "mul" | "muls" | "tst"
    );
    !only_reads && insn.args.first().is_some_and(|arg| halves.contains(&arg.as_str()))
}

/// Whether control may come to this instruction from elsewhere, or goes on elsewhere.
fn ends(insn: &Insn) -> bool {
    insn.target.is_some() || matches!(insn.op.as_str(), "ret" | "reti")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns what is found in code with one instruction every two bytes from address 0.
    fn found(lines: &[&str]) -> Vec<u32> {
        let rows = lines.iter().enumerate().map(|(i, l)| format!(" {:x}:\t{l}\n", 2 * i));
        misused(&Code::parse(&rows.collect::<String>()))
    }

    #[test]
    fn a_word_that_is_loaded_over_its_pointer_is_noticed() {
        assert_eq!(found(&["ld\tr30, Z", "ldd\tr31, Z+1\t; 0x01"]), [2]);
        assert_eq!(found(&["ldd\tr28, Y+3", "push\tr28", "nop", "ldd\tr29, Y+4"]), [6]);
        assert_eq!(found(&["ld\tr26, X", "mov\tr24, r26", "st\tX+, r24"]), [4]);
        assert_eq!(found(&["ld\tr31, Z", "icall"]), [2]);
    }

    #[test]
    fn a_pointer_that_is_read_whole_is_none() {
        assert!(found(&["ld\tr24, Z", "ldd\tr31, Z+1", "mov\tr30, r24", "ld\tr25, Z"]).is_empty());
        assert!(found(&["ld\tr30, Z", "ldi\tr31, 0x02", "ld\tr24, Z"]).is_empty());
        assert!(found(&["ld\tr30, Z", "movw\tr30, r24", "ld\tr24, Z"]).is_empty());
        assert!(found(&["ld\tr30, Z", "breq\t.+4\t; 0x8", "ld\tr24, Z"]).is_empty());
        assert!(found(&["ld\tr30, Z", "ret", "ld\tr24, Z"]).is_empty());
        assert!(found(&["ld\tr30, X+", "ld\tr31, X"]).is_empty());
    }
}
