//! Refuses an image in which a function reads arguments from the stack.
//!
//! LLVM's AVR backend (22) looks for them two bytes behind the saved registers, where the return address ends on
//! small chips. On the ATmega2560 a return address has three bytes. So the first byte of an argument is read from the
//! last byte of the return address, and all other bytes are off by one:
//!
//! ```text
//!   push r16 ... (n of them)
//!   in   r28, 0x3d
//!   in   r29, 0x3e
//!   sbiw r28, size        Y+1 to Y+size belong to the function itself, then come n saved registers,
//!   ldd  r24, Y+size+n+3  then three bytes of return address, of which this reads the last
//! ```
//!
//! Arguments are passed on the stack when they take more than 18 bytes, or do not fit into the registers that are
//! left.

use anyhow::Result;

use super::Image;
use super::disasm::{Code, Insn, number};
use super::places::{self, landmarks};

/// Bytes of a return address on the chips with this defect.
pub const RETURN_ADDRESS: usize = 3;

/// Fails when some code reads behind the registers that it has saved.
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

/// Returns the addresses of instructions that read behind the saved registers of their function.
fn beyond(code: &Code, ends: impl Fn(u32) -> bool) -> Vec<u32> {
    let mut found = Vec::new();
    for at in 0..code.len() {
        if code.get(at).is_some_and(|insn| insn.op == "in" && insn.args == ["r28", "0x3d"]) {
            found.extend(first_beyond(code, at, &ends));
        }
    }
    found
}

/// Returns the first such instruction of the function that reads the stack pointer at `at`.
fn first_beyond(code: &Code, at: usize, ends: impl Fn(u32) -> bool) -> Option<u32> {
    let saved = (0..at).rev().map_while(|i| code.get(i)).take_while(|i| i.op == "push").count();
    // The position of Y, relative to the lowest saved register.
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
            // Code behind an exit is reached from before the exit.
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

/// Returns the `q` of `ldd rX, Y+q`.
fn offset(insn: &Insn) -> Option<i32> {
    let from = |arg: &String| arg.strip_prefix("Y+").and_then(number).map(|q| q as i32);
    matches!(insn.op.as_str(), "ldd" | "std").then(|| insn.args.iter().find_map(from)).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns what is found in code with one instruction every two bytes from address 0; `f` ends at `ends`.
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
        // Behind an early exit, and in the next function, Y may be anything.
        let exit =
            ["sbiw\tr28, 0x04", "out\t0x3d, r28", "adiw\tr28, 0x04", "ret\t", "ldd\tr24, Y+6"];
        assert!(found(&[&ENTRY[..], &exit].concat(), 100).is_empty());
        assert!(found(&[&ENTRY[..], &["ret\t", "ldd\tr24, Y+40"]].concat(), 10).is_empty());
    }
}
