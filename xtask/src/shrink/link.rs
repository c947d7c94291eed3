//! From assembler text to an image: assembles it, and links it as `rustc` linked its own.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::chips::Chip;
use crate::process::run;

/// What `rustc` takes for its linker. If `KERF_LINK` names a file, it writes its arguments there, one a line, and leaves an empty file where
/// the program was to be: that is linked from the text later. Else it links.
const SCRIPT: &str = r#"#!/bin/sh
[ -n "$KERF_LINK" ] || exec avr-gcc "$@"
printf '%s\n' "$@" > "$KERF_LINK"
while [ "$1" != -o ]; do shift; done
: > "$2"
"#;

/// The variable of the environment by which the script learns where to write.
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

/// How an image was linked.
pub struct Link {
    arguments: Vec<String>,
}

impl Link {
    /// Reads what the script wrote down.
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
        // Without `-mlink-relax` distances would be fixed here, and the linker could shorten nothing.
        run(Command::new("avr-gcc")
            .args(["-c", &format!("-mmcu={}", chip.name), "-Wa,-mlink-relax"])
            .arg(&source)
            .arg("-o")
            .arg(&object))?;
        let object = object.to_string_lossy().into_owned();
        run(Command::new("avr-gcc").args(self.with(&object, &elf.to_string_lossy())?))
    }

    /// The arguments with another program and another image. `rustc` first asks for `-no-pie`, which this linker does not know.
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
