//! Branches go where they lead, not round a jump.
//!
//! ```text
//!   breq .LBB0_1
//!   rjmp .LBB0_7      becomes   brne .LBB0_7
//! .LBB0_1:                    .LBB0_1:
//! ```
//!
//! LLVM writes a branch round a jump before it knows how far the way is. A branch reaches 63 words back or forth, and what is written
//! here never lies further apart in the image: the linker only shortens. Were it otherwise, the linker would refuse the branch.

use std::collections::HashMap;

use super::text::{Function, Insn, Line, Program};

/// How far a branch reaches, bytes, less the two of the jump that goes.
const REACH: usize = 124;

/// Makes branches of all functions short but those of interrupts: this costs no cycle.
pub fn shorten(program: &mut Program) {
    let functions = program.functions.iter_mut();
    for function in functions.filter(|function| function.insns().all(|insn| insn.op != "reti")) {
        // What became shorter brings more within reach.
        loop {
            let before = function.lines.len();
            shorten_in(function);
            if function.lines.len() == before {
                break;
            }
        }
    }
}

fn shorten_in(function: &mut Function) {
    let places = Places::of(function);
    let code: Vec<usize> = (0..function.lines.len())
        .filter(|at| !matches!(function.lines[*at], Line::Note(_)))
        .collect();
    let mut gone = Vec::new();
    for at in code.windows(2) {
        let behind =
            code.iter().skip_while(|line| **line <= at[1]).map(|line| &function.lines[*line]);
        if let (Line::Insn(branch), Line::Insn(jump)) =
            (&function.lines[at[0]], &function.lines[at[1]])
            && let Some(short) = short(branch, jump, behind)
            && places.are_near(at[0], &short.args)
        {
            function.lines[at[0]] = Line::Insn(short);
            gone.push(at[1]);
        }
    }
    let mut line = 0..;
    function.lines.retain(|_| !gone.contains(&line.next().expect("lines are finite")));
}

/// The branch that does what a branch round a jump does; `behind` is what follows the two.
pub fn short<'a>(
    branch: &Insn,
    jump: &Insn,
    behind: impl Iterator<Item = &'a Line>,
) -> Option<Insn> {
    let mut labels =
        behind.map_while(|line| if let Line::Label(label) = line { Some(label) } else { None });
    let is_round = jump.op == "rjmp" && labels.any(|label| *label == branch.args);
    let op = inverse(&branch.op).filter(|_| is_round)?;
    Some(Insn { op: op.into(), args: jump.args.clone() })
}

/// The branch on the opposite condition.
pub fn inverse(op: &str) -> Option<&'static str> {
    const PAIRS: [(&str, &str); 6] = [
        ("breq", "brne"),
        ("brlo", "brsh"),
        ("brcs", "brcc"),
        ("brlt", "brge"),
        ("brmi", "brpl"),
        ("brvs", "brvc"),
    ];
    PAIRS.iter().find_map(|(a, b)| if op == *a { Some(*b) } else { (op == *b).then_some(*a) })
}

/// Where the lines of a function lie at most, bytes from its beginning.
struct Places {
    lines: Vec<usize>,
    labels: HashMap<String, usize>,
}

impl Places {
    fn of(function: &Function) -> Places {
        let mut places = Places { lines: Vec::new(), labels: HashMap::new() };
        let mut place = 0;
        for line in &function.lines {
            places.lines.push(place);
            match line {
                Line::Insn(insn) => place += insn.size(),
                // What a line of the source takes is not known: no branch goes past it.
                Line::Fixed(_) => place += REACH + 1,
                Line::Label(label) => drop(places.labels.insert(label.clone(), place)),
                Line::Note(_) => {}
            }
        }
        places
    }

    fn are_near(&self, branch: usize, label: &str) -> bool {
        self.labels.get(label).is_some_and(|place| place.abs_diff(self.lines[branch]) <= REACH)
    }
}

#[cfg(test)]
mod tests {
    use super::super::text::tests::{code, program};
    use super::super::verify;
    use super::*;

    fn shortened(name: &str, text: &str) -> String {
        let before = program(&[(name, text)]);
        let mut after = before.clone();
        shorten(&mut after);
        verify::check(&before, &after).unwrap();
        code(&after, name)
    }

    #[test]
    fn a_branch_round_a_jump_goes_where_the_jump_goes() {
        let short = shortened("f", ".LBB0_7:\nbreq .LBB0_1\nrjmp .LBB0_7\n.LBB0_2:\n.LBB0_1:\nret");
        assert_eq!(short, ".LBB0_7:; brne .LBB0_7; .LBB0_2:; .LBB0_1:; ret");
        let short = shortened("f", "brge .LBB0_1\nrjmp .LBB0_7\n.LBB0_1:\nnop\n.LBB0_7:\nret");
        assert_eq!(short, "brlt .LBB0_7; .LBB0_1:; nop; .LBB0_7:; ret");
    }

    #[test]
    fn what_does_something_else_stays() {
        let away = "nop\n".repeat(70);
        for text in [
            // It is not the jump that is gone round, goes too far, or goes past what nobody knows the size of.
            "breq .LBB0_7\nrjmp .LBB0_7\n.LBB0_1:\nnop\n.LBB0_7:\nret".to_owned(),
            "breq .LBB0_1\nrjmp .LBB0_7\nnop\n.LBB0_1:\nnop\n.LBB0_7:\nret".to_owned(),
            format!("breq .LBB0_1\nrjmp .LBB0_7\n.LBB0_1:\n{away}.LBB0_7:\nret"),
            "breq .LBB0_1\nrjmp .LBB0_7\n.LBB0_1:\n;APP\nwdr\n;NO_APP\n.LBB0_7:\nret".to_owned(),
            "breq .LBB0_1\nrjmp f\n.LBB0_1:\nret".to_owned(),
        ] {
            assert!(shortened("f", &text).contains("rjmp"), "{text}");
        }
        assert!(
            shortened("__vector_1", "breq .LBB0_1\nrjmp .LBB0_7\n.LBB0_1:\n.LBB0_7:\nreti")
                .contains("rjmp")
        );
    }
}
