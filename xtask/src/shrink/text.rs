//! The parsed assembler text of a whole program: its functions, line by line, and the text around them.

use std::collections::{BTreeSet, HashSet};

use super::dialect;

/// Prefix of the additional symbols of functions whose address is taken.
pub const TAKEN: &str = "__taken_";

/// One line of a function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Line {
    /// An instruction that the compiler made.
    Insn(Insn),
    /// A label that branches go to.
    Label(String),
    /// A line of inline assembler. No pass changes it.
    Fixed(String),
    /// A line that makes no code: directives, labels and source positions for a debugger.
    Note(String),
}

/// An instruction.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Insn {
    /// The mnemonic, such as `brne`.
    pub op: String,
    /// The operands as written, such as `r28, 61`.
    pub args: String,
}

impl Insn {
    /// Makes an instruction from a string such as `push r2`, for code that the passes make.
    pub fn new(text: &str) -> Insn {
        let (op, args) = text.trim().split_once(char::is_whitespace).unwrap_or((text.trim(), ""));
        Insn { op: op.to_owned(), args: args.trim().to_owned() }
    }

    /// Most bytes that it takes.
    pub fn size(&self) -> usize {
        match self.op.as_str() {
            "call" | "jmp" | "lds" | "sts" => 4,
            _ => 2,
        }
    }

    /// Whether the next instruction may not be the one that follows in the text.
    pub fn is_jump(&self) -> bool {
        self.is_branch()
            || matches!(self.op.as_str(), "rjmp" | "jmp" | "ijmp" | "eijmp" | "ret" | "reti")
            || self.is_skip()
    }

    /// Whether it is a branch on a flag.
    pub fn is_branch(&self) -> bool {
        self.op.starts_with("br") && self.op != "break"
    }

    /// Whether it may skip the next instruction.
    pub fn is_skip(&self) -> bool {
        matches!(self.op.as_str(), "sbrc" | "sbrs" | "sbic" | "sbis" | "cpse")
    }
}

/// A function, in a section of its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Function {
    /// Its symbol.
    pub name: String,
    /// Its lines, from the directive of its section to the directive of its size.
    pub lines: Vec<Line>,
}

impl Function {
    /// A function that a pass makes.
    pub fn new(name: &str, code: &[Insn]) -> Function {
        let notes = [
            format!("\t.section\t.text.{name},\"ax\",@progbits"),
            "\t.p2align\t1".into(),
            format!("\t.type\t{name},@function"),
            format!("{name}:"),
        ];
        let size = Line::Note(format!("\t.size\t{name}, .-{name}"));
        let code = code.iter().cloned().map(Line::Insn);
        let lines = notes.into_iter().map(Line::Note).chain(code).chain([size]).collect();
        Function { name: name.into(), lines }
    }

    /// Returns its instructions.
    pub fn insns(&self) -> impl Iterator<Item = &Insn> {
        self.lines.iter().filter_map(|line| match line {
            Line::Insn(insn) => Some(insn),
            _ => None,
        })
    }

    /// Returns the lines that make code, and labels.
    pub fn code(&self) -> impl Iterator<Item = &Line> {
        self.lines.iter().filter(|line| !matches!(line, Line::Note(_)))
    }

    /// The lines of inline assembler.
    pub fn fixed(&self) -> impl Iterator<Item = &str> {
        self.lines.iter().filter_map(|line| match line {
            Line::Fixed(text) => Some(text.as_str()),
            _ => None,
        })
    }
}

/// A program.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Program {
    /// Definitions, and names of source files. They stand before all code.
    pub head: Vec<String>,
    /// The functions in the order in which they will stand in flash.
    pub functions: Vec<Function>,
    /// Data, start-up code, and debug information.
    pub rest: Vec<String>,
}

impl Program {
    /// Parses the text as LLVM writes it.
    pub fn parse(text: &str) -> Program {
        let mut reader = Reader::default();
        text.lines().for_each(|line| reader.line(line));
        reader.finish()
    }

    /// Returns the text for the assembler.
    pub fn text(&self) -> String {
        let mut text = String::new();
        let mut line = |line: &str| {
            text.push_str(line);
            text.push('\n');
        };
        self.head.iter().for_each(|head| line(head));
        self.functions.iter().flat_map(|function| &function.lines).for_each(|code| match code {
            Line::Insn(insn) => line(&format!("\t{}\t{}", insn.op, insn.args)),
            Line::Label(label) => line(&format!("{label}:")),
            Line::Fixed(text) | Line::Note(text) => line(text),
        });
        line("\t.text");
        self.rest.iter().for_each(|rest| line(rest));
        for (number, name) in self.taken().into_iter().enumerate() {
            line(&format!("{TAKEN}{number} = {name}"));
        }
        text
    }

    /// Returns the words outside calls and jumps. Functions that they name may be called from elsewhere.
    pub fn names_elsewhere(&self) -> HashSet<String> {
        let fixed = self.functions.iter().flat_map(Function::fixed);
        let around = self.head.iter().chain(&self.rest).map(String::as_str);
        let around = around.filter(|line| !names_nothing(line) && address(line).is_none());
        let operands = self.functions.iter().flat_map(Function::insns);
        let operands = operands.filter(|insn| insn.op != "call" && insn.op != "jmp");
        let operands = operands.map(|insn| insn.args.as_str());
        let operands = operands.filter(|args| address(args).is_none());
        let lines = fixed.chain(around).chain(operands);
        let is_name = |c: char| c.is_alphanumeric() || "_.$".contains(c);
        lines.flat_map(|line| line.split(|c| !is_name(c))).map(str::to_owned).collect()
    }

    /// Returns the functions whose address is taken. The image does not show that, so the analysis of the stack finds
    /// them by additional symbols.
    pub fn taken(&self) -> BTreeSet<&str> {
        let code = self
            .functions
            .iter()
            .flat_map(|function| function.insns())
            .map(|insn| insn.args.as_str());
        let words =
            code.chain(self.rest.iter().map(String::as_str).filter(|line| line.starts_with('\t')));
        words.filter_map(address).collect()
    }
}

/// Returns the function whose address a line takes.
fn address(line: &str) -> Option<&str> {
    let (before, inside) = line.rsplit_once('(')?;
    let is_address = before.ends_with("gs") || before.ends_with("pm");
    is_address.then(|| inside.split(')').next())?
}

/// Returns a text without debug information, which is two thirds of it, and of the time in which it is assembled and
/// linked.
pub fn without_debug(text: &str) -> String {
    let mut is_debug = false;
    let mut is_code = |line: &str| {
        let line = line.trim_start();
        if line.starts_with(".section") || line == ".text" {
            is_debug = line.contains(".debug_");
        }
        !is_debug && !line.starts_with(".loc\t")
    };
    let lines = text.split_inclusive('\n').filter(|line| is_code(line.trim_end()));
    lines.collect()
}

/// Whether a directive only tells a debugger or the linker about a name, or holds text.
fn names_nothing(line: &str) -> bool {
    const DIRECTIVES: [&str; 5] = [".asciz", ".ascii", ".size", ".type", ".section"];
    let word = line.split_whitespace().next();
    word.is_some_and(|word| DIRECTIVES.contains(&word))
}

/// The state of the reader.
#[derive(Default)]
struct Reader {
    program: Program,
    /// The function that is being read.
    function: Option<Function>,
    /// Whether the line is inline assembler, between `;APP` and `;NO_APP`.
    in_source: bool,
}

impl Reader {
    fn line(&mut self, line: &str) {
        let line = dialect::translate(line);
        let word = line.split_whitespace().next().unwrap_or("");
        if word == ".section" && !self.in_source {
            self.end_function();
            self.begin_section(&line);
        }
        // Numbers of source files must be defined before their first use, which another order of functions may
        // change. So they go to the head.
        if word == ".file" {
            return self.program.head.push(line.into_owned());
        }
        let Some(function) = &mut self.function else {
            let is_head = self.program.functions.is_empty()
                && self.program.rest.is_empty()
                && !line.starts_with('\t');
            let place = if is_head { &mut self.program.head } else { &mut self.program.rest };
            return place.push(line.into_owned());
        };
        if word == ".type" && function.name.is_empty() {
            let name = line.split_whitespace().nth(1).and_then(|word| word.split(',').next());
            function.name = name.unwrap_or("").into();
        }
        self.in_source = match word {
            ";APP" => true,
            ";NO_APP" => false,
            _ => self.in_source,
        };
        function.lines.push(parse_line(&line, self.in_source));
        if word == ".size" && !self.in_source {
            self.end_function();
        }
    }

    fn begin_section(&mut self, line: &str) {
        if line.contains("\t.text.") {
            self.function = Some(Function { name: String::new(), lines: Vec::new() });
        }
    }

    /// A section without a named function is no function.
    fn end_function(&mut self) {
        let Some(function) = self.function.take() else { return };
        if function.name.is_empty() {
            let text = |line: Line| match line {
                Line::Insn(insn) => format!("\t{}\t{}", insn.op, insn.args),
                Line::Label(label) => format!("{label}:"),
                Line::Fixed(text) | Line::Note(text) => text,
            };
            return self.program.rest.extend(function.lines.into_iter().map(text));
        }
        self.program.functions.push(function);
    }

    fn finish(mut self) -> Program {
        self.end_function();
        self.program
    }
}

/// Labels that only debug information uses.
const FOR_DEBUGGERS: [&str; 3] = [".Ltmp", ".Lfunc_begin", ".Lfunc_end"];

fn parse_line(line: &str, in_source: bool) -> Line {
    let code = line.trim();
    if code.is_empty() || code.starts_with(';') {
        return Line::Note(line.into());
    }
    if in_source {
        return Line::Fixed(line.into());
    }
    match code.strip_suffix(':') {
        Some(label)
            if label.starts_with(".L")
                && !FOR_DEBUGGERS.iter().any(|prefix| label.starts_with(prefix)) =>
        {
            Line::Label(label.into())
        }
        Some(_) => Line::Note(line.into()),
        None if code.starts_with('.') => Line::Note(line.into()),
        None => Line::Insn(Insn::new(code)),
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// Returns the text of functions as LLVM writes it.
    pub fn text(functions: &[(&str, &str)]) -> String {
        let function = |(name, code): &(&str, &str)| {
            let code: String = code.lines().map(|line| indented(line.trim())).collect();
            format!(
                "\t.section\t.text.{name},\"ax\",@progbits\n\t.type\t{name},@function\n{name}:\n{code}\t.size\t{name}, .-{name}\n"
            )
        };
        functions.iter().map(function).collect()
    }

    fn indented(line: &str) -> String {
        if line.ends_with(':') {
            format!("{line}\n")
        } else {
            format!("\t{}\n", line.replacen(' ', "\t", 1))
        }
    }

    pub fn program(functions: &[(&str, &str)]) -> Program {
        Program::parse(&text(functions))
    }

    /// Returns the code of a function, a line for each instruction or label.
    pub fn code(program: &Program, name: &str) -> String {
        let function = program
            .functions
            .iter()
            .find(|function| function.name == name)
            .expect("the function exists");
        let line = |line: &Line| match line {
            Line::Insn(insn) => format!("{} {}", insn.op, insn.args).trim().to_owned(),
            Line::Label(label) => format!("{label}:"),
            Line::Fixed(text) | Line::Note(text) => text.trim().replace('\t', " "),
        };
        function.code().map(line).collect::<Vec<_>>().join("; ")
    }

    #[test]
    fn what_is_read_is_written_again() {
        let before = "\t.file\t1 \"/k\" \"a.rs\"\n__SREG__ = 63\n";
        let after = "\t.section\t.data.X,\"aw\",@progbits\nX:\n\t.byte\t1\n";
        let functions =
            text(&[("f", ".Ltmp0:\n.loc 1 2 3\nldi r24, 1\n.LBB0_1:\nret"), ("g", "ret")]);
        let program = Program::parse(&format!("{before}{functions}{after}"));
        assert_eq!(program.functions.len(), 2);
        assert_eq!(code(&program, "f"), "ldi r24, 1; .LBB0_1:; ret");
        let written = program.text();
        assert!(
            written.starts_with("\t.file\t1 \"/k/a.rs\"\n__SREG__ = 63\n\t.section\t.text.f"),
            "{written}"
        );
        assert!(
            written.contains(".Ltmp0:\n\t.loc\t1 2 3\n\tldi\tr24, 1\n.LBB0_1:\n\tret"),
            "{written}"
        );
        assert!(written.ends_with(after), "{written}");
        assert_eq!(Program::parse(&written).functions, program.functions);
    }

    #[test]
    fn functions_whose_address_is_taken_get_another_name() {
        let functions = text(&[
            ("f", "ldi r24, lo8_gs(g)\nldi r25, hi8_gs(g)\neicall"),
            ("g", "ret"),
            ("h", "call g"),
        ]);
        let program = Program::parse(
            &(functions + "\t.section\t.rodata.X\n\t.short\tpm(f)\n__vector_2 = pm(h)\n"),
        );
        let written = program.text();
        assert!(written.ends_with("__vector_2 = h\n__taken_0 = f\n__taken_1 = g\n"), "{written}");
    }

    #[test]
    fn assembler_of_the_source_is_known() {
        let program =
            program(&[("f", "push r2\n;APP\nsbrc r24, 1\nwait:\nrjmp wait\n;NO_APP\nret")]);
        let fixed: Vec<_> = program.functions[0].fixed().map(str::trim).collect();
        assert_eq!(fixed, ["sbrc\tr24, 1", "wait:", "rjmp\twait"]);
        assert_eq!(program.functions[0].insns().count(), 2);
    }

    #[test]
    fn a_text_without_debug_has_all_code() {
        let text = "\t.text\nf:\n\t.loc\t1 2 3\n\tret\n\t.section\t.debug_info,\"\"\n\t.long\t1\n\t.section\t.data\nv:\n";
        assert_eq!(without_debug(text), "\t.text\nf:\n\tret\n\t.section\t.data\nv:\n");
    }
}
