//! A file server for this computer: GET of the files of one folder, over HTTP/1.1, with a connection for each request.
//!
//! It listens at the loopback address only. A path that leads out of the folder, or to no file, gives 404; a request
//! other than GET gives 405. A browser that sends nothing blocks only a thread of its own.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Component, Path, PathBuf};

/// Most bytes of the head of a request.
const LONGEST: u64 = 16_384;

/// Serves until the program ends.
pub fn forever(listener: &TcpListener, folder: &Path) {
    for stream in listener.incoming().flatten() {
        let folder = folder.to_owned();
        // An error means that the browser has closed the connection, so nothing is left to do.
        std::thread::spawn(move || answer(stream, &folder).ok());
    }
}

fn answer(mut stream: TcpStream, folder: &Path) -> std::io::Result<()> {
    let mut head = BufReader::new(stream.try_clone()?.take(LONGEST));
    let mut request = String::new();
    head.read_line(&mut request)?;
    let mut line = String::new();
    while head.read_line(&mut line)? > 2 {
        line.clear();
    }
    let file = wanted(&request, folder);
    let (status, kind, body) = match file {
        Ok(file) => ("200 OK", kind(&file), std::fs::read(file)?),
        Err(status) => (status, "text/plain", status.as_bytes().to_vec()),
    };
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nCache-Control: no-cache\r\nConnection: close\r\n\r\n",
        body.len()
    )?;
    stream.write_all(&body)
}

/// Returns the file that a request asks for, or the status of the error.
fn wanted(request: &str, folder: &Path) -> Result<PathBuf, &'static str> {
    let mut words = request.split(' ');
    if words.next() != Some("GET") {
        return Err("405 Method Not Allowed");
    }
    let path = words.next().and_then(|path| path.split(['?', '#']).next()).unwrap_or("/");
    let path = Path::new(path.trim_start_matches('/'));
    let is_within = path.components().all(|part| matches!(part, Component::Normal(_)));
    let file = folder.join(path);
    let file = if file.is_dir() { file.join("index.html") } else { file };
    if is_within && file.is_file() { Ok(file) } else { Err("404 Not Found") }
}

fn kind(file: &Path) -> &'static str {
    match file.extension().and_then(|ending| ending.to_str()) {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("json") => "application/json",
        Some("svg") => "image/svg+xml",
        Some("wasm") => "application/wasm",
        _ => "text/plain; charset=utf-8",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::process::root;

    #[test]
    fn files_of_the_folder_and_no_others() {
        let folder = root().join("web");
        let get = |path: &str| wanted(&format!("GET {path} HTTP/1.1\r\n"), &folder);
        assert_eq!(get("/page/main.js?x=1"), Ok(folder.join("page/main.js")));
        assert_eq!(get("/page/"), Ok(folder.join("page/index.html")));
        assert_eq!(get("/../Cargo.toml"), Err("404 Not Found"));
        assert_eq!(get("/page/../../Cargo.toml"), Err("404 Not Found"));
        assert_eq!(get("//etc/passwd"), Err("404 Not Found"));
        assert_eq!(get("/none"), Err("404 Not Found"));
        assert_eq!(wanted("POST / HTTP/1.1", &folder), Err("405 Method Not Allowed"));
        assert_eq!(wanted("", &folder), Err("405 Method Not Allowed"));
        assert_eq!(kind(Path::new("kerf.wasm")), "application/wasm");
    }
}
