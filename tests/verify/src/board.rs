//! What the checks need of a board at the other end of a line.

use std::time::Duration;

/// What can be put onto a board.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Image {
    /// The image that tests the chip.
    SelfTest,
    /// Kerf.
    Kerf,
}

/// A board at the other end of a serial line. An error is a sentence for a person, and ends the check that meets it.
#[expect(async_fn_in_trait, reason = "nobody sends these futures to another thread")]
pub trait Board {
    /// Puts an image onto the board, and starts it. What the board says from its reset on is received afterwards.
    async fn flash(&mut self, image: Image) -> Result<(), String>;
    /// Resets the board. The rate is that of a board after a reset, 115,200 baud.
    async fn reset(&mut self) -> Result<(), String>;
    /// Changes the rate of this end of the line, in bits a second. What has been sent before is sent at the old rate.
    async fn set_rate(&mut self, rate: u32) -> Result<(), String>;
    /// Sends bytes. They may still be on their way when it returns.
    async fn send(&mut self, bytes: &[u8]) -> Result<(), String>;
    /// Returns the bytes that have come, as soon as there are any; none when it is `until` by [`Board::now`].
    async fn receive(&mut self, until: Duration) -> Result<Vec<u8>, String>;
    /// The time of the computer's clock.
    fn now(&self) -> Duration;
    /// Tells a person what is being done.
    fn tell(&mut self, what: &str);
}
