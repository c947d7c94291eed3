//! Parameters and expressions: random expressions against another evaluator, random lines, hostile ones, and the whole
//! firmware.

use kerf::gcode::Interpreter;
use kerf::gcode::command::Commands;
use kerf::gcode::fast_path::Writer;
use kerf::gcode::setup::Usual;
use kerf::hal::imp::Machine;
use kerf::status::Status;

use crate::seeds::try_all;

/// Random numbers.
struct Random(u64);

impl Random {
    fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x2545_F491_4F6C_DD1D)
    }

    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % end
    }

    fn of<'a>(&mut self, all: &[&'a str]) -> &'a str {
        all[self.below(all.len() as u64) as usize]
    }
}

const OPERATORS: [&[&str]; 5] = [
    &["OR", "AND", "XOR"],
    &["EQ", "NE", "GT", "GE", "LT", "LE"],
    &["+", "-"],
    &["*", "/", "MOD"],
    &["**"],
];
const FUNCTIONS: [&str; 12] =
    ["ABS", "FIX", "FUP", "ROUND", "SIN", "COS", "TAN", "EXP", "LN", "SQRT", "ASIN", "ACOS"];

/// Returns the text of a random value.
fn text(random: &mut Random, depth: u8) -> String {
    let sign = random.of(&["", "", "", "-", "+", "--"]);
    match random.below(20) {
        n if depth > 3 || n < 7 => {
            let (whole, part) = (random.below(10), random.below(1_000));
            let number = [
                format!("{whole}"),
                format!("{whole}.{part:03}"),
                format!(".{part}"),
                format!("{part}."),
                format!("#{}", 1 + random.below(3)),
                format!("#[{}+1]", random.below(3)),
            ];
            format!("{sign}{}", number[random.below(6) as usize])
        }
        7..10 => {
            let name = FUNCTIONS[random.below(12) as usize];
            format!("{sign}{name}[{}]", text(random, depth + 1))
        }
        10 => format!("ATAN[{}]/[{}]", text(random, depth + 1), text(random, depth + 1)),
        _ => {
            let mut all = text(random, depth + 1);
            for _ in 0..=random.below(4) {
                let group = OPERATORS[random.below(5) as usize];
                let blank = random.of(&["", " "]);
                all += blank;
                all += random.of(group);
                all += blank;
                all += &text(random, depth + 1);
            }
            format!("{}[{all}]", random.of(&["", "-"]))
        }
    }
}

/// The reason why a value is not compared.
#[derive(Debug, PartialEq)]
enum Why {
    /// There is none.
    Undefined,
    /// The last bit of a function would decide.
    Close,
}

/// A value, and whether its last bits depend on how functions round.
#[derive(Clone, Copy)]
struct Value {
    is: f64,
    rounded: bool,
}

type Found = Result<Value, Why>;

/// Another evaluator, which descends from rank to rank.
struct Other<'a> {
    text: &'a [u8],
    parameters: [f64; 3],
}

impl Other<'_> {
    fn eat(&mut self, word: &str) -> bool {
        let is = self.text.starts_with(word.as_bytes());
        if is {
            self.text = &self.text[word.len()..];
        }
        is
    }

    fn value(&mut self) -> Found {
        let first = self.text[0];
        let digit = |at: usize| {
            self.text.get(at).is_some_and(|byte| byte.is_ascii_digit() || *byte == b'.')
        };
        if digit(0) || (matches!(first, b'+' | b'-') && digit(1)) {
            let end = (1..self.text.len()).find(|at| !digit(*at)).unwrap_or(self.text.len());
            let number = std::str::from_utf8(&self.text[..end]).unwrap().parse().unwrap();
            self.text = &self.text[end..];
            return Ok(Value { is: number, rounded: false });
        }
        if self.eat("-") {
            return self.value().map(|value| Value { is: -value.is, ..value });
        }
        if self.eat("+") {
            return self.value();
        }
        if self.eat("#") {
            let at = self.value()?.is as usize;
            return Ok(Value { is: self.parameters[at - 1], rounded: false });
        }
        if self.eat("ATAN") {
            let y = self.brackets()?;
            assert!(self.eat("/"));
            let x = self.brackets()?;
            near(y, 0.0)?;
            return checked(y.is.atan2(x.is).to_degrees(), true);
        }
        match FUNCTIONS.iter().find(|name| self.text.starts_with(name.as_bytes())) {
            Some(name) => {
                self.eat(name);
                let x = self.brackets()?;
                function(name, x)
            }
            None => self.brackets(),
        }
    }

    fn brackets(&mut self) -> Found {
        assert!(self.eat("["));
        let value = self.rank(0)?;
        assert!(self.eat("]"));
        Ok(value)
    }

    fn rank(&mut self, rank: usize) -> Found {
        let Some(operators) = OPERATORS.get(rank) else { return self.value() };
        let mut value = self.rank(rank + 1)?;
        // `**` is no `*`.
        while let Some(name) = operators.iter().find(|name| self.text.starts_with(name.as_bytes()))
            && !(*name == "*" && self.text.starts_with(b"**"))
        {
            self.eat(name);
            let other = self.rank(rank + 1)?;
            value = operate(name, value, other)?;
        }
        Ok(value)
    }
}

fn checked(is: f64, rounded: bool) -> Found {
    if is.is_finite() { Ok(Value { is, rounded }) } else { Err(Why::Undefined) }
}

/// Refuses to compare where a value that has been rounded is next to a place where results jump.
fn near(value: Value, place: f64) -> Result<(), Why> {
    let distance = (value.is - place).abs();
    let is_close = distance < 1e-9 * value.is.abs().max(1.0);
    if value.rounded && is_close { Err(Why::Close) } else { Ok(()) }
}

fn function(name: &str, x: Value) -> Found {
    match name {
        "FIX" | "FUP" | "ROUND" => near(x, (x.is * 2.0).round() / 2.0)?,
        "ASIN" | "ACOS" => near(x, x.is.signum())?,
        "LN" | "SQRT" => near(x, 0.0)?,
        _ => {}
    }
    let angle = || (x.is % 360.0).to_radians();
    if matches!(name, "SIN" | "COS" | "TAN") && x.rounded && x.is.abs() > 1e4 {
        return Err(Why::Close);
    }
    if name == "TAN" && (x.is / 90.0).fract().abs() < 1e-6 {
        return Err(Why::Close);
    }
    let is = match name {
        "ABS" => return checked(x.is.abs(), x.rounded),
        "FIX" => x.is.floor(),
        "FUP" => x.is.ceil(),
        "ROUND" => x.is.round(),
        "SIN" => angle().sin(),
        "COS" => angle().cos(),
        "TAN" => angle().tan(),
        "EXP" => x.is.exp(),
        "LN" => x.is.ln(),
        "SQRT" => x.is.sqrt(),
        "ASIN" => x.is.asin().to_degrees(),
        "ACOS" => x.is.acos().to_degrees(),
        _ => unreachable!(),
    };
    checked(is, !matches!(name, "FIX" | "FUP" | "ROUND"))
}

fn operate(name: &str, a: Value, b: Value) -> Found {
    let rounded = a.rounded || b.rounded;
    let difference = Value { is: a.is - b.is, rounded };
    let truth = |is: bool| if is { 1.0 } else { 0.0 };
    match name {
        "EQ" | "NE" | "GE" | "LE" => {
            let close = [1e-6, -1e-6].map(|at| (difference.is - at).abs() < 1e-8);
            if close != [false; 2] {
                return Err(Why::Close);
            }
        }
        "GT" | "LT" => near(difference, 0.0)?,
        "AND" | "OR" | "XOR" | "/" => {
            near(a, 0.0)?;
            near(b, 0.0)?;
        }
        "**" => {
            near(a, 0.0)?;
            near(b, b.is.round())?;
        }
        "MOD" => {
            near(b, 0.0)?;
            near(Value { is: a.is / b.is, rounded: true }, (a.is / b.is).round())?;
        }
        _ => {}
    }
    let equal = difference.is.abs() < 1e-6;
    let is = match name {
        "+" => a.is + b.is,
        "-" => difference.is,
        "*" => a.is * b.is,
        "/" => a.is / b.is,
        "MOD" => a.is.rem_euclid(b.is),
        "**" if a.is < 0.0 && b.is.fract() != 0.0 => return Err(Why::Undefined),
        "**" => return checked(a.is.powf(b.is), true),
        "EQ" => truth(equal),
        "NE" => truth(!equal),
        "GT" => truth(a.is > b.is),
        "LT" => truth(a.is < b.is),
        "GE" => truth(equal || a.is > b.is),
        "LE" => truth(equal || a.is < b.is),
        "AND" => truth(a.is != 0.0 && b.is != 0.0),
        "OR" => truth(a.is != 0.0 || b.is != 0.0),
        "XOR" => truth((a.is != 0.0) != (b.is != 0.0)),
        _ => unreachable!(),
    };
    // What amplifies the last bits of a function is not compared.
    let lost = rounded && is.abs() < 1e-4 * a.is.abs().max(b.is.abs()) && matches!(name, "+" | "-");
    if lost || (rounded && name == "MOD") {
        return Err(Why::Close);
    }
    checked(is, rounded && !matches!(name, "EQ" | "NE" | "GT" | "LT" | "GE" | "LE"))
}

/// Compares an expression. Returns whether it could be compared.
fn compare(seed: u64) -> Result<(), String> {
    let random = &mut Random::new(seed);
    let parameters = [0.0, 1.5, -2.0];
    let (mut interpreter, mut out) = (Interpreter::new(), Commands::default());
    let mut run = |line: &str| interpreter.interpret(line.as_bytes(), &Usual, &mut out).map(drop);
    run("#2=1.5 #3=-2").unwrap();
    let all = loop {
        let all = text(random, 0);
        if all.len() < 220 {
            break all;
        }
    };
    let packed = all.replace(' ', "");
    let mut other = Other { text: packed.as_bytes(), parameters };
    let expected = other.value();
    if expected != Err(Why::Undefined) && expected.is_ok() && !other.text.is_empty() {
        return Err(format!("the test has not read {all}"));
    }
    let done = run(&format!("#4={all}"));
    let found = match done {
        Ok(()) => {
            run("(print,%.9f#4)").unwrap();
            let said = String::from_utf8(interpreter.said().into()).unwrap();
            // Numbers too long for a comment.
            if said == "######" {
                return Ok(());
            }
            Ok(said.parse::<f64>().unwrap())
        }
        Err(status) => Err(status),
    };
    match (expected, found) {
        (Err(Why::Close), Ok(_) | Err(Status::ValueUndefined)) => Ok(()),
        (Err(Why::Undefined), Err(Status::ValueUndefined)) => Ok(()),
        (Ok(value), Ok(found)) if is_same(value.is, found) => Ok(()),
        (expected, found) => {
            Err(format!("{all}: {:?}, not {found:?}", expected.map(|value| value.is)))
        }
    }
}

/// Whether values agree as far as functions may differ.
fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-7 * a.abs().max(1.0)
}

impl PartialEq for Value {
    fn eq(&self, other: &Self) -> bool {
        self.is == other.is
    }
}

impl std::fmt::Debug for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "{}", self.is)
    }
}

#[test]
fn random_expressions_have_the_values_of_another_evaluator() {
    try_all(2_000, compare);
}

/// Nearly valid lines give a result, and a refused one changes nothing.
#[test]
fn random_text_gives_a_result() {
    const PARTS: [&str; 34] = [
        "#", "#1", "#<a>", "#<_b>", "=", "[", "]", "1", "2.5", "-", "+", "*", "/", "**", "MOD",
        "EQ", "SIN", "ATAN", "EXISTS", "G", "X", "M", "N", "F", "(PRINT,", "(DEBUG,", ")", ";",
        " ", "%", "5420", "<", ">", "G1",
    ];
    try_all(2_000, |seed| {
        let random = &mut Random::new(seed);
        let (mut interpreter, mut out) = (Interpreter::new(), Commands::default());
        for _ in 0..20 {
            let mut line = random.of(&["", "#1=", "X", "G1 X[", "(print,"]).to_string();
            for _ in 0..random.below(40) {
                line += random.of(&PARTS);
            }
            let before = interpreter;
            if interpreter.interpret(line.as_bytes(), &Usual, &mut out).is_err() {
                let mut expected = before;
                expected.blame(interpreter.blamed());
                if interpreter != expected {
                    return Err(format!("{line} has changed something"));
                }
            }
        }
        Ok(())
    });
}

/// A part of a random program. Each print counts, and conditions depend on the count.
enum Part {
    Print,
    /// A condition: the label, the divisor and the remainder of the count, both branches.
    If(u32, u64, u64, Vec<Part>, Vec<Part>),
    /// A loop: the label, the passes, the body.
    Repeat(u32, u64, Vec<Part>),
    While(u32, u64, Vec<Part>),
    Do(u32, u64, Vec<Part>),
    Call(usize),
    /// Leaves the loop of a label, or goes on with its next pass.
    Leave(u32, bool),
    Return,
}

/// How a body has ended in the model.
#[derive(Clone, Copy, PartialEq)]
enum End {
    Usual,
    Leave(u32, bool),
    Return,
    /// There is too much to run.
    Late,
}

struct Maker {
    random: Random,
    label: u32,
    subs: usize,
    in_sub: bool,
}

impl Maker {
    fn body(&mut self, depth: u8, loops: &mut Vec<u32>) -> Vec<Part> {
        (0..1 + self.random.below(3)).map(|_| self.part(depth, loops)).collect()
    }

    fn part(&mut self, depth: u8, loops: &mut Vec<u32>) -> Part {
        self.label += 1;
        let (label, count) = (self.label, self.random.below(4));
        match self.random.below(12) {
            _ if depth == 0 => Part::Print,
            0..3 => {
                let (by, rest) = (2 + self.random.below(3), self.random.below(2));
                Part::If(label, by, rest, self.body(depth - 1, loops), self.body(depth - 1, loops))
            }
            3 => Part::Repeat(label, count, self.body(depth - 1, loops)),
            4..6 => {
                loops.push(label);
                let body = self.body(depth - 1, loops);
                loops.pop();
                if count % 2 == 0 { Part::While(label, 3, body) } else { Part::Do(label, 2, body) }
            }
            6 if self.subs > 0 => Part::Call(self.random.below(self.subs as u64) as usize),
            7 if !loops.is_empty() && depth < 3 => {
                let of = loops[self.random.below(loops.len() as u64) as usize];
                Part::Leave(of, count > 1)
            }
            8 if self.in_sub && depth < 3 => Part::Return,
            _ => Part::Print,
        }
    }
}

/// Writes the lines of a body.
fn write(body: &[Part], out: &mut Vec<String>) {
    for part in body {
        match part {
            Part::Print => out.push("#50 = [#50 + 1] (print,%d#50)".into()),
            Part::If(label, by, rest, yes, no) => {
                out.push(format!("o{label} if [#50 MOD {by} EQ {rest}] (note)"));
                write(yes, out);
                out.push(format!("O{label} ELSE"));
                write(no, out);
                out.push(format!("o{label} endif"));
            }
            Part::Repeat(label, count, body) => {
                out.push(format!("o{label} repeat [{count}]"));
                write(body, out);
                out.push(format!("o{label} endrepeat"));
            }
            Part::While(label, passes, body) => {
                out.push(format!("#<c{label}>=0"));
                out.push(format!("o<{label}> while [#<c{label}> LT {passes}]"));
                out.push(format!("#<c{label}>=[#<c{label}>+1]"));
                write(body, out);
                out.push(format!("o<{label}> endwhile"));
            }
            Part::Do(label, passes, body) => {
                out.push(format!("#<c{label}>=0"));
                out.push(format!("o<{label}> do"));
                out.push(format!("#<c{label}>=[#<c{label}>+1]"));
                write(body, out);
                out.push(format!("o<{label}> while [#<c{label}> LT {passes}]"));
            }
            Part::Call(sub) => out.push(format!("o<sub{sub}> call")),
            Part::Leave(label, true) => out.push(format!("o<{label}> break")),
            Part::Leave(label, false) => out.push(format!("o<{label}> continue")),
            Part::Return => out.push("o<sub> return".into()),
        }
    }
}

/// Runs a body in the model. `count` is the number of prints.
fn run(body: &[Part], subs: &[Vec<Part>], count: &mut u64) -> End {
    for part in body {
        let end = match part {
            _ if *count > 150 => End::Late,
            Part::Print => {
                *count += 1;
                End::Usual
            }
            Part::If(_, by, rest, yes, no) => {
                run(if *count % by == *rest { yes } else { no }, subs, count)
            }
            Part::Repeat(_, passes, body) => {
                let ends = (0..*passes).map(|_| run(body, subs, count));
                ends.into_iter().find(|end| *end != End::Usual).unwrap_or(End::Usual)
            }
            Part::While(label, passes, body) | Part::Do(label, passes, body) => {
                let mut ended = End::Usual;
                for _ in 0..*passes {
                    match run(body, subs, count) {
                        End::Leave(of, true) if of == *label => break,
                        End::Leave(of, false) if of == *label => {}
                        End::Usual => {}
                        end => {
                            ended = end;
                            break;
                        }
                    }
                }
                ended
            }
            Part::Call(sub) => match run(&subs[*sub], subs, count) {
                End::Late => End::Late,
                _ => End::Usual,
            },
            Part::Leave(label, leaves) => End::Leave(*label, *leaves),
            Part::Return => End::Return,
        };
        if end != End::Usual {
            return end;
        }
    }
    End::Usual
}

/// Compares a random program with the model.
fn compare_program(seed: u64) -> Result<(), String> {
    let mut maker = Maker { random: Random::new(seed), label: 0, subs: 0, in_sub: true };
    let mut subs = Vec::new();
    for _ in 0..maker.random.below(4) {
        subs.push(maker.body(2, &mut Vec::new()));
        maker.subs += 1;
    }
    maker.in_sub = false;
    let main: Vec<_> = (0..4).map(|_| maker.part(3, &mut Vec::new())).collect();
    let (mut lines, mut expected) = (vec![String::from("#50=0")], 0);
    for (n, body) in subs.iter().enumerate() {
        lines.push(format!("o<sub{n}> sub"));
        write(body, &mut lines);
        lines.push(format!("o<sub{n}> endsub"));
    }
    write(&main, &mut lines);
    if run(&main, &subs, &mut expected) == End::Late || lines.concat().len() > 4_000 {
        return Ok(());
    }
    let (mut interpreter, mut out, mut heard) = (Interpreter::new(), Commands::default(), 0);
    for line in &lines {
        loop {
            if let Err(status) = interpreter.interpret(line.as_bytes(), &Usual, &mut out) {
                return Err(format!("{line}: {status:?} in\n{}", lines.join("\n")));
            }
            if !interpreter.said().is_empty() {
                heard += 1;
                if interpreter.said() != format!("{heard}").as_bytes() {
                    return Err(format!("{line}: another count in\n{}", lines.join("\n")));
                }
                interpreter.hush();
            }
            if !interpreter.is_replay() {
                break;
            }
        }
    }
    let rests = interpreter.fast_path(b"G0X1", Writer::Numbers, &Usual, &mut out);
    match heard == expected && rests {
        true => Ok(()),
        false => Err(format!("{heard} and not {expected}, {rests}, in\n{}", lines.join("\n"))),
    }
}

#[test]
fn random_programs_run_as_a_model_says() {
    try_all(2_000, compare_program);
}

/// The firmware, with lines that are to take as much room and time as lines can.
#[test]
fn hostile_lines_are_answered() {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    let ask = |line: &str| {
        machine.send(line.as_bytes());
        machine.send(b"\n");
        machine.run_ms(300);
        String::from_utf8(machine.received()).expect("ASCII")
    };
    ask("{}");
    let long = |start: &str, part: &str| {
        [start, &part.repeat(250usize.saturating_sub(start.len()) / part.len())].concat()
    };
    for (line, number) in [
        (long("#1=", "["), 191),
        (long("#1=", "-"), 191),
        (long("", "#"), 191),
        (long("#1=", "SIN["), 191),
        (long("#1=", "ATAN["), 191),
        (long("#1=", "9"), 0),
        (long("#1=0.", "9"), 0),
        (long("", "#1=2"), 189),
        (long("#1=[1", "**1"), 190),
        (long("#<", "a"), 190),
        (long("(print,", "#1"), 0),
        (long("(print,", "%.9f#1"), 0),
    ] {
        let answer = ask(&line);
        assert!(answer.contains(&format!("\"f\":[1,{number},")), "{line}: {answer}");
    }
    for n in 0..40 {
        let answer = ask(&(long(&format!("#<{n}"), "x") + ">=1"));
        assert!(answer.contains("\"f\":[1,0,") || answer.contains("\"f\":[1,189,"), "{answer}");
    }
    assert!(ask("g0 x[#1]").contains("\"f\":[1,0,"));
}
