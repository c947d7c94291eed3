//! Tables that are kept outside the interpreter, and that cannot always take a change.

use super::super::tables::{Edit, Ram, TableRow, Tables};
use super::*;
use crate::units::{Length, PerAxis};

/// Tables that are writing one row. Meanwhile they take no change of another row.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Slow {
    kept: Ram,
    on_its_way: Option<TableRow>,
}

impl Tables for Slow {
    fn row(&self, row: TableRow) -> PerAxis<Length> {
        self.kept.row(row)
    }
    fn takes(&self, row: TableRow) -> bool {
        self.on_its_way.is_none_or(|other| other == row)
    }
    fn apply(&mut self, edit: &Edit) {
        self.on_its_way = Some(edit.row);
        self.kept.apply(edit);
    }
}

#[test]
fn a_line_that_has_to_wait_for_the_tables_leaves_no_trace() {
    let slow = Slow { kept: Ram::new(), on_its_way: None };
    let (mut state, mut out) = (Interpreter::with(slow), Commands::default());
    let mut run = |line: &str, expected| {
        let before = state;
        let done = state.interpret(line.as_bytes(), &Usual, &mut out).map(|_| ());
        assert_eq!(done, expected, "{line}");
        if done.is_err() {
            assert_eq!((state, out), (before, Commands::default()), "{line}");
        }
        state.work_offset()[0].0
    };
    run("G0 X3", Ok(()));
    assert_eq!(run("G10 L2 P1 X1", Ok(())), 10_000);
    for line in ["N7 G55 G10 L2 P2 X2", "G10 L20 P3 X2 M2", "G10 L1 P1 Z2", "G28.1", "G30.1"] {
        run(line, Err(Status::Again));
    }
    // A change of the row that is being written is accepted, and so are lines that only read rows.
    assert_eq!(run("G10 L20 P1 X0.5", Ok(())), 25_000);
    assert_eq!(run("G55", Ok(())), 0);
    assert_eq!(run("G54", Ok(())), 25_000);
}

#[test]
fn the_system_in_force_is_known_without_the_tables() {
    /// Tables that the interpreter must not read.
    #[derive(Clone, Copy)]
    struct Deaf;
    impl Tables for Deaf {
        fn row(&self, row: TableRow) -> PerAxis<Length> {
            panic!("asked for {row:?}")
        }
        fn takes(&self, _row: TableRow) -> bool {
            true
        }
        fn apply(&mut self, _edit: &Edit) {}
    }
    let (mut state, mut out) = (Interpreter::with(Deaf), Commands::default());
    let mut origin = |line: &str| {
        state.interpret(line.as_bytes(), &Usual, &mut out).expect(line);
        state.work_offset()[0].0
    };
    assert_eq!(origin("G10 L2 P1 X1"), 10_000);
    assert_eq!(origin("G92 X-2"), 20_000);
    assert_eq!(origin("G43.1 X0.5"), 25_000);
    assert_eq!(origin("G92.2"), 15_000);
    assert_eq!(origin("G92.3"), 25_000);
    assert_eq!(origin("G54 G49"), 20_000);
    assert_eq!(origin("G10 L20 P0 X5"), -50_000);
    assert_eq!(origin("G92.1"), -60_000);
    assert_eq!(origin("G92 X1"), -10_000);
    assert_eq!(origin("M2"), -60_000);
}
