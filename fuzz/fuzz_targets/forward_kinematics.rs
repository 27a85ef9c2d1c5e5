//! [`masseter_fuzz::forward_kinematics`], fed by libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| masseter_fuzz::forward_kinematics::feed(data));
