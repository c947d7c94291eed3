//! Branch shortening: lets branches go directly to their destination, instead of around a jump.
//!
//! ```text
//!   breq .LBB0_1
//!   rjmp .LBB0_7      becomes   brne .LBB0_7
//! .LBB0_1:                    .LBB0_1:
//! ```
//!
//! Where the destination is too far, another jump to it may be near. The branch then goes to that jump:
//!
//! ```text
//!   breq .LBB0_1                brne .Lway_0_0
//!   rjmp .LBB0_7              .LBB0_1:
//! .LBB0_1:         becomes      ...
//!   ...                       .Lway_0_0:
//!   rjmp .LBB0_7                rjmp .LBB0_7
//! ```
//!
//! That costs a cycle on one path, and saves one on the other.
//!
//! LLVM writes a branch around a jump before it knows the distance. A branch reaches 63 words in each direction.
//! Distances in the image are never longer than those computed here, because the linker only shortens. If one were, the
//! linker would refuse the branch.

use std::collections::HashMap;

use anyhow::{Result, bail, ensure};

use super::text::{Function, Insn, Line, Program};

/// The reach of a branch, bytes, less the two bytes of the jump that is removed.
pub const REACH: usize = 124;

/// Shortens the branches of all functions except interrupts. This costs no cycle.
pub fn shorten(program: &mut Program) {
    let functions = program.functions.iter_mut().enumerate();
    for (number, function) in
        functions.filter(|(_, function)| function.insns().all(|insn| insn.op != "reti"))
    {
        // Shorter code brings more destinations within reach.
        loop {
            let before = function.lines.len();
            shorten_in(function);
            if function.lines.len() == before {
                break;
            }
        }
        go_by_others(function, number);
    }
}

/// Prefix of the labels of jumps to which branches are redirected.
const WAY: &str = ".Lway_";

/// Lets branches around a jump go to another jump to the same destination.
fn go_by_others(function: &mut Function, number: usize) {
    let places = Places::of(function);
    let code = code(function);
    let jumps: Vec<(usize, String)> = code
        .iter()
        .filter_map(|at| match &function.lines[*at] {
            Line::Insn(insn) if insn.op == "rjmp" => Some((*at, insn.args.clone())),
            _ => None,
        })
        .collect();
    let (mut gone, mut ways): (Vec<usize>, Vec<usize>) = (Vec::new(), Vec::new());
    for at in code.windows(2) {
        let behind =
            code.iter().skip_while(|line| **line <= at[1]).map(|line| &function.lines[*line]);
        let (Line::Insn(branch), Line::Insn(jump)) =
            (&function.lines[at[0]], &function.lines[at[1]])
        else {
            continue;
        };
        let Some(mut short) = short(branch, jump, behind).filter(|_| !ways.contains(&at[1])) else {
            continue;
        };
        let is_way = |(way, to): &&(usize, String)| {
            let distance = places.lines[*way].abs_diff(places.lines[at[0]]);
            *to == short.args && *way != at[1] && !gone.contains(way) && distance <= REACH
        };
        // A jump that other branches already use is preferred.
        let way = jumps.iter().filter(is_way).max_by_key(|(way, _)| ways.contains(way));
        if let Some((way, _)) = way {
            let name = ways.iter().position(|known| known == way).unwrap_or_else(|| {
                ways.push(*way);
                ways.len() - 1
            });
            short.args = format!("{WAY}{number}_{name}");
            function.lines[at[0]] = Line::Insn(short);
            gone.push(at[1]);
        }
    }
    let mut lines = Vec::with_capacity(function.lines.len() + ways.len());
    for (at, line) in function.lines.drain(..).enumerate() {
        if let Some(name) = ways.iter().position(|way| *way == at) {
            lines.push(Line::Label(format!("{WAY}{number}_{name}")));
        }
        if !gone.contains(&at) {
            lines.push(line);
        }
    }
    function.lines = lines;
}

/// Returns code in which branches go to the destinations of the jumps that they go by.
pub fn straight(code: Vec<Line>) -> Result<Vec<Line>> {
    let mut leads = HashMap::new();
    for (at, line) in code.iter().enumerate() {
        if let Line::Label(way) = line
            && way.starts_with(WAY)
        {
            let Some(Line::Insn(jump)) = code.get(at + 1).filter(|_| !leads.contains_key(way))
            else {
                bail!("{way} leads nowhere");
            };
            ensure!(jump.op == "rjmp", "{way} leads nowhere");
            leads.insert(way.clone(), jump.args.clone());
        }
    }
    let straight = |line| match line {
        Line::Label(label) if leads.contains_key(&label) => None,
        Line::Insn(Insn { op, args }) => {
            Some(Line::Insn(Insn { op, args: leads.get(&args).cloned().unwrap_or(args) }))
        }
        line => Some(line),
    };
    Ok(code.into_iter().filter_map(straight).collect())
}

/// Returns the lines of a function that make code, and labels.
fn code(function: &Function) -> Vec<usize> {
    (0..function.lines.len()).filter(|at| !matches!(function.lines[*at], Line::Note(_))).collect()
}

fn shorten_in(function: &mut Function) {
    let places = Places::of(function);
    let code = code(function);
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

/// Returns the branch that replaces a branch around a jump; `behind` is the code that follows the two.
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

/// Returns the branch on the opposite condition; `None` if there is none.
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

/// The largest possible distance of each line of a function from its beginning, bytes.
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
                // The size of inline assembler is unknown, so no branch is made across it.
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
    use super::super::verify::tests::checked;
    use super::*;

    fn shortened(name: &str, text: &str) -> String {
        code(&checked(&[(name, text)], shorten), name)
    }

    #[test]
    fn a_branch_round_a_jump_goes_where_the_jump_goes() {
        let short = shortened("f", ".LBB0_7:\nbreq .LBB0_1\nrjmp .LBB0_7\n.LBB0_2:\n.LBB0_1:\nret");
        assert_eq!(short, ".LBB0_7:; brne .LBB0_7; .LBB0_2:; .LBB0_1:; ret");
        let short = shortened("f", "brge .LBB0_1\nrjmp .LBB0_7\n.LBB0_1:\nnop\n.LBB0_7:\nret");
        assert_eq!(short, "brlt .LBB0_7; .LBB0_1:; nop; .LBB0_7:; ret");
    }

    #[test]
    fn a_branch_that_cannot_reach_goes_by_another_jump() {
        let away = "nop\n".repeat(70);
        let pair = |n| format!("breq .LBB0_{n}\nrjmp .LBB0_9\n.LBB0_{n}:\nnop\n");
        let short = shortened(
            "f",
            &format!("{}{}{}{away}{}{away}.LBB0_9:\nret", pair(1), pair(2), pair(3), pair(4)),
        );
        let begin = "brne .Lway_0_0; .LBB0_1:; nop; brne .Lway_0_0; .LBB0_2:; nop; \
                     breq .LBB0_3; .Lway_0_0:; rjmp .LBB0_9; .LBB0_3:; nop; nop";
        assert!(short.starts_with(begin), "{short}");
        assert!(short.contains("breq .LBB0_4; rjmp .LBB0_9; .LBB0_4:"), "{short}");
    }

    #[test]
    fn a_way_must_lead_to_a_jump() {
        let way = |what: &str| {
            let code = program(&[("f", &format!("brne .Lway_0_0\n.Lway_0_0:\n{what}"))]);
            straight(code.functions[0].code().cloned().collect())
        };
        assert_eq!(way("rjmp .LBB0_9").unwrap()[0], Line::Insn(Insn::new("brne .LBB0_9")));
        assert!(way("ret").is_err());
        assert!(way("rjmp .LBB0_9\n.Lway_0_0:\nrjmp .LBB0_8").is_err());
    }

    #[test]
    fn what_does_something_else_stays() {
        let away = "nop\n".repeat(70);
        for text in [
            // It does not go around the jump, it goes too far, or it goes past code of unknown size.
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
