//! Interprocedural register allocation: removes saves of callee-saved registers that are dead in all callers.
//!
//! By the convention a function preserves 18 registers: it pushes each one that it uses and pops it at its end, which
//! takes four cycles and four bytes. Most callers have no value in most of these registers, nor have their own callers.
//! Which of them are live after a call is found for all functions together. A function must preserve the registers that
//! are live after some call of it, and those that its callers must preserve themselves. Any other register need not be
//! saved.
//!
//! A function that is called from inline assembler or from start-up code follows the convention. A function that is
//! called through a pointer preserves the registers that are live after any call through a pointer.
//!
//! Cold functions keep their saves, because many of them share equal prologues.
//!
//! [`check`] tests the result independently: it computes which registers each call changes. None of them may be live
//! after the call.

use std::collections::{HashMap, HashSet};

use anyhow::{Result, ensure};

use super::super::hot::Heat;
use super::super::text::{Function, Insn, Line, Program};
use super::super::{heat, names_in_source};
use super::effect::{self, KEPT, Set};
use super::flow::Flow;
use super::needs::{ANY, Needs, add};

/// Removes saves that are not needed.
pub fn leave_out(program: &mut Program, needs: &Needs) -> Result<()> {
    leave_out_of(program, needs, |function| heat(function) != Heat::Cold)
}

fn leave_out_of(
    program: &mut Program,
    needs: &Needs,
    is_meant: impl Fn(&Function) -> bool,
) -> Result<()> {
    let calls = Calls::of(program, needs);
    let before = Changed::by(program, &calls);
    let handed = Handed::back(program, &calls);
    for function in program.functions.iter_mut().filter(|function| is_meant(function)) {
        let Some(saves) = Saves::of(function) else { continue };
        let wanted = handed.by(&function.name);
        let gone: HashSet<usize> = (saves.pairs.iter())
            .filter(|pair| wanted & effect::bit(pair.register) == 0)
            .flat_map(|pair| pair.lines.iter().copied())
            .collect();
        let mut line = 0..;
        function.lines.retain(|_| !gone.contains(&line.next().expect("lines are finite")));
    }
    check(program, &calls, &before)
}

/// A register that a function saves, and the lines that push and pop it.
struct Pair {
    register: u8,
    lines: Vec<usize>,
}

/// The saves of a function.
struct Saves {
    pairs: Vec<Pair>,
}

impl Saves {
    /// Returns the saves of a function that begins with pushes, pops the same registers before each of its ends, and
    /// does so nowhere else; `None` for other functions.
    fn of(function: &Function) -> Option<Saves> {
        let code: Vec<(usize, &Line)> = (function.lines.iter().enumerate())
            .filter(|(_, line)| !matches!(line, Line::Note(_)))
            .collect();
        let register = |line: &Line, op: &str| match line {
            Line::Insn(insn) if insn.op == op => effect::register(&insn.args),
            _ => None,
        };
        let pushed = code.iter().map_while(|(at, line)| Some((*at, register(line, "push")?)));
        let mut pairs: Vec<Pair> = pushed
            .map(|(at, register)| Pair { register, lines: vec![at] })
            .take_while(|pair| effect::bit(pair.register) & KEPT != 0)
            .collect();
        let all: Set = pairs.iter().fold(0, |all, pair| all | effect::bit(pair.register));
        let pushes = code.iter().filter(|(_, line)| {
            register(line, "push").is_some_and(|register| effect::bit(register) & all != 0)
        });
        if pairs.is_empty()
            || pushes.count() != pairs.len()
            || all.count_ones() as usize != pairs.len()
        {
            return None;
        }
        let pops = |line: &Line| {
            register(line, "pop").is_some_and(|register| effect::bit(register) & all != 0)
        };
        let mut popped = 0;
        for end in (0..code.len()).filter(|at| is_end(code[*at].1)) {
            let from = end.checked_sub(pairs.len())?;
            for (pair, (at, line)) in pairs.iter_mut().rev().zip(&code[from..end]) {
                if register(line, "pop") != Some(pair.register) {
                    return None;
                }
                pair.lines.push(*at);
                popped += 1;
            }
        }
        (code.iter().filter(|(_, line)| pops(line)).count() == popped).then_some(Saves { pairs })
    }

    fn registers(&self) -> Set {
        self.pairs.iter().fold(0, |all, pair| all | effect::bit(pair.register))
    }
}

fn is_end(line: &Line) -> bool {
    matches!(line, Line::Insn(insn) if insn.op == "ret" || insn.op == "jmp")
}

/// The registers that each function must preserve.
struct Handed {
    back: HashMap<String, Set>,
    /// Functions that are called through a pointer.
    taken: HashSet<String>,
}

impl Handed {
    fn back(program: &Program, reads: &Calls) -> Handed {
        let (outside, taken) = (outside(program), taken(program));
        let mut back = none(program);
        back.retain(|name, _| name == ANY || !outside.contains(name));
        let mut handed = Handed { back, taken };
        let mut is_new = true;
        while is_new {
            is_new = false;
            for function in &program.functions {
                is_new |= handed.look(function, reads);
            }
        }
        handed
    }

    fn by(&self, name: &str) -> Set {
        let by_name = self.back.get(name).copied().unwrap_or(KEPT);
        if self.taken.contains(name) { by_name | self.back[ANY] } else { by_name }
    }

    /// Adds what this function needs of the functions that it calls. Returns whether that changed anything.
    fn look(&mut self, function: &Function, reads: &Calls) -> bool {
        let own = self.by(&function.name);
        let mut is_new = false;
        for call in reads.of_function(function, own) {
            is_new |= add(&mut self.back, call.to, call.behind);
        }
        is_new
    }
}

/// A call, and the registers among those of the convention that are needed after it.
struct Call<'a> {
    to: &'a str,
    behind: Set,
}

/// Which registers of the convention are read as arguments by calls.
struct Calls<'a> {
    needs: &'a Needs,
    read: HashMap<String, Set>,
}

impl Calls<'_> {
    fn of<'a>(program: &Program, needs: &'a Needs) -> Calls<'a> {
        let taken = taken(program);
        let mut calls = Calls { needs, read: none(program) };
        let mut is_new = true;
        while is_new {
            is_new = false;
            for function in &program.functions {
                // Saving a register does not count as reading it.
                let saves = Saves::of(function).map_or(Vec::new(), |saves| saves.pairs);
                let read = calls.flow(function, 0).map_or(KEPT, |mut flow| {
                    for pushed in saves.iter().filter_map(|pair| pair.lines.first()) {
                        if let Ok(at) = flow.origins.binary_search(pushed) {
                            flow.effects[at].reads = 0;
                        }
                    }
                    let needed = flow.needed();
                    flow.needed_before(0, &needed) & KEPT
                });
                for name in [function.name.as_str(), ANY] {
                    if name != ANY || taken.contains(&function.name) {
                        is_new |= add(&mut calls.read, name, read);
                    }
                }
            }
        }
        calls
    }

    /// Returns the calls of a function that must return `own` unchanged.
    fn of_function<'f>(&self, function: &'f Function, own: Set) -> Vec<Call<'f>> {
        let Some(flow) = self.flow(function, own) else {
            let insns = function.insns().filter_map(called);
            return insns.map(|to| Call { to, behind: KEPT }).collect();
        };
        let needed = flow.needed();
        let call = |(at, behind): (usize, &Set)| {
            let Line::Insn(insn) = function.lines.get(flow.origins[at])? else { return None };
            let behind = if insn.op == "jmp" { own } else { behind & KEPT };
            called(insn).map(|to| Call { to, behind })
        };
        needed.iter().enumerate().filter_map(call).collect()
    }

    /// Returns the flow of a function that returns only `own` unchanged.
    fn flow<'f>(&self, function: &'f Function, own: Set) -> Option<Flow<'f>> {
        let mut flow = Flow::of(function, self.needs)?;
        let own_asm = Saves::of(function).map_or(0, |saves| saves.registers()) | named(function);
        for (at, line) in flow.lines.iter().enumerate() {
            let effect = &mut flow.effects[at];
            match line {
                Line::Insn(insn) => {
                    let read = called(insn).and_then(|to| self.read.get(to));
                    if let Some(read) = read {
                        effect.reads = effect.reads & !KEPT | read;
                    }
                    match insn.op.as_str() {
                        "ret" => effect.reads = effect.reads & !KEPT | own,
                        "jmp" => effect.reads |= own,
                        _ => {}
                    }
                }
                // The assembler uses only registers that it names and registers that the function has saved for it.
                Line::Fixed(_) if *effect == effect::Effect::UNKNOWN => {
                    effect.reads &= !KEPT | own_asm;
                    effect.spoils &= !KEPT | own_asm;
                }
                _ => {}
            }
        }
        Some(flow)
    }
}

/// Returns the registers that inline assembler names in a function, with the other halves of their pairs.
fn named(function: &Function) -> Set {
    let words = function.fixed().flat_map(|line| line.split(|c: char| !c.is_alphanumeric()));
    let registers = words.filter_map(effect::register);
    registers.fold(0, |all, register| all | effect::pair(register & !1))
}

/// Returns the function that an instruction calls or jumps to.
fn called(insn: &Insn) -> Option<&str> {
    match insn.op.as_str() {
        "call" | "jmp" => Some(&insn.args),
        "eicall" => Some(ANY),
        _ => None,
    }
}

/// Returns an empty set for each function, and for calls through a pointer.
fn none(program: &Program) -> HashMap<String, Set> {
    let names = program.functions.iter().map(|function| function.name.clone());
    names.chain([ANY.into()]).map(|name| (name, 0)).collect()
}

/// Returns the functions that code outside the program may call.
fn outside(program: &Program) -> HashSet<String> {
    let called: HashSet<&str> = (program.functions.iter().flat_map(Function::insns))
        .filter(|insn| insn.op == "call" || insn.op == "jmp")
        .map(|insn| insn.args.as_str())
        .collect();
    let taken = program.taken();
    let mut outside = program.names_elsewhere();
    outside.extend(names_in_source(program));
    let inside = |name: &str| called.contains(name) || taken.contains(name);
    let uncalled = program.functions.iter().filter(|function| !inside(&function.name));
    outside.extend(uncalled.map(|function| function.name.clone()));
    outside
}

fn taken(program: &Program) -> HashSet<String> {
    program.taken().into_iter().map(str::to_owned).collect()
}

/// Fails if a call may change a register that is needed after it and that it did not change `before`.
fn check(program: &Program, calls: &Calls, before: &Changed) -> Result<()> {
    let handed = Handed::back(program, calls);
    let after = Changed::by(program, calls);
    let newly = |name: &str| after.when_it_returns(name) & !before.when_it_returns(name);
    for function in &program.functions {
        let name = &function.name;
        let lost = handed.by(name) & newly(name);
        ensure!(lost == 0, "{name} does not hand back {lost:#x}");
        for call in calls.of_function(function, handed.by(name)) {
            let lost = call.behind & newly(call.to);
            ensure!(lost == 0, "{} takes {lost:#x} of {name}", call.to);
        }
    }
    Ok(())
}

/// The registers of the convention that each function may have changed when it returns.
struct Changed {
    by: HashMap<String, Set>,
}

impl Changed {
    fn by(program: &Program, calls: &Calls) -> Changed {
        let taken = taken(program);
        let mut changed = Changed { by: none(program) };
        let mut is_new = true;
        while is_new {
            is_new = false;
            for function in &program.functions {
                let all = changed.of(function, calls);
                for name in [function.name.as_str(), ANY] {
                    if name != ANY || taken.contains(&function.name) {
                        is_new |= add(&mut changed.by, name, all);
                    }
                }
            }
        }
        changed
    }

    fn when_it_returns(&self, name: &str) -> Set {
        self.by.get(name).copied().unwrap_or(0)
    }

    fn of(&self, function: &Function, calls: &Calls) -> Set {
        if !function.lines.iter().any(is_end) {
            return 0;
        }
        let saved = Saves::of(function).map_or(0, |saves| saves.registers());
        let own = |flow: Flow| flow.effects.iter().fold(0, |all, effect| all | effect.changes());
        let own = calls.flow(function, 0).map_or(KEPT, own);
        let called = function.insns().filter_map(called).map(|to| self.when_it_returns(to));
        (called.fold(own, |all, one| all | one) & KEPT) & !saved
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::text::tests::{code, program};
    use super::*;

    fn without(functions: &[(&str, &str)]) -> Program {
        let mut program = program(functions);
        let needs = Needs::of(&program);
        leave_out_of(&mut program, &needs, |_| true).unwrap();
        program
    }

    /// Saves r16 and r17, and changes both.
    const SAVES: &str = "push r16\npush r17\nldi r16, 1\nldi r17, 2\npop r17\npop r16\nret";

    #[test]
    fn what_no_caller_holds_is_not_saved() {
        let main = "ldi r17, 5\n.LBB0_1:\ncall f\nsts 500, r17\nrjmp .LBB0_1";
        let after = without(&[("main", main), ("f", SAVES)]);
        assert_eq!(code(&after, "f"), "push r17; ldi r16, 1; ldi r17, 2; pop r17; ret");
    }

    #[test]
    fn what_is_held_two_calls_away_is_saved() {
        let main = "ldi r16, 5\n.LBB0_1:\ncall g\nsts 500, r16\nrjmp .LBB0_1";
        for g in ["call f\nwdr\nret", "jmp f"] {
            let after = without(&[("main", main), ("g", g), ("f", SAVES)]);
            let saved = "push r16; ldi r16, 1; ldi r17, 2; pop r16; ret";
            assert_eq!(code(&after, "f"), saved, "{g}");
        }
        // A function that saves a register itself relieves the functions that it calls.
        let g = "push r16\nldi r16, 3\ncall f\npop r16\nret";
        let after = without(&[("main", main), ("g", g), ("f", SAVES)]);
        assert_eq!(code(&after, "f"), "ldi r16, 1; ldi r17, 2; ret");
        assert!(code(&after, "g").starts_with("push r16"));
    }

    #[test]
    fn what_others_may_call_saves_all() {
        let main = ".LBB0_1:\ncall f\nrjmp .LBB0_1";
        for other in [";APP\ncall f\n;NO_APP\nret", "ldi r24, lo8(f)\nret"] {
            let after = without(&[("main", main), ("g", other), ("f", SAVES)]);
            assert!(code(&after, "f").starts_with("push r16; push r17"), "{other}");
        }
        assert!(code(&without(&[("f", SAVES)]), "f").starts_with("push r16; push r17"));
    }

    #[test]
    fn who_is_called_by_a_pointer_saves_what_is_needed_behind_such_calls() {
        let main = "ldi r30, lo8_gs(f)\nldi r31, hi8_gs(f)\nldi r16, 5\n.LBB0_1:\neicall\nsts 500, r16\nrjmp .LBB0_1";
        let after = without(&[("main", main), ("f", SAVES)]);
        assert_eq!(code(&after, "f"), "push r16; ldi r16, 1; ldi r17, 2; pop r16; ret");
    }

    #[test]
    fn ends_that_differ_stay() {
        let main = ".LBB0_1:\ncall f\nrjmp .LBB0_1";
        for f in [
            "push r16\nldi r16, 1\ncpi r24, 0\nbreq .LBB0_2\npop r16\nret\n.LBB0_2:\nret",
            "push r16\npush r17\npop r16\npop r17\nret",
            "push r16\nldi r16, 1\npush r16\npop r16\npop r16\nret",
        ] {
            let after = without(&[("main", main), ("f", f)]);
            assert_eq!(code(&after, "f"), f.replace('\n', "; "));
        }
    }

    #[test]
    fn what_assembler_of_the_source_reads_is_an_argument() {
        // The assembler has a jump within it and a call, so its effect is unknown.
        let g = ";APP\nrcall 1f\ncp r24, r16\n1: ret\n;NO_APP\nret";
        let main = ".LBB0_1:\nldi r16, 5\ncall f\ncall g\nrjmp .LBB0_1";
        let after = without(&[("main", main), ("g", g), ("f", SAVES)]);
        assert!(code(&after, "f").starts_with("push r16; push r17"));
    }

    #[test]
    fn a_register_that_is_lost_is_found() {
        let main = "ldi r16, 5\n.LBB0_1:\ncall f\nsts 500, r16\nrjmp .LBB0_1";
        let before = program(&[("main", main), ("f", SAVES)]);
        let needs = Needs::of(&before);
        let calls = Calls::of(&before, &needs);
        let changed = Changed::by(&before, &calls);
        check(&before, &calls, &changed).unwrap();
        let lost = program(&[
            ("main", main),
            ("f", &SAVES.replace("push r16\n", "").replace("pop r16\n", "")),
        ]);
        assert!(check(&lost, &calls, &changed).is_err());
    }
}
