//! `masseter bench` as its users meet it.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use masseter_runtime::clock;

use crate::common::{Cores, MASSETER, child_of};
use rustix::process::{Pid, Signal, kill_process, test_kill_process};
use serde_json::Value;

/// Waits until a run in one of the folders there is under way.
fn wait_for_a_run(place: &Path) {
    let records = || {
        let mut folders = fs::read_dir(place).unwrap();
        folders.any(|folder| folder.unwrap().path().join("run/recording.mcap").exists())
    };
    for _ in 0..1000 {
        if records() {
            return;
        }
        clock::sleep(Duration::from_millis(10));
    }
    panic!("no run was under way");
}

#[test]
fn an_interrupted_bench_ends_after_its_run_and_leaves_nothing() {
    let _cores = Cores::take();
    for signal in [Signal::INT, Signal::TERM] {
        let place = tempfile::tempdir().unwrap();
        let mut bench = Command::new(MASSETER)
            .args(["bench", "rate", "--rounds", "1"])
            .env("TMPDIR", place.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let run = child_of(&bench, "run");
        wait_for_a_run(place.path());
        kill_process(Pid::from_child(&bench), signal).unwrap();
        assert_eq!(bench.wait().unwrap().code(), Some(130), "{signal:?}");
        assert!(test_kill_process(run).is_err(), "{signal:?}: its run still plays");
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 0, "{signal:?}: its folder is still there");
    }
}

#[test]
fn a_run_without_a_recording_is_measured_by_time_and_memory() {
    let _cores = Cores::take();
    let output = Command::new(MASSETER)
        .args(["bench", "virtual", "--rounds", "1", "--format", "json"])
        .output()
        .unwrap();
    // The machine may be too disturbed for a bench.
    assert!(matches!(output.status.code(), Some(0 | 3)), "{output:?}");
    let results: Value = serde_json::from_slice(&output.stdout).unwrap();
    let virtual_time = &results["comparisons"][0];
    let names = [0, 1].map(|place| &virtual_time["candidates"][place]["name"]);
    assert_eq!(names, ["wall time", "CPU time"]);
    let notes: Vec<_> = virtual_time["notes"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    let [wall, cpu, memory] = notes[..] else { panic!("{notes:?}") };
    assert!(wall.ends_with("times real time") && cpu.ends_with("times real time"), "{notes:?}");
    assert!(memory.ends_with(" MB"), "{memory}");
}
