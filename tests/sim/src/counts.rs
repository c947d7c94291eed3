//! How often each instruction ran, written to a file when a machine is dropped.
//!
//! `KERF_COUNTS=FOLDER` has every machine of a process do so: what seldom runs need not be in `xtask/src/shrink/hot.rs`. A file has the cycles of the
//! machine in its first line, then an address in bytes and how often it was executed in each.

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
    /// Counts, if the environment asks for it.
    pub fn wanted() -> Option<Counts> {
        static MADE: AtomicU32 = AtomicU32::new(0);
        let folder = PathBuf::from(std::env::var_os("KERF_COUNTS")?);
        let number = MADE.fetch_add(1, Ordering::Relaxed);
        let file = folder.join(format!("{}-{number}", std::process::id()));
        Some(Counts { times: vec![0; WORDS], file })
    }

    /// The instruction at this address was executed.
    #[inline]
    pub fn executed(&mut self, pc: u32) {
        if let Some(times) = self.times.get_mut(pc as usize / 2) {
            *times += 1;
        }
    }

    /// Writes the file; `cycles` passed in all. A folder that is not there loses the counts, as a test must not fail for it.
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
