//! Assembles the text, and links it with the arguments that `rustc` used.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::chips::Chip;
use crate::process::run;

/// The script that `rustc` uses as its linker. If `KERF_LINK` names a file, the script writes its arguments there,
/// one a line, and creates an empty file in place of the program, which is linked from the text later. Otherwise the
/// script links.
const SCRIPT: &str = r#"#!/bin/sh
[ -n "$KERF_LINK" ] || exec avr-gcc "$@"
printf '%s\n' "$@" > "$KERF_LINK"
while [ "$1" != -o ]; do shift; done
: > "$2"
"#;

/// The environment variable that tells the script where to write.
pub const KEPT: &str = "KERF_LINK";

/// Writes the script.
pub fn write_script(path: &Path) -> Result<()> {
    if std::fs::read_to_string(path).is_ok_and(|text| text == SCRIPT) {
        return Ok(());
    }
    std::fs::create_dir_all(path.parent().unwrap_or(path))?;
    std::fs::write(path, SCRIPT).with_context(|| format!("cannot write {}", path.display()))?;
    run(Command::new("chmod").arg("+x").arg(path))
}

/// The arguments with which an image was linked.
pub struct Link {
    arguments: Vec<String>,
}

impl Link {
    /// Reads the arguments that the script has written.
    pub fn read(kept: &Path) -> Result<Link> {
        let text = std::fs::read_to_string(kept)
            .with_context(|| format!("cannot read {}", kept.display()))?;
        Ok(Link { arguments: text.lines().map(str::to_owned).collect() })
    }

    /// Assembles a program for the chip that it was linked for, and links it.
    pub fn image(&self, text: &str, elf: &Path, chip: &Chip) -> Result<()> {
        let (source, object) = (elf.with_extension("s"), elf.with_extension("o"));
        std::fs::write(&source, text)
            .with_context(|| format!("cannot write {}", source.display()))?;
        // Without `-mlink-relax` the assembler would fix distances, and the linker could shorten nothing.
        run(Command::new("avr-gcc")
            .args(["-c", &format!("-mmcu={}", chip.name), "-Wa,-mlink-relax"])
            .arg(&source)
            .arg("-o")
            .arg(&object))?;
        let object = object.to_string_lossy().into_owned();
        run(Command::new("avr-gcc").args(self.with(&object, &elf.to_string_lossy())?))
    }

    /// Returns the arguments with another object and another image. `rustc` also passes `-no-pie`, which this linker
    /// does not know.
    fn with(&self, object: &str, elf: &str) -> Result<Vec<String>> {
        let known = self.arguments.iter().filter(|argument| *argument != "-no-pie");
        let mut arguments: Vec<String> = known.cloned().collect();
        let output = arguments
            .iter()
            .position(|argument| argument == "-o")
            .context("the link has no output")?;
        *arguments.get_mut(output + 1).context("the link has no output")? = elf.into();
        let mut programs = arguments.iter_mut().filter(|argument| argument.ends_with(".rcgu.o"));
        *programs.next().context("the link has no program")? = object.into();
        ensure!(
            programs.next().is_none(),
            "the program is in several pieces: `codegen-units` must be 1"
        );
        Ok(arguments)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_program_is_linked_alike() {
        let link = |text: &str| Link { arguments: text.split(' ').map(str::to_owned).collect() };
        let with = link("k.cgu-0.rcgu.o -lm -no-pie b.rlib -o k.elf -Wl,--relax")
            .with("s.o", "s.elf")
            .unwrap();
        assert_eq!(with.join(" "), "s.o -lm b.rlib -o s.elf -Wl,--relax");
        assert!(link("a.rcgu.o b.rcgu.o -o k.elf").with("s.o", "s.elf").is_err());
        assert!(link("a.rcgu.o -lm").with("s.o", "s.elf").is_err());
    }
}
