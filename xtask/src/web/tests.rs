//! Tests the page's modules in Node, by `tests/web/modules.mjs`, and the page in headless Chromium, driven by
//! `tests/web/page.mjs`: the actions of a visitor, and the end positions of the motors, compared with the simulated
//! chip.
//!
//! The stage takes a minute. It leaves pictures of the page, `target/web-tests/*.png`.

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use super::serve;
use crate::boards::Board;
use crate::machines::Machine;
use crate::npm;
use crate::process::{root, run as run_child};
use crate::sim;

/// Jobs whose last steps are compared.
const COMPARED: [&str; 2] = ["square", "bracket"];

/// The settings as lines, which the page has exported.
const EXPORTED: &str = "exported.txt";

/// Serves the page, and runs the tests.
pub fn run(page: &Path) -> Result<()> {
    let folder = npm::install("web-tests", &root().join("tests/web"))?;
    let elf = sim::prepare(Board::default(), Machine::default())?;
    let reports = reports(&elf, &folder)?;
    let mut modules = Command::new("node");
    modules.arg(root().join("tests/web/modules.mjs")).arg(page);
    run_child(&mut modules)?;
    let listener = TcpListener::bind("127.0.0.1:0").context("no port to serve at")?;
    let address = format!("http://{}/", listener.local_addr()?);
    let page = page.to_owned();
    // The server ends with this program.
    std::thread::spawn(move || serve::forever(&listener, &page));
    let mut node = Command::new("node");
    node.current_dir(&folder).arg(root().join("tests/web/page.mjs")).arg(address).args(reports);
    run_child(&mut node)?;
    // The simulated chip must accept the settings that the page has exported.
    let set = [format!("@{}", folder.join(EXPORTED).display())];
    sim::report(&elf, &root().join("examples/square.gcode"), &set, &folder.join("exported.json"))
}

/// Runs the jobs on the simulated chip. Returns the reports, `NAME.json` each.
fn reports(elf: &Path, folder: &Path) -> Result<Vec<PathBuf>> {
    let report = |name: &&str| {
        let file = folder.join(format!("{name}.json"));
        sim::report(elf, &root().join(format!("examples/{name}.gcode")), &[], &file)?;
        Ok(file)
    };
    COMPARED.iter().map(report).collect()
}
