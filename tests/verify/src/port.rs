//! A board at a serial port of this computer.

use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use kerf_verify::{Board, Image};
use serialport::SerialPort;

/// The rate of a board after a reset.
const RATE: u32 = 115_200;
/// Time in which a converter sends what it still has, after the system has given it everything.
const DRAIN: Duration = Duration::from_millis(30);
/// Longest time until a port can be opened: a board with USB of its own takes its port away in a reset.
const OPEN: Duration = Duration::from_secs(10);
/// Longest time in which an image is flashed and read back: 242,000 bytes take a minute and a half.
const FLASH: Duration = Duration::from_secs(300);
/// Time between two attempts.
const AGAIN: Duration = Duration::from_millis(200);
/// Time for which DTR is off, so that the board resets when it goes on.
const PULSE: Duration = Duration::from_millis(50);
/// The character that resets Kerf.
const RESET: &[u8] = &[0x18];
/// Number of lines of `avrdude` that are told when it fails.
const TOLD: usize = 6;

/// How the board is reset and flashed.
pub enum Way {
    /// A boot loader behind a serial line. Opening the port resets the board.
    Loader {
        /// Kerf, as an ELF file.
        kerf: PathBuf,
        /// The image that tests the chip, as an Intel HEX file.
        self_test: PathBuf,
    },
    /// A chip with USB of its own, which has Kerf already. A reset takes the port away for a moment.
    Usb,
}

/// A board at a serial port.
pub struct Port {
    name: String,
    way: Way,
    /// `None` while another program has it.
    port: Option<Box<dyn SerialPort>>,
    start: Instant,
}

impl Port {
    /// Opens the port.
    pub fn open(name: &str, way: Way) -> Result<Self, String> {
        let port = Some(opened(name)?);
        Ok(Port { name: name.to_owned(), way, port, start: Instant::now() })
    }

    fn port(&mut self) -> Result<&mut Box<dyn SerialPort>, String> {
        self.port.as_mut().ok_or_else(|| format!("{} is closed", self.name))
    }

    /// Closes the port and opens it again, with an edge of DTR.
    fn reopen(&mut self) -> Result<(), String> {
        self.port = None;
        sleep(AGAIN);
        let mut port = opened(&self.name)?;
        // A pseudo-terminal has no DTR.
        let _ = port.write_data_terminal_ready(false);
        sleep(PULSE);
        let _ = port.write_data_terminal_ready(true);
        let _ = port.clear(serialport::ClearBuffer::Input);
        self.port = Some(port);
        Ok(())
    }
}

fn opened(name: &str) -> Result<Box<dyn SerialPort>, String> {
    let start = Instant::now();
    loop {
        match serialport::new(name, RATE).timeout(AGAIN).open() {
            Ok(port) => return Ok(port),
            Err(error) if start.elapsed() > OPEN => {
                return Err(format!("cannot open {name}: {error}"));
            }
            Err(_) => sleep(AGAIN),
        }
    }
}

/// Writes an image by `avrdude`.
fn avrdude(port: &str, image: &Path) -> Result<(), String> {
    let mut command = Command::new("avrdude");
    command.args(["-p", "m2560", "-c", "wiring", "-P", port, "-b", "115200", "-D"]);
    let is_hex = image.extension().is_some_and(|extension| extension == "hex");
    let format = if is_hex { 'i' } else { 'e' };
    command.arg("-U").arg(format!("flash:w:{}:{format}", image.display()));
    let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    let mut child = child.map_err(|error| format!("cannot start avrdude: {error}"))?;
    let said = child.stderr.take().map(|mut said| {
        std::thread::spawn(move || {
            let mut text = String::new();
            // What is no text is not told.
            let _ = said.read_to_string(&mut text);
            text
        })
    });
    if ended(child)? {
        return Ok(());
    }
    let text = said.and_then(|said| said.join().ok()).unwrap_or_default();
    let lines: Vec<_> = text.lines().filter(|line| !line.trim().is_empty()).collect();
    Err(format!("avrdude fails: {}", lines[lines.len().saturating_sub(TOLD)..].join(" / ")))
}

/// Waits until a program ends, and returns whether it reports success. Kills it if it does not end: without its port
/// `avrdude` may wait for ever.
fn ended(mut child: Child) -> Result<bool, String> {
    let start = Instant::now();
    while start.elapsed() < FLASH {
        match child.try_wait() {
            Ok(Some(status)) => return Ok(status.success()),
            Ok(None) => sleep(AGAIN),
            Err(error) => return Err(error.to_string()),
        }
    }
    let _ = child.kill();
    Err(format!("avrdude does not end within {} s", FLASH.as_secs()))
}

impl Board for Port {
    async fn flash(&mut self, image: Image) -> Result<(), String> {
        let Way::Loader { kerf, self_test } = &self.way else { return self.reset().await };
        let image = if image == Image::Kerf { kerf } else { self_test };
        println!("flashing {}", image.display());
        self.port = None;
        avrdude(&self.name, image)?;
        self.reopen()
    }

    async fn reset(&mut self) -> Result<(), String> {
        if matches!(self.way, Way::Usb) {
            self.send(RESET).await?;
            self.port = None;
            sleep(2 * AGAIN);
        }
        self.reopen()
    }

    async fn set_rate(&mut self, rate: u32) -> Result<(), String> {
        let port = self.port()?;
        port.flush().map_err(|error| error.to_string())?;
        sleep(DRAIN);
        port.set_baud_rate(rate).map_err(|error| format!("{rate} baud: {error}"))
    }

    async fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.port()?.write_all(bytes).map_err(|error| error.to_string())
    }

    async fn receive(&mut self, until: Duration) -> Result<Vec<u8>, String> {
        let mut bytes = [0; 256];
        loop {
            let left = until.saturating_sub(self.now());
            if left.is_zero() {
                return Ok(Vec::new());
            }
            let port = self.port()?;
            port.set_timeout(left).map_err(|error| error.to_string())?;
            match port.read(&mut bytes) {
                Ok(n) => return Ok(bytes[..n].to_vec()),
                Err(error)
                    if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
                Err(error) => return Err(format!("the port fails: {error}")),
            }
        }
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }

    fn tell(&mut self, what: &str) {
        println!("{what}");
    }
}
