//! Peephole and data-flow optimizations of LLVM's output.
//!
//! LLVM's back end for AVR makes a 0 or 1 from a condition and tests that, copies registers needlessly, loads values
//! from the frame that a register still holds, and compares with 0 a value whose computation has set the flags.
//! Removing that saves flash and time, so it is done in hot functions as well. [`rules`], [`conditions`] and
//! [`addresses`] contain the rules. They use the data flow of [`flow`] and [`local`], and the interprocedural facts of
//! [`needs`]. [`layout`] is block layout: it puts code after the jumps to it. [`equal`] compares every function with
//! the compiler's version, by running both.

mod addresses;
mod base;
mod conditions;
mod copies;
mod effect;
mod equal;
mod flow;
mod layout;
mod local;
mod needs;
mod offsets;
mod rules;
mod run;
mod saves;

use std::collections::HashMap;

use anyhow::{Result, ensure};

use super::names_in_source;
use super::text::{Function, Line, Program};
use copies::Copies;
use effect::Set;
use flow::{Flow, Known};
use local::Local;
use needs::Needs;
use rules::{Edit, Place};

/// Most sweeps over a function.
const SWEEPS: usize = 1_000;

/// Tidies all functions that follow the compiler's own conventions.
pub fn tidy(program: &mut Program) -> Result<()> {
    let in_source = names_in_source(program);
    let needs = Needs::of(program);
    for function in &mut program.functions {
        let has_convention =
            !in_source.contains(&function.name) && function.insns().all(|insn| insn.op != "reti");
        if has_convention {
            tidy_function(function, &needs)?;
        }
    }
    let after = Needs::of(program);
    ensure!(after.are_within(&needs), "a function needs more than before");
    saves::leave_out(program, &after)
}

fn tidy_function(function: &mut Function, needs: &Needs) -> Result<()> {
    let mut versions = vec![function.clone()];
    while versions.len() < SWEEPS && sweep(function, needs) {
        versions.push(function.clone());
    }
    if base::share(function, needs) {
        versions.push(function.clone());
    }
    if layout::arrange(function) {
        versions.push(function.clone());
    }
    equal::check(&versions, needs)
}

/// Applies at most one rule between each two labels. Returns whether any was applied.
fn sweep(function: &mut Function, needs: &Needs) -> bool {
    let Some(flow) = Flow::of(function, needs) else { return false };
    let sweep =
        Sweep { needed: flow.needed(), known: flow.known(), uses: uses(&flow), flow: &flow };
    let mut edits = sweep.edits(|place| place.edit(), None);
    if edits.is_empty() {
        edits = sweep.edits(|place| place.constant(), Some(&[]));
    }
    if edits.is_empty() {
        edits = sweep.edits(|place| place.copy(), Some(&Copies::of(&flow)));
    }
    let origins = flow.origins;
    let lost = edits.is_empty();
    let mut gone = Vec::new();
    for (at, becomes) in edits {
        match becomes {
            Some(insn) => function.lines[origins[at]] = Line::Insn(insn),
            None => gone.push(origins[at]),
        }
    }
    gone.sort_unstable();
    let mut line = 0..;
    function.lines.retain(|_| gone.binary_search(&line.next().expect("lines are finite")).is_err());
    !lost
}

/// Returns how many jumps and branches go to each label.
fn uses(flow: &Flow) -> HashMap<String, usize> {
    let mut uses = HashMap::new();
    for line in &flow.lines {
        if let Line::Insn(insn) = line
            && insn.is_jump()
        {
            *uses.entry(insn.args.clone()).or_default() += 1;
        }
    }
    uses
}

struct Sweep<'a> {
    flow: &'a Flow<'a>,
    needed: Vec<Set>,
    known: Vec<Known>,
    uses: HashMap<String, usize>,
}

impl Sweep<'_> {
    /// Returns the edits that a rule finds: all, or only the first if the rule depends on what is true at labels.
    fn edits(&self, rule: impl Fn(&Place) -> Option<Edit>, first: Option<&[Copies]>) -> Edit {
        let flow = self.flow;
        let calls = |label: &str| self.uses.get(label).copied().unwrap_or(0);
        let mut local = Local::of(flow);
        let mut edits = Edit::new();
        // The next search begins after the last line that an edit changes.
        let mut busy = None;
        let mut waits = false;
        for (at, line) in flow.lines.iter().enumerate() {
            if let Line::Label(label) = line {
                waits &= busy.is_some_and(|last| last > at);
                match first.and_then(|copies| copies.get(at)) {
                    Some(copies) => local.enter(copies),
                    None => local.clear(),
                }
                if first.is_none() && calls(label) == 0 && label.starts_with(".LBB") && !waits {
                    edits.push((at, None));
                }
                continue;
            }
            if let Line::Insn(insn) = line
                && !waits
                && !flow.may_be_skipped[at]
            {
                let place = Place {
                    flow,
                    needed: &self.needed,
                    known: &self.known,
                    local: &local,
                    calls: &calls,
                    at,
                    insn,
                };
                if let Some(edit) = rule(&place) {
                    if first.is_some() {
                        return edit;
                    }
                    busy = edit.iter().map(|(at, _)| *at).max();
                    waits = true;
                    edits.extend(edit);
                }
            }
            local.pass(flow, at);
        }
        edits
    }
}

#[cfg(test)]
mod tests {
    use super::super::text::tests::{code, program};
    use super::*;

    fn tidied(text: &str) -> String {
        let mut program = program(&[("f", text)]);
        tidy(&mut program).unwrap();
        code(&program, "f")
    }

    #[test]
    fn a_condition_is_branched_on() {
        for (test, branch, becomes) in [
            ("andi r24, 1\ncpi r24, 0", "breq", "brge"),
            ("andi r24, 1", "brne", "brlt"),
            ("cpi r24, 0\nldd r26, Z+1\nst Z, r26", "brne", "brlt"),
        ] {
            let text = format!(
                "cp r24, r22\nldi r24, 1\nbrlt .LBB0_1\nmov r24, r1\n.LBB0_1:\n{test}\n{branch} .LBB0_2\n\
                 sts 500, r1\n.LBB0_2:\nldi r24, 5\nret"
            );
            let after = tidied(&text);
            assert!(after.starts_with("cp r24, r22; "), "{after}");
            assert!(
                after.contains(&format!(
                    "{becomes} .LBB0_2; sts 500, r1; .LBB0_2:; ldi r24, 5; ret"
                )),
                "{after}"
            );
            assert!(!after.contains(".LBB0_1"), "{after}");
        }
    }

    #[test]
    fn a_condition_that_is_needed_stays() {
        let text = "cp r24, r22\nldi r24, 1\nbrlt .LBB0_1\nmov r24, r1\n.LBB0_1:\ncpi r24, 0\nbreq .LBB0_2\nsts 500, r1\n\
                    .LBB0_2:\nret";
        assert!(tidied(text).contains("brlt .LBB0_1; mov r24, r1"));
    }

    #[test]
    fn what_nobody_needs_goes() {
        assert_eq!(tidied("ldi r26, 3\nldi r24, 3\nret"), "ldi r24, 3; ret");
        assert_eq!(
            tidied("ldd r26, Z+1\nret"),
            "ldd r26, Z+1; ret",
            "it may be a register of the chip"
        );
        assert_eq!(tidied("ldi r24, 3\ncall g\nret"), "ldi r24, 3; call g; ret");
        assert_eq!(
            tidied("mul r24, r22\nmov r24, r0\nclr r1\nret"),
            "mul r24, r22; mov r24, r0; clr r1; ret"
        );
    }

    #[test]
    fn copies_are_made_once() {
        assert_eq!(
            tidied("movw r18, r24\nmovw r30, r18\nst Z, r1\ncall g\nret"),
            "movw r18, r24; movw r30, r24; st Z, r1; call g; ret"
        );
        assert_eq!(tidied("mov r24, r22\nmov r25, r23\nret"), "movw r24, r22; ret");
        assert_eq!(
            tidied("ldd r26, Z+1\nldd r27, Z+2\nmovw r24, r26\nret"),
            "ldd r24, Z+1; ldd r25, Z+2; ret"
        );
        assert_eq!(tidied("mov r18, r24\nmov r24, r18\nret"), "mov r18, r24; ret");
    }

    #[test]
    fn what_every_way_has_copied_is_not_copied_again() {
        let text = |between: &str| {
            format!(
                "movw r30, r24\nldd r18, Z+1\ncpi r18, 0\nbreq .LBB0_1\n{between}\n.LBB0_1:\nmovw r30, r24\nstd Z+2, r18\nret"
            )
        };
        assert_eq!(tidied(&text("inc r18")).matches("movw").count(), 1);
        for between in ["ld r18, Z+", "inc r24", "call g"] {
            assert_eq!(tidied(&text(between)).matches("movw").count(), 2, "{between}");
        }
        let again = "wdr\nmovw r30, r24\n.LBB0_1:\nmovw r30, r24\nldd r18, Z+1\nsbiw r24, 1\nbrne .LBB0_1\nret";
        assert!(tidied(again).contains(".LBB0_1:; movw r30, r24"));
    }

    #[test]
    fn a_pair_of_constants_is_copied_from_another() {
        let text = |high: &str| {
            format!("ldi r20, 7\nldi r21, {high}\nldi r24, 7\nldi r25, 0\ncall g\nret")
        };
        assert_eq!(tidied(&text("0")), "ldi r20, 7; ldi r21, 0; movw r24, r20; call g; ret");
        assert!(tidied(&text("1")).contains("ldi r24, 7; ldi r25, 0"));
    }

    #[test]
    fn assembler_of_the_source_may_use_register_1_meanwhile() {
        let asm = ";APP\nmul r24, r22\nmov r23, r1\nclr r1\n;NO_APP\nstd Z+1, r23\nmovw r24, r18\nmovw r22, r20\nret";
        assert!(tidied(asm).contains("std Z+1, r23"));
    }

    #[test]
    fn a_zero_is_register_1() {
        assert_eq!(tidied("ldi r26, 0\nstd Z+1, r26\nret"), "std Z+1, r1; ret");
        assert_eq!(
            tidied("ldi r26, 0\nmul r24, r22\nmov r24, r0\nstd Z+1, r26\nclr r1\nret")
                .matches("std Z+1, r26")
                .count(),
            1
        );
    }

    #[test]
    fn flags_that_are_set_are_not_set_again() {
        let text = |test: &str, branch: &str| {
            format!("{test}\ncpi r24, 0\n{branch} .LBB0_1\nsts 500, r1\n.LBB0_1:\nret")
        };
        for (test, branch, goes) in [
            ("and r24, r22", "breq", true),
            ("add r24, r22", "breq", true),
            ("add r24, r22", "brlo", false),
            ("add r24, r22", "brlt", false),
            ("sbc r24, r22", "breq", false),
            ("add r22, r24", "breq", false),
            ("and r24, r22\nadd r22, r24", "breq", false),
        ] {
            assert_eq!(!tidied(&text(test, branch)).contains("cpi"), goes, "{test} {branch}");
        }
    }

    #[test]
    fn a_pair_is_compared_with_0_at_once() {
        let text = |pair: &str, branch: &str| {
            let (low, high) = pair.split_once(' ').unwrap();
            format!("cp {low}, r1\ncpc {high}, r1\n{branch} .LBB0_1\nsts 500, r1\n.LBB0_1:\nret")
        };
        for (pair, branch, begins) in [
            ("r24 r25", "breq", "sbiw r24, 0; breq"),
            ("r24 r25", "brlt", "sbiw r24, 0; brlt"),
            ("r24 r22", "breq", "cp r24, r1; cpc r22, r1; breq"),
            ("r26 r27", "breq", "or r26, r27; breq"),
            ("r26 r27", "brlt", "sbiw r26, 0; brlt"),
            ("r24 r27", "brne", "or r27, r24; brne"),
            ("r24 r27", "brlt", "cp r24, r1; cpc r27, r1; brlt"),
            ("r18 r19", "breq", "cp r18, r1; cpc r19, r1; breq"),
        ] {
            let after = tidied(&text(pair, branch));
            assert!(after.starts_with(begins), "{pair} {branch}: {after}");
        }
    }

    #[test]
    fn flags_that_are_kept_and_put_back_need_not_be_set() {
        let text = |between: &str| {
            format!("and r24, r22\ncpi r24, 0\nin r0, 63\ncli\n{between}out 63, r0\nret")
        };
        assert!(!tidied(&text("sts 500, r24\n")).contains("cpi"));
        let asm = "and r24, r22\ncpi r24, 0\n;APP\nin r18, 63\ncli\n;NO_APP\nsts 500, r24\n;APP\nout 63, r18\n;NO_APP\n";
        assert!(!tidied(&format!("{asm}ldi r18, 0\nret")).contains("cpi"));
        // The register is read, or the flags are needed later.
        assert!(tidied(&text("sts 500, r0\n")).contains("cpi"));
        assert!(tidied(&format!("{asm}sts 502, r18\nret")).contains("cpi"));
        assert!(
            tidied(&format!("{asm}brlo .LBB0_1\nwdr\n.LBB0_1:\nldi r18, 0\nret")).contains("cpi")
        );
    }

    #[test]
    fn what_a_register_holds_is_not_loaded() {
        let frame = "push r28\npush r29\nin r28, 61\nin r29, 62\n";
        let after = |text: &str| tidied(&format!("{frame}{text}\npop r29\npop r28\nret"));
        assert!(after("std Y+1, r22\nldd r24, Y+1").contains("std Y+1, r22; mov r24, r22; pop"));
        assert!(after("std Y+1, r22\ncall g\nldd r24, Y+1").contains("ldd r24, Y+1"));
        assert!(after("std Y+1, r22\nst Z, r24\nldd r24, Y+1").contains("ldd r24, Y+1"));
        assert!(after("std Y+1, r22\ninc r22\nldd r24, Y+1").contains("ldd r24, Y+1"));
        assert!(
            tidied("std Y+1, r22\nldd r24, Y+1\nret").contains("ldd r24, Y+1"),
            "Y may point anywhere"
        );
    }

    #[test]
    fn a_variable_is_reached_by_a_pointer() {
        let stores = "sts V+3, r25\nsts V+2, r24\nmov r24, r22\nsts V+4, r24\n";
        let by_z = "ldi r30, lo8(V+2); ldi r31, hi8(V+2); std Z+1, r25; st Z, r24; ";
        let after = tidied(&format!("{stores}lds r24, V+7\nret"));
        assert!(after.starts_with(by_z), "{after}");
        assert!(after.ends_with("std Z+2, r22; ldd r24, Z+5; ret"), "{after}");
        for text in [
            format!("{stores}ret"),
            format!("{stores}lds r24, V+70\nret"),
            format!("{stores}lds r24, W+7\nret"),
            format!("{stores}call g\nlds r24, V+7\nret"),
            format!(";APP\ncli\n;NO_APP\n{stores}lds r24, V+7\nret"),
            format!("movw r30, r20\n{stores}lds r24, V+7\nst Z, r24\nret"),
        ] {
            assert!(!tidied(&text).contains("lo8"), "{text}");
        }
    }

    #[test]
    fn jumps_go_where_jumps_lead() {
        assert_eq!(
            tidied("cpi r24, 1\nbreq .LBB0_2\nrjmp .LBB0_1\n.LBB0_2:\nwdr\n.LBB0_1:\nret"),
            "cpi r24, 1; breq .LBB0_2; ret; .LBB0_2:; wdr; ret"
        );
    }

    #[test]
    fn a_call_at_the_end_does_not_return() {
        assert_eq!(
            tidied(
                "cpi r24, 0\nbreq .LBB0_1\nldi r26, 3\nret\n.LBB0_1:\nmovw r18, r24\nmovw r22, r18\ncall g"
            ),
            "cpi r24, 0; breq .LBB0_1; ret; .LBB0_1:; movw r18, r24; movw r22, r24; call g"
        );
    }

    #[test]
    fn what_may_be_skipped_stays() {
        assert_eq!(
            tidied("sbrc r24, 0\nldi r25, 0\nmov r22, r25\nret"),
            "sbrc r24, 0; ldi r25, 0; mov r22, r25; ret"
        );
    }

    #[test]
    fn a_call_reads_what_the_function_needs() {
        let f = ("f", "ldi r20, 1\nldi r22, 2\ncall g\nsts 500, r24\n.LBB0_1:\nrjmp .LBB0_1");
        let g = ("g", "mov r24, r22\nldi r25, 1\nret");
        let mut both = program(&[f, g]);
        tidy(&mut both).unwrap();
        assert_eq!(code(&both, "f"), "ldi r22, 2; call g; sts 500, r24; .LBB0_1:; rjmp .LBB0_1");
        assert_eq!(code(&both, "g"), "mov r24, r22; ret");
    }

    #[test]
    fn a_condition_that_one_way_needs_is_branched_on() {
        // Where the branch goes the register holds 1, as before.
        let text = |read: &str| {
            format!(
                "ldi r18, 1\ncp r24, r22\nbrlt .LBB0_1\nmov r18, r1\n.LBB0_1:\ncpi r18, 0\nbreq .LBB0_2\n{read}\n\
                 ldi r18, 5\nret\n.LBB0_2:\nldi r18, 4\nret"
            )
        };
        let after = tidied(&text("sts 500, r18"));
        assert!(
            after.starts_with("ldi r18, 1; cp r24, r22; brge .LBB0_2; sts 500, r18"),
            "{after}"
        );
        let after = tidied(&text("wdr").replace(".LBB0_2:\n", ".LBB0_2:\nsts 500, r18\n"));
        assert!(after.contains("brlt .LBB0_1"), "{after}");
    }

    #[test]
    fn what_is_joined_with_nothing_is_copied() {
        assert_eq!(
            tidied("clr r30\nor r30, r18\nmov r24, r30\ninc r18\nret"),
            "mov r24, r18; inc r18; ret"
        );
        assert_eq!(tidied("ldi r26, 0\nadd r24, r26\nret"), "ret");
        assert!(tidied("ldi r26, 0\nadd r24, r26\nadc r25, r22\nret").contains("add r24, r1"));
    }

    #[test]
    fn flags_that_nobody_needs_are_not_kept() {
        let far = "in r0, 63\nadiw r28, 9\nstd Y+63, r24\nsbiw r28, 9\nout 63, r0\n";
        assert_eq!(tidied(&format!("{far}ret")), "adiw r28, 9; std Y+63, r24; sbiw r28, 9; ret");
        let twice = tidied(&format!("{far}{}ret", far.replace('9', "10")));
        assert_eq!(
            twice,
            "adiw r28, 9; std Y+63, r24; adiw r28, 1; std Y+63, r24; sbiw r28, 10; ret"
        );
        let kept = format!("cp r24, r22\n{far}brlo .LBB0_1\nwdr\n.LBB0_1:\nret");
        assert!(tidied(&kept).contains("in r0, 63"));
        assert!(
            tidied(&format!("{}ret", far.replace("std Y+63, r24", "cli"))).contains("in r0, 63")
        );
    }

    #[test]
    fn an_address_is_made_of_one_that_is_near() {
        let far = |offset: u8| format!("movw r30, r24\nsubi r30, {offset}\nsbci r31, 255\n");
        let text =
            |offset| format!("{}ld r22, Z\n{}st Z, r22\nst Z, r20\nret", far(80), far(offset));
        assert!(tidied(&text(74)).ends_with("ld r22, Z; std Z+6, r22; std Z+6, r20; ret"));
        assert!(tidied(&text(90)).contains("ld r22, Z; sbiw r30, 10; st Z, r22"));
        assert!(tidied(&text(1)).contains("subi r30, 1"), "79 is too far");
        let changed = text(74).replace("ld r22, Z", "ld r22, Z\ninc r24");
        assert!(tidied(&changed).contains("subi r30, 74"));
    }

    #[test]
    fn assembler_of_the_source_needs_what_it_reads() {
        let asm = |piece: &str| format!("ldi r18, 1\n;APP\n{piece}\n;NO_APP\nldi r18, 2\nret");
        assert!(!tidied(&asm("lpm r25, Z+")).contains("ldi r18, 1"));
        let copy = ".Ltmp1:\nlpm r24, Z+\nst X+, r24\ndec r25\nbrne .Ltmp1";
        assert!(!tidied(&asm(copy)).contains("ldi r18, 1"));
        assert!(tidied(&asm(&copy.replace("dec r25", "dec r18"))).contains("ldi r18, 1"));
        assert!(tidied(&asm("push r25\nrcall 1\npop r25")).contains("ldi r18, 1"));
    }

    #[test]
    fn interrupts_and_what_assembler_calls_stay() {
        let text = "ldi r26, 3\nldi r24, 3\nreti";
        assert_eq!(tidied(text), "ldi r26, 3; ldi r24, 3; reti");
        let mut program = program(&[("f", "ldi r26, 3\nret"), ("g", ";APP\ncall f\n;NO_APP\nret")]);
        tidy(&mut program).unwrap();
        assert_eq!(code(&program, "f"), "ldi r26, 3; ret");
    }
}
