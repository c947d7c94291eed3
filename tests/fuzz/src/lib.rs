//! Fuzzing of the path of a line: bytes to G-code interpreter, and bytes to the whole machine.
//!
//! `cargo xtask fuzz` builds the fuzzers with coverage counters and runs them. What they do with an input
//! is here, so that `cargo test -p kerf-fuzz` does it with the examples and transcripts, without libFuzzer
//! and its compiler.
//!
//! | target | an input is | what must hold |
//! |---|---|---|
//! | [`lines`] | lines | see there |
//! | [`serial`] | how to send, then what to send | see there |
//!
//! A fuzzer takes files as arguments, too: each is run once. That is how to look at a finding, and `words.dict`
//! holds what inputs are put together from. A finding that is understood becomes a test beside the code
//! that was wrong.

pub mod lines;
pub mod serial;
