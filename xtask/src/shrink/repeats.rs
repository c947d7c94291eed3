//! Outlining: shares code that repeats in cold functions.
//!
//! ```text
//!   movw r24, r28                       call __part_0
//!   adiw r24, 5       becomes
//!   call render                       __part_0:
//!                                       movw r24, r28
//!                                       adiw r24, 5
//!                                       call render
//!                                       ret
//! ```
//!
//! Code that ends with `ret` is jumped to instead (`__tail_0`, tail merging). This costs no stack, and the code may pop
//! anything, so epilogues can be shared. It costs two or three cycles, so warm functions share their tails only.
//!
//! `call`, `jmp` and `ret` change no register and no flag, so a part may begin and end anywhere, with these exceptions:
//!
//! - a part has no branch, no label and no inline assembler;
//! - a part that is called does not touch the stack pointer, because its return address lies on top (it may access the
//!   frame, through Y), and it does not disable or enable interrupts, so that code with interrupts off stays as short
//!   as it was;
//! - nothing is taken from between `cli` and the instruction that enables interrupts again;
//! - an instruction that a skip instruction may skip is not moved.
//!
//! The part that saves most is shared first, until no part saves anything. Repeated code within parts is found in
//! another round.

use std::collections::{BinaryHeap, HashMap};

use super::hot::Heat;
use super::text::{Function, Insn, Line, Program};
use super::{heat, prologue, quiet};

/// Prefix of the names of parts that are called.
pub const PART: &str = "__part_";
/// Prefix of the names of parts that are jumped to; they include the `ret` of the function.
pub const TAIL: &str = "__tail_";

/// Most instructions of a part.
const LONGEST: usize = 60;
/// Number of rounds; later ones find repeated code within parts.
const ROUNDS: usize = 3;
/// Bytes of a call or jump to a part. The linker makes it two where the distance is short.
const SITE: usize = 4;

/// Shares code that repeats in cold functions.
pub fn share(program: &mut Program) {
    let mut made = 0;
    for _ in 0..ROUNDS {
        let before = made;
        round(program, &mut made);
        if made == before {
            break;
        }
    }
}

fn round(program: &mut Program, made: &mut usize) {
    let mut stream = Stream::of(program);
    let groups = stream.groups();
    let mut heap: BinaryHeap<(usize, std::cmp::Reverse<usize>)> = (groups.iter().enumerate())
        .filter_map(|(at, group)| {
            Some((stream.saving(&stream.free(group), group.length)?, std::cmp::Reverse(at)))
        })
        .collect();
    let mut changes = Vec::new();
    while let Some((promised, std::cmp::Reverse(at))) = heap.pop() {
        let (places, length) = (stream.free(&groups[at]), groups[at].length);
        let Some(saving) = stream.saving(&places, length) else { continue };
        if saving < promised {
            heap.push((saving, std::cmp::Reverse(at)));
            continue;
        }
        changes.push(stream.take(&places, length, *made));
        *made += 1;
    }
    changes.into_iter().for_each(|change| change.apply(program));
    program.functions.iter_mut().for_each(|function| function.lines.retain(|line| *line != gone()));
}

/// How an instruction may be shared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    /// It may stand in any part.
    Plain,
    /// It may stand only in a part that is jumped to.
    Tail,
    /// It ends a part that is jumped to.
    Ret,
    /// It may stand in no part.
    Barrier,
}

fn class(insn: &Insn) -> Class {
    let touches_stack = insn.op == "push"
        || insn.op == "pop"
        || (insn.op == "in" && (insn.args.ends_with(", 61") || insn.args.ends_with(", 62")));
    let sets_stack =
        insn.op == "out" && (insn.args.starts_with("61,") || insn.args.starts_with("62,"));
    match insn.op.as_str() {
        "ret" => Class::Ret,
        "cli" | "sei" => Class::Tail,
        "icall" | "eicall" => Class::Barrier,
        // A shared prologue returns with a changed stack pointer.
        "call" if insn.args.starts_with(prologue::NAME) => Class::Barrier,
        _ if insn.is_jump() => Class::Barrier,
        _ if touches_stack || sets_stack => Class::Tail,
        _ => Class::Plain,
    }
}

/// All code that could be shared, as numbers. Equal instructions have equal numbers.
struct Stream {
    /// For each place: the number of its instruction, or of a barrier.
    numbers: Vec<u32>,
    classes: Vec<Class>,
    /// For each place: its function and its line.
    origins: Vec<Origin>,
    /// For each number: its instruction.
    insns: Vec<Insn>,
}

/// Places with equal sequences of instructions.
struct Group {
    length: usize,
    places: Vec<usize>,
}

impl Stream {
    fn of(program: &Program) -> Stream {
        let mut stream = Stream {
            numbers: Vec::new(),
            classes: Vec::new(),
            origins: Vec::new(),
            insns: Vec::new(),
        };
        let mut known: HashMap<Insn, u32> = HashMap::new();
        for (at, function) in program.functions.iter().enumerate() {
            let heat = heat(function);
            if heat == Heat::Hot {
                continue;
            }
            let quiet = quiet(function);
            let mut may_be_skipped = false;
            for (line, what) in function.lines.iter().enumerate() {
                let is_plain = !quiet[line] && !may_be_skipped;
                match what {
                    Line::Insn(insn) if is_plain => {
                        let number = *known.entry(insn.clone()).or_insert_with(|| {
                            stream.insns.push(insn.clone());
                            stream.insns.len() as u32 - 1
                        });
                        let class = match class(insn) {
                            Class::Plain if heat == Heat::Warm => Class::Tail,
                            class => class,
                        };
                        stream.push(number, class, (at, line));
                    }
                    Line::Note(_) => {}
                    _ => stream.push(u32::MAX, Class::Barrier, (at, line)),
                }
                may_be_skipped = match what {
                    Line::Insn(insn) => insn.is_skip(),
                    Line::Fixed(text) => Insn::new(text).is_skip(),
                    Line::Label(_) | Line::Note(_) => may_be_skipped,
                };
            }
            stream.push(u32::MAX, Class::Barrier, (at, 0));
        }
        stream
    }

    fn push(&mut self, number: u32, class: Class, origin: Origin) {
        self.numbers.push(number);
        self.classes.push(class);
        self.origins.push(origin);
    }

    /// Whether the instructions from a place on may be a part.
    fn is_part(&self, at: usize, length: usize) -> bool {
        let classes = &self.classes[at..at + length];
        match classes.last() {
            Some(Class::Ret) => true,
            _ => classes.iter().all(|class| *class == Class::Plain),
        }
    }

    /// Returns all sequences that repeat and could save something.
    fn groups(&self) -> Vec<Group> {
        let mut found = Vec::new();
        // A sequence that repeats with one more instruction also repeats without it.
        let mut starts: Vec<usize> =
            (0..self.numbers.len()).filter(|at| self.goes_on(*at)).collect();
        for length in 2..=LONGEST {
            let mut same: HashMap<&[u32], Vec<usize>> = HashMap::new();
            for at in starts.drain(..) {
                if at + length <= self.numbers.len()
                    && self.goes_on(at + length - 2)
                    && self.classes[at + length - 1] != Class::Barrier
                {
                    same.entry(&self.numbers[at..at + length]).or_default().push(at);
                }
            }
            let mut repeated: Vec<_> =
                same.into_values().filter(|places| places.len() > 1).collect();
            repeated.sort_unstable();
            starts.extend(repeated.iter().flatten());
            // Only some places of a group may be in functions that share more than their ends.
            let parts = repeated.into_iter().map(|mut places| {
                places.retain(|at| self.is_part(*at, length));
                places
            });
            let groups = parts.map(|places| Group { length, places });
            found.extend(groups.filter(|group| self.saving(&self.free(group), length).is_some()));
        }
        found
    }

    /// Whether another instruction may follow in a part.
    fn goes_on(&self, at: usize) -> bool {
        !matches!(self.classes[at], Class::Barrier | Class::Ret)
    }

    /// Returns the places of a group from which nothing has been taken yet and that do not overlap.
    fn free(&self, group: &Group) -> Vec<usize> {
        let mut end = 0;
        let mut free = Vec::new();
        for at in &group.places {
            let whole =
                self.classes[*at..at + group.length].iter().all(|class| *class != Class::Barrier);
            if whole && *at >= end {
                free.push(*at);
                end = at + group.length;
            }
        }
        free
    }

    /// Returns how many bytes it saves to share these places; `None` if it saves none.
    fn saving(&self, places: &[usize], length: usize) -> Option<usize> {
        let first = *places.first()?;
        let size: usize = self.code(first, length).map(Insn::size).sum();
        let ret = if self.classes[first + length - 1] == Class::Ret { 0 } else { 2 };
        (places.len() * size)
            .checked_sub(places.len() * SITE + size + ret)
            .filter(|saving| *saving > 0)
    }

    fn code(&self, at: usize, length: usize) -> impl Iterator<Item = &Insn> {
        self.numbers[at..at + length].iter().map(|number| &self.insns[*number as usize])
    }

    /// Takes the instructions of a group away.
    fn take(&mut self, places: &[usize], length: usize, number: usize) -> Change {
        let first = places[0];
        let is_tail = self.classes[first + length - 1] == Class::Ret;
        let mut code: Vec<_> = self.code(first, length).cloned().collect();
        let (name, op) = if is_tail {
            (format!("{TAIL}{number}"), "jmp")
        } else {
            (format!("{PART}{number}"), "call")
        };
        if !is_tail {
            code.push(Insn::new("ret"));
        }
        for at in places {
            self.classes[*at..at + length].fill(Class::Barrier);
        }
        let places = places.iter().map(|at| self.origins[*at..at + length].to_vec()).collect();
        Change {
            routine: Function::new(&name, &code),
            site: Insn::new(&format!("{op} {name}")),
            places,
        }
    }
}

/// Function and line of an instruction.
type Origin = (usize, usize);

/// A part that is shared.
struct Change {
    routine: Function,
    /// The call or jump that replaces it.
    site: Insn,
    /// The former places of its instructions, for each place that it is taken from.
    places: Vec<Vec<Origin>>,
}

/// The placeholder for an instruction that is taken away, until the end of the round.
fn gone() -> Line {
    Line::Note("\t; shared".into())
}

impl Change {
    fn apply(self, program: &mut Program) {
        for place in self.places {
            for (function, line) in &place {
                program.functions[*function].lines[*line] = gone();
            }
            if let Some((function, line)) = place.first() {
                program.functions[*function].lines[*line] = Line::Insn(self.site.clone());
            }
        }
        program.functions.push(self.routine);
    }
}

#[cfg(test)]
mod tests {
    use super::super::text::tests::{code, program};
    use super::super::verify::tests::checked;
    use super::*;

    fn shared(functions: &[(&str, &str)]) -> Program {
        checked(functions, share)
    }

    const BODY: &str = "ldi r18, 1\nldi r19, 2\nldi r20, 3\nsts 500, r18\n";

    #[test]
    fn what_repeats_is_called() {
        let after = shared(&[
            ("f", &format!("{BODY}nop\nret")),
            ("g", &format!("inc r2\n{BODY}dec r2\nret")),
        ]);
        let names: Vec<_> = after.functions.iter().map(|function| function.name.as_str()).collect();
        assert_eq!(names, ["f", "g"], "two copies of ten bytes save nothing");
        let after = shared(&[
            ("f", &format!("{BODY}{BODY}nop\nret")),
            ("g", &format!("inc r2\n{BODY}dec r2\nret")),
        ]);
        assert_eq!(code(&after, "f"), "call __part_0; call __part_0; nop; ret");
        assert_eq!(code(&after, "g"), "inc r2; call __part_0; dec r2; ret");
        assert_eq!(
            code(&after, "__part_0"),
            "ldi r18, 1; ldi r19, 2; ldi r20, 3; sts 500, r18; ret"
        );
    }

    #[test]
    fn what_returns_is_jumped_to_and_may_use_the_stack() {
        let end = "adiw r28, 5\nin r0, 63\ncli\nout 62, r29\nout 63, r0\nout 61, r28\npop r29\npop r28\nret";
        let after = shared(&[("f", &format!("inc r24\n{end}")), ("g", &format!("dec r24\n{end}"))]);
        assert_eq!(code(&after, "f"), "inc r24; jmp __tail_0");
        assert_eq!(code(&after, "g"), "dec r24; jmp __tail_0");
        let insns: Vec<_> = end.split('\n').collect();
        assert_eq!(code(&after, "__tail_0"), insns.join("; "));
    }

    #[test]
    fn nothing_that_uses_the_stack_is_called() {
        for odd in [
            "push r2",
            "pop r2",
            "in r28, 61",
            "out 62, r29",
            "cli",
            "sei",
            "eicall",
            "breq .LBB0_1",
            "call __enter_0",
        ] {
            let body = format!("ldi r18, 1\n{odd}\nldi r19, 2\nldi r20, 3\nldi r21, 4\n");
            let code = format!("{body}{body}{body}nop\nrjmp .LBB0_1");
            let mut after = program(&[("f", &code)]);
            share(&mut after);
            let part = after.functions.iter().filter(|function| function.name.starts_with(PART));
            assert!(
                part.flat_map(|function| function.insns()).all(|insn| Insn::new(odd) != *insn),
                "{odd}"
            );
        }
    }

    #[test]
    fn labels_and_assembler_of_the_source_end_a_part() {
        let code = |between: &str| format!("{BODY}{between}\n{BODY}").repeat(3);
        for between in [".LBB0_1:", ";APP\nnop\n;NO_APP"] {
            let after = shared(&[("f", &(code(between) + "nop\nrjmp .LBB0_1"))]);
            let parts: Vec<_> =
                after.functions.iter().filter(|function| function.name.starts_with(PART)).collect();
            assert!(
                parts.iter().all(|part| part.code().all(|line| matches!(line, Line::Insn(_)))),
                "{between}"
            );
        }
    }

    #[test]
    fn code_with_interrupts_off_is_left_as_it_is() {
        let code = format!(";APP\nin r24, 63\ncli\n;NO_APP\n{BODY};APP\nout 63, r24\n;NO_APP\n");
        let after = shared(&[("f", &(code.repeat(5) + "ret"))]);
        assert_eq!(after.functions.len(), 1);
    }

    #[test]
    fn what_may_be_skipped_is_left_where_it_is() {
        let after = shared(&[("f", &(format!("sbrc r24, 0\n{BODY}").repeat(5) + "ret"))]);
        assert!(code(&after, "f").starts_with("sbrc r24, 0; ldi r18, 1; call __part_0;"));
    }

    #[test]
    fn hot_code_is_left_as_it_is() {
        let after =
            shared(&[("__vector_1", &(BODY.repeat(5) + "ret")), ("f", &(BODY.repeat(5) + "ret"))]);
        assert!(after.functions[0].insns().all(|insn| insn.op != "call"));
        assert!(after.functions[1].insns().any(|insn| insn.op == "call"));
    }

    #[test]
    fn warm_code_shares_its_ends_alone() {
        let warm = super::super::hot::WARM[0];
        let body = format!("{BODY}inc r2\n").repeat(5) + BODY + "ret";
        let after = shared(&[(warm, &body), ("f", &body), ("g", &format!("{BODY}ret"))]);
        assert!(after.functions[0].insns().all(|insn| insn.op != "call"));
        assert!(after.functions[0].insns().any(|insn| insn.op == "jmp"));
    }

    #[test]
    fn parts_hold_parts() {
        let small = BODY;
        let large = format!("{BODY}inc r2\ninc r3\ninc r4\ninc r5\ninc r6\ninc r7\n");
        let f = format!("{large}nop\n{large}wdr\n{large}ret");
        let g = format!("{small}sleep\n{small}asr r2\n{small}lsr r3\n{small}rjmp .LBB0_1");
        let after = shared(&[("f", &f), ("g", &g)]);
        assert!(
            after.functions.iter().filter(|function| function.name.starts_with(PART)).count() >= 2
        );
    }
}
