//! [`masseter_fuzz::motion_csv`], fed by libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| masseter_fuzz::motion_csv::feed(data));
