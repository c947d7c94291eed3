//! Lines with O words.

use super::super::command::Commands;
use super::super::interpreter::Interpreter;
use super::super::setup::Usual;
use crate::status::Status;
use std::boxed::Box;
use std::format;
use std::string::String;
use std::vec::Vec;

/// A sender and a machine: each line is answered when what it has begun is over.
struct Machine {
    interpreter: Box<Interpreter>,
    /// What lines have told, and where moves have ended on X.
    heard: Vec<String>,
}

impl Machine {
    fn new() -> Self {
        Self { interpreter: Box::new(Interpreter::new()), heard: Vec::new() }
    }

    /// Sends a line. Gives up after many lines of a replay.
    fn send(&mut self, line: &str) -> Result<(), Status> {
        let mut out = Commands::default();
        for _ in 0..5_000 {
            self.interpreter.interpret(line.as_bytes(), &Usual, &mut out)?;
            if !self.interpreter.said().is_empty() {
                self.heard.push(String::from_utf8(self.interpreter.said().into()).unwrap());
                self.interpreter.hush();
            }
            if out.moves() {
                self.heard.push(format!("x{}", self.interpreter.position()[0].0 / 10_000));
            }
            if !self.interpreter.is_replay() {
                return Ok(());
            }
        }
        Err(Status::Terminated)
    }

    /// Sends lines that are all accepted. Returns what has been heard since.
    fn play(&mut self, program: &str) -> String {
        for line in program.lines() {
            assert_eq!(self.send(line.trim()), Ok(()), "{line}");
        }
        core::mem::take(&mut self.heard).join(" ")
    }

    fn is_at_rest(&self) -> bool {
        !self.interpreter.is_replay() && self.clone_is_fresh()
    }

    /// Whether a plain move takes the fast path.
    fn clone_is_fresh(&self) -> bool {
        let (mut copy, mut out) = (self.interpreter.clone(), Commands::default());
        copy.fast_path(b"G0X1", super::super::fast_path::Writer::Numbers, &Usual, &mut out)
    }
}

fn play(program: &str) -> String {
    let mut machine = Machine::new();
    let heard = machine.play(program);
    assert!(machine.is_at_rest(), "{program}");
    heard
}

/// Returns the answers to all lines.
fn answers(program: &str) -> Vec<Result<(), Status>> {
    let mut machine = Machine::new();
    program.lines().map(|line| machine.send(line.trim())).collect()
}

#[test]
fn conditions() {
    let program = |value: &str| {
        format!(
            "#1={value}
            o1 if [#1 EQ 1]
            (print,one)
            o2 elseif [1/0]
            o1 elseif [#1 EQ 2]
            (print,two)
            garbage [1/0] #<none>
            o1 else
            (print,other)
            o1 endif"
        )
        .replace("garbage [1/0] #<none>\n", "")
    };
    assert_eq!(play(&program("2")), "two");
    assert_eq!(play(&program("3")), "other");
    let skipped = "o1 if [0]\nrubbish [1/0] #<none>\no7 if [1/0]\no9 call\n%%\no1 endif\n(print,a)";
    assert_eq!(play(skipped), "a");
    let nested =
        "o1 if [1]\no2 if [0]\n(print,a)\no2 else\n(print,b)\no2 endif\n(print,c)\no1 endif";
    assert_eq!(play(nested), "b c");
    assert_eq!(play("o1 if [0.0000001]\n(print,a)\no1 endif\n/o2 if [0]\n(print,b)"), "a b");
    let behind = "o1 if [1]\n(print,a)\no1 elseif [1/0]\n(print,b)\no1 else\n(print,c)\no1 endif";
    assert_eq!(play(behind), "a");
}

#[test]
fn loops() {
    let while_loop = "#1=0\no1 while [#1 LT 3]\nG0 X#1\n#1=[#1+1]\no1 endwhile\n(print,%d#1)";
    assert_eq!(play(while_loop), "x0 x1 x2 3");
    assert_eq!(play("o1 while [0]\n(print,a)\no1 endwhile\n(print,b)"), "b");
    let do_loop = "#1=5\no1 do\n(print,%d#1)\n#1=[#1+1]\no1 while [#1 LT 7]\n(print,end)";
    assert_eq!(play(do_loop), "5 6 end");
    for (count, passes) in [("3", 3), ("2.5", 2), ("3.5", 4), ("0", 0), ("-2", 0)] {
        let program = format!("o1 repeat [{count}]\n(print,a)\no1 endrepeat");
        assert_eq!(play(&program), ["a"].repeat(passes).join(" "), "{count}");
    }
    let nested =
        "o1 repeat [2]\n(print,a)\no2 repeat [3]\n(print,b)\no2 endrepeat\n(print,c)\no1 endrepeat";
    assert_eq!(play(nested), "a b b b c a b b b c");
    let other = "o1 repeat [2]\no2 while [0]\n(print,b)\no2 endwhile\no3 if [1]\n(print,c)\no3 endif\no1 endrepeat";
    assert_eq!(play(other), "c c");
}

#[test]
fn loops_are_left_and_gone_on_with() {
    let program = |word: &str| {
        format!(
            "#1=0
            o1 while [#1 LT 5]
            #1=[#1+1]
            o2 if [#1 EQ 3]
            o1 {word}
            o2 endif
            (print,%d#1)
            o1 endwhile
            (print,end)"
        )
    };
    assert_eq!(play(&program("break")), "1 2 end");
    assert_eq!(play(&program("continue")), "1 2 4 5 end");
    let first = "o1 while [1]\n(print,a)\no1 break\n(print,b)\no1 endwhile\n(print,c)";
    assert_eq!(play(first), "a c");
    let of_do = "#1=0\no1 do\n#1=[#1+1]\no2 if [#1 EQ 2]\no1 continue\no2 endif\n(print,%d#1)\no1 while [#1 LT 3]";
    assert_eq!(play(of_do), "1 3");
    let outer = "#1=0\no1 while [#1 LT 3]\n#1=[#1+1]\no2 repeat [2]\no3 if [#1 EQ 2]\no1 continue\no3 endif\n(print,%d#1)\no2 endrepeat\no1 endwhile";
    assert_eq!(play(outer), "1 1 3 3");
    assert_eq!(answers("o1 repeat [2]\no1 break")[1], Err(Status::OWordInvalid));
}

#[test]
fn subroutines() {
    let program = "o100 sub
        (print,%d#1 #2 #3)
        #1=9 #40=7 #<own>=1
        o100 endsub [#1+1]
        #1=5 #3=6
        o100 call [1] [2]
        (print,%d#1 #3 #40 #<_value> #<_value_returned>)
        #4=EXISTS[#<own>]
        (print,%d#4)";
    assert_eq!(play(program), "1 2 0 5 6 7 10 1 0");
    let nested = "o<in ner> sub
        (print,in %d#1 level #<_call_level>)
        o<inner> return
        (print,never)
        o<inner> endsub
        o<outer> sub
        o<INNER> call [#1+1]
        (print,out %d#1 #<_value_returned>)
        o<outer> endsub
        o<outer> call [1]";
    assert_eq!(play(nested), "in 2 level 2 out 1 0");
    let factorial = "o1 sub
        o2 if [#1 LE 1]
        o1 return [1]
        o2 endif
        o1 call [#1-1]
        o1 endsub [#<_value>*#1]
        o1 call [5]
        (print,%d#<_value>)";
    assert_eq!(play(factorial), "120");
    let in_loop = "o1 sub\nG91 G0 X[#1]\nG90\no1 endsub\n#1=3\no2 repeat [3]\no1 call [#1]\no2 endrepeat\n(print,%d#1)";
    assert_eq!(play(in_loop), "x3 x6 x9 3");
    let returns = "o1 sub\no2 while [1]\no3 repeat [5]\n(print,a)\no1 return\no3 endrepeat\no2 endwhile\no1 endsub\no1 call\no1 call\n(print,b)";
    assert_eq!(play(returns), "a a b");
    assert_eq!(play("o1 sub\n(print,a)\no1 endsub\no1 sub\n(print,b)\no1 endsub\no1 call"), "b");
    let computed = "o[1+1] sub\n(print,a)\no2 endsub\n#1=2\nN10 o#1 call (a note)";
    assert_eq!(play(computed), "a");
}

#[test]
fn calls_have_a_limit() {
    let depth = |depth: u8| {
        format!("o1 sub\no2 if [#1 GT 1]\no1 call [#1-1]\no2 endif\no1 endsub\no1 call [{depth}]")
    };
    assert_eq!(answers(&depth(9)).last(), Some(&Ok(())));
    let mut machine = Machine::new();
    for line in depth(10).lines() {
        let done = machine.send(line);
        assert!(done.is_ok() != line.ends_with("[10]"), "{line}");
    }
    assert!(machine.is_at_rest());
    // All levels have ended.
    assert_eq!(machine.play("(print,%d#1 #<_call_level>)\no1 call [3]"), "0 0");
}

#[test]
fn what_is_out_of_place_is_refused() {
    for (program, status) in [
        ("o1 call", Status::SubUnknown),
        ("o1 endif", Status::OWordInvalid),
        ("o1 else", Status::OWordInvalid),
        ("o1 endwhile", Status::OWordInvalid),
        ("o1 return", Status::OWordInvalid),
        ("o1 endsub", Status::OWordInvalid),
        ("o1 break", Status::OWordInvalid),
        ("o1 foo", Status::OWordInvalid),
        ("o<a", Status::ExpressionInvalid),
        ("o[0.5] sub", Status::OWordInvalid),
        ("o[-1] sub", Status::OWordInvalid),
        ("o1 if", Status::OWordInvalid),
        ("o1 if 1", Status::OWordInvalid),
        ("o1 if [1] G0 X1", Status::OWordInvalid),
        ("o1 do G0 X1", Status::OWordInvalid),
        ("o1 while [1/0]", Status::ValueUndefined),
        ("o1 if [1]\no1 if [1]", Status::OWordInvalid),
        ("o1 if [1]\no2 sub", Status::OWordInvalid),
        ("o1 sub\no2 sub", Status::OWordInvalid),
        ("o1 sub\no1 endsub\no1 call 5", Status::OWordInvalid),
    ] {
        assert_eq!(answers(program).pop(), Some(Err(status)), "{program}");
    }
    let many = format!("o1 sub\no1 endsub\no1 call {}", "[1]".repeat(31));
    assert_eq!(answers(&many).pop(), Some(Err(Status::OWordInvalid)));
    let deep: Vec<_> = (0..21).map(|n| format!("o{n} if [1]")).collect();
    assert_eq!(answers(&deep.join("\n")).pop(), Some(Err(Status::FlowTooDeep)));
}

#[test]
fn a_loop_of_which_a_line_is_refused_is_refused() {
    let mut machine = Machine::new();
    machine.play("o1 repeat [2]\no2 if [1]");
    assert_eq!(machine.send("G1 X[1/0]"), Err(Status::ValueUndefined));
    for line in ["G0 X1", "o2 endif", "(print,a)", "o1 endrepeat"] {
        assert_eq!(machine.send(line), Err(Status::FlowBroken), "{line}");
    }
    assert_eq!(machine.play("G0 X2\n(print,b)"), "x2 b");
    machine.play("o1 repeat [2]");
    assert!(machine.send("G1 X[1/0]").is_err());
    assert_eq!(machine.play("M2\n(print,c)"), "c");
    assert!(machine.is_at_rest());
}

#[test]
fn a_refused_line_of_a_replay_ends_it() {
    let mut machine = Machine::new();
    machine.play("o1 sub\n#<a>=1\nG0 X[1/#2]\no1 endsub\n#1=4\no2 repeat [3]");
    assert_eq!(machine.send("o1 call [5]"), Err(Status::ValueUndefined));
    assert!(!machine.interpreter.is_replay());
    assert_eq!(machine.play("(print,%d#1)"), "4");
    assert!(machine.send("#5=#<a>").is_err());
}

#[test]
fn records_have_a_limit() {
    let line = format!("G1 X{} F100", "1".repeat(4));
    let mut machine = Machine::new();
    machine.play("o1 sub");
    let full = (0..2_000).find(|_| machine.send(&line).is_err()).expect("a limit");
    assert!(full > 100, "{full}");
    assert_eq!(machine.send(&line), Err(Status::FlowBroken));
    assert_eq!(machine.send("o1 endsub"), Err(Status::FlowBroken));
    assert_eq!(machine.send("o1 call"), Err(Status::SubUnknown));
    machine.play("G1 F100\no1 while [1]");
    let full = (0..2_000).map(|_| machine.send("G1 X1")).find(Result::is_err);
    assert_eq!(full, Some(Err(Status::RecordFull)));
    assert_eq!(machine.send("o1 endwhile"), Err(Status::FlowBroken));
    assert!(machine.is_at_rest());
    machine.play("o1 sub\nG1 X1\no1 endsub\no1 call");
    machine.play("M2");
    for n in 0..24 {
        machine.play(&format!("o{n} sub\nG0 X{n} (note)\no{n} endsub"));
    }
    for (line, status) in [
        ("o24 sub", Status::RecordFull),
        ("G0 X1", Status::FlowBroken),
        ("o24 endsub", Status::FlowBroken),
    ] {
        assert_eq!(machine.send(line), Err(status), "{line}");
    }
    assert_eq!(machine.play("o19 call\no3 call"), "x19 x3");
    machine.play("M30");
    assert_eq!(machine.send("o3 call"), Err(Status::SubUnknown));
}

#[test]
fn endless_loops_go_on_line_by_line_and_can_be_ended() {
    let mut machine = Machine::new();
    machine.play("o1 sub\no2 while [1]\n#1=[#1+1]\no2 endwhile\no1 endsub");
    assert_eq!(machine.send("o1 call"), Err(Status::Terminated));
    assert!(machine.interpreter.is_replay());
    machine.interpreter.end_flow();
    assert!(machine.is_at_rest());
    assert_eq!(machine.play("(print,%d#1 #<_call_level>)"), "0 0");
    let end = "o1 sub\nM2\n(print,never)\no1 endsub\no3 repeat [2]\no1 call\n(print,a)";
    let mut machine = Machine::new();
    assert_eq!(machine.play(end), "a");
    assert_eq!(machine.send("o3 endrepeat"), Err(Status::OWordInvalid));
}
