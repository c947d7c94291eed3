//! Trampolines: lets long calls share a jump.
//!
//! ```text
//!   call __mulsf3                       call __via_0      two bytes each, for it is near
//!   ...               becomes           ...
//!   call __mulsf3                       call __via_0
//!                                     __via_0:
//!                                       jmp  __mulsf3
//! ```
//!
//! A call or jump takes two bytes within 4 KB and four elsewhere. Where three or more calls near each other go to one
//! far function, they go to a jump placed between them. This costs two cycles each, and no stack. Calls in hot
//! functions stay direct, and so do calls of shared prologues, which return with a changed stack pointer.

use std::collections::{BTreeMap, HashMap};

use super::hot::Heat;
use super::text::{Function, Insn, Line, Program};
use super::{heat, prologue};

/// Prefix of the names of the jumps.
pub const NAME: &str = "__via_";

/// The reach of a short call, bytes, less some room for the jumps themselves.
const REACH: usize = 3_900;

/// A call or jump.
#[derive(Clone, Copy, Debug)]
struct Site {
    function: usize,
    line: usize,
    /// Largest possible position, bytes.
    place: usize,
}

/// Shares long calls. The functions must be in their final order.
pub fn share(program: &mut Program) {
    let (starts, sites) = far(program);
    let mut added: Vec<(usize, Function)> = Vec::new();
    for (target, sites) in sites {
        let mut rest = sites.as_slice();
        while let Some(first) = rest.first() {
            let near = rest.iter().take_while(|site| site.place - first.place <= 2 * REACH).count();
            let (group, behind) = rest.split_at(near);
            let middle = (first.place + group[near - 1].place) / 2;
            let at = starts.partition_point(|start| *start < middle).min(starts.len() - 1);
            let reached: Vec<_> =
                group.iter().filter(|site| site.place.abs_diff(starts[at]) <= REACH).collect();
            rest = behind;
            if reached.len() < 3 {
                continue;
            }
            let name = format!("{NAME}{}", added.len());
            for site in reached {
                if let Line::Insn(insn) = &mut program.functions[site.function].lines[site.line] {
                    insn.args.clone_from(&name);
                }
            }
            added.push((at, Function::new(&name, &[Insn::new(&format!("jmp {target}"))])));
        }
    }
    // Inserted from the end, so that earlier positions stay valid.
    added.sort_by_key(|(at, _)| std::cmp::Reverse(*at));
    added.into_iter().for_each(|(at, function)| program.functions.insert(at, function));
}

/// Returns where functions begin, and the calls and jumps over a long distance, by their destination.
fn far(program: &Program) -> (Vec<usize>, BTreeMap<String, Vec<Site>>) {
    let size = |line: &Line| match line {
        Line::Insn(insn) => insn.size(),
        Line::Fixed(text) => Insn::new(text).size(),
        Line::Label(_) | Line::Note(_) => 0,
    };
    let (mut starts, mut end) = (Vec::new(), 0);
    for function in &program.functions {
        starts.push(end);
        end += function.lines.iter().map(size).sum::<usize>();
    }
    let places: HashMap<&str, usize> = (program.functions.iter())
        .map(|function| function.name.as_str())
        .zip(starts.iter().copied())
        .collect();
    let mut sites: BTreeMap<String, Vec<Site>> = BTreeMap::new();
    for (function, code) in program.functions.iter().enumerate() {
        let mut place = starts[function];
        let is_hot = heat(code) == Heat::Hot;
        for (line, what) in code.lines.iter().enumerate() {
            if let Line::Insn(insn) = what
                && matches!(insn.op.as_str(), "call" | "jmp")
                && !insn.args.starts_with(prologue::NAME)
                && !is_hot
            {
                // A function that is not in the map comes from a library, which is placed after all code.
                let to = places.get(insn.args.as_str()).copied().unwrap_or(end);
                if to.abs_diff(place) > REACH {
                    let site = Site { function, line, place };
                    sites.entry(insn.args.clone()).or_default().push(site);
                }
            }
            place += size(what);
        }
    }
    (starts, sites)
}

#[cfg(test)]
mod tests {
    use super::super::text::tests::{code, program};
    use super::super::verify::tests::checked;
    use super::*;

    fn shared(functions: &[(&str, &str)]) -> Program {
        checked(functions, share)
    }

    #[test]
    fn three_that_go_far_go_by_one_jump() {
        let long = "nop\n".repeat(5_000);
        let caller = "call g\nnop\njmp g";
        let after = shared(&[("a", caller), ("b", "call g\nret"), ("x", &long), ("g", "ret")]);
        assert_eq!(code(&after, "a"), "call __via_0; nop; jmp __via_0");
        assert_eq!(code(&after, "b"), "call __via_0; ret");
        assert_eq!(code(&after, "__via_0"), "jmp g");
        let at = after.functions.iter().position(|f| f.name == "__via_0");
        assert!(at < after.functions.iter().position(|f| f.name == "x"));
    }

    #[test]
    fn two_or_near_or_hot_ones_go_straight() {
        let long = "nop\n".repeat(5_000);
        let three = "call g\ncall g\ncall g\nret";
        for functions in [
            [("a", "call g\ncall g\nret"), ("x", long.as_str()), ("g", "ret")],
            [("a", three), ("x", "nop"), ("g", "ret")],
            [("__vector_1", three), ("x", long.as_str()), ("g", "ret")],
        ] {
            assert_eq!(shared(&functions).functions.len(), 3);
        }
        let enters = three.replace('g', "__enter_0");
        let mut entering = program(&[("a", &enters), ("x", &long), ("__enter_0", "ret")]);
        share(&mut entering);
        assert_eq!(entering.functions.len(), 3);
    }
}
