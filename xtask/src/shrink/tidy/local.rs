//! Local data flow between two labels: which registers hold copies, and which hold values of the frame.

use super::super::text::{Insn, Line};
use super::copies::Copies;
use super::effect::{self, bit, operands, register};
use super::flow::Flow;
use super::offsets::Offsets;

/// The facts that hold before a line.
#[derive(Clone, Default)]
pub struct Local {
    /// For each register: another register with the same value.
    copies: [Option<u8>; 32],
    /// Places in the frame, each with a register that holds its value.
    frame: Vec<(String, u8)>,
    /// The values of pairs.
    pub offsets: Offsets,
    /// Whether Y points to the frame.
    pub has_frame: bool,
}

impl Local {
    pub fn of(flow: &Flow) -> Local {
        let loads = |op: &str, args: &str| {
            flow.lines
                .iter()
                .any(|line| matches!(line, Line::Insn(insn) if insn.op == op && insn.args == args))
        };
        Local { has_frame: loads("in", "r28, 61") && loads("in", "r29, 62"), ..Local::default() }
    }

    /// Drops all facts, because control may come from elsewhere.
    pub fn clear(&mut self) {
        self.copies = [None; 32];
        self.frame.clear();
        self.offsets.clear();
    }

    /// Enters a label: only the copies that hold on every path stay known.
    pub fn enter(&mut self, copies: &Copies) {
        self.clear();
        for register in 0..32 {
            self.copy(register, copies.root(register));
        }
    }

    pub fn original(&self, copy: u8) -> Option<u8> {
        self.copies[usize::from(copy)]
    }

    fn root(&self, register: u8) -> u8 {
        self.original(register).unwrap_or(register)
    }

    pub fn are_equal(&self, a: u8, b: u8) -> bool {
        self.root(a) == self.root(b)
    }

    /// Returns the register that already holds the value of a load.
    pub fn held(&self, is_load: bool, place: &str) -> Option<u8> {
        let found = self.frame.iter().find(|(known, _)| known == place);
        found.filter(|_| is_load && self.has_frame).map(|(_, register)| *register)
    }

    /// Moves past a line.
    pub fn pass(&mut self, flow: &Flow, at: usize) {
        let (line, effect, may_be_skipped) =
            (flow.lines[at], &flow.effects[at], flow.may_be_skipped[at]);
        let before = self.clone();
        let insn = flow.insn(at).filter(|_| !may_be_skipped);
        self.offsets.pass(insn, flow.insn(at + 1), effect.changes());
        for r in (0..32).filter(|r| effect.changes() & bit(*r) != 0) {
            self.forget(r);
        }
        match line {
            Line::Insn(insn) if !may_be_skipped => self.learn(insn, &before),
            Line::Insn(insn) if insn.op.starts_with("st") => self.frame.clear(),
            Line::Insn(_) | Line::Note(_) => {}
            Line::Fixed(_) if flow.fixed.contains_key(&at) => self.frame.clear(),
            Line::Label(_) | Line::Fixed(_) => self.clear(),
        }
    }

    fn forget(&mut self, register: u8) {
        self.copies[usize::from(register)] = None;
        for copy in &mut self.copies {
            *copy = copy.filter(|original| *original != register);
        }
        self.frame.retain(|(_, held)| *held != register);
        if register == 28 || register == 29 {
            self.frame.clear();
        }
    }

    fn learn(&mut self, insn: &Insn, before: &Local) {
        let (first, second) = operands(insn);
        let (d, s) = (register(first), register(second));
        match (insn.op.as_str(), d, s) {
            ("mov", Some(d), Some(s)) => self.copy(d, before.root(s)),
            ("movw", Some(d), Some(s)) => {
                let lost = effect::pair(d);
                let root =
                    |s| Some(before.root(s)).filter(|root| bit(*root) & lost == 0).unwrap_or(s);
                if lost & effect::pair(s) == 0 {
                    self.copy(d, root(s));
                    self.copy(d + 1, root(s + 1));
                }
            }
            ("ldd", Some(d), _) if second.starts_with("Y+") => self.hold(second, d),
            ("std", _, Some(s)) if first.starts_with("Y+") => self.hold(first, s),
            // This may write to the frame.
            ("st" | "std" | "call" | "eicall", ..) => self.frame.clear(),
            _ => {}
        }
    }

    fn copy(&mut self, d: u8, s: u8) {
        if d != s {
            self.copies[usize::from(d)] = Some(s);
        }
    }

    fn hold(&mut self, place: &str, register: u8) {
        self.frame.retain(|(known, _)| known != place);
        self.frame.push((place.to_owned(), register));
    }
}
