//! A small image with two executors, whose stack use is known.

use super::*;
use crate::elf::{Sizes, Symbol};

const LISTING: &str = "\
 e4:\tjmp\t0x200\t; 0x200 <poll of shallow>
 e8:\tjmp\t0x300\t; 0x300 <poll of exec>
 ec:\tjmp\t0x400\t; 0x400 <wake>
 100:\tcall\t0x180\t; 0x180 <executor>
 104:\tret
 180:\tpush\tr2
 182:\teicall
 184:\tret
 200:\tpush\tr2
 202:\tpush\tr3
 204:\teicall
 206:\tret
 300:\tpush\tr2
 302:\tpush\tr3
 304:\tpush\tr4
 306:\tret
 400:\tpush\tr2
 402:\tpush\tr3
 404:\tpush\tr4
 406:\tpush\tr5
 408:\tret
 500:\tpush\tr2
 502:\tsei
 504:\tcall\t0x180\t; 0x180 <executor>
 508:\treti
 600:\tpush\tr2
 602:\tpush\tr3
 604:\treti
 700:\trcall\t.-2\t; 0x700 <again>
 702:\tret
";

fn symbol(name: &str, address: u64, size: u64) -> Symbol {
    Symbol { name: name.into(), address, size, is_data: false }
}

fn poll(task: &str, address: u64) -> Symbol {
    let future = format!("k::tasks::{task}::run::{{closure#0}}");
    symbol(&format!("<embassy_executor::raw::TaskStorage<{future}>>::poll"), address, 8)
}

fn image(last: &[Symbol]) -> Image {
    let first = [
        symbol("__bad_interrupt", 0x80, 4),
        symbol("__vector_9", 0x80, 0),
        symbol("__trampolines_start", 0xe4, 0),
        symbol("__trampolines_end", 0xf0, 0),
        symbol("main", 0x100, 6),
        symbol("executor", 0x180, 6),
        poll("shallow", 0x200),
        poll("exec", 0x300),
        symbol("wake", 0x400, 10),
        symbol("__vector_55", 0x500, 10),
        symbol("__vector_17", 0x600, 6),
    ];
    let symbols = first.iter().chain(last).cloned().collect();
    Image { path: "none".into(), sizes: Sizes::default(), symbols }
}

fn analyse(last: &[Symbol], interrupt_tasks: &[&str]) -> Stack {
    let image = image(last);
    Graph::new(&image, Code::parse(LISTING), interrupt_tasks).analyse().unwrap()
}

fn names(chain: &Chain) -> Vec<&str> {
    chain.links.iter().map(|link| link.name.as_str()).collect()
}

#[test]
fn levels_add_up() {
    let stack = analyse(&[], &["exec"]);
    // main 3 + call 3, executor 1 + call 3, shallow 2 + call 3, wake 4.
    assert_eq!(stack.main.bytes(), 19);
    assert_eq!(names(&stack.main)[3], "wake");
    // Entry 3, push 1 + call 3, executor 1 + call 3. Then the 4 of `wake` exceed the 3 of `exec`.
    assert_eq!(stack.nesting.len(), 1);
    assert_eq!(stack.nesting[0].root(), "__vector_55");
    assert_eq!(stack.nesting[0].bytes(), 15);
    assert_eq!((stack.short.root(), stack.short.bytes()), ("__vector_17", 5));
    assert_eq!(stack.bytes(), 19 + 15 + 5);
    assert!(stack.unbounded.is_empty());
}

#[test]
fn without_known_interrupt_tasks_any_task_may_interrupt() {
    let stack = analyse(&[], &["other"]);
    assert_eq!(stack.nesting[0].bytes(), 3 + 4 + 4 + 5 + 4);
}

#[test]
fn recursion_is_reported() {
    let stack = analyse(&[symbol("__vector_20", 0x700, 4)], &["exec"]);
    assert_eq!(stack.unbounded, ["recursion through __vector_20"]);
}

#[test]
fn tasks_are_named_as_in_the_source() {
    assert_eq!(task_name(&poll("exec", 0).name).as_deref(), Some("exec"));
    assert_eq!(task_name("embassy_executor::raw::Executor::poll"), None);
}
