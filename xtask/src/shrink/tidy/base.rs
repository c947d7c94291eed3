//! Accesses the bytes of one variable through a pointer.
//!
//! ```text
//!   sts PLACE, r24                      ldi r30, lo8(PLACE)
//!   sts PLACE+1, r25                    ldi r31, hi8(PLACE)
//!   sts PLACE+2, r1      becomes        st  Z, r24
//!   sts PLACE+3, r1                     std Z+1, r25
//!                                       std Z+2, r1
//!                                       std Z+3, r1
//! ```
//!
//! An address takes two bytes in each `lds` and `sts`. Four or more of them are worth a pointer, if Z is free. It
//! costs two cycles, so nothing is changed where interrupts are off.

use super::super::quiet;
use super::super::text::{Function, Insn, Line};
use super::effect::{operands, pair, register};
use super::flow::Flow;
use super::needs::Needs;

/// Least number of accesses that are worth a pointer.
const FEWEST: usize = 4;
/// How far a pointer reaches, bytes.
const REACH: i32 = 63;

/// A `lds` or `sts`.
#[derive(Clone)]
struct Access {
    line: usize,
    insn: Insn,
    offset: i32,
}

/// Lets all runs of accesses to a variable go through a pointer. Returns whether there was one.
pub fn share(function: &mut Function, needs: &Needs) -> bool {
    let Some(flow) = Flow::of(function, needs) else { return false };
    let needed = flow.needed();
    let quiet = quiet(function);
    let mut changes: Vec<(usize, Vec<Insn>)> = Vec::new();
    let mut at = 0;
    while at < flow.lines.len() {
        let run = if quiet[flow.origins[at]] { Vec::new() } else { run(&flow, at) };
        let is_free = |access: &Access| needed[access.line] & pair(30) == 0;
        let length = (FEWEST..=run.len()).rev().find(|length| is_free(&run[length - 1]));
        let Some(length) = length else {
            at += 1;
            continue;
        };
        let run = &run[..length];
        changes.extend(by_pointer(run).into_iter().map(|(line, code)| (flow.origins[line], code)));
        at = run[length - 1].line + 1;
    }
    let any = !changes.is_empty();
    let mut changes = changes.into_iter().peekable();
    let mut lines = Vec::with_capacity(function.lines.len());
    for (at, line) in function.lines.drain(..).enumerate() {
        match changes.next_if(|(line, _)| *line == at) {
            Some((_, code)) => lines.extend(code.into_iter().map(Line::Insn)),
            None => lines.push(line),
        }
    }
    function.lines = lines;
    any
}

/// Returns the accesses to one variable from a line on, up to where Z is touched or other code runs.
fn run(flow: &Flow, first: usize) -> Vec<Access> {
    let mut run: Vec<Access> = Vec::new();
    let Some(symbol) = flow.insn(first).and_then(variable).map(|(symbol, _)| symbol) else {
        return run;
    };
    let (mut least, mut most) = (i32::MAX, i32::MIN);
    for line in first..flow.lines.len() {
        let Line::Insn(insn) = flow.lines[line] else { break };
        let effect = &flow.effects[line];
        let touched = effect.reads | effect.changes();
        let is_odd = insn.is_jump() || insn.op.ends_with("call") || flow.may_be_skipped[line];
        if is_odd || touched & pair(30) != 0 {
            break;
        }
        let Some((_, offset)) = variable(insn).filter(|(other, _)| *other == symbol) else {
            continue;
        };
        (least, most) = (least.min(offset), most.max(offset));
        if most - least > REACH {
            break;
        }
        run.push(Access { line, insn: insn.clone(), offset });
    }
    run
}

/// Returns the variable that an instruction reads or writes, and the offset in it.
fn variable(insn: &Insn) -> Option<(&str, i32)> {
    let (first, second) = operands(insn);
    let address = match insn.op.as_str() {
        "lds" => second,
        "sts" => first,
        _ => return None,
    };
    if !address.starts_with(|first: char| first.is_alphabetic() || "_.".contains(first)) {
        return None;
    }
    match address.split_once('+') {
        None => Some((address, 0)),
        Some((symbol, offset)) => Some((symbol, offset.parse().ok()?)),
    }
}

fn by_pointer(run: &[Access]) -> Vec<(usize, Vec<Insn>)> {
    let least = run.iter().map(|access| access.offset).min().unwrap_or(0);
    let symbol = variable(&run[0].insn).map_or("", |(symbol, _)| symbol);
    let base = if least == 0 { symbol.to_owned() } else { format!("{symbol}+{least}") };
    let mut changes = Vec::new();
    for access in run {
        let mut code = Vec::new();
        if changes.is_empty() {
            code.push(Insn::new(&format!("ldi r30, lo8({base})")));
            code.push(Insn::new(&format!("ldi r31, hi8({base})")));
        }
        let (first, second) = operands(&access.insn);
        let place = match access.offset - least {
            0 => "Z".to_owned(),
            offset => format!("Z+{offset}"),
        };
        let displaced = if place == "Z" { "" } else { "d" };
        let by_pointer = match register(first) {
            Some(_) => format!("ld{displaced} {first}, {place}"),
            None => format!("st{displaced} {place}, {second}"),
        };
        code.push(Insn::new(&by_pointer));
        changes.push((access.line, code));
    }
    changes
}
