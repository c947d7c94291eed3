//! Whole lines with parameters and expressions.

use super::super::command::{Commands, Motion};
use super::super::interpreter::Interpreter;
use super::super::setup::Usual;
use super::parameters::{NAMED, NUMBERED};
use crate::status::Status;
use std::boxed::Box;
use std::format;
use std::string::String;

/// An interpreter, and what its last line has commanded.
struct Machine(Box<Interpreter>, Commands);

impl Machine {
    fn new() -> Self {
        Self(Box::default(), Commands::default())
    }

    /// Runs a line. Checks that a refused line changes nothing.
    fn line(&mut self, line: &str) -> Result<(), Status> {
        let before = self.0.clone();
        let done = self.0.interpret(line.as_bytes(), &Usual, &mut self.1).map(drop);
        assert!(done.is_ok() || (self.0 == before && self.1 == Commands::default()), "{line}");
        done
    }

    /// Runs lines, and returns what the last one has told.
    fn say(&mut self, lines: &[&str]) -> String {
        for line in lines {
            assert_eq!(self.line(line), Ok(()), "{line}");
        }
        String::from_utf8(self.0.said().into()).unwrap()
    }

    /// Returns a value as text.
    fn value(&mut self, value: &str) -> String {
        self.say(&[&format!("#1={value}"), "(print,#1)"])
    }
}

/// Returns what the last of these lines tells.
fn said(lines: &[&str]) -> String {
    Machine::new().say(lines)
}

/// Returns the status with which the last of these lines is refused.
fn refusal(lines: &[&str]) -> Status {
    let mut machine = Machine::new();
    let (last, before) = lines.split_last().unwrap();
    machine.say(before);
    machine.line(last).expect_err(last)
}

/// Returns the position after these lines, in units.
fn position(lines: &[&str]) -> [i32; 3] {
    let mut machine = Machine::new();
    machine.say(lines);
    let place = machine.0.position();
    [place[0].0, place[1].0, place[2].0]
}

#[test]
fn operators_and_their_ranks() {
    let mut machine = Machine::new();
    for (value, expected) in [
        ("[2**3**2]", "64"),
        ("[-2**2]", "4"),
        ("[0-2**2]", "-4"),
        ("[2**-1]", "0.5"),
        ("[2+3*4-6/3]", "12"),
        ("[1 OR 1 AND 0]", "0"),
        ("[1 OR [1 AND 0]]", "1"),
        ("[1 XOR 1 OR 1]", "1"),
        ("[1 AND 2 GT 1]", "1"),
        ("[1 LT 2 LT 3]", "1"),
        ("[5 MOD 3 * 2]", "4"),
        ("[10-4-3]", "3"),
        ("[24/4/2]", "3"),
        ("[9+8*7/6+5-4*3**2+1]", "-11.666667"),
        ("[-7 MOD 3]", "2"),
        ("[7 mod -3]", "1"),
        ("[-7MOD-3]", "2"),
        ("[-0.5 MOD 0.2]", "0.1"),
        ("[0.5 AND 2]", "1"),
        ("[0 XOR 0.1]", "1"),
        ("[0**0]", "1"),
        ("[-8**3]", "-512"),
        ("[1--SIN[30]]", "1.5"),
        ("--3", "3"),
        ("- [ 3 ]", "-3"),
        ("[0.1+0.2 EQ 0.3]", "1"),
        ("[1 EQ 1.000002]", "0"),
        ("[1.0000005 GT 1]", "1"),
        ("[1.0000005 LE 1]", "1"),
        ("[1 NE 1.0000005]", "0"),
    ] {
        let expected: f64 = expected.parse().unwrap();
        assert_eq!(machine.value(value), format!("{expected:.6}"), "{value}");
    }
}

#[test]
fn functions() {
    let mut machine = Machine::new();
    for (value, expected) in [
        ("FIX[-2.8]", "-3"),
        ("FUP[-2.8]", "-2"),
        ("ROUND[2.5]", "3"),
        ("ROUND[-2.5]", "-3"),
        ("ROUND[3000000000.4]", "3000000000"),
        ("ATAN[1]/[0]", "90"),
        ("ATAN[0]/[-1]", "180"),
        ("ATAN[-0]/[-1]", "-180"),
        ("ATAN[0]/[0]", "0"),
        ("[ATAN[1]/[1]/5]", "9"),
        ("sin[390]", "0.5"),
        ("COS[60]", "0.5"),
        ("TAN[45]", "1"),
        ("ASIN[0.5]", "30"),
        ("ACOS[-1]", "180"),
        ("EXP[1]", "2.718282"),
        ("LN[10]", "2.302585"),
        ("SQRT[2]", "1.414214"),
        ("ABS[-3.5]", "3.5"),
        ("[SQRT[ABS[-16]]**2]", "16"),
        ("-SIN[30]", "-0.5"),
    ] {
        let expected: f64 = expected.parse().unwrap();
        assert_eq!(machine.value(value), format!("{expected:.6}"), "{value}");
    }
}

#[test]
fn all_is_read_before_anything_is_assigned() {
    assert_eq!(said(&["#1=5", "#1=10 #2=#1", "(print,%d#1 #2)"]), "10 5");
    assert_eq!(said(&["#3=1 #3=2 #3=3", "(print,%d#3)"]), "3");
    assert_eq!(said(&["#4=7 G0 X#4 (print,%d#4)"]), "7");
    assert_eq!(position(&["#4=7 G0 X#4 Y3"]), [0, 30_000, 0]);
    assert_eq!(said(&["#<a>=1 #<b>=#<a>", "(print,%d#<b>)"]), "0");
    assert_eq!(said(&["#<a>=1", "#<b>=#<a> #<a>=2", "(print,%d#<a> #<b>)"]), "2 1");
}

#[test]
fn parameters_name_parameters() {
    assert_eq!(said(&["#2=31 #31=32", "##2=7", "(print,%d#31)"]), "7");
    assert_eq!(said(&["#2=31 #31=32", "###2=8", "(print,%d#32)"]), "8");
    assert_eq!(said(&["#1=2", "#[#1]=3 #[#1+1]=4", "(print,%d#2 #3)"]), "3 4");
    assert_eq!(position(&["#1=2 #2=3", "G0 X#1 Y##1 Z-##1"]), [20_000, 30_000, -30_000]);
    assert_eq!(said(&["#1.00005=6 #[2*0.99996]=5", "(print,%d#1 #2)"]), "6 5");
    let all = ["#<P a R am>=4", "#1=EXISTS[#<PARAM>] #2=EXISTS[#<none>] #3=EXISTS[#5601]"];
    assert_eq!(said(&[all[0], all[1], "#4=EXISTS[#6000]", "(print,%d#1#2#3#4)"]), "1010");
}

#[test]
fn words_and_codes_are_computed() {
    assert_eq!(position(&["G0 X-SQRT[4] Y+[1+1] Z--3"]), [-20_000, 20_000, 30_000]);
    assert_eq!(position(&["#1=3", "g0XABS[-1]YSIN[90]Z#1"]), [10_000, 10_000, 30_000]);
    assert_eq!(position(&["#1=1 #2=59.1", "G#1 X1 F[50+50]", "G[2*0.5] X2", "G#2"])[0], 20_000);
    let mut machine = Machine::new();
    machine.say(&["#2=59.1", "G#2"]);
    assert_eq!(machine.0.coordinate_system(), 7);
    machine.say(&["G[54.9999]", "M[3+0] S[2*50]", "T[2.99995]"]);
    assert_eq!((machine.0.coordinate_system(), machine.0.selected_tool()), (2, 3));
    assert_eq!(position(&["#1=1", "G0 X[#1/3] Y1"]), [3_333, 10_000, 0]);
    // A thousand times a third of a millimetre.
    let mut machine = Machine::new();
    machine.say(&["G91 G0", "#1=1"]);
    (0..1_000).for_each(|_| drop(machine.say(&["X[#1/3]"])));
    assert_eq!(machine.0.position()[0].0, 3_333_333);
}

#[test]
fn the_state_of_the_machine_is_read() {
    let modes =
        "(print,%d#<_metric>#<_imperial> #<_plane> #<_coord_system> #<_motion_mode> #<_flood>)";
    assert_eq!(said(&["G20 G18 G55 M8", modes]), "01 180 550 800 1");
    assert_eq!(said(&["G59.3 G2 X1 I0.5 F100", modes]), "10 170 593 20 0");
    assert_eq!(said(&["G0 X25.4 Y50.8", "G20 (print,%d#5420 #5421)"]), "25 51");
    assert_eq!(said(&["G0 X25.4", "G20", "(print,%d#5420 #<_x> #5021)"]), "1 1 1");
    assert_eq!(said(&["G0 X5", "G92 X1", "(print,%d#5420 #5021 #5211 #5210)"]), "1 5 4 1");
    assert_eq!(said(&["G10 L2 P2 X3", "(print,%d#5241 #5220)"]), "3 1");
    assert_eq!(said(&["G10 L1 P2 Z3", "T2 M6", "G43", "(print,%d#5403 #5400 #5083)"]), "3 2 3");
    assert_eq!(said(&["F100", "G20", "(print,#<_feed>)"]), "3.937008");
    assert_eq!(said(&["G7 G0 X10", "(print,%d#5420)"]), "10");
    assert_eq!(said(&["G0 X5", "G28.1", "(print,%d#5161)"]), "5");
}

#[test]
fn comments_tell_values() {
    assert_eq!(said(&["(print,a)(print,b)"]), "b");
    assert_eq!(said(&["(print,a)(plain)"]), "");
    assert_eq!(said(&["G0 X1 ; (print,a)"]), "");
    assert_eq!(said(&["G0 X1 #1=2 (debug,%d#1)"]), "2");
    assert_eq!(said(&["#5599=0", "(debug,a)"]), "");
    assert_eq!(said(&["#5599=0", "(print,a)"]), "a");
    assert_eq!(said(&["/ (print,a)"]), "");
    let mut machine = Machine::new();
    machine.say(&["(print,a)"]);
    machine.0.hush();
    assert!(machine.0.said().is_empty());
}

#[test]
fn refused_lines_have_their_reasons() {
    for (line, status) in [
        ("#5420=1", Status::ParameterReadOnly),
        ("#5221=1", Status::ParameterReadOnly),
        ("#<_flood>=1", Status::ParameterReadOnly),
        ("#1=#<nope>", Status::ParameterUnknown),
        ("#5602=1", Status::ParameterInvalid),
        ("#0=1", Status::ParameterInvalid),
        ("#-1=1", Status::ParameterInvalid),
        ("#1=#0", Status::ParameterInvalid),
        ("#1.5=1", Status::ParameterInvalid),
        ("#1=##2", Status::ParameterInvalid),
        ("#1=[1/0]", Status::ValueUndefined),
        ("#1=[1/-0]", Status::ValueUndefined),
        ("#1=[5 MOD 0]", Status::ValueUndefined),
        ("#1=[-8**[1/3]]", Status::ValueUndefined),
        ("#1=[0**-1]", Status::ValueUndefined),
        ("#1=ACOS[1.0000001]", Status::ValueUndefined),
        ("#1=ASIN[-2]", Status::ValueUndefined),
        ("#1=SQRT[-1]", Status::ValueUndefined),
        ("#1=LN[0]", Status::ValueUndefined),
        ("#1=EXP[1000]", Status::ValueUndefined),
        ("#1=[10**300*10**300]", Status::ValueUndefined),
        ("#1", Status::ExpressionInvalid),
        ("#1=", Status::ExpressionInvalid),
        ("#<a=1", Status::ExpressionInvalid),
        ("#< >=1", Status::ExpressionInvalid),
        ("#1=[1", Status::ExpressionInvalid),
        ("#1=[]", Status::ExpressionInvalid),
        ("#1=[1+]", Status::ExpressionInvalid),
        ("#1=[1e-9]", Status::ExpressionInvalid),
        ("#1=[MOD 2]", Status::ExpressionInvalid),
        ("#1=SIN30", Status::ExpressionInvalid),
        ("#1=FOO[1]", Status::ExpressionInvalid),
        ("#1=ATAN[1]", Status::ExpressionInvalid),
        ("#1=ATAN[1]*[2]", Status::ExpressionInvalid),
        ("#1=EXISTS[1]", Status::ExpressionInvalid),
        ("#1=EXISTS[#1+1]", Status::ExpressionInvalid),
        ("#1=1]", Status::MalformedCommand),
        ("#1=2 G0 X#1+2", Status::MalformedCommand),
        ("N[1] G0", Status::BadNumber),
        ("#1=1 G0 X", Status::BadNumber),
        ("G[54.15]", Status::GcodeUnsupported),
        ("G0 X[10**9]", Status::OutOfRange),
        ("G0 X[10**10]", Status::OutOfRange),
        ("#1=1 G0 X1 X2", Status::WordRepeated),
        ("#1=1 U2", Status::GcodeUnsupported),
    ] {
        assert_eq!(refusal(&[line]), status, "{line}");
    }
}

#[test]
fn hostile_lines_are_refused() {
    let nested = |depth: usize| ["#1=", &"[".repeat(depth), "1", &"]".repeat(depth)].concat();
    assert_eq!(Machine::new().line(&nested(16)), Ok(()));
    assert_eq!(refusal(&[&nested(17)]), Status::ExpressionTooDeep);
    assert_eq!(refusal(&[&nested(125)]), Status::ExpressionTooDeep);
    assert_eq!(refusal(&[&["#1=", &"[".repeat(250)].concat()]), Status::ExpressionTooDeep);
    assert_eq!(refusal(&[&["#1=", &"-".repeat(250), "#1"].concat()]), Status::ExpressionTooDeep);
    assert_eq!(refusal(&[&"#".repeat(254)]), Status::ExpressionTooDeep);
    assert_eq!(Machine::new().line(&["#1=", &"9".repeat(250)].concat()), Ok(()));
    assert_eq!(refusal(&[&["G0 X[", &"9".repeat(240), "]"].concat()]), Status::OutOfRange);
    // With every rank waiting in each bracket.
    let deep = ["#1=", &"[1 OR 1 EQ 1+1*1**".repeat(13), "1", &"]".repeat(13)].concat();
    assert_eq!(Machine::new().line(&deep), Ok(()), "{}", deep.len());
}

#[test]
fn full_stores_refuse_more() {
    let mut machine = Machine::new();
    for number in 0..NUMBERED as u16 {
        machine.say(&[&format!("#{}=1", 31 + number)]);
    }
    assert_eq!(machine.line("#4000=1"), Err(Status::ParametersFull));
    machine.say(&["#31=2", "#30=5", "#4000=0", "#32=0", "#4000=1"]);
    for name in 0..NAMED {
        machine.say(&[&format!("#<n{name}>=1")]);
    }
    assert_eq!(machine.line("#<other>=1 G0 X5"), Err(Status::ParametersFull));
    assert_eq!(machine.0.position()[0].0, 0);
    machine.say(&["#<n5>=2"]);
    let mut machine = Machine::new();
    for name in 0..3 {
        machine.say(&[&format!("#<{name}{}>=1", "x".repeat(240))]);
    }
    assert_eq!(machine.line(&format!("#<7{}>=1", "x".repeat(240))), Err(Status::ParametersFull));
}

#[test]
fn plain_lines_do_as_before() {
    let mut machine = Machine::new();
    machine.say(&["G0 X1 (a)", "%", "O100 (part)", "(MSG, #1 [2])", "%prog #1"]);
    let (mut plain, mut out) = (Interpreter::new(), Commands::default());
    plain.interpret(b"G1 F100 X0.1 Y0.2", &Usual, &mut out).unwrap();
    let first = out.motion;
    let mut other = Machine::new();
    other.say(&["#1=0.2 G1 F[50*2] X0.1 Y0.2"]);
    assert!(matches!(first, Motion::Feed { .. }) && first == other.1.motion);
}
