//! Puts a jump to the start of the program at 0x20000.
//!
//! The boot loader of the Arduino Mega (since 2011, "issue 181") means to start the program at once after a reset by the
//! watchdog. It calls address 0 by a pointer, but bit 16 of the word address is still set in EIND, so it calls 0x20000.
//! A program that is longer has code there, in which the CPU would go on with unknown registers. Here it finds a jump
//! to 0.
//!
//! The jump stands in the middle of a function, which jumps over it: two cycles and up to 30 bytes. Its place is found in
//! a first link, and corrected by words that are never executed until a link has it at the address.
//! `crate::elf::restart` refuses an image without it.

use std::collections::HashMap;
use std::path::Path;

use anyhow::{Context, Result, anyhow, bail};
use object::{Object, ObjectSymbol, SymbolKind};

use super::link::Link;
use super::quiet;
use super::text::{Function, Insn, Line, Program};
use crate::chips::Chip;
use crate::elf::disasm::Code;

/// Where the loader calls.
pub const CALLED: u32 = 0x2_0000;
/// A jump to 0. The linker would make a shorter one of an instruction.
const JUMP: &str = "\t.word\t0x940c, 0";
/// Bytes of the jump over it, and of words before it, so that there are some to leave out.
const BEFORE: u32 = 2 + 12;
/// How far before the address a place is sought, bytes.
const FARTHEST: u32 = 600;
/// Farthest destination of a branch, bytes.
const BRANCH: u32 = 126;
/// Bytes by which what stands before the address may be shorter in a later link than in the first.
const SLACK: u32 = 16;
/// How often the place is corrected.
const TRIES: usize = 8;
/// How many places are tried.
const PLACES: usize = 8;

/// Where the jump stands in the program.
#[derive(Clone, Debug)]
struct Place {
    function: String,
    /// Position among the function's lines.
    line: usize,
    /// Words before it that are never executed.
    words: u32,
}

/// Assembles and links a program with the jump. A program that ends before it is linked as it is.
pub fn link(link: &Link, program: &Program, elf: &Path, chip: &Chip) -> Result<()> {
    // With debug information, without which the linker shortens other calls.
    link.image(&program.text(), elf, chip)?;
    let layout = Layout::read(elf)?;
    if layout.code.at(CALLED - 2).or(layout.code.at(CALLED - 4)).is_none() {
        return Ok(());
    }
    let mut failure = anyhow!("no function can have the jump at 0x20000");
    for place in layout.candidates(program).into_iter().take(PLACES) {
        match settle(link, program, place, elf, chip) {
            Ok(()) => return Ok(()),
            Err(error) => failure = error,
        }
    }
    Err(failure)
}

/// Links a program with the jump at a place, and corrects the place until the jump is at the address.
fn settle(link: &Link, program: &Program, mut place: Place, elf: &Path, chip: &Chip) -> Result<()> {
    for _ in 0..TRIES {
        link.image(&with_jump(program, &place).text(), elf, chip)?;
        let Some(found) = nearest_jump(&Code::load(elf)?) else { bail!("the jump is lost") };
        if found == CALLED {
            return Ok(());
        }
        let off = (i64::from(CALLED) - i64::from(found)) / 2;
        let words = u32::try_from(i64::from(place.words) + off);
        place.words = words.context("the program has grown before the jump at 0x20000")?;
    }
    bail!("the jump at 0x20000 does not come to rest")
}

/// Returns the address of the jump to 0 that is nearest to where it should be.
fn nearest_jump(code: &Code) -> Option<u32> {
    let all = (0..code.len()).filter_map(|at| code.get(at));
    let jumps = all.filter(|insn| insn.op == "jmp" && insn.target == Some(0));
    jumps.map(|insn| insn.address).min_by_key(|address| address.abs_diff(CALLED))
}

/// Returns the program with the jump.
fn with_jump(program: &Program, place: &Place) -> Program {
    let mut program = program.clone();
    let function = program.functions.iter_mut().find(|function| function.name == place.function);
    if let Some(function) = function {
        let over = format!("rjmp .+{}", 2 * place.words + 4);
        let unused = (0..place.words).map(|_| Line::Insn(Insn::new("nop")));
        let jump = [Line::Insn(Insn::new(&over))].into_iter().chain(unused);
        let jump = jump.chain([Line::Note(JUMP.into())]).collect::<Vec<_>>();
        function.lines.splice(place.line..place.line, jump);
    }
    program
}

/// What a link says.
struct Layout {
    code: Code,
    /// The addresses of functions.
    functions: HashMap<String, u32>,
}

impl Layout {
    fn read(elf: &Path) -> Result<Layout> {
        let bytes = std::fs::read(elf)?;
        let file = object::File::parse(&*bytes)?;
        let functions = file
            .symbols()
            .filter(|symbol| symbol.kind() == SymbolKind::Text)
            .filter_map(|symbol| Some((symbol.name().ok()?.to_owned(), symbol.address() as u32)))
            .collect();
        Ok(Layout { code: Code::load(elf)?, functions })
    }

    /// Returns the places where a jump may stand, the nearest to the address first.
    fn candidates(&self, program: &Program) -> Vec<Place> {
        let mut places: Vec<(u32, Place)> =
            program.functions.iter().flat_map(|function| self.places(function)).collect();
        places.sort_by_key(|(address, _)| std::cmp::Reverse(*address));
        let words = |address| (CALLED - address - 2) / 2;
        places.into_iter().map(|(at, place)| Place { words: words(at), ..place }).collect()
    }

    /// Returns the places of a function where a jump may stand, each with its address.
    fn places(&self, function: &Function) -> Vec<(u32, Place)> {
        let Some(start) = self.functions.get(&function.name) else { return Vec::new() };
        let near = CALLED - FARTHEST..=CALLED - BEFORE;
        if *start > *near.end() || start + 0x4000 < *near.start() {
            return Vec::new();
        }
        let (lines, quiet) = (code_lines(function), quiet(function));
        let mut at = self.code.at(*start);
        let mut found = Vec::new();
        for (n, line) in lines.iter().enumerate() {
            let Some(insn) = at.and_then(|at| self.code.get(at)) else { break };
            let before = n.checked_sub(1).map(|n| &function.lines[lines[n]]);
            let is_free = |line: &Line| matches!(line, Line::Insn(insn) if !insn.is_skip());
            let fits = near.contains(&insn.address)
                && before.is_some_and(is_free)
                && matches!(function.lines[*line], Line::Insn(_))
                && !quiet[*line]
                && !self.is_spanned(insn.address);
            if fits {
                let place = Place { function: function.name.clone(), line: *line, words: 0 };
                found.push((insn.address, place));
            }
            at = at.map(|at| at + 1);
        }
        found
    }

    /// Whether a branch over an address would not reach its destination over the jump, which is put there with the
    /// words before it.
    fn is_spanned(&self, address: u32) -> bool {
        let growth = CALLED - address + 4 + SLACK;
        let insns = (0..self.code.len()).filter_map(|at| self.code.get(at));
        let mut near = insns.filter(|insn| insn.address.abs_diff(address) < 2 * BRANCH);
        near.any(|insn| {
            let target = insn.target.filter(|_| insn.op.starts_with("br"));
            target.is_some_and(|target| {
                let (low, high) = (insn.address.min(target), insn.address.max(target));
                (low..=high).contains(&address) && high - low + growth > BRANCH
            })
        })
    }
}

/// Returns the positions of a function's lines that are instructions, in inline assembler, too.
fn code_lines(function: &Function) -> Vec<usize> {
    let is_code = |line: &Line| match line {
        Line::Insn(_) => true,
        Line::Fixed(text) => is_instruction(text),
        Line::Label(_) | Line::Note(_) => false,
    };
    (0..).zip(&function.lines).filter(|(_, line)| is_code(line)).map(|(at, _)| at).collect()
}

/// Whether a line of inline assembler is an instruction, not a label, a directive or a comment.
fn is_instruction(text: &str) -> bool {
    let text = text.trim();
    !text.is_empty() && !text.starts_with(['.', ';', '#']) && !text.ends_with(':')
}

#[cfg(test)]
mod tests {
    use super::super::text::tests::program;
    use super::*;

    /// A function at 0x1FF00 of 400 words, with these lines first.
    fn long(first: &str) -> (Program, Layout) {
        let first = first.split('\n').map(str::to_owned);
        let lines: Vec<String> = first.chain((0..400).map(|_| "inc r24".into())).collect();
        let listing: String = (0..)
            .zip(lines.iter().filter(|line| is_instruction(line)))
            .map(|(n, line)| format!(" {:x}:\t{line}\t\n", 0x1_FF00 + 2 * n))
            .collect();
        let functions = HashMap::from([("f".to_owned(), 0x1_FF00)]);
        let layout = Layout { code: Code::parse(&listing), functions };
        (program(&[("f", &lines.join("\n"))]), layout)
    }

    #[test]
    fn the_jump_stands_where_it_is_called() {
        let (program, layout) = long("push r2");
        let place = layout.candidates(&program).swap_remove(0);
        assert_eq!((place.function.as_str(), place.words), ("f", 6));
        let with = with_jump(&program, &place);
        let code: Vec<_> = with.functions[0]
            .lines
            .iter()
            .filter_map(|line| match line {
                Line::Insn(insn) => Some((2, insn.op.clone())),
                Line::Note(text) if text == JUMP => Some((4, "jump".into())),
                _ => None,
            })
            .collect();
        let at = code.iter().position(|(_, op)| op == "jump").unwrap();
        let bytes: u32 = code[..at].iter().map(|(bytes, _)| bytes).sum();
        assert_eq!(0x1_FF00 + bytes, CALLED);
        assert_eq!(code[at - 7], (2, "rjmp".into()));
    }

    #[test]
    fn nothing_stands_behind_a_skip_or_in_inline_assembler() {
        let many = |line: &str| [line].repeat(130).join("\n");
        for bad in [many("sbrc r24, 1"), format!(";APP\n{}\n;NO_APP", many("nop"))] {
            let (program, layout) = long(&bad);
            let places = layout.candidates(&program);
            assert!(places.is_empty(), "{places:?}");
        }
    }

    /// A branch over the place reaches its destination with the jump and all words before it.
    #[test]
    fn no_branch_is_made_too_long() {
        // A branch at 0x1FFEC goes 50 words on, and 34 bytes or more would be put in behind it.
        let first = (0..118).map(|_| "inc r24".to_owned());
        let all: Vec<String> = first.chain(["breq .+100".to_owned()]).collect();
        let (program, mut layout) = long(&all.join("\n"));
        let listing = (0..400).map(|n| match n {
            118 => {
                format!(" {:x}:\tbreq\t.+100\t; 0x{:x}\n", 0x1_FF00 + 2 * n, 0x1_FF00 + 2 * n + 102)
            }
            _ => format!(" {:x}:\tinc\tr24\t\n", 0x1_FF00 + 2 * n),
        });
        layout.code = Code::parse(&listing.collect::<String>());
        let place = layout.candidates(&program).swap_remove(0);
        // It stands before the branch: 22 bytes before the address, two of them the jump over it.
        assert_eq!(place.words, 10);
    }
}
