//! Runs a command of this program in parallel to the stages, in a process of its own.

use std::fs::{self, File};
use std::path::PathBuf;
use std::process::{Child, Command};

use anyhow::{Context, Result, ensure};

use crate::process::{root, shown};

/// A command that runs in parallel to the stages. Its output goes to a file and is shown when it has ended, because it
/// would otherwise mix with the output of the stages.
pub struct Beside {
    command: Command,
    child: Child,
    output: PathBuf,
}

impl Beside {
    /// Starts this program with arguments, in the background.
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

    /// Waits until the command ends, and shows its output.
    pub fn wait(mut self) -> Result<()> {
        let status = self.child.wait()?;
        print!("{}", String::from_utf8_lossy(&fs::read(&self.output)?));
        ensure!(status.success(), "`{}` failed ({status})", shown(&self.command));
        Ok(())
    }
}

impl Drop for Beside {
    /// Runs when a stage has failed. A compiler that the command has started ends by itself, and an error means that
    /// the command has ended already.
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
