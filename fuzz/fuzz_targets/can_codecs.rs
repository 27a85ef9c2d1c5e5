//! [`masseter_fuzz::can_codecs`], fed by libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| masseter_fuzz::can_codecs::feed(data));
