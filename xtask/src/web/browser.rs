//! Opens an address in the browser, by the system's own program. The address is also printed, in case there is no
//! browser.

use std::process::{Command, Stdio};

/// Programs that open an address, by system.
const PROGRAMS: [&[&str]; 3] = [&["xdg-open"], &["open"], &["cmd", "/c", "start"]];

/// Opens an address with the first of the programs that exists.
pub fn open(address: &str) {
    for words in PROGRAMS {
        let mut command = Command::new(words[0]);
        command.args(&words[1..]).arg(address);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        if command.spawn().is_ok() {
            return;
        }
    }
    println!("open it in a browser");
}
