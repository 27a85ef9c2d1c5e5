//! A rig that is reset again and again takes no more memory. It has a process of its own, so that nothing else does.

use std::{env, fs};

use masseter_runtime::messages::Command;
use masseter_scenario::Scenario;
use masseter_virtual_time::Rig;

/// How many resets: `scripts/nightly` does ten thousand.
const RESETS: usize = 500;
/// What the allocator may keep beside, bytes.
const MARGIN: usize = 1 << 20;

/// The resident set of this process, bytes.
fn resident() -> usize {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("Linux says so");
    1024 * line.trim().trim_end_matches(" kB").parse::<usize>().unwrap()
}

#[test]
fn memory_is_flat_over_resets() {
    let resets =
        env::var("RIG_RESETS").map_or(RESETS, |resets| resets.parse().expect("RIG_RESETS is a number"));
    let mut rig = Rig::new(&Scenario::default(), 1).unwrap();
    let play = |rig: &mut Rig, times| {
        for _ in 0..times {
            rig.reset().unwrap();
            rig.step(&Command::default()).unwrap();
            let branch = rig.snapshot();
            rig.restore(&branch).unwrap();
        }
    };
    play(&mut rig, 50);
    let before = resident();
    play(&mut rig, resets);
    let more = resident().saturating_sub(before);
    assert!(more < MARGIN, "{more} bytes more after {resets} resets");
}
