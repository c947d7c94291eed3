//! Compares the program with shared code to the tidied program.
//!
//! All shared code is inlined again at its calls, using only the text of the routines. The result must equal the tidied
//! text, instruction by instruction. The only allowed difference is a branch that went around a jump and now goes to
//! the jump's destination, directly or by another jump. Any other difference fails the build.

use std::collections::HashMap;

use anyhow::{Context, Result, bail, ensure};

use super::text::{Function, Insn, Line, Program};
use super::{branch, prologue, repeats, via};

/// Greatest depth of routines that call routines. A greater depth means recursion.
const DEEPEST: usize = 100;

/// Fails if `after` differs from `before` in more than shared code.
pub fn check(before: &Program, after: &Program) -> Result<()> {
    ensure!(
        before.head == after.head && before.rest == after.rest,
        "data or start-up code was changed"
    );
    let functions: HashMap<&str, &Function> =
        after.functions.iter().map(|f| (f.name.as_str(), f)).collect();
    ensure!(functions.len() == after.functions.len(), "two functions have one name");
    let routines: HashMap<_, _> = functions
        .iter()
        .map(|(name, f)| (*name, *f))
        .filter(|(name, _)| is_routine(name))
        .collect();
    ensure!(
        functions.len() == before.functions.len() + routines.len(),
        "functions were lost or added"
    );
    for function in &before.functions {
        let name = &function.name;
        let made = functions.get(name.as_str()).with_context(|| format!("{name} is gone"))?;
        let whole = put_back(made, &routines, 0).and_then(branch::straight);
        let whole = whole.with_context(|| format!("in {name}"))?;
        ensure!(
            is_same(&function.code().collect::<Vec<_>>(), &whole),
            "{name} is not what the compiler wrote"
        );
    }
    Ok(())
}

/// Whether the code is equal, except for branches that went around a jump.
fn is_same(before: &[&Line], after: &[Line]) -> bool {
    let mut before = before;
    for line in after {
        before = match before {
            [first, rest @ ..] if *first == line => rest,
            [Line::Insn(branch), Line::Insn(jump), rest @ ..]
                if branch::short(branch, jump, rest.iter().copied())
                    .is_some_and(|short| Line::Insn(short) == *line) =>
            {
                rest
            }
            _ => return false,
        };
    }
    before.is_empty()
}

fn is_routine(name: &str) -> bool {
    [prologue::NAME, repeats::PART, repeats::TAIL, via::NAME]
        .iter()
        .any(|prefix| name.starts_with(prefix))
}

/// Returns the code of a function with all shared code inlined.
fn put_back(
    function: &Function,
    routines: &HashMap<&str, &Function>,
    depth: usize,
) -> Result<Vec<Line>> {
    ensure!(depth < DEEPEST, "{} contains itself", function.name);
    let mut whole = Vec::new();
    for line in function.code() {
        match line {
            Line::Insn(insn) if is_routine(&insn.args) => {
                let insn = &straight(insn, routines)?;
                let Some(routine) = routines.get(insn.args.as_str()) else {
                    whole.push(Line::Insn(insn.clone()));
                    continue;
                };
                take_in(insn, put_back(routine, routines, depth + 1)?, &mut whole)?;
            }
            other => whole.push(other.clone()),
        }
    }
    Ok(whole)
}

/// Returns the real call or jump where a routine consists of a jump only.
fn straight(site: &Insn, routines: &HashMap<&str, &Function>) -> Result<Insn> {
    let routine =
        routines.get(site.args.as_str()).with_context(|| format!("{} is missing", site.args))?;
    if !site.args.starts_with(via::NAME) {
        return Ok(site.clone());
    }
    match (site.op.as_str(), routine.code().collect::<Vec<_>>().as_slice()) {
        ("call" | "jmp", [Line::Insn(jump)]) if jump.op == "jmp" => {
            let is_end = !is_routine(&jump.args) || routines.contains_key(jump.args.as_str());
            ensure!(is_end, "{} is missing", jump.args);
            // The analysis of the stack recognises calls of shared prologues by name, so they must not go through a
            // jump.
            let is_odd = [via::NAME, prologue::NAME].iter().any(|odd| jump.args.starts_with(odd));
            ensure!(!is_odd, "{} leads to {}", site.args, jump.args);
            Ok(Insn { op: site.op.clone(), args: jump.args.clone() })
        }
        _ => bail!("{} is no jump", site.args),
    }
}

/// Inlines the call of a routine.
fn take_in(site: &Insn, mut routine: Vec<Line>, whole: &mut Vec<Line>) -> Result<()> {
    let ret = Line::Insn(Insn::new("ret"));
    match site.op.as_str() {
        "jmp" if site.args.starts_with(repeats::TAIL) => {
            ensure!(routine.last() == Some(&ret), "{} does not return", site.args)
        }
        "call" if site.args.starts_with(repeats::PART) => {
            ensure!(routine.pop() == Some(ret), "{} does not return", site.args);
        }
        "call" if site.args.starts_with(prologue::NAME) => {
            let insns = prologue::put_back(&insns(&routine)?, &insns(whole)?);
            let insns =
                insns.with_context(|| format!("{} is no beginning of a function", site.args))?;
            routine = insns.into_iter().map(Line::Insn).collect();
            whole.clear();
        }
        op => bail!("{op} {}", site.args),
    }
    whole.append(&mut routine);
    Ok(())
}

fn insns(code: &[Line]) -> Result<Vec<Insn>> {
    let insn = |line: &Line| match line {
        Line::Insn(insn) => Ok(insn.clone()),
        other => bail!("{other:?} in the beginning of a function"),
    };
    code.iter().map(insn).collect()
}

#[cfg(test)]
pub mod tests {
    use super::super::text::tests::program;
    use super::*;

    /// Returns the functions after a pass. Checks that they are equal to the ones before it.
    pub fn checked(functions: &[(&str, &str)], pass: fn(&mut Program)) -> Program {
        let before = program(functions);
        let mut after = before.clone();
        pass(&mut after);
        check(&before, &after).unwrap();
        after
    }

    const BEFORE: [(&str, &str); 2] =
        [("f", "ldi r24, 1\ninc r24\nret"), ("g", "ldi r24, 1\ninc r24\ninc r24\nret")];

    fn refused(after: &[(&str, &str)]) -> String {
        format!("{:#}", check(&program(&BEFORE), &program(after)).unwrap_err())
    }

    #[test]
    fn what_is_shared_may_be_anywhere() {
        let part = ("__part_0", "ldi r24, 1\ninc r24\nret");
        let tail = ("__tail_1", "inc r24\nret");
        let after =
            [("g", "call __part_0\njmp __tail_1"), part, tail, ("f", "ldi r24, 1\njmp __tail_1")];
        check(&program(&BEFORE), &program(&after)).unwrap();
    }

    #[test]
    fn a_way_may_lead_to_a_function_or_to_what_is_shared() {
        let [_, g] = BEFORE;
        let part = ("__part_0", "ldi r24, 1\ninc r24\nret");
        let f = ("f", "call __via_0\nret");
        let by = |way| check(&program(&BEFORE), &program(&[f, g, part, ("__via_0", way)]));
        by("jmp __part_0").unwrap();
        for wrong in ["call __part_0", "nop\njmp __part_0", "jmp __via_0", "jmp __part_1", "jmp g"]
        {
            assert!(by(wrong).is_err(), "{wrong}");
        }
        let calls = program(&[("f", "call h\nret")]);
        check(&calls, &program(&[("f", "call __via_0\nret"), ("__via_0", "jmp h")])).unwrap();
        assert!(
            check(&calls, &program(&[("f", "jmp __via_0\nret"), ("__via_0", "jmp h")])).is_err()
        );
    }

    #[test]
    fn another_program_is_refused() {
        let [f, g] = BEFORE;
        assert!(refused(&[f]).contains("lost or added"));
        assert!(refused(&[f, ("g", "ldi r24, 1\ninc r24\nret")]).contains("g is not what"));
        assert!(refused(&[f, g, ("h", "ret")]).contains("lost or added"));
        assert!(refused(&[f, ("h", "ret")]).contains("g is gone"));
        assert!(refused(&[f, f]).contains("one name"));
    }

    #[test]
    fn a_wrong_routine_is_refused() {
        let [_, g] = BEFORE;
        let f = |routine| [("f", "call __part_0\nret"), g, ("__part_0", routine)];
        assert!(check(&program(&BEFORE), &program(&f("ldi r24, 1\ninc r24\nret"))).is_ok());
        assert!(refused(&f("ldi r24, 2\ninc r24\nret")).contains("f is not what"));
        assert!(refused(&f("ldi r24, 1\ninc r24")).contains("does not return"));
        assert!(refused(&f("call __part_0\nret")).contains("contains itself"));
        assert!(refused(&[("f", "call __part_1\nret"), g]).contains("missing"));
        assert!(
            refused(&[("f", "call __enter_0\nret"), g, ("__enter_0", "push r2\nret")])
                .contains("no beginning")
        );
    }
}
