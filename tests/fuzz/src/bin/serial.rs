//! The fuzzer of [`kerf_fuzz::serial`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| kerf_fuzz::serial::check(input));
