//! How often each instruction ran, written to a file when a machine is dropped.
//!
//! `KERF_COUNTS=FOLDER` makes every machine of a process write its counts to a file in the folder. Code that seldom
//! runs need not be listed in `xtask/src/shrink/hot.rs`. The first line of a file has the cycles of the machine. Each
//! further line has an address in bytes and how often the instruction there was executed.

use std::fmt::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

/// Words of flash.
const WORDS: usize = 1 << 17;

/// How often each word of flash was executed.
pub struct Counts {
    times: Vec<u64>,
    file: PathBuf,
}

impl Counts {
    /// Returns counts if the environment variable asks for them, else `None`.
    pub fn wanted() -> Option<Counts> {
        static MADE: AtomicU32 = AtomicU32::new(0);
        let folder = PathBuf::from(std::env::var_os("KERF_COUNTS")?);
        let number = MADE.fetch_add(1, Ordering::Relaxed);
        let file = folder.join(format!("{}-{number}", std::process::id()));
        Some(Counts { times: vec![0; WORDS], file })
    }

    /// Counts an execution of the instruction at this address.
    #[inline]
    pub fn executed(&mut self, pc: u32) {
        if let Some(times) = self.times.get_mut(pc as usize / 2) {
            *times += 1;
        }
    }

    /// Writes the file; `cycles` is the machine's total. If the folder does not exist the counts are lost, because a
    /// test must not fail for them.
    pub fn write(&self, cycles: u64) {
        let mut text = format!("{cycles}\n");
        for (word, times) in self.times.iter().enumerate().filter(|(_, times)| **times > 0) {
            let _ = writeln!(text, "{:#x} {times}", word * 2);
        }
        if let Err(error) = std::fs::write(&self.file, text) {
            eprintln!("cannot write {}: {error}", self.file.display());
        }
    }
}
