//! Faults of processes: each strikes real processes at its time of the motion, and ends the run as it must.

use std::fs;
use std::process::Output;

use masseter_runtime::realtime::scheduling::{SchedulingRequest, obtain};

use crate::common::{
    self, Cores, LENIENT, SharedMemory, Workspace, check, ended, has_event, masseter, skip, stderr, stdout,
};

/// A busy machine may disturb a run in real time.
const TRIES: usize = 10;

/// A scenario with one fault, half a second into the motion.
fn with_fault(kind: &str, more: &str) -> String {
    format!("duration_s = 1.5\n[[faults]]\nkind = '{kind}'\nat_s = 0.5\n{more}")
}

/// Runs the scenario in lockstep to its end, with this exit code; nothing of the rig stays in shared memory.
fn in_lockstep(scenario: &str, arguments: &[&str], code: i32) -> (Workspace, String) {
    let workspace = Workspace::new(scenario);
    let rig = workspace.start_lockstep(arguments);
    let memory = SharedMemory::of_running(&format!("{}-", rig.id()));
    let said = format!("{scenario}: {}", ended(rig, code));
    assert_eq!(memory.files(), Vec::<String>::new(), "{said}");
    (workspace, said)
}

/// A run in real time in which the machine took less than half of the cycles that a stall of 100 ms takes. Were those
/// taken for the machine's, no run would be quiet.
fn in_quiet_real_time(cores: &Cores, scenario: &str) -> (Workspace, String) {
    let mut lost = Vec::new();
    while lost.len() < TRIES {
        let workspace = Workspace::new(scenario);
        let output = workspace.run(cores, &["--quiet"]);
        let said = format!("{scenario}: {}{}", stdout(&output), stderr(&output));
        assert!(common::PASSED_OR_INVALID.contains(&output.status.code()), "{said}");
        let cycles = workspace.summary()["verdict"]["timing"]["lost"].as_u64().unwrap();
        if cycles < 50 {
            return (workspace, said);
        }
        lost.push(cycles);
    }
    panic!("cycles lost to the machine, each try: {lost:?}: {scenario}");
}

/// The fault's strike, s from the beginning of the motion.
fn struck_s(workspace: &Workspace) -> f64 {
    let figures = &workspace.summary()["figures"];
    let events = figures["events"].as_array().unwrap();
    let runs = events.iter().find(|event| event["transition"][1] == "running").expect("the motion began");
    let struck_ns = figures["faults"][0]["struck_ns"].as_f64().expect("the fault has struck");
    (struck_ns - runs["time_ns"].as_f64().unwrap()) / 1e9
}

/// A run in real time whose fault struck within 0.1 s of its time; a busy machine may hold the supervisor up for longer.
fn struck_in_time(cores: &Cores, scenario: &str) -> (Workspace, Output) {
    let mut late_s = Vec::new();
    while late_s.len() < TRIES {
        let workspace = Workspace::new(&format!("{scenario}{LENIENT}"));
        let output = workspace.run(cores, &["--quiet"]);
        let late = struck_s(&workspace) - 0.5;
        if late.abs() < 0.1 {
            return (workspace, output);
        }
        late_s.push(late);
    }
    panic!("the fault was late in each try: {late_s:?} s: {scenario}");
}

#[test]
fn a_process_that_is_killed_or_stalls_beyond_the_patience_ends_the_run_with_its_name() {
    let [killed, silent] = ["SIGKILL (9)", "it did not answer in cycle "];
    for (role, kind, size, reason) in [
        ("controller", "kill", "", killed),
        ("plant", "kill", "", killed),
        ("recorder", "kill", "", killed),
        ("plant", "stall", "size = '10 s'\n", silent),
        ("recorder", "stall", "size = '10 s'\n", silent),
    ] {
        let scenario = with_fault(&format!("{role}_{kind}"), size);
        let (workspace, said) = in_lockstep(&scenario, &["--patience", "2s"], 4);
        let summary = workspace.summary();
        let found = summary["verdict"]["reason"].as_str().unwrap();
        assert!(found.starts_with(&format!("the {role} died: {reason}")), "{found}: {said}");
        assert_eq!(workspace.manifest()["process_faults"][0]["number"], 1, "{said}");
        // A lost recorder takes the newest messages with it, perhaps also the beginning of the motion.
        if role != "recorder" {
            assert!((struck_s(&workspace) - 0.5).abs() < 2e-3, "{}: {said}", struck_s(&workspace));
        }
        match (role, kind) {
            ("controller", _) => assert!(has_event(&summary, "fault", "command_lost"), "{said}"),
            ("plant", "kill") => assert!(has_event(&summary, "fault", "stale_reading"), "{said}"),
            _ => {}
        }
    }
}

/// In simulated time the controller's stall withholds commands, under every clock the same; the others' costs only time.
#[test]
fn a_short_stall_has_the_bytes_of_virtual_time_in_lockstep() {
    let figures = |workspace: &Workspace| workspace.summary()["figures"].clone();
    let in_virtual_time = |scenario: &str| {
        let workspace = Workspace::new(scenario);
        assert_eq!(workspace.run_virtual(&["--quiet"]).status.code(), Some(0), "{scenario}");
        figures(&workspace)
    };
    let plain = in_virtual_time("duration_s = 1.5");
    for role in ["plant", "recorder"] {
        let (workspace, said) =
            in_lockstep(&with_fault(&format!("{role}_stall"), "size = '300 ms'\n"), &[], 0);
        let summary = workspace.summary();
        assert!(check(&summary, "faults")["finding"].as_str().unwrap().contains("1 of 1"), "{said}");
        assert!((struck_s(&workspace) - 0.5).abs() < 2e-3, "{said}");
        assert_eq!(figures(&workspace)["digest"], plain["digest"], "{said}");
    }
    let scenario = with_fault("controller_stall", "size = '10 ms'\n");
    let (workspace, said) = in_lockstep(&scenario, &[], 0);
    assert_eq!(figures(&workspace), in_virtual_time(&scenario), "{said}");
    assert_eq!(workspace.manifest()["process_faults"].as_array().unwrap().len(), 0, "{said}");
}

#[test]
fn a_full_disk_leaves_an_incomplete_recording() {
    let (workspace, said) = in_lockstep(&with_fault("disk_full", "").replace("1.5", "5.0"), &[], 6);
    assert_eq!(workspace.summary()["verdict"]["word"], "INCOMPLETE", "{said}");
    assert_eq!(workspace.manifest()["process_faults"][0]["number"], 1, "{said}");
}

/// A stopped controller sends nothing, and its loop loses the cycles: to the scenario, not to the machine.
#[test]
fn stalls_of_the_loops_are_real_in_real_time_and_the_scenarios_own() {
    let cores = Cores::take();
    for (kind, skips) in [("controller_stall", "controller_skips"), ("plant_stall", "plant_skips")] {
        let require = format!(
            "[[require]]\nname = 'once'\nevent = 'fault.{kind}'\nat_least = 1\nat_most = 1\n\
             [[require]]\nname = 'ends'\nevent = 'fault.{kind}.ended'\nat_least = 1\nat_most = 1\n"
        );
        let scenario = with_fault(kind, "size = '100 ms'\n") + LENIENT + &require;
        let (workspace, said) = in_quiet_real_time(&cores, &scenario);
        let summary = workspace.summary();
        let skipped = summary["figures"][skips]["by_scenario"].as_u64().unwrap();
        for name in ["once", "ends"] {
            assert_eq!(check(&summary, name)["result"], "passed", "{said}");
        }
        let timing = &summary["verdict"]["timing"];
        assert_eq!(timing["stalled"].as_u64(), Some(skipped), "{said}");
        let fault = &workspace.manifest()["process_faults"][0];
        let lasted_ns = fault["ended_ns"].as_u64().unwrap() - fault["struck_ns"].as_u64().unwrap();
        assert!(lasted_ns >= 100_000_000, "{lasted_ns} ns: {said}");
        assert!(skipped.abs_diff(lasted_ns / 1_000_000) < 20, "{skipped} skipped in {lasted_ns} ns: {said}");
    }
}

#[test]
fn a_process_is_killed_and_a_core_taken_in_real_time_too() {
    let cores = Cores::take();
    let (workspace, output) = struck_in_time(&cores, &with_fault("plant_kill", ""));
    assert_eq!(output.status.code(), Some(4), "{}{}", stdout(&output), stderr(&output));
    let reason = &workspace.summary()["verdict"]["reason"];
    assert!(reason.as_str().unwrap().starts_with("the plant died: SIGKILL (9), "), "{reason}");

    let request = SchedulingRequest { core: Some(0), fifo_priority: Some(81), locked_memory: false };
    let obtained = std::thread::spawn(move || obtain(request)).join().unwrap();
    if let Some(refusal) = obtained.refusals.first() {
        return skip(refusal);
    }
    let (workspace, output) = struck_in_time(&cores, &with_fault("core_stall", "size = '5 ms'\n"));
    assert_eq!(workspace.manifest()["process_faults"][0]["number"], 1);
    assert!(
        common::PASSED_OR_INVALID.contains(&output.status.code()),
        "{}{}",
        stdout(&output),
        stderr(&output)
    );
}

#[test]
fn where_there_are_no_such_processes_the_fault_is_refused() {
    for (kind, arguments, expected) in [
        ("plant_kill", &["--clock", "virtual"][..], "virtual time has no processes: use --clock lockstep"),
        ("core_stall", &["--clock", "lockstep"], "use --clock rt"),
        ("plant_kill", &["--clock", "rt", "--controller", "none"], "only a controller knows"),
        ("controller_kill", &["--clock", "rt", "--controller", "external"], "kills only what it started"),
        ("controller_stall", &["--clock", "rt", "--controller", "external"], "stops only what it started"),
    ] {
        let size = if kind.ends_with("_stall") { "size = '1 ms'\n" } else { "" };
        let workspace = Workspace::new(&with_fault(kind, size));
        let file = workspace.file("scenario.toml");
        let output = masseter(&[&["run", file.to_str().unwrap()], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{kind} {arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(expected), "{kind} {arguments:?}: {}", stderr(&output));
    }
}

#[test]
fn a_suite_runs_such_scenarios_in_lockstep_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("plain.toml"), "duration_s = 1.0\n").unwrap();
    let stall = with_fault("plant_stall", "size = '50 ms'\n");
    fs::write(folder.path().join("stall.toml"), stall).unwrap();
    let output = masseter(&["test", folder.path().to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
    assert!(
        stderr(&output).contains("in lockstep, one after the other") && stderr(&output).contains(": stall\n")
    );
    assert!(stdout(&output).contains("test stall ... ok"), "{}", stdout(&output));
}
