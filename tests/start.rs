//! The start of a run: what keeps the drives off, and the dry run, as a user sees them.

use std::process::Command;

use rustix::process::{Pid, Signal, kill_process};

use crate::common::{MASSETER, Workspace, ended, masseter, stderr, stdout, wait_until_it_records};

/// Runs the scenario under virtual time; the exit code and the output.
fn run(scenario: &str, arguments: &[&str]) -> (Option<i32>, String) {
    let workspace = Workspace::new(&format!("duration_s = 1.0\n{scenario}"));
    let output = workspace.run_virtual(arguments);
    (output.status.code(), stdout(&output) + &stderr(&output))
}

fn fault_of_l2(kind: &str, rest: &str) -> String {
    format!("[[faults]]\nkind = '{kind}'\naxis = 'l2'\nfrom_s = 0.0\n{rest}")
}

fn assert_says(text: &str, parts: &[&str]) {
    assert!(parts.iter().all(|part| text.contains(part)), "{text}");
}

#[test]
fn a_fault_found_at_the_start_ends_the_run_unless_its_reset_is_requested() {
    let scenario = fault_of_l2("drive_fault", "for_s = 0.05");
    let (code, text) = run(&scenario, &[]);
    assert_eq!(code, Some(5), "{text}");
    assert_says(
        &text,
        &["SAFE STOP", "axis l2", "5112h (logic supply too low), statusword 0", "--reset-faults"],
    );
    let (code, text) = run(&scenario, &["--reset-faults"]);
    assert_eq!(code, Some(0), "{text}");
    assert_says(
        &text,
        &["start:", "axis l2 (node 5 on bus 1): was found in fault, which was reset; error code 5112h"],
    );
}

#[test]
fn safe_torque_off_is_waited_for_and_named() {
    let (code, text) = run(&fault_of_l2("drive_sto", "for_s = 3.0"), &[]);
    assert_eq!(code, Some(0), "{text}");
    assert_says(
        &text,
        &["axis l2", "the other drives wait for this one: switch on disabled (", "safe torque off?"],
    );
    let (code, text) = run(&fault_of_l2("drive_sto", ""), &["--wait-ready", "1s"]);
    assert_eq!(code, Some(5), "{text}");
    assert_says(
        &text,
        &["axis l2", "not ready to switch on within can.ready_timeout_ms: switch on disabled ("],
    );
}

#[test]
fn a_drive_that_is_enabled_too_late_keeps_all_off() {
    let scenario = fault_of_l2("drive_slow_enable", "size = '3 s'");
    let (code, text) = run(&scenario, &[]);
    assert_eq!(code, Some(5), "{text}");
    assert_says(
        &text,
        &[
            "axis l2",
            "not enabled within can.enable_timeout_ms, so all drives are switched off: switched on (",
        ],
    );
    let (code, text) = run(&scenario, &["--set", "can.enable_timeout_ms=4000"]);
    assert_eq!(code, Some(0), "{text}");
}

#[test]
fn a_jaw_too_far_from_its_first_pose_does_not_start() {
    let (code, text) = run("[controller]\nstart_tolerance_mm = 2.0", &[]);
    assert_eq!(code, Some(5), "{text}");
    assert_says(
        &text,
        &["the jaw is ", "mm from the first pose of the motion, limit 2.000 mm", "start_tolerance_mm"],
    );
}

#[test]
fn a_dry_run_predicts_the_demands_at_full_speed() {
    let whole = Workspace::new("duration_s = 2.0");
    let output = whole.run_virtual(&["--dry"]);
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{text}{}", stderr(&output));
    assert_says(&text, &["20.0 s of motion", "at full speed, predicted from this run at 10 %", "TPDO1 here"]);
}

#[test]
fn a_run_that_goes_on_has_no_verdict_yet() {
    let workspace = Workspace::new("");
    let rig = workspace.start_lockstep(&["--duration", "120"]);
    wait_until_it_records(&workspace);
    let run = workspace.run_folder();
    let refused = masseter(&["report", run.to_str().unwrap()]);
    assert_eq!(refused.status.code(), Some(2), "{}", stderr(&refused));
    assert!(stderr(&refused).contains("goes on and has no verdict yet"), "{}", stderr(&refused));
    assert!(!run.join("summary.json").exists());
    kill_process(Pid::from_child(&rig), Signal::INT).unwrap();
    ended(rig, 130);
    assert_eq!(masseter(&["report", run.to_str().unwrap()]).status.code(), Some(130));
}

#[test]
fn a_path_through_a_file_is_named_as_such() {
    let workspace = Workspace::new("");
    let out = workspace.write("plain.txt", "").join("run");
    let refused = masseter(&["run", "--clock", "virtual", "--out", out.to_str().unwrap()]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("plain.txt is no folder"), "{}", stderr(&refused));
}

#[test]
fn too_few_open_files_are_refused_before_the_start() {
    let workspace = Workspace::new("");
    let refused = Command::new("sh")
        .args(["-c", "ulimit -n 60; exec \"$0\" run --clock lockstep --out \"$1\"", MASSETER])
        .arg(workspace.run_folder())
        .output()
        .unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", stderr(&refused));
    assert!(
        stderr(&refused).contains("a process may open 60 files, and a run needs 128"),
        "{}",
        stderr(&refused)
    );
    assert!(!workspace.run_folder().exists());
}
