//! The dependencies within `src`, computed from the sources and compared with the table of layers in ARCHITECTURE.md.
//!
//! A **unit** is a folder of `src`, or a file of `src` outside these folders. A unit uses every path of its code,
//! tests excepted, that begins with `crate::` or that leads out of the unit by `super::`. The table's third column
//! lists the paths that the units of the first column may use. A path stands for everything below it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::process::root;
use crate::sources::rust_files;

/// Files in a folder that are a unit of their own: the beginnings of their paths, and the name of the unit.
const APART: [(&str, &str); 6] = [
    ("hal/primitives", "primitives"),
    ("hal/progmem", "primitives"),
    ("hal/avr/PRIMITIVE", "primitives"),
    ("hal/host/PRIMITIVE", "primitives"),
    ("hal/rp2040/PRIMITIVE", "primitives"),
    ("gcode/codes/docs", "docs"),
];
/// The bottom of `hal`: modules for arithmetic or for reading flash, which touch no register.
const PRIMITIVES: [&str; 4] = ["arithmetic", "flash", "float", "text"];
/// Macros of these modules, which are at the root of the crate.
const MACROS: [&str; 5] = ["flash_bytes", "named", "plain", "progmem", "text"];
/// Units that are no layers: they put the others together.
const ENTRIES: [&str; 2] = ["lib", "main"];

/// A path that is used, as words.
type Used = Vec<String>;

/// For each unit, the paths that it uses, each with a file that uses it.
type Uses = BTreeMap<String, BTreeMap<String, String>>;

/// Returns code without comments, strings and characters.
fn code(text: &str) -> String {
    let (mut code, mut rest) = (String::new(), text);
    while let Some(c) = rest.chars().next() {
        let skipped = match c {
            '/' if rest.starts_with("//") => rest.find('\n').unwrap_or(rest.len()),
            '/' if rest.starts_with("/*") => rest.find("*/").map_or(rest.len(), |end| end + 2),
            '"' => string(rest),
            'r' if raw(rest).is_some() && !code.ends_with(is_word) => raw(rest).unwrap_or(1),
            '\'' => character(rest),
            _ => 0,
        };
        if skipped == 0 {
            code.push(c);
        }
        rest = &rest[skipped.max(c.len_utf8())..];
    }
    code
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The length of a string literal.
fn string(text: &str) -> usize {
    let mut escaped = true;
    for (at, c) in text.char_indices() {
        match c {
            '"' if !escaped => return at + 1,
            '\\' if !escaped => escaped = true,
            _ => escaped = false,
        }
    }
    text.len()
}

/// The length of a raw string literal, if one begins here.
fn raw(text: &str) -> Option<usize> {
    let hashes = text[1..].chars().take_while(|c| *c == '#').count();
    let body = text[1 + hashes..].strip_prefix('"')?;
    let end = body.find(&format!("\"{}", "#".repeat(hashes)))?;
    Some(2 + 2 * hashes + end + 1)
}

/// The length of a character literal; 0 if it is a lifetime.
fn character(text: &str) -> usize {
    let body = &text[1..];
    let end = match body.strip_prefix('\\') {
        Some(escape) => {
            escape.char_indices().skip(1).find(|(_, c)| *c == '\'').map(|(at, _)| at + 1)
        }
        None => body.chars().next().map(char::len_utf8).filter(|at| body[*at..].starts_with('\'')),
    };
    end.map_or(0, |at| at + 2)
}

/// Returns code without parts that are for tests only, and the names of test modules in other files.
fn without_tests(code: &str) -> (String, Vec<String>) {
    let (mut kept, mut modules, mut rest) = (String::new(), Vec::new(), code);
    while let Some(at) = rest.find("#[cfg(test)]") {
        kept.push_str(&rest[..at]);
        let item = &rest[at + "#[cfg(test)]".len()..];
        let end = item.find([';', '{']).unwrap_or(item.len());
        if item[end..].starts_with(';') {
            let words: Vec<_> = item[..end].split_whitespace().collect();
            if let Some(name) = words.iter().position(|word| *word == "mod") {
                modules.push(words[name + 1].to_owned());
            }
        }
        rest = &item[end + block(&item[end..])..];
    }
    kept.push_str(rest);
    (kept, modules)
}

/// Returns the length of a block in braces, or 1 if the item ends with a single character.
fn block(text: &str) -> usize {
    let mut depth = 0;
    for (at, c) in text.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return at + c.len_utf8();
        }
    }
    text.len()
}

/// Adds the paths of a `use` tree, or the single path of an expression. Returns the text behind it.
fn tree<'a>(text: &'a str, before: &[String], found: &mut Vec<Used>) -> &'a str {
    let text = text.trim_start();
    if let Some(mut list) = text.strip_prefix('{') {
        loop {
            list = list.trim_start_matches([',', ' ', '\n', '\t']);
            match list.strip_prefix('}') {
                Some(rest) => return rest,
                None if list.is_empty() => return list,
                None => list = tree(list, before, found),
            }
        }
    }
    let end = text.find(|c| !is_word(c)).unwrap_or(text.len());
    let mut path = before.to_vec();
    match end {
        0 if text.starts_with('*') => path.push("*".into()),
        0 => {}
        _ => path.push(text[..end].into()),
    }
    let mut rest = &text[end.max(usize::from(text.starts_with('*')))..];
    if end > 0
        && let Some(deeper) = rest.strip_prefix("::")
        && deeper.trim_start().starts_with(|c: char| is_word(c) || c == '{' || c == '*')
    {
        return tree(deeper, &path, found);
    }
    if let Some(renamed) = rest.trim_start().strip_prefix("as ") {
        rest = renamed.trim_start().trim_start_matches(is_word);
    }
    if end == 0 && rest.len() == text.len() {
        // Neither a name nor a list: continues behind this character.
        rest = text.get(1..).unwrap_or_default();
    }
    found.push(path);
    rest
}

/// Returns the paths from the crate's root that a file's code uses. `depth` is the number of modules that the file is
/// deep.
fn paths(code: &str, depth: usize) -> Vec<Used> {
    let mut found = Vec::new();
    let out = "super::".repeat(depth);
    for begin in ["crate::", &out] {
        for (at, _) in code.match_indices(begin) {
            if !code[..at].ends_with(|c| is_word(c) || c == ':') {
                tree(&code[at + begin.len()..], &[], &mut found);
            }
        }
    }
    found
}

/// Returns the module path of a file below `src`, without endings.
fn modules(file: &Path) -> String {
    let below = file.strip_prefix(root().join("src")).expect("in src").with_extension("");
    let below = below.to_string_lossy().replace('\\', "/");
    below.strip_suffix("/mod").unwrap_or(&below).to_owned()
}

/// Returns the unit of a module.
fn unit(modules: &str) -> String {
    let begins = |path: &str| {
        let rest = |path: &str| modules.strip_prefix(path).map(|rest| !rest.starts_with(is_word));
        match path.strip_suffix("PRIMITIVE") {
            Some(folder) => {
                PRIMITIVES.iter().any(|name| rest(&format!("{folder}{name}")) == Some(true))
            }
            None => rest(path) == Some(true),
        }
    };
    let apart = APART.iter().find(|(path, _)| begins(path));
    let folder = || modules.split('/').next().unwrap_or(modules);
    apart.map_or_else(folder, |(_, name)| name).to_owned()
}

/// Returns a path as the table writes it. The path of a unit of its own within a folder begins with the unit's name.
fn shown(path: &[String]) -> String {
    let words: Vec<_> = path.iter().map(String::as_str).collect();
    let primitive = |name: &str| PRIMITIVES.contains(&name);
    match words[..] {
        ["progmem", ..] | ["hal", "progmem", ..] => "primitives".into(),
        [name, ..] if MACROS.contains(&name) => "primitives".into(),
        ["hal", "primitives", ..] => "primitives".into(),
        ["hal", name, ..] | ["hal", "imp", name, ..] if primitive(name) => "primitives".into(),
        _ => words.join("::"),
    }
}

/// Returns what each unit uses.
fn uses() -> Uses {
    let (mut sources, mut tests) = (Vec::new(), Vec::new());
    for file in rust_files("src") {
        let text = std::fs::read_to_string(&file).expect("a source");
        let name = modules(&file);
        let (code, own) = without_tests(&code(&text));
        tests.extend(own.into_iter().map(|module| format!("{name}/{module}")));
        sources.push((name, code));
    }
    let is_test =
        |name: &str| tests.iter().any(|test| name == test || name.starts_with(&format!("{test}/")));
    let mut uses = Uses::new();
    for (name, code) in sources.iter().filter(|(name, _)| !is_test(name)) {
        let own = unit(name);
        let used = uses.entry(own.clone()).or_default();
        for path in paths(code, name.split('/').count()) {
            let path = shown(&path);
            if !begins_with(&path, &own) && !path.is_empty() {
                used.entry(path).or_insert_with(|| name.clone());
            }
        }
    }
    uses.retain(|unit, _| !ENTRIES.contains(&unit.as_str()));
    uses
}

/// Whether a path equals another path or is below it.
fn begins_with(path: &str, other: &str) -> bool {
    path.strip_prefix(other).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
}

/// A row of the table: its units, and the paths that they may use; `None` for everything.
struct Row {
    units: Vec<String>,
    may_use: Option<Vec<String>>,
}

/// Returns the rows of the table of layers that are about units of `src`.
fn rows() -> Vec<Row> {
    let tour = std::fs::read_to_string(root().join("ARCHITECTURE.md")).expect("the tour");
    let lines = tour.lines().skip_while(|line| !line.starts_with("| folder |"));
    let rows = lines.skip(2).take_while(|line| line.starts_with('|'));
    let row = |line: &str| {
        let cells: Vec<_> = line.split('|').map(str::trim).collect();
        let spans = |cell: &str| -> Vec<String> {
            cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
        };
        let file = |span: String| {
            let name = span.strip_prefix("src/")?;
            Some(unit(name.strip_suffix(".rs").unwrap_or(name)))
        };
        // The units of a row that names none are the folders of the project beside `src`.
        let units: Vec<_> = spans(cells[1]).into_iter().filter_map(file).collect();
        let may_use = (cells[3] != "everything").then(|| spans(cells[3]));
        (!units.is_empty()).then_some(Row { units, may_use })
    };
    rows.filter_map(row).collect()
}

#[test]
fn units_use_what_the_tour_says() {
    let (uses, rows) = (uses(), rows());
    let mut wrong = Vec::new();
    for (unit, used) in &uses {
        let Some(row) = rows.iter().find(|row| row.units.contains(unit)) else {
            wrong.push(format!("`{unit}` has no row"));
            continue;
        };
        let Some(may_use) = &row.may_use else { continue };
        let forbidden =
            used.iter().filter(|(path, _)| !may_use.iter().any(|may| begins_with(path, may)));
        wrong.extend(forbidden.map(|(path, file)| format!("src/{file}.rs uses `{path}`")));
    }
    for row in &rows {
        let of = || row.units.iter().filter_map(|unit| uses.get(unit));
        let is_used =
            |may: &&String| of().any(|used| used.keys().any(|path| begins_with(path, may)));
        let idle = row.may_use.iter().flatten().filter(|may| !may.contains('-') && !is_used(may));
        wrong.extend(idle.map(|may| format!("{} use no `{may}`", row.units.join(", "))));
        let gone = row.units.iter().filter(|unit| !uses.contains_key(*unit));
        wrong.extend(gone.map(|unit| format!("there is no `{unit}`")));
    }
    assert!(
        wrong.is_empty(),
        "ARCHITECTURE.md's table of layers says otherwise; mend the code, or the table:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn there_is_no_circle() {
    let uses = uses();
    let of = |unit: &str| -> BTreeSet<String> {
        let used = uses.get(unit).into_iter().flat_map(BTreeMap::keys);
        let first = |path: &String| path.split("::").next().unwrap_or_default().to_owned();
        used.map(first).filter(|used| used != unit).collect()
    };
    // A unit is settled if it uses only settled units.
    let mut open: BTreeSet<_> = uses.keys().cloned().collect();
    loop {
        let settled: Vec<_> =
            open.iter().filter(|unit| of(unit).is_disjoint(&open)).cloned().collect();
        if settled.is_empty() {
            break;
        }
        settled.iter().for_each(|unit| _ = open.remove(unit));
    }
    let circle = open.iter().map(|unit| {
        let used: Vec<_> = of(unit).intersection(&open).cloned().collect();
        format!("{unit} uses {}", used.join(", "))
    });
    assert!(open.is_empty(), "in a circle:\n{}", circle.collect::<Vec<_>>().join("\n"));
}

/// Only the folder `hal`, and the place where an image begins, depend on the architecture or the chip.
#[test]
fn no_layer_asks_for_the_chip() {
    let files = rust_files("src");
    let asks = |file: &&PathBuf| {
        let text = std::fs::read_to_string(file).unwrap_or_default();
        code(&text).contains("target_arch") || text.contains("feature = \"chip-")
    };
    let asking: BTreeSet<_> = files.iter().filter(asks).map(|file| unit(&modules(file))).collect();
    assert_eq!(asking, ["hal", "main", "primitives"].map(str::to_owned).into());
}

/// Other layers use `hal` only by `hal::contract` and `hal::primitives`. On the host, tests also use its machine.
#[test]
fn no_layer_knows_the_chip() {
    let uses = uses();
    let knows = |path: &&String| begins_with(path, "hal::imp") && *path != "hal::imp::Machine";
    let wrong = uses.iter().filter(|(unit, _)| *unit != "hal" && *unit != "primitives");
    let wrong: Vec<_> = wrong.flat_map(|(_, used)| used.keys().filter(knows)).collect();
    assert!(wrong.is_empty(), "{wrong:?}: `hal` has it without `imp`");
}

#[test]
fn the_chip_knows_nothing_of_motion() {
    let uses = uses();
    let known = uses["hal"].keys().filter(|path| begins_with(path, "motion"));
    assert_eq!(known.count(), 0);
    // What `hal` must know of steps is in `dda`.
    assert!(
        uses["hal"].contains_key("dda::Segment")
            && uses["dda"].keys().all(|path| begins_with(path, "boards"))
    );
}

/// The list is compared with the number of timers when Kerf is built.
#[test]
fn tasks_that_wait_for_a_time_are_counted() {
    let files = rust_files("src");
    let text = |file: &Path| std::fs::read_to_string(file).unwrap_or_default();
    let mut waiting: Vec<_> = files
        .iter()
        .filter(|file| code(&text(file)).contains("after_ms("))
        .map(|file| modules(file))
        .filter(|modules| modules != "hal")
        .collect();
    waiting.sort();
    let tasks = text(&root().join("src/tasks/mod.rs"));
    let list = tasks.split("WAIT_FOR_TIME: ").nth(1).and_then(|rest| rest.split(';').nth(1));
    let counted: Vec<_> = list
        .unwrap_or_default()
        .split('"')
        .skip(1)
        .step_by(2)
        .map(|name| format!("tasks/{name}"))
        .collect();
    assert_eq!(waiting, counted, "`WAIT_FOR_TIME` of src/tasks/mod.rs");
}

#[test]
fn paths_are_found_and_tests_are_none() {
    let text = r#"
        use crate::a::{self, b::{C, D as E}, f::*};
        // crate::comment
        fn g<'a>(x: &'a str) { crate::h::i(x, "crate::text \" }", '}', '\''); $crate::j!(); }
        #[cfg(test)]
        mod tests { use crate::k; const C: char = '{'; }
        #[cfg(test)]
        mod other;
        pub(super) use super::super::l::M;
    "#;
    let (code, modules) = without_tests(&code(text));
    let found: Vec<_> = paths(&code, 2).iter().map(|path| path.join("::")).collect();
    assert_eq!(found, ["a::self", "a::b::C", "a::b::D", "a::f::*", "h::i", "j", "l::M"]);
    assert_eq!(modules, ["other"]);
}

#[test]
fn parts_of_a_folder_may_be_units() {
    let units = ["hal/avr/text", "hal/avr/textile", "hal/progmem/text", "gcode/codes/docs", "baud"];
    assert_eq!(units.map(unit), ["primitives", "hal", "primitives", "docs", "baud"]);
    let path = |text: &str| shown(&text.split("::").map(str::to_owned).collect::<Vec<_>>());
    assert_eq!(path("hal::imp::float::sqrtf"), "primitives");
    assert_eq!(path("hal::imp::floats"), "hal::imp::floats");
}
