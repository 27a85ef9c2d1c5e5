//! Stimuli in whole runs: pushes by tables and torques, and a motion whose rate and amplitude change.

use std::fs;

use crate::common::{Workspace, check, json, masseter, stderr, stdout};

const TABLE: &str = "time_s,force_x_n,force_y_n,force_z_n\n0,0,0,0\n0.1,0,0,-12\n0.2,0,0,0\n";
const PUSHED: &str = "duration_s = 1.5\n[[stimulus]]\nat_s = 0.5\npush_table = 'push.csv'\n\
     [[stimulus]]\nname = 'turn'\nat_s = 1.0\nfor_s = 0.2\ntorque_n_m = [0.0, 0.0, 0.5]\n";

fn pushed(table: &str) -> Workspace {
    let workspace = Workspace::new(PUSHED);
    workspace.write("push.csv", table);
    workspace
}

#[test]
fn every_process_and_every_repetition_reads_the_table_that_the_run_keeps() {
    let [by_virtual, by_lockstep] = ["virtual", "lockstep"].map(|clock| {
        let workspace = pushed(TABLE);
        let output = workspace.run_simulated(clock, &["--quiet"]);
        assert_eq!(output.status.code(), Some(0), "{clock}: {}{}", stdout(&output), stderr(&output));
        workspace
    });
    assert!(by_virtual.recording() == by_lockstep.recording());
    let summary = by_virtual.summary();
    let events = summary["figures"]["events"].as_array().unwrap();
    let times_s = |cause: &str| -> Vec<f64> {
        let of_cause = events.iter().filter(|event| event["cause"] == cause);
        of_cause.map(|event| event["time_ns"].as_f64().unwrap() / 1e9).collect()
    };
    let lasted_s: Vec<_> = times_s("stimulus_ended")
        .iter()
        .zip(times_s("stimulus_began"))
        .map(|(end_s, begin_s)| end_s - begin_s)
        .collect();
    assert!(lasted_s.len() == 2 && lasted_s.iter().all(|s| (s - 0.2).abs() < 1e-3), "{lasted_s:?}");

    // Another table lies there now, and the run folder still has the first.
    by_virtual.write("push.csv", &TABLE.replace("-12", "12"));
    let (kept, again) = (by_virtual.run_folder().join("scenario.toml"), by_virtual.file("again"));
    assert_eq!(fs::read_to_string(by_virtual.run_folder().join("stimulus_1.csv")).unwrap(), TABLE);
    let arguments =
        ["run", kept.to_str().unwrap(), "--clock", "virtual", "--quiet", "--out", again.to_str().unwrap()];
    assert_eq!(masseter(&arguments).status.code(), Some(0));
    assert_eq!(json(&again.join("summary.json"))["figures"]["digest"], summary["figures"]["digest"]);
}

#[test]
fn a_table_that_cannot_be_used_is_refused_with_its_line_before_the_start() {
    let workspace = pushed(&TABLE.replace("0.2,", "0.1,"));
    let output = workspace.run_virtual(&[]);
    assert_eq!(output.status.code(), Some(2));
    let expected = "push.csv:4: time 0.1 s does not come after 0.1 s; sort the rows";
    assert!(stderr(&output).contains(expected), "{}", stderr(&output));
    fs::remove_file(workspace.file("push.csv")).unwrap();
    let output = workspace.run_virtual(&[]);
    assert!(
        output.status.code() == Some(2) && stderr(&output).contains("cannot read"),
        "{}",
        stderr(&output)
    );
    assert!(!workspace.run_folder().exists());
}

#[test]
fn a_motion_is_played_at_its_rate_unless_it_takes_ten_times_its_duration() {
    for (rate, code, finding) in [
        (0.0, 1, "the scenario's motion was not played: 0 % of its way of "),
        (0.02, 1, "the scenario's motion was not played: "),
        (0.1, 0, "ended in state finished"),
    ] {
        let workspace = Workspace::new(&format!("duration_s = 1.0\n[parameters]\nmotion_rate = {rate}\n"));
        let output = workspace.run_virtual(&["--quiet"]);
        assert_eq!(output.status.code(), Some(code), "{rate}: {}{}", stdout(&output), stderr(&output));
        let summary = workspace.summary();
        let found = check(&summary, "sequence")["finding"].as_str().unwrap();
        assert!(found.starts_with(finding), "{rate}: {found}");
    }
}

#[test]
fn a_motion_that_becomes_slower_and_smaller_is_followed_to_its_end() {
    let scenario = "duration_s = 2.0\n\
         [[stimulus]]\nparameter = 'motion_rate'\nvalue = 0.5\nat_s = 0.5\n\
         [[stimulus]]\nname = 'smaller'\nparameter = 'motion_amplitude'\nvalue = 0.4\nat_s = 0.5\n";
    let [by_virtual, by_lockstep] = ["virtual", "lockstep"].map(|clock| {
        let workspace = Workspace::new(scenario);
        let output = workspace.run_simulated(clock, &["--quiet"]);
        assert_eq!(output.status.code(), Some(0), "{clock}: {}{}", stdout(&output), stderr(&output));
        workspace
    });
    assert!(by_virtual.recording() == by_lockstep.recording());
    let summary = by_virtual.summary();
    assert_eq!(summary["figures"]["final_state"], "finished");
    let events = summary["figures"]["events"].as_array().unwrap();
    let enters_s = |state: &str| {
        let entry = events.iter().find(|event| event["transition"][1] == state).unwrap();
        entry["time_ns"].as_f64().unwrap() / 1e9
    };
    let runs_s = enters_s("holding") - enters_s("running");
    // Half a second as written; then half as much a second, but for what the change of the rate leaves.
    assert!((3.0..3.5).contains(&runs_s), "{runs_s}");
}
