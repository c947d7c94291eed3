//! Shows what an image takes of the chip, and whether that is within the caps.

use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};
use clap::Args;

use crate::boards::Board;
use crate::caps;
use crate::elf::places::task_name;
use crate::elf::stack::{Chain, Stack};
use crate::elf::{self, Image, Sizes, Symbol};
use crate::firmware;
use crate::machines::Machine;
use crate::rp2040;
use crate::setup::{self, Scope};
use crate::shrink::hot;

/// Number of rows in the lists.
const ROWS: usize = 15;

/// `cargo xtask size`
#[derive(Args)]
pub struct SizeArgs {
    /// The board to build for
    #[arg(long, value_enum, default_value_t)]
    board: Board,
    /// Examine this image instead, without building
    #[arg(long, conflicts_with = "board")]
    elf: Option<PathBuf>,
}

/// Builds the image, prints its sizes, and fails past a cap.
pub fn run(args: &SizeArgs) -> Result<()> {
    setup::ensure(if args.board.is_rp2040() { Scope::Arm } else { Scope::Firmware })?;
    match &args.elf {
        Some(path) => {
            elf::check(path)?;
            show(path)
        }
        None => show_board(args.board, &firmware::build(args.board, Machine::default())?),
    }
}

/// As [`show`], for the image of a board for the machine `careful`. Fails also if an image for another machine might be
/// past the cap of flash.
pub fn show_board(board: Board, elf: &Path) -> Result<()> {
    if board.is_rp2040() {
        return rp2040::show(elf);
    }
    show(elf)?;
    let most = Image::load(elf)?.sizes.flash + caps::PROFILE;
    ensure!(
        most <= caps::FLASH,
        "{board} may not fit with each machine: up to {most} bytes of flash"
    );
    Ok(())
}

/// Prints what an image takes. Fails past a cap, or if the stack has no bound.
pub fn show(elf: &Path) -> Result<()> {
    let image = Image::load(elf)?;
    let stack = Stack::of(&image, caps::INTERRUPT_TASKS)?;
    println!("{}", elf.display());
    print_symbols(&image);
    print_stack(&stack);
    print_totals(image.sizes, &stack);
    let over = past_caps(image.sizes, stack.bytes());
    ensure!(over.is_empty(), "past the caps of xtask/src/caps.rs: {}", over.join("; "));
    let unbounded = &stack.unbounded;
    ensure!(unbounded.is_empty(), "the stack has no bound: {}", unbounded.join("; "));
    let stale = hot::stale(image.symbols.iter().map(|symbol| symbol.name.as_str()));
    ensure!(
        stale.is_empty(),
        "rows of xtask/src/shrink/hot.rs that name no function: {}",
        stale.join(", ")
    );
    Ok(())
}

fn print_symbols(image: &Image) {
    let (tasks, statics): (Vec<&Symbol>, Vec<&Symbol>) =
        image.symbols.iter().filter(|s| s.is_in_ram()).partition(|s| s.name.ends_with("::POOL"));
    let (polls, functions): (Vec<&Symbol>, Vec<&Symbol>) =
        image.symbols.iter().filter(|s| !s.is_in_ram()).partition(|s| task_name(&s.name).is_some());
    print_largest("async tasks, bytes of RAM", tasks);
    print_largest("largest statics, bytes of RAM", statics);
    print_largest("polls of tasks, bytes of flash", polls);
    print_largest("largest functions, bytes of flash", functions);
}

fn print_largest(title: &str, mut symbols: Vec<&Symbol>) {
    symbols.retain(|symbol| symbol.size > 0);
    symbols.sort_by_key(|symbol| std::cmp::Reverse(symbol.size));
    let total: u64 = symbols.iter().map(|symbol| symbol.size).sum();
    println!("\n{title} ({} in all, {total}):", symbols.len());
    for symbol in symbols.iter().take(ROWS) {
        println!("{:>7}  {}", symbol.size, shorten(&symbol.name));
    }
}

/// Shortens a name, because mangled names of generics fill several lines.
fn shorten(name: &str) -> String {
    const WIDTH: usize = 90;
    let name = task_name(name).map_or_else(|| name.to_owned(), |task| format!("poll of {task}"));
    if name.chars().count() <= WIDTH {
        return name;
    }
    name.chars().take(WIDTH - 3).chain("...".chars()).collect()
}

fn print_stack(stack: &Stack) {
    println!("\ndeepest stack by analysis (bytes with return address; own frame and calls):");
    print_chain("thread mode", &stack.main);
    for chain in &stack.nesting {
        print_chain("handler that enables interrupts", chain);
    }
    if !stack.short.links.is_empty() {
        print_chain("deepest other handler", &stack.short);
    }
    println!(
        "  assumed: an indirect call in an executor reaches the deepest task of its level, any \
         other\n  indirect call the deepest function whose address is taken; those make no more."
    );
    for cause in &stack.unbounded {
        println!("  NOT BOUNDED, the real stack may be deeper: {cause}");
    }
}

fn print_chain(title: &str, chain: &Chain) {
    println!("  {title}: {} bytes, {}", chain.bytes(), chain.root());
    for link in &chain.links {
        println!("{:>7}  {}", link.bytes, shorten(&link.name));
    }
}

fn print_totals(sizes: Sizes, stack: &Stack) {
    println!();
    print_total("flash", sizes.flash, caps::FLASH);
    print_total(".data", sizes.data, caps::DATA);
    println!("{:<12} {:>7}", ".bss", sizes.bss);
    print_total("static RAM", sizes.ram(), caps::STATIC_RAM);
    let free = free_stack(sizes, stack.bytes());
    println!("{:<12} {:>7} of {} left by the statics", "stack", stack.bytes(), free_ram(sizes));
    println!("{:<12} {free:>7} (at least {})", "free", caps::FREE_STACK);
}

fn print_total(what: &str, value: u64, cap: u64) {
    println!("{what:<12} {value:>7} of {cap} ({} %)", value * 100 / cap);
}

fn free_ram(sizes: Sizes) -> i64 {
    caps::RAM.cast_signed() - sizes.ram().cast_signed()
}

fn free_stack(sizes: Sizes, stack: u32) -> i64 {
    free_ram(sizes) - i64::from(stack)
}

/// Returns what exceeds its cap.
fn past_caps(sizes: Sizes, stack: u32) -> Vec<String> {
    let limits = [
        ("flash", sizes.flash, caps::FLASH),
        (".data", sizes.data, caps::DATA),
        ("static RAM", sizes.ram(), caps::STATIC_RAM),
    ];
    let over = limits.into_iter().filter(|(_, value, cap)| value > cap);
    let mut over: Vec<_> =
        over.map(|(what, value, cap)| format!("{what} {value} > {cap}")).collect();
    let free = free_stack(sizes, stack);
    if free < caps::FREE_STACK {
        over.push(format!("free stack {free} < {}", caps::FREE_STACK));
    }
    over
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZES: Sizes =
        Sizes { flash: caps::FLASH, data: caps::DATA, bss: caps::STATIC_RAM - caps::DATA };

    #[test]
    fn the_caps_themselves_are_allowed() {
        let stack = caps::RAM - caps::STATIC_RAM - caps::FREE_STACK.cast_unsigned();
        assert_eq!(past_caps(SIZES, u32::try_from(stack).unwrap()), [""; 0]);
    }

    #[test]
    fn one_byte_more_is_not() {
        let over = past_caps(Sizes { flash: caps::FLASH + 1, ..SIZES }, 0);
        assert_eq!(over, [format!("flash {} > {}", caps::FLASH + 1, caps::FLASH)]);
        let over = past_caps(Sizes { data: caps::DATA + 1, bss: 0, ..SIZES }, 0);
        assert_eq!(over, [format!(".data {} > {}", caps::DATA + 1, caps::DATA)]);
        let over = past_caps(Sizes { bss: SIZES.bss + 1, ..SIZES }, 0);
        assert_eq!(over, [format!("static RAM {} > {}", caps::STATIC_RAM + 1, caps::STATIC_RAM)]);
        let stack = caps::RAM - caps::STATIC_RAM - caps::FREE_STACK.cast_unsigned();
        let over = past_caps(SIZES, u32::try_from(stack).unwrap() + 1);
        assert_eq!(over, ["free stack 399 < 400"]);
    }

    #[test]
    fn long_names_are_cut() {
        assert_eq!(shorten("kerf::main"), "kerf::main");
        assert_eq!(shorten(&"x".repeat(200)).len(), 90);
    }
}
