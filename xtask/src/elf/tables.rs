//! Refuses an image with constants in flash where `lpm` does not reach.
//!
//! `lpm` reads the first 64 KiB only; beyond them it would silently read something else. The linker puts `.progmem`
//! sections right behind the vectors. So the check fails only if a table is placed differently, or if there are more
//! tables than fit.

use anyhow::{Result, ensure};

use super::Image;

/// End of the range that `lpm` reaches.
const REACH: u64 = 0x1_0000;

/// Fails when a table or text in flash lies beyond the reach of `lpm`.
pub fn check(image: &Image) -> Result<()> {
    let found: Vec<_> = image
        .symbols
        .iter()
        .filter(|symbol| symbol.is_data && !symbol.is_in_ram())
        .filter(|symbol| symbol.address + symbol.size > REACH)
        .map(|symbol| format!("  {:#x} {}", symbol.address, symbol.name))
        .collect();
    ensure!(
        found.is_empty(),
        "{} has constants in flash beyond the first 64 KiB, where `lpm` does not reach:\n{}",
        image.path.display(),
        found.join("\n")
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elf::{Sizes, Symbol};

    fn checked(address: u64, size: u64, is_data: bool) -> Result<()> {
        let symbols = vec![Symbol { name: "TEXT".into(), address, size, is_data }];
        check(&Image { path: "none".into(), sizes: Sizes::default(), symbols })
    }

    #[test]
    fn tables_lie_in_reach_and_nothing_else_has_to() {
        assert!(checked(0xFFF0, 16, true).is_ok());
        assert!(checked(0xFFF0, 17, true).unwrap_err().to_string().contains("0xfff0 TEXT"));
        assert!(checked(0x1_2000, 100, false).is_ok());
        assert!(checked(0x80_0200, 100, true).is_ok());
    }
}
