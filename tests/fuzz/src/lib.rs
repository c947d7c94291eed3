//! Fuzzing of the path of a line: bytes to G-code interpreter, and bytes to the whole machine.
//!
//! `cargo xtask fuzz` builds the fuzzers with coverage counters and runs them. The checks of an input are in this
//! crate, so that `cargo test -p kerf-fuzz` runs them with the examples and transcripts, without libFuzzer and its
//! compiler.
//!
//! | target | an input is | what must hold |
//! |---|---|---|
//! | [`lines`] | lines | see the module |
//! | [`serial`] | how to send, then what to send | see the module |
//!
//! A fuzzer also takes files as arguments and runs each once, which reproduces a finding. `words.dict` is the
//! dictionary of the fuzzers. A finding that is understood becomes a test beside the code that was wrong.

pub mod lines;
pub mod serial;
