//! The operator of a scenario: parameters that are set and stops that are asked for, at times of the motion.

use crate::common::{self, Workspace, has_event, masseter, stderr, stdout};
use serde_json::Value;

const SETS: &str = "duration_s = 2.0\n\
     [[stimulus]]\nparameter = 'integral_gain_per_s'\nvalue = 8.0\nat_s = 0.5\n\
     [[stimulus]]\nname = 'again'\nparameter = 'integral_gain_per_s'\nvalue = 4.0\nat_s = 0.25\nafter = 'stimulus.parameter'\n";
const STOPS: &str = "duration_s = 2.0\n[[stimulus]]\nstop = true\nat_s = 0.75\n";

/// When each event with this cause came, s from the first cycle in `running`.
fn times_s(summary: &Value, cause: &str) -> Vec<f64> {
    let events = summary["figures"]["events"].as_array().unwrap();
    let time_s = |event: &Value| event["time_ns"].as_f64().unwrap() / 1e9;
    let runs = events.iter().find(|event| event["transition"][1] == "running").map(time_s).unwrap();
    events.iter().filter(|event| event["cause"] == cause).map(|event| time_s(event) - runs).collect()
}

#[test]
fn parameters_are_set_at_times_of_the_motion_with_the_same_bytes_under_both_clocks() {
    let [by_virtual, by_lockstep] = ["virtual", "lockstep"].map(|clock| {
        let workspace = Workspace::new(SETS);
        let output = workspace.run_simulated(clock, &["--quiet"]);
        assert_eq!(output.status.code(), Some(0), "{clock}: {}{}", stdout(&output), stderr(&output));
        workspace
    });
    assert!(by_virtual.recording() == by_lockstep.recording());
    let summary = by_virtual.summary();
    assert_eq!(by_lockstep.summary(), summary);
    for cause in ["stimulus_began", "parameter_set"] {
        let times_s = times_s(&summary, cause);
        assert!(times_s.len() == 2, "{cause}: {times_s:?}");
        assert!((times_s[0] - 0.5).abs() < 2e-3 && (times_s[1] - 0.75).abs() < 4e-3, "{cause}: {times_s:?}");
    }
    let began = summary["figures"]["events"].as_array().unwrap();
    let began: Vec<_> = began.iter().filter(|event| event["cause"] == "stimulus_began").collect();
    assert!(began.iter().all(|event| event["source"] == "scenario"), "{began:?}");
    assert_eq!(began.iter().map(|event| event["value"].as_f64().unwrap()).collect::<Vec<_>>(), [1.0, 2.0]);
    let missing = summary["figures"]["topics"].as_array().unwrap();
    assert!(missing.iter().all(|topic| topic["missing"] == 0), "{missing:?}");
}

#[test]
fn a_stop_that_the_scenario_asks_for_ends_the_run_in_order() {
    let [by_virtual, by_lockstep] = ["virtual", "lockstep"].map(|clock| {
        let workspace = Workspace::new(STOPS);
        let output = workspace.run_simulated(clock, &["--quiet"]);
        assert_eq!(output.status.code(), Some(130), "{clock}: {}{}", stdout(&output), stderr(&output));
        workspace
    });
    assert!(by_virtual.recording() == by_lockstep.recording());
    let summary = by_virtual.summary();
    assert_eq!(summary["verdict"]["word"], "INTERRUPTED");
    assert_eq!(summary["verdict"]["reason"], "stopped by stimulus 1 of the scenario");
    assert_eq!(summary["figures"]["final_state"], "finished");
    assert!(!has_event(&summary, "fault", "stale_reading"));
    assert!((times_s(&summary, "stimulus_began")[0] - 0.75).abs() < 2e-3);
}

#[test]
fn an_attached_program_has_the_same_operator() {
    let scenario = STOPS.replace("0.75", "0.25");
    let workspace = Workspace::new(&scenario);
    let program =
        workspace.write("controller.sh", &format!("#!/bin/sh\nexec {} controller\n", common::MASSETER));
    std::process::Command::new("chmod").arg("+x").arg(&program).status().unwrap();
    let output = workspace.run_simulated("lockstep", &["--quiet", "--controller", program.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(130), "{}{}", stdout(&output), stderr(&output));
}

#[test]
fn what_the_controller_does_not_have_is_refused_before_the_start() {
    let of = |parameter: &str, value: &str| {
        format!("[[stimulus]]\nparameter = '{parameter}'\nvalue = {value}\nat_s = 1.0\n")
    };
    let after = of("integral_gain_per_s", "1.0")
        + "after = 'fault.lose'\n[[faults]]\nkind = 'lose'\nbus = 0\nfrom_s = 1.0\n";
    for (scenario, expected) in [
        (of("integral_gain_per_z", "1.0"), "did you mean 'integral_gain_per_s'"),
        (of("integral_gain_per_s", "1e9"), "its range is"),
        (after, "which the controller does not see"),
    ] {
        let workspace = Workspace::new(&scenario);
        let file = workspace.file("scenario.toml");
        for clock in ["virtual", "lockstep"] {
            let out = workspace.run_folder();
            let arguments = ["run", file.to_str().unwrap(), "--clock", clock, "--out", out.to_str().unwrap()];
            let output = masseter(&arguments);
            assert_eq!(output.status.code(), Some(2), "{scenario}: {}", stderr(&output));
            assert!(stderr(&output).contains(expected), "{scenario}: {}", stderr(&output));
            assert!(!out.exists());
        }
    }
}
