//! A model of the streams of both ports: senders that count lines or characters, or heed flow control, at full speed, with real-time
//! characters at any byte. Each line has a number that comes back, so that each answer belongs to one line.
//!
//! | file | is |
//! |---|---|
//! | `ops` | what a conversation is made of, at random |
//! | `lines` | the lines, and what each is to do |
//! | `port` | a sender: what it may put on the line, and when |
//! | `ledger` | which lines wait for answers, and in which order these may come |
//! | `answer`, `json` | what the machine says |
//! | `course` | where the motors are to be |
//! | `dialogue`, `judge` | a conversation, had and judged |

pub mod answer;
pub mod course;
pub mod dialogue;
pub mod json;
mod judge;
pub mod ledger;
pub mod lines;
pub mod ops;
pub mod port;
