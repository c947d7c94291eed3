//! Lets cold functions share their prologues.
//!
//! A prologue saves callee-saved registers, two bytes each, and makes a frame in 16 more bytes:
//!
//! ```text
//!   push r16                            ldi  r26, 5        (frames of more than a byte: r27 as well)
//!   push r17                            call __enter_0
//!   push r28
//!   push r29                          __enter_0:
//!   in   r28, 61        becomes         clr  r27
//!   in   r29, 62                        pop  r0            the return address, three bytes
//!   sbiw r28, 5                         pop  r31
//!   in   r0, 63                         pop  r30
//!   cli                                 push r16 ...       as before
//!   out  62, r29                        in   r28, 61
//!   out  63, r0                         in   r29, 62
//!   out  61, r28                        sub  r28, r26 ...
//! ```
//!
//! The shared code pops its return address, does the work of the prologue, and pushes the address again.
//!
//! It may use r0, r26, r27, r30, r31 and the flags. LLVM's calling convention for AVR passes arguments in r8 to r25
//! only, so these registers hold nothing at entry. Functions that inline assembler calls are not changed, because the
//! assembler may have its own convention.
//!
//! Epilogues need no special treatment: [`super::repeats`] shares them like any other code.

use std::collections::BTreeMap;

use super::hot::Heat;
use super::text::{Function, Insn, Line, Program};
use super::{heat, names_in_source};

/// The prologue of a function.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Entry {
    /// The registers that it pushes, in this order.
    saved: Vec<String>,
    /// The size of its frame, if it has one.
    frame: Option<u16>,
    /// The indices of its instructions among the lines.
    lines: Vec<usize>,
}

/// The kind of a prologue: the registers that it saves, and whether the size of its frame has one byte or two, or there
/// is none. Functions with equal kinds share a prologue.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Kind {
    saved: Vec<String>,
    frame: Frame,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Frame {
    None,
    Byte,
    Word,
}

/// Prefix of the names of shared prologues.
pub const NAME: &str = "__enter_";

/// Shares the prologues of cold functions where that makes the program smaller.
pub fn share(program: &mut Program) {
    let in_source = names_in_source(program);
    let mut groups: BTreeMap<Kind, Vec<(usize, Entry)>> = BTreeMap::new();
    for (at, function) in program.functions.iter().enumerate() {
        if heat(function) == Heat::Cold
            && !in_source.contains(&function.name)
            && let Some(entry) = entry(function)
        {
            groups.entry(kind(&entry)).or_default().push((at, entry));
        }
    }
    let worth = groups.into_iter().filter(|(kind, all)| {
        let each = all.iter().map(|(_, entry)| size(&written(entry))).sum::<usize>();
        let calls = all.iter().map(|(_, entry)| size(&call(entry, NAME))).sum::<usize>();
        each > calls + size(&routine(kind))
    });
    for (number, (kind, all)) in worth.enumerate() {
        let name = format!("{NAME}{number}");
        for (at, entry) in all {
            replace(&mut program.functions[at], &entry, &name);
        }
        program.functions.push(Function::new(&name, &routine(&kind)));
    }
}

fn size(code: &[Insn]) -> usize {
    code.iter().map(Insn::size).sum()
}

fn kind(entry: &Entry) -> Kind {
    let frame = match entry.frame {
        None => Frame::None,
        Some(..=255) => Frame::Byte,
        Some(_) => Frame::Word,
    };
    Kind { saved: entry.saved.clone(), frame }
}

/// Returns the prologue of a function if it has LLVM's usual form; else `None`.
fn entry(function: &Function) -> Option<Entry> {
    let mut code =
        function.lines.iter().enumerate().filter(|(_, line)| !matches!(line, Line::Note(_)));
    let mut insns = Vec::new();
    while let Some((at, Line::Insn(insn))) = code.next() {
        insns.push((at, insn));
    }
    let saved: Vec<_> =
        insns.iter().map_while(|(_, i)| (i.op == "push").then(|| i.args.clone())).collect();
    let frame = frame(insns[saved.len()..].iter().map(|(_, insn)| *insn));
    let count = saved.len() + written_frame(frame).len();
    let entry =
        Entry { saved, frame, lines: insns.iter().take(count).map(|(at, _)| *at).collect() };
    (count > 0).then_some(entry)
}

/// Returns the size of the frame that the first instructions make.
fn frame<'a>(mut code: impl Iterator<Item = &'a Insn> + Clone) -> Option<u16> {
    let rest = code.clone();
    let number = |args: &str, register: &str| {
        args.strip_prefix(register)?.strip_prefix(", ")?.parse::<u16>().ok()
    };
    let (first, second) = (code.nth(2)?, code.next()?);
    let size = match (first.op.as_str(), second.op.as_str()) {
        ("sbiw", _) => number(&first.args, "r28")?,
        ("subi", "sbci") => number(&first.args, "r28")? | number(&second.args, "r29")? << 8,
        _ => return None,
    };
    let wanted = written_frame(Some(size));
    (rest.take(wanted.len()).eq(wanted.iter())).then_some(size)
}

/// Returns the instructions that LLVM writes for a frame.
fn written_frame(size: Option<u16>) -> Vec<Insn> {
    let Some(size) = size else { return Vec::new() };
    let reserve = match size {
        ..64 => format!("sbiw r28, {size}"),
        _ => format!("subi r28, {}\nsbci r29, {}", size & 255, size >> 8),
    };
    insns(&format!(
        "in r28, 61\nin r29, 62\n{reserve}\nin r0, 63\ncli\nout 62, r29\nout 63, r0\nout 61, r28"
    ))
}

/// Parses one instruction a line.
fn insns(text: &str) -> Vec<Insn> {
    text.lines().map(Insn::new).collect()
}

/// Returns the instructions that LLVM writes for a prologue.
fn written(entry: &Entry) -> Vec<Insn> {
    let pushes = entry.saved.iter().map(|register| Insn::new(&format!("push {register}")));
    pushes.chain(written_frame(entry.frame)).collect()
}

/// Returns the instructions that replace a prologue.
fn call(entry: &Entry, name: &str) -> Vec<Insn> {
    let size = match entry.frame {
        None => String::new(),
        Some(size @ ..=255) => format!("ldi r26, {size}\n"),
        Some(size) => format!("ldi r26, {}\nldi r27, {}\n", size & 255, size >> 8),
    };
    insns(&format!("{size}call {name}"))
}

/// Returns the shared code.
fn routine(kind: &Kind) -> Vec<Insn> {
    let clear = if kind.frame == Frame::Byte { "clr r27\n" } else { "" };
    let pushes: String = kind.saved.iter().map(|register| format!("push {register}\n")).collect();
    let frame = match kind.frame {
        Frame::None => "",
        _ => {
            "in r28, 61\nin r29, 62\nsub r28, r26\nsbc r29, r27\nin r26, 63\ncli\nout 62, r29\nout 63, r26\n\
             out 61, r28\n"
        }
    };
    insns(&format!(
        "{clear}pop r0\npop r31\npop r30\n{pushes}{frame}push r30\npush r31\npush r0\nret"
    ))
}

fn replace(function: &mut Function, entry: &Entry, name: &str) {
    let mut instead = call(entry, name).into_iter();
    let (last, others) = entry.lines.split_last().expect("an entry has instructions");
    let mut lines = Vec::with_capacity(function.lines.len());
    for (at, line) in function.lines.drain(..).enumerate() {
        if at == *last {
            lines.extend(instead.by_ref().map(Line::Insn));
        } else if !others.contains(&at) {
            lines.push(line);
        }
    }
    function.lines = lines;
}

/// Returns the instructions that a call of a shared prologue replaces; `before` loads the size of the frame.
pub fn put_back(routine: &[Insn], before: &[Insn]) -> Option<Vec<Insn>> {
    let saved: Vec<_> = routine.iter().filter(|i| i.op == "push").map(|i| i.args.clone()).collect();
    let saved =
        saved.strip_suffix(&["r30".to_owned(), "r31".to_owned(), "r0".to_owned()])?.to_vec();
    let byte = |insn: &Insn, register: &str| {
        insn.args.strip_prefix(register)?.strip_prefix(", ")?.parse::<u16>().ok()
    };
    let frame = match before {
        [] => None,
        [low] => Some(byte(low, "r26")?),
        [low, high, ..] => Some(byte(low, "r26")? | byte(high, "r27")? << 8),
    };
    let entry = Entry { saved, frame, lines: Vec::new() };
    (routine == self::routine(&kind(&entry))).then(|| written(&entry))
}

#[cfg(test)]
mod tests {
    use super::super::text::tests::{code, program, text};
    use super::super::verify::tests::checked;
    use super::*;

    const SAVED: &str = "push r12\npush r13\npush r14\npush r15\npush r16\npush r17\n";
    const Y: &str = "push r28\npush r29\nin r28, 61\nin r29, 62\n";
    const SET: &str = "in r0, 63\ncli\nout 62, r29\nout 63, r0\nout 61, r28\n";

    /// Returns the functions, each several times, with shared prologues.
    fn shared(functions: &[(&str, String)]) -> Program {
        let copies = (0..8)
            .flat_map(|n| functions.iter().map(move |(name, code)| (format!("{name}{n}"), code)));
        let copies: Vec<_> = copies.collect();
        let copies: Vec<_> =
            copies.iter().map(|(name, code)| (name.as_str(), code.as_str())).collect();
        checked(&copies, share)
    }

    #[test]
    fn saved_registers_are_pushed_by_a_routine() {
        let after = shared(&[("f", format!("{SAVED}mov r12, r24\nret"))]);
        assert_eq!(code(&after, "f3"), "call __enter_0; mov r12, r24; ret");
        let routine = "pop r0; pop r31; pop r30; push r12; push r13; push r14; push r15; push r16; push r17; push r30; push r31; \
                       push r0; ret";
        assert_eq!(code(&after, "__enter_0"), routine);
    }

    #[test]
    fn frames_of_any_size_are_made_by_one_routine() {
        let with = |reserve: &str| format!("{SAVED}{Y}{reserve}\n{SET}std Y+1, r24\nret");
        let after = shared(&[
            ("small", with("sbiw r28, 5")),
            ("middle", with("subi r28, 200\nsbci r29, 0")),
            ("large", with("subi r28, 44\nsbci r29, 1")),
        ]);
        assert_eq!(code(&after, "small0"), "ldi r26, 5; call __enter_0; std Y+1, r24; ret");
        assert_eq!(code(&after, "middle0"), "ldi r26, 200; call __enter_0; std Y+1, r24; ret");
        assert_eq!(
            code(&after, "large0"),
            "ldi r26, 44; ldi r27, 1; call __enter_1; std Y+1, r24; ret"
        );
        assert!(code(&after, "__enter_0").starts_with("clr r27; pop r0;"));
        assert!(
            code(&after, "__enter_1")
                .contains("in r28, 61; in r29, 62; sub r28, r26; sbc r29, r27; in r26, 63; cli; ")
        );
    }

    #[test]
    fn hot_functions_and_those_that_assembler_calls_stay() {
        let body = format!("{SAVED}ret");
        let after = shared(&[("__vector_1", body.clone()), ("kerf::hal::f", body.clone())]);
        assert!(after.functions.iter().all(|function| !function.name.starts_with(NAME)));
        let caller = ("caller", "push r2\n;APP\ncall f\n;NO_APP\nret");
        let mut after = program(&[
            caller,
            ("f", &body),
            ("g", &body),
            ("h", &body),
            ("i", &body),
            ("j", &body),
            ("k", &body),
        ]);
        share(&mut after);
        assert!(code(&after, "f").starts_with("push r12"));
        assert!(code(&after, "g").starts_with("call __enter_0"));
    }

    #[test]
    fn what_is_no_frame_is_left() {
        let odd = text(&[("f", "push r28\npush r29\nin r28, 61\nin r29, 62\nldd r24, Y+6\nret")]);
        let odd = Program::parse(&odd);
        assert_eq!(entry(&odd.functions[0]).unwrap().frame, None);
    }
}
