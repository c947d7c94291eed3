//! The fuzzer of [`kerf_fuzz::lines`].
#![no_main]

libfuzzer_sys::fuzz_target!(|input: &[u8]| kerf_fuzz::lines::check(input));
