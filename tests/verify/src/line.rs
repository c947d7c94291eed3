//! Lines of text from and to a board, each with a limit of time.

use std::time::Duration;

use crate::board::{Board, Image};

/// Longest line that is kept. A board that is out of its mind may send no line end at all.
const LONGEST: usize = 4_096;
/// Number of lines that are told when the expected one has not come.
const TOLD: usize = 4;

/// The line to a board, and what has come from it.
pub struct Line<'b, B> {
    board: &'b mut B,
    heard: Vec<u8>,
}

impl<'b, B: Board> Line<'b, B> {
    /// A line on which nothing has come.
    pub fn new(board: &'b mut B) -> Self {
        Line { board, heard: Vec::new() }
    }

    /// The board itself.
    pub fn board(&mut self) -> &mut B {
        self.board
    }

    /// The time of the computer's clock.
    pub fn now(&self) -> Duration {
        self.board.now()
    }

    /// Puts an image onto the board. Forgets what has come before.
    pub async fn flash(&mut self, image: Image) -> Result<(), String> {
        self.heard.clear();
        self.board.flash(image).await
    }

    /// Resets the board. Forgets what has come before.
    pub async fn reset(&mut self) -> Result<(), String> {
        self.board.reset().await?;
        self.heard.clear();
        Ok(())
    }

    /// Sends a line.
    pub async fn say(&mut self, text: &str) -> Result<(), String> {
        self.board.send(format!("{text}\n").as_bytes()).await
    }

    /// Returns the next line that is not empty, without its end; `None` when it is `until`.
    pub async fn next(&mut self, until: Duration) -> Result<Option<String>, String> {
        loop {
            while let Some(end) = self.heard.iter().position(|byte| *byte == b'\n') {
                let line: Vec<u8> = self.heard.drain(..=end).collect();
                let text = String::from_utf8_lossy(&line);
                // Flow control characters may stand between lines.
                let text = text.trim_matches(|c: char| c.is_whitespace() || c.is_control());
                if !text.is_empty() {
                    return Ok(Some(text.to_owned()));
                }
            }
            let more = self.board.receive(until).await?;
            if more.is_empty() {
                return Ok(None);
            }
            self.heard.extend(more);
            if self.heard.len() > LONGEST {
                return Err(format!("{LONGEST} bytes without a line end"));
            }
        }
    }

    /// Returns the lines up to the first one that `is_last` accepts. The error says what has come instead.
    pub async fn until(
        &mut self,
        longest: Duration,
        is_last: impl Fn(&str) -> bool,
    ) -> Result<Vec<String>, String> {
        let until = self.now() + longest;
        let mut lines: Vec<String> = Vec::new();
        while let Some(line) = self.next(until).await? {
            let ends = is_last(&line);
            lines.push(line);
            if ends {
                return Ok(lines);
            }
        }
        let seconds = longest.as_secs_f64();
        let last = lines.len().saturating_sub(TOLD);
        Err(match &lines[last..] {
            [] => format!("no answer within {seconds} s"),
            other => format!("no answer within {seconds} s; the last lines were {other:?}"),
        })
    }

    /// Forgets what has come before.
    pub async fn forget(&mut self) -> Result<(), String> {
        self.pass(Duration::from_millis(1)).await
    }

    /// Waits for this time, and forgets what comes meanwhile.
    pub async fn pass(&mut self, time: Duration) -> Result<(), String> {
        let until = self.now() + time;
        while !self.board.receive(until).await?.is_empty() {}
        self.heard.clear();
        Ok(())
    }
}
