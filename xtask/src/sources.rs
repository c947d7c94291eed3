//! The files of the sources, for the tests that read them.

use std::path::{Path, PathBuf};

use crate::process::root;

/// Returns all files below a folder of the checkout.
pub fn files(folder: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    collect(&root().join(folder), &mut found);
    found
}

/// Returns the files of Rust below a folder of the checkout.
pub fn rust_files(folder: &str) -> Vec<PathBuf> {
    let mut found = files(folder);
    found.retain(|file| file.extension().is_some_and(|ending| ending == "rs"));
    found
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) {
    match std::fs::read_dir(path) {
        Ok(entries) => entries.flatten().for_each(|entry| collect(&entry.path(), files)),
        Err(_) => files.push(path.to_owned()),
    }
}
