//! A pseudo-terminal with the machine on one side and a sender on the other.

use std::fs;
use std::io::ErrorKind;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, bail};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, open};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// The machine's side of a pseudo-terminal.
pub struct Pty {
    master: OwnedFd,
    path: PathBuf,
    link: Option<PathBuf>,
    unwritten: Vec<u8>,
}

/// The state of the other side.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Peer {
    /// A program has the other side open.
    Open,
    /// No program has the other side open.
    Closed,
}

impl Pty {
    /// A new pseudo-terminal in raw mode.
    pub fn new() -> Result<Self> {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY;
        let master = openpt(flags).context("no pseudo-terminal")?;
        grantpt(&master)?;
        unlockpt(&master)?;
        rustix::io::ioctl_fionbio(&master, true)?;
        let name = ptsname(&master, Vec::new())?;
        let path = PathBuf::from(name.to_str().context("a strange pseudo-terminal name")?);
        make_raw(&path)?;
        Ok(Pty { master, path, link: None, unwritten: Vec::new() })
    }

    /// The path that a sender opens.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Makes a symbolic link to the path. The link is removed when this `Pty` is dropped. An older link is replaced;
    /// any other file is an error.
    pub fn link(&mut self, link: &Path) -> Result<()> {
        match fs::symlink_metadata(link) {
            Ok(meta) if meta.is_symlink() => fs::remove_file(link)?,
            Ok(_) => bail!("{} is there already and no link", link.display()),
            Err(e) if e.kind() == ErrorKind::NotFound => {}
            Err(e) => return Err(e).with_context(|| format!("cannot look at {}", link.display())),
        }
        std::os::unix::fs::symlink(&self.path, link)
            .with_context(|| format!("cannot make {}", link.display()))?;
        self.link = Some(link.to_path_buf());
        Ok(())
    }

    /// Waits up to `timeout` for bytes. Returns whether the other side is open.
    pub fn wait(&self, timeout: Duration) -> Result<Peer> {
        let mut fds = [PollFd::new(&self.master, PollFlags::IN)];
        let timeout = Timespec::try_from(timeout)?;
        match poll(&mut fds, Some(&timeout)) {
            Ok(_) | Err(Errno::INTR) => {}
            Err(e) => return Err(e).context("cannot watch the pseudo-terminal"),
        }
        let closed = fds[0].revents().contains(PollFlags::HUP);
        Ok(if closed { Peer::Closed } else { Peer::Open })
    }

    /// Returns the bytes from the other side; empty if none have come.
    pub fn read(&self) -> Result<Vec<u8>> {
        let mut buffer = [0; 1024];
        match rustix::io::read(&self.master, &mut buffer) {
            Ok(n) => Ok(buffer[..n].to_vec()),
            // Linux returns EIO while no program has the other side open.
            Err(Errno::AGAIN | Errno::INTR | Errno::IO) => Ok(Vec::new()),
            Err(e) => Err(e).context("cannot read from the pseudo-terminal"),
        }
    }

    /// Writes bytes to the other side; keeps what does not fit for the next call.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.unwritten.extend(bytes);
        while !self.unwritten.is_empty() {
            match rustix::io::write(&self.master, &self.unwritten) {
                Ok(n) => drop(self.unwritten.drain(..n)),
                Err(Errno::AGAIN | Errno::INTR) => break,
                Err(Errno::IO) => self.unwritten.clear(),
                Err(e) => return Err(e).context("cannot write to the pseudo-terminal"),
            }
        }
        Ok(())
    }

    /// Discards bytes that the other side has not read.
    pub fn discard(&mut self) {
        self.unwritten.clear();
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        if let Some(link) = &self.link {
            // The link may be gone already, and an error cannot be handled here.
            let _ = fs::remove_file(link);
        }
    }
}

/// Puts the other side into raw mode, which lasts as long as the machine's side is open.
fn make_raw(path: &Path) -> Result<()> {
    let slave = open(path, OFlags::RDWR | OFlags::NOCTTY, Mode::empty())
        .with_context(|| format!("cannot open {}", path.display()))?;
    let mut settings = tcgetattr(&slave)?;
    settings.make_raw();
    tcsetattr(&slave, OptionalActions::Now, &settings)?;
    Ok(())
}
