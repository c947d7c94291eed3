//! Refuses an image in which a function reads arguments from the stack.
//!
//! LLVM's AVR backend (22) looks for them two bytes behind the saved registers, where the return address
//! ends on small chips; on the ATmega2560 it has three bytes, so that the first byte of an argument is
//! the last of the return address, and all others are one off:
//!
//! ```text
//!   push r16 ... (n of them)
//!   in   r28, 0x3d
//!   in   r29, 0x3e
//!   sbiw r28, size        Y+1 to Y+size are the function's own, n saved registers follow,
//!   ldd  r24, Y+size+n+3  then three bytes of return address, of which this is the last
//! ```
//!
//! Arguments go to the stack when they take more than 18 bytes, or do not fit what is left of them.

use anyhow::Result;

use super::Image;
use super::disasm::{Code, Insn, number};
use super::places::{self, landmarks};

/// Bytes of a return address on the chips that the defect is of.
pub const RETURN_ADDRESS: usize = 3;

/// Fails when some code reaches behind the registers that it saved.
pub fn check(image: &Image, code: &Code) -> Result<()> {
    let ends = landmarks(image).ends;
    let found = beyond(code, |address| ends.contains(&address));
    places::refuse(
        image,
        &found,
        "takes arguments from the wrong place on the stack",
        "A defect of LLVM on chips with three bytes of return address: give the function fewer arguments, 18 bytes at most, for example by reference.",
    )
}

/// The addresses of instructions that reach behind the saved registers of their function.
fn beyond(code: &Code, ends: impl Fn(u32) -> bool) -> Vec<u32> {
    let mut found = Vec::new();
    for at in 0..code.len() {
        if code.get(at).is_some_and(|insn| insn.op == "in" && insn.args == ["r28", "0x3d"]) {
            found.extend(first_beyond(code, at, &ends));
        }
    }
    found
}

/// The first such instruction of the function that takes the stack pointer at `at`.
fn first_beyond(code: &Code, at: usize, ends: impl Fn(u32) -> bool) -> Option<u32> {
    let saved = (0..at).rev().map_while(|i| code.get(i)).take_while(|i| i.op == "push").count();
    // Where Y points, seen from the lowest saved register.
    let (mut y, mut size) = (0, None);
    let mut high = 0;
    for insn in (at + 2..).map_while(|i| code.get(i)) {
        if ends(insn.address) {
            return None;
        }
        match (insn.op.as_str(), insn.args.first().map(String::as_str)) {
            ("sbiw", Some("r28")) => y -= operand(insn)?,
            ("adiw", Some("r28")) => y += operand(insn)?,
            ("subi", Some("r28")) => high = operand(insn)?,
            ("sbci", Some("r29")) => {
                let moved = (operand(insn)? << 8 | high) as u16;
                y -= i32::from(moved as i16);
            }
            // What follows an exit is reached from before it.
            ("ret" | "reti", _) => y = -size.unwrap_or(0),
            _ => {}
        }
        if insn.op == "out" && insn.args == ["0x3d", "r28"] && size.is_none() {
            size = Some(-y);
        }
        if offset(insn).is_some_and(|offset| y + offset > saved as i32) {
            return Some(insn.address);
        }
    }
    None
}

fn operand(insn: &Insn) -> Option<i32> {
    insn.args.get(1).and_then(|word| number(word)).map(|value| value as i32)
}

/// The `q` of `ldd rX, Y+q`.
fn offset(insn: &Insn) -> Option<i32> {
    let from = |arg: &String| arg.strip_prefix("Y+").and_then(number).map(|q| q as i32);
    matches!(insn.op.as_str(), "ldd" | "std").then(|| insn.args.iter().find_map(from)).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One instruction each two bytes from address 0; `f` ends at `ends`.
    fn found(lines: &[&str], ends: u32) -> Vec<u32> {
        let rows = lines.iter().enumerate().map(|(i, l)| format!(" {:x}:\t{l}\n", 2 * i));
        let code = Code::parse(&rows.collect::<String>());
        beyond(&code, |at| at == ends)
    }

    const ENTRY: [&str; 4] = ["push\tr16", "push\tr28", "in\tr28, 0x3d", "in\tr29, 0x3e"];

    #[test]
    fn an_argument_on_the_stack_is_noticed() {
        let small = [&ENTRY[..], &["sbiw\tr28, 0x04", "out\t0x3d, r28", "ldd\tr24, Y+9"]].concat();
        assert_eq!(found(&small, 100), [12]);
        let none = [&ENTRY[..], &["ldd\tr24, Y+5"]].concat();
        assert_eq!(found(&none, 100), [8]);
        let large = ["subi\tr28, 0x2C", "sbci\tr29, 0x01", "out\t0x3d, r28", "subi\tr28, 0xD4"];
        let large = [&ENTRY[..], &large, &["sbci\tr29, 0xFE", "ldd\tr24, Y+5"]].concat();
        assert_eq!(found(&large, 100), [18]);
    }

    #[test]
    fn what_is_the_functions_own_is_not() {
        let own = ["sbiw\tr28, 0x04", "out\t0x3d, r28", "ldd\tr24, Y+6", "std\tY+1, r2"];
        assert!(found(&[&ENTRY[..], &own].concat(), 100).is_empty());
        // Behind an early exit, and of the next function, where Y is anything.
        let exit =
            ["sbiw\tr28, 0x04", "out\t0x3d, r28", "adiw\tr28, 0x04", "ret\t", "ldd\tr24, Y+6"];
        assert!(found(&[&ENTRY[..], &exit].concat(), 100).is_empty());
        assert!(found(&[&ENTRY[..], &["ret\t", "ldd\tr24, Y+40"]].concat(), 10).is_empty());
    }
}
