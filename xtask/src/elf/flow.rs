//! Finds what one function does to the stack, by following its instructions along every branch.
//!
//! A jump into another function (a tail call) is followed like any other jump. So the call graph needs edges for
//! calls only.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::Range;

use super::disasm::{Code, Insn, number};

/// A call pushes three bytes on a chip with more than 128 KiB of flash.
pub const RETURN_ADDRESS: u32 = 3;

/// A depth beyond this means a loop that pushes.
const BOTTOMLESS: u32 = 8192;

/// The stack pointer's low byte, which is written after the high byte.
const SPL: &str = "0x3d";

/// What the walk needs to know about the image besides its code.
#[derive(Default)]
pub struct Landmarks {
    /// Ends of functions whose size is known. A call right before such an end does not return.
    pub ends: HashSet<u32>,
    /// libgcc's shared prologue. A function jumps into it, and it jumps back.
    pub prologue_saves: Range<u32>,
    /// The shared prologues of `crate::shrink`. They are called, and return with more on the stack.
    pub enters: HashSet<u32>,
}

/// Stack use of one function. All depths count from its entry, without its return address.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Flow {
    /// Most bytes that it pushes and reserves itself.
    pub frame: u32,
    /// Its callees, each with the depth of the deepest call.
    pub calls: BTreeMap<u32, u32>,
    /// The depth of the deepest indirect call.
    pub indirect: Option<u32>,
    /// Whether it enables interrupts.
    pub enables_interrupts: bool,
    /// Whether no bound for its depth was found.
    pub bottomless: bool,
}

/// Follows the function at `entry`.
pub fn follow(code: &Code, entry: u32, marks: &Landmarks) -> Flow {
    let mut walk = Walk { code, marks, flow: Flow::default(), seen: HashMap::new() };
    let mut todo: Vec<(usize, u32)> = code.at(entry).map(|at| (at, 0)).into_iter().collect();
    while let Some((at, depth)) = todo.pop() {
        if walk.is_news(at, depth) {
            walk.step(at, depth, &mut todo);
        }
    }
    walk.flow
}

struct Walk<'a> {
    code: &'a Code,
    marks: &'a Landmarks,
    flow: Flow,
    seen: HashMap<usize, u32>,
}

impl Walk<'_> {
    /// Whether an instruction is reached for the first time, or deeper than before.
    fn is_news(&mut self, at: usize, depth: u32) -> bool {
        if depth > BOTTOMLESS {
            self.flow.bottomless = true;
            return false;
        }
        let before = self.seen.insert(at, depth);
        if let Some(before) = before.filter(|before| *before >= depth) {
            self.seen.insert(at, before);
            return false;
        }
        true
    }

    /// Follows one instruction: its effect, and where control goes from there.
    fn step(&mut self, at: usize, depth: u32, todo: &mut Vec<(usize, u32)>) {
        let Some(insn) = self.code.get(at) else { return };
        self.flow.enables_interrupts |= insn.op == "sei";
        let after = self.depth_after(at, insn, depth);
        self.flow.frame = self.flow.frame.max(after);
        let target = insn.target.and_then(|target| self.code.at(target));
        match insn.op.as_str() {
            "ret" | "reti" => {}
            "ijmp" | "eijmp" => self.indirect(depth),
            "jmp" | "rjmp" => todo.extend(self.jump(at, insn, after)),
            "call" | "rcall" => self.call(at, insn, after, todo),
            "icall" | "eicall" => {
                self.indirect(depth + RETURN_ADDRESS);
                todo.push((at + 1, after));
            }
            "sbrc" | "sbrs" | "sbic" | "sbis" | "cpse" => {
                todo.extend([(at + 1, after), (at + 2, after)]);
            }
            _ => {
                todo.push((at + 1, after));
                todo.extend(target.map(|target| (target, after)));
            }
        }
    }

    fn indirect(&mut self, depth: u32) {
        self.flow.indirect = self.flow.indirect.max(Some(depth));
    }

    fn call(&mut self, at: usize, insn: &Insn, depth: u32, todo: &mut Vec<(usize, u32)>) {
        let next = self.code.get(at + 1).map(|next| next.address);
        if let Some(target) = insn.target.filter(|target| self.marks.enters.contains(target)) {
            return todo.push((at + 1, self.enter(at, target, depth)));
        }
        if !self.is_reservation(at, insn)
            && let Some(target) = insn.target
        {
            let deepest = self.flow.calls.entry(target).or_default();
            *deepest = (*deepest).max(depth + RETURN_ADDRESS);
        }
        if next.is_some_and(|next| !self.marks.ends.contains(&next)) {
            todo.push((at + 1, depth));
        }
    }

    /// Returns where a jump goes, and the depth there. libgcc's shared prologue pushes and comes back.
    fn jump(&self, at: usize, insn: &Insn, depth: u32) -> Option<(usize, u32)> {
        let target = insn.target?;
        if !self.marks.prologue_saves.contains(&target) {
            return Some((self.code.at(target)?, depth));
        }
        let inside = (self.code.at(target)?..).map_while(|at| self.code.get(at));
        let inside = inside.take_while(|i| self.marks.prologue_saves.contains(&i.address));
        let pushes = inside.filter(|i| i.op == "push").count();
        Some((at + 1, depth + u32::try_from(pushes).ok()?))
    }

    /// Returns the depth after a shared prologue: what the prologue pushes, and the frame whose size is in r26 and
    /// r27.
    fn enter(&mut self, at: usize, target: u32, depth: u32) -> u32 {
        let mut depth = depth + RETURN_ADDRESS;
        let mut inside = self.code.at(target);
        while let Some(insn) = inside.and_then(|at| self.code.get(at)) {
            depth = match (insn.op.as_str(), insn.args.first().map(String::as_str)) {
                ("push", _) => depth + 1,
                ("pop", _) => depth.saturating_sub(1),
                ("out", Some(SPL)) => depth + self.frame_size(at),
                ("ret", _) => break,
                _ => depth,
            };
            self.flow.frame = self.flow.frame.max(depth);
            let goes = insn.target.filter(|_| matches!(insn.op.as_str(), "jmp" | "rjmp"));
            inside = goes.map_or(inside.map(|at| at + 1), |target| self.code.at(target));
        }
        depth.saturating_sub(RETURN_ADDRESS)
    }

    /// Returns the frame size that is loaded for a shared prologue that is called at `at`.
    fn frame_size(&self, at: usize) -> u32 {
        let loaded = |at: usize, register: &str| {
            let insn = self
                .code
                .get(at)
                .filter(|i| i.op == "ldi" && i.args.first().is_some_and(|arg| arg == register));
            insn.and_then(|insn| number(insn.args.get(1)?))
        };
        let high = loaded(at - 1, "r27");
        let low = loaded(at - 1 - usize::from(high.is_some()), "r26");
        (high.unwrap_or(0) << 8) | low.unwrap_or(BOTTOMLESS)
    }

    fn depth_after(&self, at: usize, insn: &Insn, depth: u32) -> u32 {
        match insn.op.as_str() {
            "push" => depth + 1,
            "pop" => depth.saturating_sub(1),
            "rcall" | "call" if self.is_reservation(at, insn) => depth + RETURN_ADDRESS,
            "out" if insn.args[0] == SPL => {
                let register = insn.args.get(1).map_or("", String::as_str);
                depth.saturating_add_signed(self.reserved(at, register))
            }
            _ => depth,
        }
    }

    /// Whether a call goes to the next instruction, which only makes room on the stack.
    fn is_reservation(&self, at: usize, insn: &Insn) -> bool {
        let next = self.code.get(at + 1).map(|next| next.address);
        insn.target.is_some() && insn.target == next
    }

    /// Returns by how much the stack grows when `register` is written to the stack pointer. It is what was subtracted
    /// from the register since it was read. If the frame pointer was read long ago, only recent subtractions count.
    fn reserved(&self, at: usize, register: &str) -> i32 {
        let high = next_register(register);
        let (mut low_byte, mut high_byte) = (None, None);
        for before in (at.saturating_sub(12)..at).rev().filter_map(|at| self.code.get(at)) {
            let value = before.args.get(1).and_then(|arg| number(arg));
            let value = value.and_then(|value| i32::try_from(value).ok());
            match (before.op.as_str(), before.args[0] == register) {
                ("sbiw", true) => return value.unwrap_or(0),
                ("adiw", true) => return -value.unwrap_or(0),
                ("subi", true) => low_byte = low_byte.or(value),
                ("sbci", _) if before.args[0] == high => high_byte = high_byte.or(value),
                ("in", true) | ("ret" | "reti" | "jmp" | "rjmp", _) => break,
                _ => {}
            }
        }
        let (Some(low), Some(high)) = (low_byte, high_byte) else { return 0 };
        let word = high << 8 | low;
        if word >= 0x8000 { word - 0x1_0000 } else { word }
    }
}

/// Returns the register behind another: `r29` for `r28`.
fn next_register(register: &str) -> String {
    let index = register.strip_prefix('r').and_then(|digits| digits.parse::<u8>().ok());
    index.map_or_else(String::new, |index| format!("r{}", index + 1))
}

#[cfg(test)]
mod tests;
