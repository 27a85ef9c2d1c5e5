//! Runs in lockstep: three real processes leave the bytes of virtual time, whatever the machine does to them. A process
//! that stays silent ends the run with its name; `process_faults.rs` kills them.

use std::process::{Child, Command, Stdio};
use std::time::Duration;

use masseter_runtime::clock;

use crate::common::{
    SharedMemory, Workspace, child_of, ended, is_dead, masseter, stderr, stdout, wait_until,
    wait_until_it_records,
};
use rustix::process::{Pid, Signal, kill_process};

const ROLES: [&str; 3] = ["controller", "plant", "recorder"];

/// Every frame of a node is destroyed for a while, then a node is disconnected: the rig stops.
const FAULTS: &str = "[[faults]]\nkind = 'corrupt'\nbus = 0\nfrom_s = 1.6\nuntil_s = 1.605\nprobability = 0.3\n\
     [[faults]]\nkind = 'lose'\nbus = 1\nfrom_s = 1.7\ncount = 3\n\
     [[faults]]\nkind = 'disconnect'\nbus = 1\nnode = 5\nfrom_s = 2.2\n";

/// The recording of a scenario under virtual time, and how that run exits.
fn virtual_run(scenario: &str, arguments: &[&str]) -> (Vec<u8>, Option<i32>) {
    let workspace = Workspace::new(scenario);
    let output = workspace.run_virtual(&[&["--quiet"], arguments].concat());
    (workspace.recording(), output.status.code())
}

/// A rig in lockstep that records already.
fn running(scenario: &str, arguments: &[&str]) -> (Workspace, Child, SharedMemory) {
    let workspace = Workspace::new(scenario);
    let child = workspace.start_lockstep(arguments);
    let memory = SharedMemory::of_running(&format!("{}-", child.id()));
    wait_until_it_records(&workspace);
    (workspace, child, memory)
}

/// Four processes that never sleep.
struct Load([Child; 4]);

impl Load {
    fn start() -> Self {
        let busy = || Command::new("sh").args(["-c", "while :; do :; done"]).stdin(Stdio::null()).spawn();
        Self([(); 4].map(|()| busy().expect("a shell starts")))
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        for child in &mut self.0 {
            child.kill().expect("it is a child");
            child.wait().expect("it was killed");
        }
    }
}

#[test]
fn three_processes_leave_the_bytes_of_virtual_time() {
    let scenario = "duration_s = 2.0\n";
    let faulty = format!("{scenario}{FAULTS}");
    for (scenario, arguments) in [
        (scenario, &["--seed", "1"][..]),
        (scenario, &["--seed", "2", "--controller", "hold"]),
        (scenario, &["--seed", "3", "--rate-hz", "500"]),
        (&faulty, &["--seed", "4"]),
        (&faulty, &["--seed", "5"]),
    ] {
        let (expected, code) = virtual_run(scenario, arguments);
        let workspace = Workspace::new(scenario);
        let child = workspace.start_lockstep(arguments);
        let memory = SharedMemory::of_running(&format!("{}-", child.id()));
        let output = child.wait_with_output().unwrap();
        let context = format!("{arguments:?}: {}{}", stdout(&output), stderr(&output));
        assert_eq!(output.status.code(), code, "{context}");
        assert!(workspace.recording() == expected, "{context}");
        assert_eq!(memory.files(), Vec::<String>::new(), "{context}");
        assert_eq!(workspace.manifest()["clock"], "lockstep");
        let is_faulty = scenario.contains("faults");
        assert_eq!(code, Some(if is_faulty { 5 } else { 0 }), "{context}");
    }
}

#[test]
fn a_busy_machine_that_stops_processes_for_moments_changes_no_byte() {
    let scenario = "duration_s = 10.0";
    let (expected, _) = virtual_run(scenario, &[]);
    let _load = Load::start();
    let (workspace, child, _memory) = running(scenario, &[]);
    for role in [ROLES, ROLES].concat() {
        let victim = child_of(&child, role);
        kill_process(victim, Signal::STOP).unwrap();
        clock::sleep(Duration::from_millis(200));
        kill_process(victim, Signal::CONT).unwrap();
        clock::sleep(Duration::from_millis(3));
    }
    let said = ended(child, 0);
    assert!(workspace.recording() == expected, "{said}");
}

/// If it went on, it would find the others silent, which have given it up.
#[test]
fn a_process_that_stays_silent_is_killed_before_it_can_go_on_and_named_with_the_cycle() {
    // Alone, the controller waits for steady readings as long as that.
    let boot = "[controller]\nsteady_readings = 10000000\nstart_timeout_s = 20000.0";
    for role in ROLES {
        let (workspace, child, memory) = running(boot, &["--patience", "2s"]);
        let victim = child_of(&child, role);
        kill_process(victim, Signal::STOP).unwrap();
        wait_until("it is killed", || is_dead(victim.as_raw_nonzero().get()));
        ended(child, 4);
        let summary = workspace.summary();
        let reason = summary["verdict"]["reason"].as_str().unwrap();
        let silent_s = if role == "plant" { "4.0" } else { "2.0" };
        assert!(reason.starts_with(&format!("the {role} died: it did not answer in cycle ")), "{reason}");
        assert!(reason.contains(&format!("for {silent_s} s (--patience)")), "{reason}");
        assert_eq!(memory.files(), Vec::<String>::new());
    }
}

#[test]
fn endless_patience_waits_and_the_user_ends_it() {
    let (workspace, child, memory) = running("duration_s = 60.0", &["--patience", "none"]);
    // Longer than the default patience.
    let controller = child_of(&child, "controller");
    kill_process(controller, Signal::STOP).unwrap();
    clock::sleep(Duration::from_secs(11));
    kill_process(controller, Signal::CONT).unwrap();
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    ended(child, 130);
    let figures = &workspace.summary()["figures"];
    assert_eq!(figures["final_state"], "finished", "{figures}");
    assert_eq!(figures["cut_short"], false);
    assert_eq!(memory.files(), Vec::<String>::new());
}

#[test]
fn arguments_of_other_clocks_are_refused() {
    for (arguments, expected) in [
        (&["--patience", "1s", "--clock", "rt"][..], "--patience needs --clock lockstep"),
        (&["--clock", "lockstep", "--require-rt"], "--require-rt needs --clock rt"),
        (&["--patience", "1ms"], "give at least 100ms"),
        (&["--clock", "virtual", "--live"], "--live needs --clock rt"),
        (&["--clock", "lockstep", "--can", "can0,can1"], "simulated time has no real CAN interfaces"),
        (&["--clock", "lockstep", "--patience", "long"], "or none"),
    ] {
        let output = masseter(&[&["run"], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(stderr(&output).contains(expected), "{arguments:?}: {}", stderr(&output));
    }
}
