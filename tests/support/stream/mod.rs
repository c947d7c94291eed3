//! A model of the streams of both ports. Senders count lines or characters, or heed flow control. They send at full
//! speed, with real-time characters at any byte. Each line has a number that comes back, so that each answer belongs
//! to one line.
//!
//! | file | is |
//! |---|---|
//! | `ops` | the random actions of a conversation |
//! | `lines` | the lines, and what each must do |
//! | `port` | a sender: what it may put on the line, and when |
//! | `ledger` | which lines wait for answers, and in which order the answers may come |
//! | `answer`, `json` | what the machine sends |
//! | `course` | where the motors must be |
//! | `dialogue`, `judge` | plays and judges a conversation |

pub mod answer;
pub mod course;
pub mod dialogue;
pub mod json;
mod judge;
pub mod ledger;
pub mod lines;
pub mod ops;
pub mod port;
