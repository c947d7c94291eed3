//! Control flow graph, liveness and known bits of a function.

use std::collections::HashMap;

use super::super::text::{Function, Insn, Line};
use super::effect::{self, Effect, Set};
use super::needs::Needs;

/// The code of a function, line by line, and its control flow.
pub struct Flow<'a> {
    /// The lines that make code, and labels.
    pub lines: Vec<&'a Line>,
    /// Index of each of these lines among all lines of the function.
    pub origins: Vec<usize>,
    pub effects: Vec<Effect>,
    /// For each line, the lines that may run next: none, one or two.
    pub next: Vec<Vec<usize>>,
    /// Whether the instruction before may skip this one.
    pub may_be_skipped: Vec<bool>,
    pub labels: HashMap<&'a str, usize>,
    /// Instructions of inline assembler whose effect is known.
    pub fixed: HashMap<usize, Insn>,
    /// For each line that saves the status register: the line that restores it.
    pub restores: Vec<Option<usize>>,
}

impl<'a> Flow<'a> {
    /// Returns the flow of a function; `None` if it has jumps to unknown destinations. `needs` are the needs of all
    /// functions.
    pub fn of(function: &'a Function, needs: &Needs) -> Option<Flow<'a>> {
        let code =
            function.lines.iter().enumerate().filter(|(_, line)| !matches!(line, Line::Note(_)));
        let (origins, lines): (Vec<usize>, Vec<&Line>) = code.unzip();
        let label = |(at, line): (usize, &&'a Line)| match line {
            Line::Label(label) => Some((label.as_str(), at)),
            _ => None,
        };
        let labels: HashMap<&str, usize> = lines.iter().enumerate().filter_map(label).collect();
        let pieces = Pieces::of(function);
        let fixed: HashMap<usize, Insn> = (origins.iter().enumerate())
            .filter_map(|(at, origin)| Some((at, pieces.straight.get(origin)?.clone())))
            .collect();
        let effect = |(at, line): (usize, &&Line)| {
            let whole = pieces.winding.get(&origins[at]).copied();
            let effect = fixed.get(&at).and_then(effect::of).or(whole);
            as_needed(effect.unwrap_or_else(|| effect::of_line(line)), line, &function.name, needs)
        };
        let effects: Vec<Effect> = lines.iter().enumerate().map(effect).collect();
        let next =
            (0..lines.len()).map(|at| next(&lines, &labels, at)).collect::<Option<Vec<_>>>()?;
        let may_be_skipped: Vec<bool> =
            (0..lines.len()).map(|at| at > 0 && is_skip(lines[at - 1])).collect();
        let mut flow = Flow {
            restores: vec![None; lines.len()],
            lines,
            origins,
            effects,
            next,
            may_be_skipped,
            labels,
            fixed,
        };
        flow.restores = (0..flow.lines.len()).map(|at| flow.restored(at)).collect();
        Some(flow)
    }

    /// Returns the instruction of a line, including one of inline assembler whose effect is known.
    pub fn insn(&self, at: usize) -> Option<&Insn> {
        match self.lines.get(at)? {
            Line::Insn(insn) => Some(insn),
            Line::Fixed(_) => self.fixed.get(&at),
            Line::Label(_) | Line::Note(_) => None,
        }
    }

    /// Returns where the status that `in r0, 63` saves is restored: straight on, with no other use of the register.
    fn restored(&self, at: usize) -> Option<usize> {
        let kept = kept_status(self.insn(at)?).filter(|_| !self.may_be_skipped[at])?;
        for out in at + 1..self.lines.len() {
            let (insn, effect) = (self.insn(out)?, &self.effects[out]);
            let (first, second) = effect::operands(insn);
            if insn.op == "out" && first == "63" && effect::register(second) == Some(kept) {
                return (!self.may_be_skipped[out]).then_some(out);
            }
            if insn.is_jump()
                || (effect.reads | effect.changes()) & effect::bit(kept) != 0
                || effect.reads & effect::FLAGS != 0
            {
                return None;
            }
        }
        None
    }

    /// Returns the registers and flags that a line reads, given those that are live after each line.
    ///
    /// Flags that are saved and restored are read if they are needed where they are restored.
    fn reads(&self, at: usize, needed: &[Set]) -> Set {
        let reads = self.effects[at].reads;
        let Some(out) = self.restores[at] else { return reads };
        let kept = self.insn(at).and_then(kept_status).map_or(0, effect::bit);
        if needed[out] & kept != 0 {
            return reads;
        }
        reads & !effect::FLAGS | needed[out] & effect::FLAGS
    }

    /// Returns the first line at or after a line that is no label.
    pub fn skip_labels(&self, at: usize) -> usize {
        self.lines[at..].iter().take_while(|line| matches!(line, Line::Label(_))).count() + at
    }

    /// Returns the first line that runs at a label and is no jump. If jumps lead in a circle it is one of them.
    pub fn destination(&self, label: &str) -> usize {
        let mut at = self.skip_labels(self.labels[label]);
        for _ in 0..self.labels.len() {
            match self.lines.get(at) {
                Some(Line::Insn(insn)) if insn.op == "rjmp" => {
                    at = self.skip_labels(self.labels[insn.args.as_str()]);
                }
                _ => break,
            }
        }
        at
    }

    /// Liveness: returns for each line the registers and flags that are live after it.
    pub fn needed(&self) -> Vec<Set> {
        let mut before = vec![0; self.lines.len()];
        let mut behind = vec![0; self.lines.len()];
        let mut again = true;
        while again {
            again = false;
            for at in (0..self.lines.len()).rev() {
                behind[at] =
                    self.next[at].iter().map(|to| before[*to]).fold(0, |all, one| all | one);
                let needed = self.needed_before(at, &behind);
                again |= needed != before[at];
                before[at] = needed;
            }
        }
        behind
    }

    /// Returns the registers and flags that are live before a line, given those that are live after each line.
    pub fn needed_before(&self, at: usize, needed: &[Set]) -> Set {
        let Some(effect) = self.effects.get(at) else { return 0 };
        let written = if self.may_be_skipped[at] { 0 } else { effect.writes };
        needed[at] & !written | self.reads(at, needed)
    }

    /// Returns for each line the known bits of the registers before it.
    pub fn known(&self) -> Vec<Known> {
        let mut before: Vec<Option<Known>> = vec![None; self.lines.len()];
        let mut open = Vec::new();
        if let Some(first) = before.first_mut() {
            *first = Some(Known::at_entry());
            open.push(0);
        }
        while let Some(at) = open.pop() {
            let Some(known) = before[at] else { continue };
            let mut behind = known.behind(self.lines[at], self.insn(at), &self.effects[at]);
            if self.may_be_skipped[at] {
                behind = behind.or(&known);
            }
            for to in &self.next[at] {
                let joined = before[*to].map_or(behind, |old| old.or(&behind));
                if before[*to] != Some(joined) {
                    before[*to] = Some(joined);
                    open.push(*to);
                }
            }
        }
        before.into_iter().map(Option::unwrap_or_default).collect()
    }
}

/// Returns the effect of a line with regard to needs: a call reads what the called function needs, and a return reads
/// what callers need.
fn as_needed(effect: Effect, line: &Line, name: &str, needs: &Needs) -> Effect {
    let Line::Insn(insn) = line else { return effect };
    let reads = match insn.op.as_str() {
        "call" => needs.arguments(&insn.args),
        "ret" => effect.reads & !effect::RESULTS | needs.results(name),
        _ => effect.reads,
    };
    Effect { reads, ..effect }
}

/// Returns the register in which an instruction saves the status register.
fn kept_status(insn: &Insn) -> Option<u8> {
    let (first, second) = effect::operands(insn);
    if insn.op == "in" && second == "63" { effect::register(first) } else { None }
}

/// Pieces of inline assembler whose effect is known.
#[derive(Default)]
struct Pieces {
    /// Instructions of pieces that run straight on, by their lines.
    straight: HashMap<usize, Insn>,
    /// For each line of a piece with jumps within it: the possible effect of the whole piece.
    winding: HashMap<usize, Effect>,
}

impl Pieces {
    fn of(function: &Function) -> Pieces {
        let mut pieces = Pieces::default();
        let mut piece = Vec::new();
        for (at, line) in function.lines.iter().enumerate() {
            match line {
                Line::Fixed(text) => piece.push((at, Insn::new(text))),
                _ => pieces.take(std::mem::take(&mut piece)),
            }
        }
        pieces.take(piece);
        pieces
    }

    fn take(&mut self, piece: Vec<(usize, Insn)>) {
        const STRAIGHT: [&str; 15] = [
            "in", "out", "cli", "sei", "mul", "mov", "movw", "add", "adc", "clr", "lpm", "wdr",
            "nop", "ldi", "swap",
        ];
        if piece.iter().all(|(_, insn)| STRAIGHT.contains(&insn.op.as_str())) {
            self.straight.extend(piece);
            return;
        }
        let mut whole = Effect { reads: 0, writes: 0, spoils: 0, acts: true };
        for (_, insn) in piece.iter().filter(|(_, insn)| !insn.op.ends_with(':')) {
            let goes_within = effect::branch(&insn.op).is_some();
            let Some(effect) = effect::of(insn).filter(|_| goes_within || !insn.is_jump()) else {
                return;
            };
            if insn.op.ends_with("call") || matches!(insn.op.as_str(), "push" | "pop") {
                return;
            }
            whole.reads |= effect.reads;
            whole.spoils |= effect.changes();
        }
        self.winding.extend(piece.into_iter().map(|(at, _)| (at, whole)));
    }
}

fn is_skip(line: &Line) -> bool {
    matches!(line, Line::Insn(insn) if insn.is_skip())
}

/// Returns the lines that may run after a line.
fn next(lines: &[&Line], labels: &HashMap<&str, usize>, at: usize) -> Option<Vec<usize>> {
    let follows = (at + 1 < lines.len()).then_some(at + 1);
    let Line::Insn(insn) = lines[at] else { return Some(follows.into_iter().collect()) };
    let to = || labels.get(insn.args.as_str()).copied();
    match insn.op.as_str() {
        "ret" | "jmp" => Some(Vec::new()),
        "rjmp" => Some(vec![to()?]),
        // If this call returned, it would run into the next function.
        "call" if follows.is_none() => Some(Vec::new()),
        _ if effect::branch(&insn.op).is_some() => Some(vec![to()?, follows?]),
        "cpse" | "sbrc" | "sbrs" | "sbic" | "sbis" => {
            Some(vec![follows?, (at + 2 < lines.len()).then_some(at + 2)?])
        }
        _ if insn.is_jump() => None,
        _ => Some(vec![follows?]),
    }
}

/// The bits of each register that are known to be 0, and those known to be 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Known {
    registers: [Bits; 32],
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bits {
    pub zeros: u8,
    pub ones: u8,
}

impl Bits {
    pub fn of(value: u8) -> Bits {
        Bits { zeros: !value, ones: value }
    }

    pub fn value(self) -> Option<u8> {
        (self.zeros | self.ones == u8::MAX).then_some(self.ones)
    }
}

impl Known {
    /// Register 1 is 0 at the beginning of every function.
    fn at_entry() -> Known {
        let mut known = Known::default();
        known.registers[1] = Bits::of(0);
        known
    }

    pub fn bits(&self, register: u8) -> Bits {
        self.registers[usize::from(register)]
    }

    pub fn value(&self, register: u8) -> Option<u8> {
        self.bits(register).value()
    }

    fn or(&self, other: &Known) -> Known {
        let both = |at: usize| {
            let (a, b) = (self.registers[at], other.registers[at]);
            Bits { zeros: a.zeros & b.zeros, ones: a.ones & b.ones }
        };
        Known { registers: std::array::from_fn(both) }
    }

    /// Returns the known bits after a line.
    pub fn behind(&self, line: &Line, insn: Option<&Insn>, effect: &Effect) -> Known {
        let mut known = *self;
        for (number, register) in known.registers.iter_mut().enumerate() {
            if effect.changes() & 1 << number != 0 {
                *register = Bits::default();
            }
        }
        // Inline assembler leaves register 1 unchanged.
        if matches!(line, Line::Fixed(_)) && insn.is_none() {
            known.registers[1] = self.registers[1];
        }
        if let Some(insn) = insn {
            self.computed(insn, &mut known);
        }
        known
    }

    fn computed(&self, insn: &Insn, known: &mut Known) {
        let (first, second) = effect::operands(insn);
        let Some(d) = effect::register(first) else { return };
        let s = effect::register(second);
        let (a, b) = (self.bits(d), s.map_or_else(Bits::default, |s| self.bits(s)));
        let number = immediate(second);
        let result = match (insn.op.as_str(), number) {
            ("ldi", Some(value)) => Bits::of(value),
            ("mov", _) => b,
            ("clr", _) => Bits::of(0),
            ("eor" | "sub", _) if s == Some(d) => Bits::of(0),
            ("andi", Some(mask)) => Bits { zeros: a.zeros | !mask, ones: a.ones & mask },
            ("ori", Some(mask)) => Bits { zeros: a.zeros & !mask, ones: a.ones | mask },
            ("and", _) => Bits { zeros: a.zeros | b.zeros, ones: a.ones & b.ones },
            ("or", _) => Bits { zeros: a.zeros & b.zeros, ones: a.ones | b.ones },
            ("lsr", _) => Bits { zeros: a.zeros >> 1 | 0x80, ones: a.ones >> 1 },
            ("lsl", _) => Bits { zeros: a.zeros << 1 | 1, ones: a.ones << 1 },
            ("swap", _) => Bits { zeros: a.zeros.rotate_left(4), ones: a.ones.rotate_left(4) },
            ("com", _) => Bits { zeros: a.ones, ones: a.zeros },
            ("movw", _) => {
                let Some(s) = s else { return };
                known.registers[usize::from(d) + 1] = self.bits(s + 1);
                self.bits(s)
            }
            _ => return,
        };
        known.registers[usize::from(d)] = result;
    }
}

/// Returns an operand that is a number, as a byte.
pub fn immediate(operand: &str) -> Option<u8> {
    let number: i32 = operand.parse().ok()?;
    u8::try_from(number & 0xFF).ok()
}
