//! Code as `avr-objdump -d` lists it.

use std::collections::HashMap;
use std::path::Path;
use std::process::Command;

use anyhow::Result;

use crate::process;

/// One instruction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Insn {
    /// Byte address.
    pub address: u32,
    /// The mnemonic, such as `rcall`.
    pub op: String,
    /// The operands, such as `r28, 0x10`.
    pub args: Vec<String>,
    /// The target of a jump, branch or call.
    pub target: Option<u32>,
}

/// All instructions by address.
#[derive(Default)]
pub struct Code {
    insns: Vec<Insn>,
    index: HashMap<u32, usize>,
}

impl Code {
    /// Disassembles an image.
    pub fn load(elf: &Path) -> Result<Code> {
        let mut objdump = Command::new("avr-objdump");
        Ok(Code::parse(&process::output(objdump.args(["-d", "--no-show-raw-insn"]).arg(elf))?))
    }

    /// Parses the listing.
    pub fn parse(listing: &str) -> Code {
        let insns: Vec<_> = listing.lines().filter_map(parse_line).collect();
        let index = insns.iter().enumerate().map(|(i, insn)| (insn.address, i)).collect();
        Code { insns, index }
    }

    /// Number of instructions.
    pub fn len(&self) -> usize {
        self.insns.len()
    }

    /// Position of the instruction at an address.
    pub fn at(&self, address: u32) -> Option<usize> {
        self.index.get(&address).copied()
    }

    /// The instruction at a position.
    pub fn get(&self, position: usize) -> Option<&Insn> {
        self.insns.get(position)
    }
}

/// Parses a line such as `  fc:\tcall\t0x142\t; 0x142 <__bad_interrupt>`.
fn parse_line(line: &str) -> Option<Insn> {
    let (address, rest) = line.split_once(":\t")?;
    let address = u32::from_str_radix(address.trim(), 16).ok()?;
    let (code, comment) = rest.split_once(';').unwrap_or((rest, ""));
    let (op, args) = code.trim().split_once(char::is_whitespace).unwrap_or((code.trim(), ""));
    let args: Vec<_> = args.split(',').map(|arg| arg.trim().to_owned()).collect();
    let target = goes_somewhere(op).then(|| target(&args, comment)).flatten();
    Some(Insn { address, op: op.to_owned(), args, target })
}

fn goes_somewhere(op: &str) -> bool {
    matches!(op, "jmp" | "rjmp" | "call" | "rcall") || op.starts_with("br") && op != "break"
}

/// Returns the target address, which is in the comment, except for `call 0` and `jmp 0`.
fn target(args: &[String], comment: &str) -> Option<u32> {
    let word = comment.split_whitespace().next().or(args.last().map(String::as_str))?;
    number(word)
}

/// Parses `0x1f` or `31`.
pub fn number(word: &str) -> Option<u32> {
    match word.strip_prefix("0x") {
        Some(hex) => u32::from_str_radix(hex, 16).ok(),
        None => word.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_listing_is_read() {
        let code = Code::parse(
            "00000136 <main>:\n\
             \x20136:\tcall\t0x13e\t; 0x13e <main>\n\
             \x2013a:\tsbiw\tr28, 0x10\t; 16\n\
             \x2013c:\trjmp\t.-4      \t; 0x13a <main+0x4>\n\
             \x20142:\tjmp\t0\t; 0x0 <__vectors>\n\
             \x20146:\tlds\tr18, 0x029C\t; 0x80029c <X>\n\
             \x2014a:\tret\n",
        );
        assert_eq!(code.get(0).unwrap().target, Some(0x13e));
        assert_eq!(code.get(1).unwrap().args, ["r28", "0x10"]);
        assert_eq!(code.get(1).unwrap().target, None);
        assert_eq!(code.get(2).unwrap().target, Some(0x13a));
        assert_eq!(code.get(3).unwrap().target, Some(0));
        assert_eq!(code.get(4).unwrap().target, None);
        assert_eq!(code.at(0x14a), Some(5));
        assert_eq!(code.get(5).unwrap().op, "ret");
        assert_eq!(code.at(0x138), None);
    }
}
