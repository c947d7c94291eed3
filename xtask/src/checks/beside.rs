//! A command of this program that runs beside the stages, in a process of its own.

use std::fs::{self, File};
use std::path::PathBuf;
use std::process::{Child, Command};

use anyhow::{Context, Result, ensure};

use crate::process::{root, shown};

/// What it prints goes to a file, and is shown once it has ended: in between it would tear what the stages print.
pub struct Beside {
    command: Command,
    child: Child,
    output: PathBuf,
}

impl Beside {
    /// Starts this program with arguments.
    pub fn start(arguments: &[&str]) -> Result<Self> {
        let folder = root().join("target/tmp");
        fs::create_dir_all(&folder)?;
        let output = folder.join(format!("{}.log", arguments.join("-")));
        let file = File::create(&output).with_context(|| output.display().to_string())?;
        let mut command = Command::new(std::env::current_exe()?);
        command.args(arguments).stdout(file.try_clone()?).stderr(file);
        let child = command.spawn().with_context(|| shown(&command))?;
        Ok(Self { command, child, output })
    }

    /// Waits for its end, and shows what it printed.
    pub fn wait(mut self) -> Result<()> {
        let status = self.child.wait()?;
        print!("{}", String::from_utf8_lossy(&fs::read(&self.output)?));
        ensure!(status.success(), "`{}` failed ({status})", shown(&self.command));
        Ok(())
    }
}

impl Drop for Beside {
    /// A stage has failed. A compiler that the command has started ends by itself; a command that has ended is not there any more.
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
