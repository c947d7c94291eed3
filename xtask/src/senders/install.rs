//! Gets the senders by npm, into `target/senders`.

use std::path::PathBuf;

use anyhow::Result;

use crate::npm;
use crate::process::root;

/// The folder that the senders are installed in. No scripts run: `g2core-api` has one that builds a serial port too old to build.
pub fn senders() -> Result<PathBuf> {
    npm::install("senders", &drivers())
}

/// Where the drivers lie.
pub fn drivers() -> PathBuf {
    root().join("tests/senders")
}
