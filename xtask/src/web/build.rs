//! Compiles the module and collects the files of the page in `target/page`, which is emptied first. (`target/web` is
//! cargo's folder for the profile.)
//!
//! Nothing is bundled or changed: the browser's modules and an import map do the work of a bundler. [`VENDOR`] lists
//! the files that are copied from packages of npm, with their licences.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::npm;
use crate::process::{host_cargo, output, root, run};
use crate::setup::TARGET;

/// Most bytes of the page, with each file compressed by gzip.
const CAP: u64 = 1_500_000;

/// Files of packages, and their names in the page.
const VENDOR: [(&str, &str); 13] = [
    ("three/build/three.module.js", "three.module.js"),
    ("three/build/three.core.js", "three.core.js"),
    ("three/LICENSE", "LICENSE-three.txt"),
    ("three/examples/jsm/controls/OrbitControls.js", "OrbitControls.js"),
    ("three/examples/jsm/lines/LineSegments2.js", "lines/LineSegments2.js"),
    ("three/examples/jsm/lines/LineSegmentsGeometry.js", "lines/LineSegmentsGeometry.js"),
    ("three/examples/jsm/lines/LineMaterial.js", "lines/LineMaterial.js"),
    ("uplot/dist/uPlot.iife.min.js", "uPlot.iife.min.js"),
    ("uplot/dist/uPlot.min.css", "uPlot.min.css"),
    ("uplot/LICENSE", "LICENSE-uplot.txt"),
    ("LICENSE-MIT", "LICENSE-kerf-MIT.txt"),
    ("LICENSE-APACHE", "LICENSE-kerf-APACHE.txt"),
    ("docs/settings.schema.json", "../settings.schema.json"),
];

/// Builds the page; returns the folder of its files.
pub fn page() -> Result<PathBuf> {
    let module = module()?;
    let packages = npm::install("web-packages", &root().join("web"))?.join("node_modules");
    let folder = root().join("target/page");
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    copy_all(&root().join("web/page"), &folder)?;
    copy(&module, &folder.join("kerf.wasm"))?;
    copy_all(&root().join("examples"), &folder.join("examples"))?;
    for (from, to) in VENDOR {
        let package = packages.join(from);
        let from = if package.is_file() { package } else { root().join(from) };
        copy(&from, &folder.join("vendor").join(to))?;
    }
    let sizes = sizes(&folder)?;
    println!("{} bytes in {} files, {} compressed", sizes.plain, sizes.files, sizes.compressed);
    ensure!(sizes.compressed <= CAP, "{} bytes compressed, more than {CAP}", sizes.compressed);
    Ok(folder)
}

/// Compiles the firmware to WebAssembly.
fn module() -> Result<PathBuf> {
    let mut cargo = host_cargo();
    cargo.current_dir(root()).args(["build", "--quiet", "--package", "kerf-web", "--lib"]);
    cargo.env("RUSTFLAGS", remaps());
    run(cargo.args(["--profile", "web", "--target", TARGET]))?;
    Ok(root().join("target").join(TARGET).join("web/kerf_web.wasm"))
}

/// Returns flags that leave paths of this computer out of what is published.
fn remaps() -> String {
    let home = std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".cargo"));
    let cargo = std::env::var_os("CARGO_HOME").map(PathBuf::from).or(home);
    let remap =
        |(path, name): (&Path, &str)| format!("--remap-path-prefix={}={name}", path.display());
    let paths = [(Some(root()), "kerf"), (cargo.as_deref(), "cargo")];
    let flags: Vec<_> =
        paths.into_iter().filter_map(|(path, name)| Some(remap((path?, name)))).collect();
    flags.join(" ")
}

/// The sizes of the page.
struct Sizes {
    files: usize,
    plain: u64,
    compressed: u64,
}

fn sizes(folder: &Path) -> Result<Sizes> {
    let mut sizes = Sizes { files: 0, plain: 0, compressed: 0 };
    for file in files(folder)? {
        sizes.files += 1;
        sizes.plain += fs::metadata(&file)?.len();
        sizes.compressed += compressed(&file)?;
    }
    Ok(sizes)
}

/// Returns the bytes that a server sends for a file, compressed. Node does the compression; npm comes with it.
fn compressed(file: &Path) -> Result<u64> {
    let script =
        "console.log(require('zlib').gzipSync(require('fs').readFileSync(process.argv[1])).length)";
    let mut node = std::process::Command::new("node");
    let text = output(node.args(["-e", script]).arg(file))?;
    text.trim().parse().with_context(|| format!("the size of {}", file.display()))
}

/// Returns all files below a folder, in order.
pub fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut entries: Vec<_> = fs::read_dir(folder)
        .with_context(|| folder.display().to_string())?
        .map(|entry| Ok(entry?.path()))
        .collect::<Result<_>>()?;
    entries.sort();
    let mut found = Vec::new();
    for path in entries {
        match path.is_dir() {
            true => found.extend(files(&path)?),
            false => found.push(path),
        }
    }
    Ok(found)
}

fn copy_all(from: &Path, to: &Path) -> Result<()> {
    for file in files(from)? {
        copy(&file, &to.join(file.strip_prefix(from)?))?;
    }
    Ok(())
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to.parent().context("a folder")?)?;
    fs::copy(from, to).with_context(|| format!("cannot copy {}", from.display()))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_the_page_asks_for_is_there() {
        let page = root().join("web/page");
        let own: Vec<_> = files(&page).unwrap();
        let names: Vec<_> = VENDOR.iter().map(|(_, to)| format!("./vendor/{to}")).collect();
        for file in own.iter().filter(|file| file.extension() == Some("js".as_ref())) {
            let text = fs::read_to_string(file).unwrap();
            for import in text.lines().filter_map(|line| line.split_once(" from './")) {
                let name = import.1.split('\'').next().unwrap();
                let there = page.join(name).is_file() || names.contains(&format!("./{name}"));
                assert!(there, "{}: {name}", file.display());
            }
        }
    }
}
