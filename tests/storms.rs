//! `masseter storm` as a user meets it: found, played again, shrunk, interrupted, continued, refused.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use crate::common::{MASSETER, json, stderr, stdout, wait_until};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use tempfile::TempDir;

const CALM: &str = "duration_s = 1.5\n";
/// A requirement that no run keeps.
const STRICT: &str = "\
duration_s = 1.5
[[require]]
name = 'impossible'
signal = 'incisal.error'
during = 'running'
max = '1 nm'
";

fn folder(scenario: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("base.toml"), scenario).unwrap();
    folder
}

fn command(folder: &TempDir, arguments: &[&str]) -> Command {
    let mut command = Command::new(MASSETER);
    command.current_dir(folder.path()).args(arguments);
    command
}

fn storm(folder: &TempDir, arguments: &[&str]) -> Output {
    command(folder, &[&["storm", "base.toml", "--out", "out"], arguments].concat())
        .output()
        .expect("it starts")
}

/// The log without the time, which differs.
fn log(folder: &Path) -> Value {
    let mut log = json(&folder.join("out/storms.json"));
    log.as_object_mut().unwrap().remove("took_s");
    log
}

#[test]
fn a_broken_requirement_ends_the_storms_with_a_command_and_the_smallest_scenario() {
    let folder = folder(STRICT);
    let output = storm(&folder, &["--storms", "1", "--seed", "3"]);
    let said = stdout(&output);
    assert_eq!(output.status.code(), Some(1), "{said}{}", stderr(&output));
    assert!(said.contains("storm 0 breaks a law; the requirements hold: impossible "), "{said}");
    assert!(said.contains("again: masseter run out/storm-0.toml --clock virtual"), "{said}");
    // The command plays the storm again, and what the storm does not need is gone from the smallest one.
    for scenario in ["out/storm-0.toml", "out/storm-0-smallest.toml"] {
        let again = command(
            &folder,
            &["run", scenario, "--clock", "virtual", "--out", scenario.trim_end_matches(".toml")],
        );
        let again = { again }.output().unwrap();
        assert!(stdout(&again).contains("impossible"), "{}{}", stdout(&again), stderr(&again));
    }
    let smallest = fs::read_to_string(folder.path().join("out/storm-0-smallest.toml")).unwrap();
    assert!(!smallest.contains("[[faults]]") && !smallest.contains("[[stimulus]]"), "{smallest}");
}

#[test]
fn interrupted_storms_go_on_and_come_to_the_same() {
    let [whole, broken_off] = [folder(CALM), folder(CALM)];
    let output = storm(&whole, &["--storms", "96", "--go-on"]);
    assert!(matches!(output.status.code(), Some(0 | 1)), "{}", stderr(&output));

    let arguments = ["storm", "base.toml", "--out", "out", "--go-on", "--storms", "96"];
    let child =
        command(&broken_off, &arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let log_path = broken_off.path().join("out/storms.json");
    wait_until("some storms are kept", || log_path.exists());
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    let interrupted = child.wait_with_output().unwrap();
    assert!(matches!(interrupted.status.code(), Some(130 | 1)), "{}", stderr(&interrupted));
    let played = log(broken_off.path())["played"].as_u64().unwrap();
    assert!(played < 96, "the interrupt came too late: {played}");
    storm(&broken_off, &["--go-on", "--storms", &(96 - played).to_string()]);
    assert_eq!(log(broken_off.path()), log(whole.path()));
}

#[test]
fn storms_of_another_seed_or_scenario_and_a_damaged_log_are_refused() {
    let folder = folder(CALM);
    storm(&folder, &["--storms", "1", "--go-on"]);
    let refused = |arguments: &[&str], expected: &str| {
        let output = storm(&folder, arguments);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains(expected), "{}", stderr(&output));
    };
    refused(&["--from", "5"], "go on with number 1; leave --from away");
    refused(&["--storms", "0"], "--storms");
    refused(&["--minutes", "nan"], "above 0");
    refused(&["--seed", "2"], "another seed; choose another --out");
    fs::write(folder.path().join("base.toml"), "duration_s = 1.0\n").unwrap();
    refused(&[], "another scenario; choose another --out");
    fs::write(folder.path().join("out/storms.json"), "{\"seed\": 1").unwrap();
    refused(&[], "is no log of storms; choose another --out");
    fs::write(folder.path().join("base.toml"), "duration_s = -1.0\n").unwrap();
    refused(&[], "duration_s");
}
