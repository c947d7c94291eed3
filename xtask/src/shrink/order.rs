//! Function placement: puts functions near the functions that they call.
//!
//! A call or jump takes four bytes, but only two within 4 KB, where the linker shortens it (`--relax`). So the program
//! is smaller the more calls go to near functions.
//!
//! The best order is too expensive to compute; a heuristic is enough. Functions that call each other most are grouped
//! first. Then each function is tried beside all functions that it calls or is called by, and moved to where most calls
//! are short (local search). The result is deterministic.

use std::collections::{BTreeMap, HashMap};

use super::text::{Insn, Line, Program};

/// How far a short call reaches, bytes.
const REACH: usize = 4_090;
/// Most bytes of a group. All functions in a group reach each other.
const GROUP: usize = 4_000;
/// How often each function is tried in other places.
const SWEEPS: usize = 4;

/// A call or jump from one function to another.
struct Call {
    from: usize,
    /// Position of the call in its function, bytes.
    offset: usize,
    to: usize,
}

/// The part of the program that the order depends on.
struct Map {
    sizes: Vec<usize>,
    calls: Vec<Call>,
    /// For each function, the functions that it calls or is called by.
    neighbours: Vec<Vec<usize>>,
}

/// Puts the functions into another order.
pub fn arrange(program: &mut Program) {
    let map = Map::of(program);
    let mut order = map.grouped();
    for _ in 0..SWEEPS {
        if !map.improve(&mut order) {
            break;
        }
    }
    let mut functions: Vec<_> = program.functions.drain(..).map(Some).collect();
    program.functions.extend(order.into_iter().filter_map(|at| functions[at].take()));
}

impl Map {
    fn of(program: &Program) -> Map {
        let places: HashMap<&str, usize> =
            program.functions.iter().enumerate().map(|(at, f)| (f.name.as_str(), at)).collect();
        let (mut sizes, mut calls) = (Vec::new(), Vec::new());
        for (from, function) in program.functions.iter().enumerate() {
            let mut offset = 0;
            for line in &function.lines {
                let (size, target) = match line {
                    Line::Insn(insn) => (insn.size(), target(insn)),
                    Line::Fixed(text) => (Insn::new(text).size(), None),
                    Line::Label(_) | Line::Note(_) => (0, None),
                };
                if let Some(to) = target.and_then(|name| places.get(name)).filter(|to| **to != from)
                {
                    calls.push(Call { from, offset, to: *to });
                }
                offset += size;
            }
            sizes.push(offset);
        }
        let mut neighbours = vec![Vec::new(); sizes.len()];
        for call in &calls {
            neighbours[call.from].push(call.to);
            neighbours[call.to].push(call.from);
        }
        for all in &mut neighbours {
            all.sort_unstable();
            all.dedup();
        }
        Map { sizes, calls, neighbours }
    }

    /// Returns an order in which functions that call each other often stand in one group.
    fn grouped(&self) -> Vec<usize> {
        let mut often: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        for call in &self.calls {
            *often.entry((call.from.min(call.to), call.from.max(call.to))).or_default() += 1;
        }
        let mut often: Vec<_> = often.into_iter().collect();
        often.sort_by_key(|(pair, times)| (std::cmp::Reverse(*times), *pair));
        let mut group_of: Vec<usize> = (0..self.sizes.len()).collect();
        let mut groups: Vec<Vec<usize>> = (0..self.sizes.len()).map(|at| vec![at]).collect();
        let size = |group: &[usize]| group.iter().map(|at| self.sizes[*at]).sum::<usize>();
        for ((a, b), _) in often {
            let (a, b) = (group_of[a], group_of[b]);
            if a != b && size(&groups[a]) + size(&groups[b]) <= GROUP {
                let moved = std::mem::take(&mut groups[b]);
                moved.iter().for_each(|at| group_of[*at] = a);
                groups[a].extend(moved);
            }
        }
        groups.concat()
    }

    /// Tries each function in other places. Returns whether one was moved.
    fn improve(&self, order: &mut Vec<usize>) -> bool {
        let mut moved = false;
        let mut least = self.cost(order);
        for unit in 0..self.sizes.len() {
            for neighbour in &self.neighbours[unit] {
                for behind in [0, 1] {
                    let before = order
                        .iter()
                        .position(|at| *at == unit)
                        .expect("each function has its place");
                    order.remove(before);
                    let beside = order
                        .iter()
                        .position(|at| at == neighbour)
                        .expect("each function has its place");
                    order.insert(beside + behind, unit);
                    let cost = self.cost(order);
                    if cost < least {
                        (least, moved) = (cost, true);
                    } else {
                        order.remove(beside + behind);
                        order.insert(before, unit);
                    }
                }
            }
        }
        moved
    }

    /// Returns the cost of the long calls. Each has a fixed cost plus a small part that grows with its length, so that
    /// moves in the right direction pay off.
    fn cost(&self, order: &[usize]) -> usize {
        const LONG: usize = 1_000;
        let mut places = vec![0; order.len()];
        let mut end = 0;
        for at in order {
            places[*at] = end;
            end += self.sizes[*at];
        }
        let cost = |call: &Call| match places[call.to].abs_diff(places[call.from] + call.offset) {
            ..=REACH => 0,
            far => LONG + (far / 64).min(LONG / 2),
        };
        self.calls.iter().map(cost).sum()
    }
}

/// Returns the function that an instruction calls or jumps to.
fn target(insn: &Insn) -> Option<&str> {
    matches!(insn.op.as_str(), "call" | "rcall" | "jmp" | "rjmp").then_some(insn.args.as_str())
}

#[cfg(test)]
mod tests {
    use super::super::text::tests::program;
    use super::*;

    #[test]
    fn who_calls_stands_beside_whom_it_calls() {
        let long = "nop\n".repeat(1_500);
        let far = ["a", "b", "c", "d"].map(|name| (name, long.as_str()));
        let mut all = vec![("caller", "call callee\nret")];
        all.extend(far);
        all.push(("callee", "ret"));
        let mut program = program(&all);
        arrange(&mut program);
        let names: Vec<_> =
            program.functions.iter().map(|function| function.name.as_str()).collect();
        let place = |name| names.iter().position(|n| *n == name).unwrap();
        assert_eq!(names.len(), 6);
        assert_eq!(place("caller").abs_diff(place("callee")), 1);
    }

    #[test]
    fn a_move_shortens_calls() {
        let long = "nop\n".repeat(1_500);
        let program = program(&[("f", "call g\nret"), ("x", &long), ("y", &long), ("g", "ret")]);
        let map = Map::of(&program);
        let mut order = vec![0, 1, 2, 3];
        assert!(map.cost(&order) >= 1_000);
        assert!(map.improve(&mut order));
        assert_eq!(map.cost(&order), 0);
        assert!(!map.improve(&mut order));
    }
}
