//! Runs whose recording leaves the CAN frames out: every reader says so, and nothing else changes.

use std::fs;
use std::path::Path;

use crate::common::{Cores, LENIENT, Workspace, assert_played, check, json, masseter, stderr, stdout};
use masseter_recording::{Reader, Recorded};
use serde_json::Value;

const WITH: &str = "duration_s = 1.0\n";
const WITHOUT: &str = "duration_s = 1.0\n[recording]\nframes = false\n";
const NOT_RECORDED: &str = "the CAN frames are not recorded (recording.frames = false)";

fn virtual_run(scenario: &str) -> Workspace {
    let workspace = Workspace::new(scenario);
    let output = workspace.run_virtual(&[]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    workspace
}

fn said(arguments: &[&str], paths: &[&Path]) -> (Option<i32>, String) {
    let paths = paths.iter().map(|path| path.to_str().unwrap());
    let output = masseter(&arguments.iter().copied().chain(paths).collect::<Vec<_>>());
    (output.status.code(), stdout(&output) + &stderr(&output))
}

/// The run has no frames, and says that it has none.
fn assert_without_frames(folder: &Path) {
    let mut reader = Reader::open(&folder.join("recording.mcap")).unwrap();
    let mut readings = 0;
    while let Some(message) = reader.next_message().unwrap() {
        assert!(!matches!(message, Recorded::Frame(_)));
        readings += u64::from(matches!(message, Recorded::Reading(_)));
    }
    assert!(readings > 1000 && !reader.has_frames(), "{readings}");
    let summary = json(&folder.join("summary.json"));
    let bus_response = check(&summary, "bus response");
    assert_eq!(
        (&bus_response["result"], &bus_response["finding"]),
        (&"not_judged".into(), &NOT_RECORDED.into())
    );
    assert_eq!(check(&summary, "dropped messages")["result"], "passed", "{summary}");
    assert_eq!(summary["figures"]["frames"], Value::Null);
    assert!(!folder.join("can0.log").exists());
    let page = fs::read_to_string(folder.join("report.html")).unwrap();
    assert!(page.contains("The CAN frames are not recorded (recording.frames = false)"));
}

#[test]
fn a_virtual_run_differs_by_its_frames_alone() {
    let [with, without] = [WITH, WITHOUT].map(virtual_run);
    assert_without_frames(&without.run_folder());
    assert!(without.recorded_bytes() * 100 < with.recorded_bytes() * 95, "{}", without.recorded_bytes());
    let [a, b] = [&with, &without].map(|run| run.summary()["figures"]["digest"].clone());
    assert_eq!(a, b);
    let (code, words) = said(&["diff"], &[&with.run_folder(), &without.run_folder()]);
    assert_eq!(code, Some(0), "{words}");
    assert!(words.starts_with("EQUAL") && words.contains("not compared: 'frame'"), "{words}");
    let (code, words) = said(&["diff"], &[&without.run_folder(), &without.run_folder()]);
    assert!(code == Some(0) && !words.contains("not compared"), "neither run has frames: {words}");
}

#[test]
fn every_verb_that_shows_frames_says_that_there_are_none() {
    let workspace = virtual_run(WITHOUT);
    let run = workspace.run_folder();
    for (verb, words) in [
        (&["report"][..], "frames: not recorded (recording.frames = false)"),
        (&["recording", "verify"], "frame          not recorded"),
        (&["recording", "info"], "frames   not recorded (recording.frames = false)"),
        (&["export"], "the recording leaves out the CAN frames"),
    ] {
        let (code, found) = said(verb, &[&run]);
        assert_eq!(code, Some(0), "{found}");
        assert!(found.contains(words), "{verb:?}: {found}");
    }
    let tables = workspace.file("tables");
    let (code, words) = said(&["export", "--table", "frame", "--out", tables.to_str().unwrap()], &[&run]);
    assert!(code == Some(2) && words.contains("it leaves out the CAN frames"), "{words}");
}

#[test]
fn a_run_without_a_recording_has_the_same_verdict() {
    let workspace = Workspace::new(WITHOUT);
    let junit = workspace.file("junit.xml");
    let (code, words) =
        said(&["test", "--junit", junit.to_str().unwrap()], &[&workspace.file("scenario.toml")]);
    assert_eq!(code, Some(0), "{words}");
    let junit = fs::read_to_string(junit).unwrap();
    assert!(junit.contains(NOT_RECORDED), "{junit}");
}

#[test]
fn a_run_in_real_time_plays_without_them() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("{WITHOUT}{LENIENT}"));
    let output = workspace.run(&cores, &[]);
    assert_played(&workspace.run_folder(), output.status, &(stdout(&output) + &stderr(&output)));
    assert_without_frames(&workspace.run_folder());
}
