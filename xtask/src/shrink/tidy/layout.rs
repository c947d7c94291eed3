//! Block layout: puts code after the jump that leads to it.
//!
//! ```text
//!   rjmp .L2                      .L2:
//! .L1:                              wdr
//!   inc r24         becomes         ret
//!   ret                           .L1:
//! .L2:                              inc r24
//!   wdr                             ret
//!   ret
//! ```
//!
//! Code into which no other code falls through may be placed anywhere in its function. Placed after a jump to it, it
//! makes the jump unnecessary, which saves flash and time. Every branch must still reach its destination.

use std::collections::HashMap;

use super::super::branch::REACH;
use super::super::text::{Function, Line};
use super::effect;

/// Puts code after the jumps to it. Returns whether any code was moved.
pub fn arrange(function: &mut Function) -> bool {
    let mut pieces = pieces(&function.lines);
    let mut moved = false;
    let mut at = 0;
    while at < pieces.len() {
        match pieces[at].target().and_then(|label| behind(&pieces, at, label)) {
            Some((better, place)) => (pieces, at, moved) = (better, place, true),
            None => at += 1,
        }
    }
    if moved {
        function.lines = pieces.into_iter().flat_map(|piece| piece.lines).collect();
    }
    moved
}

/// Lines that run on from one to the next. No code falls through into the first of them, except at the beginning of
/// the function.
#[derive(Clone)]
struct Piece {
    lines: Vec<Line>,
}

impl Piece {
    /// Returns the label that the jump at its end leads to.
    fn target(&self) -> Option<&str> {
        match self.lines.last()? {
            Line::Insn(insn) if insn.op == "rjmp" => Some(&insn.args),
            _ => None,
        }
    }

    /// Whether it begins with a label.
    fn begins(&self, label: &str) -> bool {
        let code = self.lines.iter().filter(|line| !matches!(line, Line::Note(_)));
        let mut labels =
            code.map_while(|line| if let Line::Label(label) = line { Some(label) } else { None });
        labels.any(|first| first == label)
    }
}

/// Returns the pieces of a function. The last piece stays at the end.
fn pieces(lines: &[Line]) -> Vec<Piece> {
    let mut pieces = vec![Piece { lines: Vec::new() }];
    let mut may_be_skipped = false;
    for line in lines {
        let last = pieces.last_mut().expect("there is one");
        last.lines.push(line.clone());
        let Line::Insn(insn) = line else {
            may_be_skipped &= matches!(line, Line::Note(_));
            continue;
        };
        let ends = matches!(insn.op.as_str(), "rjmp" | "ret" | "jmp") && !may_be_skipped;
        may_be_skipped = insn.is_skip();
        if ends {
            pieces.push(Piece { lines: Vec::new() });
        }
    }
    pieces
}

/// Moves the piece that begins with a label to after another piece, whose jump is removed. Returns the new pieces and
/// the index of the pair; `None` if a branch would no longer reach.
fn behind(pieces: &[Piece], at: usize, label: &str) -> Option<(Vec<Piece>, usize)> {
    let to = pieces.iter().position(|piece| piece.begins(label))?;
    if to == at || to == 0 || to + 1 == pieces.len() {
        return None;
    }
    let mut better = pieces.to_vec();
    let piece = better.remove(to);
    let at = if to < at { at - 1 } else { at };
    better[at].lines.pop();
    better.insert(at + 1, piece);
    if !all_reach(&better) {
        return None;
    }
    let piece = better.remove(at + 1);
    better[at].lines.extend(piece.lines);
    Some((better, at))
}

/// Whether every branch from one piece to another reaches. Branches within a piece do not get longer.
fn all_reach(pieces: &[Piece]) -> bool {
    let mut place = 0;
    let mut labels: HashMap<&str, (usize, usize)> = HashMap::new();
    let mut branches: Vec<(&str, (usize, usize))> = Vec::new();
    for (number, piece) in pieces.iter().enumerate() {
        for line in &piece.lines {
            match line {
                Line::Insn(insn) => {
                    if effect::branch(&insn.op).is_some() {
                        branches.push((&insn.args, (number, place)));
                    }
                    place += insn.size();
                }
                // The size of inline assembler is unknown, so no branch is made across it.
                Line::Fixed(_) => place += REACH + 1,
                Line::Label(label) => drop(labels.insert(label, (number, place))),
                Line::Note(_) => {}
            }
        }
    }
    branches.into_iter().all(|(label, (number, from))| match labels.get(label) {
        Some((piece, to)) => *piece == number || to.abs_diff(from) <= REACH,
        None => false,
    })
}

#[cfg(test)]
mod tests {
    use super::super::super::text::tests::{code, program};
    use super::*;

    fn arranged(text: &str) -> String {
        let mut program = program(&[("f", text)]);
        arrange(&mut program.functions[0]);
        code(&program, "f")
    }

    #[test]
    fn what_a_jump_leads_to_stands_behind_it() {
        assert_eq!(
            arranged(
                "breq .LBB0_1\nrjmp .LBB0_2\n.LBB0_1:\ninc r24\nret\n.LBB0_2:\nwdr\nret\n.LBB0_3:\nret"
            ),
            "breq .LBB0_1; .LBB0_2:; wdr; ret; .LBB0_1:; inc r24; ret; .LBB0_3:; ret"
        );
    }

    #[test]
    fn what_is_fallen_into_stays() {
        for text in [
            "cpi r24, 1\nbreq .LBB0_1\nret\n.LBB0_1:\nwdr\n.LBB0_2:\nret\n.LBB0_3:\nrjmp .LBB0_2",
            // The jump may be skipped, so the code after it is reached by falling through.
            "sbrc r24, 0\nrjmp .LBB0_2\n.LBB0_1:\nret\n.LBB0_2:\nwdr\nret\n.LBB0_3:\nret",
            ".LBB0_1:\nwdr\nrjmp .LBB0_1",
            // The last piece may end with a call that never returns.
            "breq .LBB0_1\nrjmp .LBB0_2\n.LBB0_1:\nret\n.LBB0_2:\ncall g",
        ] {
            assert_eq!(arranged(text), text.replace('\n', "; "), "{text}");
        }
    }

    #[test]
    fn branches_reach_where_they_go() {
        let away = "nop\n".repeat(60);
        let text = format!(
            "breq .LBB0_1\nrjmp .LBB0_2\n.LBB0_1:\n{away}ret\n.LBB0_2:\n{away}wdr\nret\n.LBB0_3:\nret"
        );
        assert!(arranged(&text).contains("rjmp .LBB0_2"), "breq would go too far");
        let text = format!(
            "rjmp .LBB0_1\n.LBB0_2:\n{away}breq .LBB0_1\nret\n.LBB0_1:\n{away}rjmp .LBB0_2\n.LBB0_3:\nret"
        );
        assert!(
            arranged(&text).contains("rjmp .LBB0_2"),
            "so it would to the place that it jumps to"
        );
    }
}
