//! Reads a firmware image: sections, symbols with readable names, code. Refuses images with certain defects.

mod arithmetic;
pub mod disasm;
mod flow;
mod marks;
pub mod places;
mod pointer;
pub mod restart;
mod scratch;
pub mod stack;
mod stack_args;
mod tables;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use object::elf::SHF_ALLOC;
use object::{File, Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind, SymbolKind};

use disasm::Code;

use crate::caps;
use crate::chips::Chip;
use crate::dist::hex;

/// From this address up, avr-gcc's addresses mean RAM; below it, flash.
const RAM_BASE: u64 = 0x80_0000;
/// From this address up, addresses mean EEPROM and fuses.
const EEPROM_BASE: u64 = 0x81_0000;

/// A named place in the image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Symbol {
    /// The name in the source, as far as the mangled name tells.
    pub name: String,
    /// Byte address; RAM from 0x800000.
    pub address: u64,
    /// Bytes; 0 for labels of assembler code.
    pub size: u64,
    /// Whether it is a static or a constant, not code.
    pub is_data: bool,
}

impl Symbol {
    /// Whether it is a place in RAM.
    pub fn is_in_ram(&self) -> bool {
        (RAM_BASE..EEPROM_BASE).contains(&self.address)
    }
}

/// The sizes of an image, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Code, constants and the initial values of `.data`.
    pub flash: u64,
    /// Statics with an initial value.
    pub data: u64,
    /// Statics that start at zero or not at all.
    pub bss: u64,
}

impl Sizes {
    /// Bytes of all statics.
    pub fn ram(self) -> u64 {
        self.data + self.bss
    }

    fn add(&mut self, address: u64, size: u64, has_bytes: bool) {
        if address >= EEPROM_BASE {
            return;
        }
        if has_bytes {
            self.flash += size;
        }
        match (address >= RAM_BASE, has_bytes) {
            (true, true) => self.data += size,
            (true, false) => self.bss += size,
            (false, _) => {}
        }
    }
}

/// Refuses an image that would not work, or would be far too slow: see the modules.
pub fn check(path: &Path) -> Result<()> {
    let image = Image::load(path)?;
    let (flash, shown) = (image.sizes.flash, path.display());
    ensure!(
        flash <= caps::FLASH,
        "{shown} takes {flash} bytes of flash, more than {}",
        caps::FLASH
    );
    let parts = hex::parts(&std::fs::read(path)?)?;
    marks::check(&image, &parts)?;
    restart::check(&image, &parts)?;
    arithmetic::check(&image)?;
    tables::check(&image)
}

/// Refuses a program that has been made wrong by defects of the compiler. It must be the compiler's own program, with
/// nothing shared, because these checks follow the code of each function from its beginning to its end.
pub fn check_compiled(path: &Path, chip: &Chip) -> Result<()> {
    let (image, code) = (Image::load(path)?, Code::load(path)?);
    scratch::check(&image, &code)?;
    pointer::check(&image, &code)?;
    match chip.return_address {
        stack_args::RETURN_ADDRESS => stack_args::check(&image, &code),
        _ => Ok(()),
    }
}

/// A firmware image.
pub struct Image {
    /// The file that it was read from.
    pub path: PathBuf,
    /// Its sizes.
    pub sizes: Sizes,
    /// Named places by address.
    pub symbols: Vec<Symbol>,
}

impl Image {
    /// Reads an ELF file.
    pub fn load(path: &Path) -> Result<Image> {
        let shown = path.display();
        let bytes = std::fs::read(path).with_context(|| format!("cannot read {shown}"))?;
        let file = File::parse(&*bytes).with_context(|| format!("{shown} is no ELF file"))?;
        Ok(Image { path: path.to_owned(), sizes: sizes(&file), symbols: symbols(&file) })
    }

    /// Returns the symbols whose name satisfies `wanted`.
    pub fn named<'a>(
        &'a self,
        wanted: impl Fn(&str) -> bool + 'a,
    ) -> impl Iterator<Item = &'a Symbol> + 'a {
        self.symbols.iter().filter(move |symbol| wanted(&symbol.name))
    }
}

fn sizes(file: &File) -> Sizes {
    let mut sizes = Sizes::default();
    for section in file.sections() {
        if let SectionFlags::Elf { sh_flags } = section.flags()
            && sh_flags & u64::from(SHF_ALLOC) != 0
        {
            let no_bits = section.kind() == SectionKind::UninitializedData;
            sizes.add(section.address(), section.size(), !no_bits);
        }
    }
    sizes
}

fn symbols(file: &File) -> Vec<Symbol> {
    // Labels of assembler code have a section but no type.
    let defined = file.symbols().filter(|s| s.section_index().is_some());
    let mut symbols: Vec<_> = defined
        .filter_map(|s| {
            let name = s.name().ok().filter(|name| !name.is_empty())?;
            let name = format!("{:#}", rustc_demangle::demangle(name));
            let is_data = s.kind() == SymbolKind::Data;
            Some(Symbol { name, address: s.address(), size: s.size(), is_data })
        })
        .collect();
    symbols.sort_by_key(|symbol| (symbol.address, std::cmp::Reverse(symbol.size)));
    symbols
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_are_counted_where_they_lie() {
        let mut sizes = Sizes::default();
        sizes.add(0, 1000, true); // .text
        sizes.add(0x80_0200, 26, true); // .data: RAM, and its initial values in flash
        sizes.add(0x80_021a, 199, false); // .bss
        sizes.add(0x81_0000, 64, true); // .eeprom
        assert_eq!(sizes, Sizes { flash: 1026, data: 26, bss: 199 });
        assert_eq!(sizes.ram(), 225);
    }

    #[test]
    fn what_is_no_elf_is_refused() {
        let error = Image::load(Path::new(file!()).file_name().unwrap().as_ref());
        assert!(error.is_err());
    }
}
