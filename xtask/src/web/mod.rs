//! `cargo xtask web`: the firmware in a page, as a folder of static files.
//!
//! | module | purpose |
//! |---|---|
//! | [`build`] | compiles the module, collects the files, compares their size with the cap |
//! | [`serve`] | a file server for this computer |
//! | [`browser`] | finds a browser and opens the page |
//! | [`tests`] | the page in headless Chromium: a stage of `cargo xtask test` |
//!
//! `docs/web.md` says what the page is and which parts of the machine are simulated.

mod browser;
mod build;
mod serve;
mod tests;

use std::net::TcpListener;

use anyhow::{Context, Result};
use clap::Args;

use crate::setup::{self, Scope};

/// `cargo xtask web`
#[derive(Args)]
pub struct WebArgs {
    /// Serve the page on this computer and open the browser
    #[arg(long)]
    open: bool,
    /// The TCP port that the page is served at; 0 chooses a free one
    #[arg(long, value_name = "PORT", default_value_t = 0)]
    port: u16,
    /// Run the tests of the page in headless Chromium
    #[arg(long, conflicts_with = "open")]
    test: bool,
}

/// Builds the page, and serves or tests it as the arguments say.
pub fn run(args: &WebArgs) -> Result<()> {
    if args.test {
        return test();
    }
    setup::ensure(Scope::Web)?;
    let folder = build::page()?;
    println!("page: {}", folder.display());
    if args.open {
        let listener =
            TcpListener::bind(("127.0.0.1", args.port)).context("no port to serve at")?;
        let address = format!("http://{}/", listener.local_addr()?);
        println!("serving {address}; Ctrl-C ends it");
        browser::open(&address);
        serve::forever(&listener, &folder);
    }
    Ok(())
}

/// Builds the page and tests it.
pub fn test() -> Result<()> {
    setup::ensure(Scope::WebTests)?;
    tests::run(&build::page()?)
}
