//! [`masseter_fuzz::recording`], fed by libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| masseter_fuzz::recording::feed(data));
