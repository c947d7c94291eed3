//! Whether a jog may begin, which is a question of order in the streams: none does whose line came before its end was asked for.
//!
//! ```text
//!  Open    jogs begin                   bar       the control task: a character has come that ends jogs
//!  Barred  none does                    passed    the reader: all that came before is in the pool
//!  Passed  none does                    passes    the reader: new bytes have come, and the pool was empty
//! ```

/// Where the lines are that came before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bar {
    /// A jog may begin.
    #[default]
    Open,
    /// No jog may begin: a line that came before may be in the receive ring still.
    Barred,
    /// No jog may begin: a line that came before is in the pool.
    Passed,
}
