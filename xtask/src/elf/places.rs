//! Addresses in the code that the stack analysis starts from or needs to know.

use anyhow::{Result, ensure};

use super::disasm::Code;
use super::flow::Landmarks;
use super::{Image, RAM_BASE};
use crate::shrink::prologue::NAME as ENTER;
use crate::shrink::text::TAKEN;

/// Returns the interrupt handlers. Vectors without a handler of their own share a path to the reset.
pub fn handlers(image: &Image) -> Vec<u32> {
    let bad = image.named(|name| name == "__bad_interrupt").next().map(|s| s.address);
    let is_handler = |name: &str| name.strip_prefix("__vector_").is_some_and(is_number);
    let vectors = image.named(is_handler).map(|s| s.address);
    let mut entries: Vec<_> = vectors.filter(|entry| Some(*entry) != bad).map(address).collect();
    entries.dedup();
    entries
}

fn is_number(text: &str) -> bool {
    text.parse::<u8>().is_ok()
}

/// Returns the functions whose address is taken. The linker makes a stub for each of them beyond 128 KiB;
/// `crate::shrink` gives each a further name.
pub fn addresses_taken(image: &Image, code: &Code) -> Vec<u32> {
    let place = |wanted: &str| image.named(|name| name == wanted).next().map(|s| s.address);
    let stubs = place("__trampolines_start").zip(place("__trampolines_end"));
    let (start, end) = stubs.map_or((0, 0), |(start, end)| (address(start), address(end)));
    let inside = (start..end).step_by(2).filter_map(|at| code.get(code.at(at)?)?.target);
    let named = image.named(|name| name.starts_with(TAKEN)).map(|s| address(s.address));
    let mut taken: Vec<_> = inside.chain(named).collect();
    taken.sort_unstable();
    taken.dedup();
    taken
}

pub fn landmarks(image: &Image) -> Landmarks {
    let code = image.symbols.iter().filter(|s| s.address < RAM_BASE && s.size > 0);
    let ends = code.map(|s| address(s.address + s.size)).collect();
    let saves = image.named(|name| name == "__prologue_saves__").next();
    let prologue_saves = saves.map_or(0..0, |s| address(s.address)..address(s.address + s.size));
    let enters = image.named(|name| name.starts_with(ENTER)).map(|s| address(s.address)).collect();
    Landmarks { ends, prologue_saves, enters }
}

/// Returns the name of an address. If it has several, returns the name of the function with a size.
pub fn name_at(image: &Image, entry: u32) -> String {
    let at = image.symbols.binary_search_by_key(&u64::from(entry), |s| s.address);
    let Ok(mut at) = at else { return format!("{entry:#x}") };
    while at > 0 && image.symbols[at - 1].address == u64::from(entry) {
        at -= 1;
    }
    image.symbols[at].name.clone()
}

/// Returns the function that an instruction belongs to. Labels of assembler code have no size, so the last symbol
/// before the instruction counts.
pub fn function_at(image: &Image, insn: u32) -> &str {
    let before = |s: &&super::Symbol| {
        s.address <= u64::from(insn) && !s.is_data && !s.name.starts_with(TAKEN)
    };
    image.symbols.iter().rfind(before).map_or("code without a name", |symbol| &symbol.name)
}

/// Fails if some instructions were found. The error lists their addresses, what they do, and what helps.
pub fn refuse(image: &Image, found: &[u32], does: &str, helps: &str) -> Result<()> {
    let place = |at: &u32| format!("  {at:#x} in {}", function_at(image, *at));
    let places: Vec<_> = found.iter().map(place).collect();
    let shown = image.path.display();
    ensure!(found.is_empty(), "{shown} {does}:\n{}\n{helps}", places.join("\n"));
    Ok(())
}

/// Returns the name of a task: `exec` for `<...TaskStorage<kerf::tasks::exec::run::{closure#0}>>::poll`.
pub fn task_name(poll: &str) -> Option<String> {
    if !poll.contains("TaskStorage<") || !poll.ends_with("::poll") {
        return None;
    }
    let (path, _) = poll.split_once("::run::{closure")?;
    let (_, name) = path.rsplit_once("::")?;
    Some(name.to_owned())
}

/// Converts a code address to 32 bits.
pub fn address(address: u64) -> u32 {
    u32::try_from(address).expect("AVR addresses have 24 bits")
}
