//! Reads a firmware ELF: flash contents, the end of static data, and function names.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};
use object::elf::FileHeader32;
use object::read::elf::{ElfFile, ProgramHeader};
use object::{Endianness, Object, ObjectSymbol, SymbolKind};

/// Data-space addresses in an AVR ELF start here.
const DATA_SPACE: u64 = 0x80_0000;

/// A firmware image, ready to be put into a machine's flash.
#[derive(Clone, Default)]
pub struct Image {
    /// Flash contents from address 0.
    pub flash: Vec<u8>,
    /// First address after static data, which the stack must not reach. 0 when it is not known.
    pub static_end: u16,
    /// Functions, by rising address.
    functions: Vec<(u32, String)>,
    /// Variables, each with its address in the data space.
    variables: HashMap<String, u16>,
}

impl Image {
    /// An image of bare instruction words.
    pub fn from_words(words: &[u16]) -> Self {
        let flash = words.iter().flat_map(|w| w.to_le_bytes()).collect();
        Image { flash, ..Image::default() }
    }

    /// Reads an ELF file.
    pub fn read(path: &Path) -> Result<Self> {
        let name = path.display();
        let bytes = fs::read(path).with_context(|| format!("cannot read {name}"))?;
        Self::parse(&bytes).with_context(|| format!("{name} is not an AVR program"))
    }

    fn parse(bytes: &[u8]) -> Result<Self> {
        let elf = ElfFile::<FileHeader32<Endianness>>::parse(bytes)?;
        if elf.architecture() != object::Architecture::Avr {
            bail!("it is for {:?}", elf.architecture());
        }
        let mut image = Image::default();
        for segment in elf.elf_program_headers() {
            image.load(segment, elf.endian(), bytes)?;
        }
        if image.flash.is_empty() {
            bail!("it has nothing to put into flash");
        }
        image.read_symbols(&elf);
        Ok(image)
    }

    fn load(
        &mut self,
        segment: &object::elf::ProgramHeader32<Endianness>,
        endian: Endianness,
        bytes: &[u8],
    ) -> Result<()> {
        let addr = segment.p_paddr(endian) as usize;
        if segment.p_type(endian) != object::elf::PT_LOAD || addr as u64 >= DATA_SPACE {
            return Ok(());
        }
        let Ok(data) = segment.data(endian, bytes) else { bail!("a segment is cut short") };
        let end = addr + data.len();
        if self.flash.len() < end {
            self.flash.resize(end, 0xFF);
        }
        self.flash[addr..end].copy_from_slice(data);
        Ok(())
    }

    fn read_symbols(&mut self, elf: &ElfFile<'_, FileHeader32<Endianness>>) {
        let mut sized = Vec::new();
        for symbol in elf.symbols() {
            let Ok(name) = symbol.name() else { continue };
            let addr = symbol.address();
            if addr >= DATA_SPACE {
                let addr = (addr - DATA_SPACE) as u16;
                self.variables.insert(pretty(name), addr);
                continue;
            }
            let is_code = symbol.kind() == SymbolKind::Text || name.starts_with("__");
            if is_code && !name.is_empty() && symbol.is_definition() {
                sized.push((addr as u32, symbol.size() == 0, name));
            }
        }
        let end = self.variable("_end").or(self.variable("__bss_end"));
        self.static_end = end.unwrap_or(0);
        // If an address has several names, the name with a size comes first and is kept.
        sized.sort();
        sized.dedup_by_key(|s| s.0);
        self.functions = sized.into_iter().map(|(addr, _, name)| (addr, pretty(name))).collect();
    }

    /// Returns the address of a variable in the data space.
    pub fn variable(&self, name: &str) -> Option<u16> {
        self.variables.get(name).copied()
    }

    /// Returns the address in flash at which a function begins, by its full name.
    pub fn function(&self, name: &str) -> Option<u32> {
        self.functions.iter().find(|(_, known)| known == name).map(|(addr, _)| *addr)
    }

    /// All functions with their start addresses.
    pub fn functions(&self) -> &[(u32, String)] {
        &self.functions
    }

    /// The function that a flash address belongs to.
    pub fn function_at(&self, pc: u32) -> String {
        let next = self.functions.partition_point(|(addr, _)| *addr <= pc);
        match next.checked_sub(1) {
            Some(i) => self.functions[i].1.clone(),
            None => format!("{pc:#07x}"),
        }
    }
}

/// A Rust symbol without its hash; anything else as it is.
fn pretty(name: &str) -> String {
    format!("{:#}", rustc_demangle::demangle(name))
}
