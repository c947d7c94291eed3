//! Decides whether a jog may begin. After a character that ends jogs, a jog whose line arrived before that character
//! must not begin. [`Bar`] tracks whether such a line may still be waiting. Its states, the function that leaves each,
//! and the caller:
//!
//! ```text
//!  Open    jogs may begin               bar       the control task, at a character that ends jogs
//!  Barred  no jog may begin             passed    the reader, when all earlier bytes are in the pool
//!  Passed  no jog may begin             passes    the reader, when new bytes come while the pool is empty
//! ```

/// Where a line that arrived before the character may still be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bar {
    /// A jog may begin.
    #[default]
    Open,
    /// No jog may begin: an earlier line may still be in the receive ring.
    Barred,
    /// No jog may begin: an earlier line may still be in the line pool.
    Passed,
}
