//! The conversations that the pages in `docs` show, played to the firmware on the host.

#[path = "support/pages.rs"]
mod shown;

use std::fs;
use std::path::Path;

use kerf::hal::imp::Machine;

use crate::transcript;

#[test]
fn the_machine_does_what_the_pages_show() {
    let boot = || Machine::boot(115_200).expect("one machine for each thread");
    transcript::play_all(shown::read_all(Path::new("docs")), 16, boot);
}

/// Names in pages that look like requests: the machine's own lines, grbl's settings, names shown as unknown, a part
/// of `srs`.
const NONE: [&str; 9] = [
    "$100=80",
    "$H",
    "$X",
    "{\"ack\":true}",
    "{\"jog\":0}",
    "$100=250",
    "$1=255",
    "{ic:1}",
    "{set:{vel:t,posa:f}}",
];

/// Returns the requests that pages name, in JSON or with a dollar, each with its page. Only complete requests to Kerf
/// count.
fn requests() -> Vec<(String, String)> {
    let mut all = Vec::new();
    for entry in fs::read_dir("docs").expect("docs") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|ending| ending != "md") {
            continue;
        }
        let page = fs::read_to_string(&path).expect("a page");
        let mut fenced = false;
        for line in page.lines() {
            fenced ^= line.starts_with("```");
            // The first column has the settings of other firmwares.
            let own = line.strip_prefix("| `$").and_then(|rest| rest.split_once('|'));
            let line = own.map_or(line, |(_, rest)| rest);
            let spans = line.split('`').skip(1).step_by(2).filter(|_| !fenced);
            let is_request = |span: &&str| {
                let is_json = span.starts_with('{') && span.ends_with('}') && span.contains(':');
                let is_none = NONE.contains(span) || span.starts_with("{\"r\":");
                (is_json || span.starts_with('$'))
                    && !is_none
                    && !span.contains("..")
                    && !span.contains('*')
            };
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            all.extend(spans.filter(is_request).map(|span| (name.to_string(), span.to_string())));
        }
    }
    all
}

/// Whether the machine answers that it does not know a request.
fn is_unknown(request: &str) -> bool {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    machine.run_ms(200);
    machine.received();
    machine.send(format!("{request}\n").as_bytes());
    machine.run_ms(500);
    let heard = String::from_utf8_lossy(&machine.received()).into_owned();
    let json = [100, 101, 111].iter().any(|status| heard.contains(&format!("\"f\":[1,{status},")));
    json || heard.contains("Unrecognized")
}

#[test]
fn what_pages_ask_the_machine_for_it_knows() {
    let mut requests = requests();
    requests.sort();
    requests.dedup();
    assert!(requests.len() > 100, "{}", requests.len());
    let unknown = requests.into_iter().filter(|(_, request)| {
        let request = request.clone();
        std::thread::spawn(move || is_unknown(&request)).join().expect("an answer")
    });
    let unknown: Vec<_> = unknown.collect();
    assert!(unknown.is_empty(), "{unknown:#?}");
}
