//! Interprocedural liveness: which arguments functions read, and which results their callers read.
//!
//! The calling convention has 18 registers for arguments and 8 for results. Most functions use only a few of them. An
//! argument that the function does not read need not be computed, nor a result that no caller reads. Both are found by
//! a fixpoint iteration over all functions.

use std::collections::{HashMap, HashSet};

use super::super::text::{Function, Program};
use super::effect::{ARGUMENTS, RESULTS, Set, bit};
use super::flow::Flow;

/// The name for all functions that are called through a pointer.
pub const ANY: &str = "";

/// The needs of functions, by name. A function that is not listed uses all registers of the convention.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    arguments: HashMap<String, Set>,
    results: HashMap<String, Set>,
    /// Functions that are called through a pointer.
    taken: HashSet<String>,
}

impl Needs {
    /// Returns the needs of all functions of a program.
    pub fn of(program: &Program) -> Needs {
        let insns = program.functions.iter().flat_map(Function::insns);
        let called: HashSet<&str> =
            insns.filter(|insn| insn.op == "call").map(|insn| insn.args.as_str()).collect();
        let taken = program.taken().into_iter().map(str::to_owned).collect();
        let mut needs = Needs { taken, ..Needs::default() };
        let elsewhere = program.names_elsewhere();
        for name in program.functions.iter().map(|function| &function.name) {
            needs.arguments.insert(name.clone(), 0);
            let is_called = called.contains(name.as_str()) || needs.taken.contains(name);
            if is_called && !elsewhere.contains(name) {
                needs.results.insert(name.clone(), 0);
            }
        }
        needs.results.insert(ANY.into(), 0);
        let mut is_new = true;
        while is_new {
            is_new = false;
            for function in &program.functions {
                is_new |= needs.look(function);
            }
        }
        needs
    }

    /// Returns the registers that a call of this function reads.
    pub fn arguments(&self, name: &str) -> Set {
        self.arguments.get(name).copied().unwrap_or(ARGUMENTS) | bit(1)
    }

    /// Returns the registers that some caller of this function reads after it has returned.
    pub fn results(&self, name: &str) -> Set {
        let by_name = self.results.get(name).copied().unwrap_or(RESULTS);
        if self.taken.contains(name) { by_name | self.results[ANY] } else { by_name }
    }

    /// Whether every need is within the needs of another program.
    pub fn are_within(&self, others: &Needs) -> bool {
        let within = |name: &String| {
            self.arguments(name) & !others.arguments(name) == 0
                && self.results(name) & !others.results(name) == 0
        };
        self.arguments.keys().all(within)
    }

    /// Adds the needs of a function. Returns whether that changed anything.
    fn look(&mut self, function: &Function) -> bool {
        let Some(flow) = Flow::of(function, self) else {
            return self.look_at_unknown(function);
        };
        let needed = flow.needed();
        let mut is_new = false;
        let entry = flow.needed_before(0, &needed) & ARGUMENTS;
        is_new |= add(&mut self.arguments, &function.name, entry);
        for (at, behind) in needed.iter().enumerate() {
            let Some(insn) = flow.insn(at) else { continue };
            match insn.op.as_str() {
                "call" => is_new |= add(&mut self.results, &insn.args, behind & RESULTS),
                "eicall" => is_new |= add(&mut self.results, ANY, behind & RESULTS),
                // The results of the function that is jumped to are also the results of this one.
                "jmp" => is_new |= add(&mut self.results, &insn.args, RESULTS),
                _ => {}
            }
        }
        is_new
    }

    /// Handles a function with jumps to unknown places: it needs everything.
    fn look_at_unknown(&mut self, function: &Function) -> bool {
        let mut is_new = add(&mut self.arguments, &function.name, ARGUMENTS);
        is_new |= add(&mut self.results, ANY, RESULTS);
        for insn in function.insns().filter(|insn| insn.op == "call" || insn.op == "jmp") {
            is_new |= add(&mut self.results, &insn.args, RESULTS);
        }
        is_new
    }
}

/// Adds to what is known of a function, if the function is listed. Returns whether that changed anything.
pub fn add(sets: &mut HashMap<String, Set>, name: &str, set: Set) -> bool {
    let Some(known) = sets.get_mut(name) else { return false };
    let is_new = set & !*known != 0;
    *known |= set;
    is_new
}

#[cfg(test)]
mod tests {
    use super::super::super::text::tests::program;
    use super::*;

    /// Registers that a function need not return unchanged.
    const OWN: Set = RESULTS;

    fn needs(functions: &[(&str, &str)]) -> Needs {
        Needs::of(&program(functions))
    }

    #[test]
    fn a_function_needs_what_it_reads_before_it_writes_it() {
        let f = ("f", "mov r24, r22\nldi r20, 1\nadd r24, r20\nret");
        let needs = needs(&[f, ("h", "call f\nsts 500, r24\n.LBB0_1:\nwdr\nrjmp .LBB0_1")]);
        assert_eq!(needs.arguments("f") & OWN, bit(22));
        assert_eq!(needs.arguments("g"), ARGUMENTS | bit(1), "nobody knows");
    }

    #[test]
    fn what_it_hands_on_it_needs_if_it_is_needed_there() {
        let f = ("f", "call g\n.LBB0_1:\nwdr\nrjmp .LBB0_1");
        let g = ("g", "sts 500, r24\nldi r24, 1\nret");
        assert_eq!(needs(&[f, g]).arguments("f") & OWN, bit(24));
        assert_eq!(needs(&[f]).arguments("f") & OWN, OWN);
    }

    #[test]
    fn results_are_what_callers_read() {
        let f = ("f", "call g\nsts 500, r24\nldi r24, 1\nldi r25, 1\ncall h");
        let g = ("g", "ldi r24, 1\nldi r25, 2\nret");
        let h = ("h", "sts 500, r25\nret");
        assert_eq!(needs(&[f, g, h]).results("g"), bit(24));
        assert_eq!(needs(&[f, g]).results("h"), RESULTS);
        assert_eq!(needs(&[("f", "call g\nret"), g]).results("g"), RESULTS, "what f returns");
        let asm = ("a", ";APP\ncall g\n;NO_APP\nret");
        assert_eq!(needs(&[f, g, h, asm]).results("g"), RESULTS);
    }

    #[test]
    fn who_is_called_by_a_pointer_returns_what_is_read_behind_such_calls() {
        let f = ("f", "ldi r30, lo8_gs(g)\nldi r31, hi8_gs(g)\neicall\nsts 500, r24\ncall h");
        let g = ("g", "ldi r24, 1\nldi r25, 2\nret");
        let h = ("h", "ldi r24, 1\nret");
        assert_eq!(needs(&[f, g, h]).results("g"), bit(24));
    }

    #[test]
    fn functions_that_call_one_another_need_what_one_of_them_reads() {
        let f = ("f", "cpi r24, 0\nbreq .LBB0_1\ncall g\n.LBB0_1:\nret");
        let g = ("g", "sts 500, r22\ncall f\nret");
        let needs = needs(&[f, g]);
        assert_eq!(needs.arguments("f") & OWN, bit(24) | bit(22));
        assert_eq!(needs.arguments("g") & OWN, bit(22) | bit(24));
    }
}
