//! Runs in real time that the user ends, by a key, a signal or a closed terminal, before or during the motion.

use std::fs;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Stdio};
use std::time::Duration;

use masseter_runtime::clock::{self, SECOND_NS};

use crate::common::{Cores, LENIENT, Workspace, child_of, ended, is_dead, wait_until};
use rustix::process::{Pid, Signal, kill_process, kill_process_group, test_kill_process};

#[test]
fn an_interrupted_motion_ends_in_order_and_is_held_for_the_whole_hold_time() {
    let cores = Cores::take();
    let (workspace, child) =
        Workspace::running(&cores, &LENIENT.replace("[controller]", "[controller]\nhold_s = 6.0"));
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    ended(child, 130);
    let summary = workspace.summary();
    assert_eq!(summary["figures"]["final_state"], "finished");
    let entered_ns = |state: &str| {
        let events = summary["figures"]["events"].as_array().unwrap().iter();
        let mut entries = events.filter(|event| event["transition"][1] == state);
        entries.next().and_then(|event| event["time_ns"].as_u64()).unwrap_or_else(|| panic!("never {state}"))
    };
    let held_ns = entered_ns("disabling") - entered_ns("holding");
    assert!(held_ns >= 6 * SECOND_NS, "held for {held_ns} ns");
}

#[test]
fn a_closed_terminal_ends_the_motion_in_order() {
    let cores = Cores::take();
    let (workspace, mut child) = Workspace::running(&cores, LENIENT);
    let roles = ["controller", "plant", "recorder"].map(|role| child_of(&child, role));
    // Nothing reads the output any more, and every process gets SIGHUP.
    drop((child.stdout.take(), child.stderr.take()));
    for id in roles.into_iter().chain([Pid::from_child(&child)]) {
        kill_process(id, Signal::HUP).unwrap();
    }
    ended(child, 130);
    assert_eq!(workspace.summary()["figures"]["final_state"], "finished");
    assert_eq!(workspace.summary()["figures"]["cut_short"], false);
}

/// Whether the process has a handler for SIGINT by now.
fn catches_interrupts(process: &Child) -> bool {
    let status = fs::read_to_string(format!("/proc/{}/status", process.id())).unwrap_or_default();
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
    let caught = caught.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    caught.is_some_and(|mask| mask >> (Signal::INT.as_raw() - 1) & 1 == 1)
}

/// As a terminal sends the signal: to the supervisor and to its processes, which may have no handler yet.
#[test]
fn an_interrupt_before_anything_is_recorded_ends_the_run_in_order() {
    let cores = Cores::take();
    for after_ms in [0, 5, 10, 20, 30, 50, 120, 200] {
        let workspace = Workspace::new(&format!("duration_s = 5.0\n{LENIENT}"));
        let mut command = workspace.command(&cores, &[]);
        let child = command.process_group(0).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        wait_until("the rig catches SIGINT", || catches_interrupts(&child));
        clock::sleep(Duration::from_millis(after_ms));
        kill_process_group(Pid::from_child(&child), Signal::INT).unwrap();
        ended(child, 130);
    }
}

/// The motion of a day takes many seconds to plan.
#[test]
fn a_signal_while_a_run_is_prepared_ends_it_at_once_and_leaves_no_folder() {
    let workspace = Workspace::new("duration_s = 86400.0\n");
    let mut child = workspace.start_virtual();
    clock::sleep(Duration::from_millis(500));
    // Not SIGINT: a program that a script starts in the background ignores it.
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    wait_until("the signal ends the process", || child.try_wait().unwrap().is_some());
    assert_eq!(child.wait().unwrap().signal(), Some(Signal::TERM.as_raw()));
    assert!(!workspace.run_folder().exists());
}

#[test]
fn a_process_that_dies_after_an_interrupt_is_reported_as_dead() {
    let cores = Cores::take();
    for role in ["plant", "controller", "recorder"] {
        let (workspace, child) = Workspace::running(&cores, LENIENT);
        let victim = child_of(&child, role);
        kill_process(Pid::from_child(&child), Signal::INT).unwrap();
        kill_process(victim, Signal::KILL).unwrap();
        ended(child, 4);
        let reason = &workspace.summary()["verdict"]["reason"];
        assert!(reason.as_str().unwrap().starts_with(&format!("the {role} died: SIGKILL (9), ")), "{reason}");
    }
}

#[test]
fn a_second_signal_ends_the_run_at_once_as_interrupted() {
    let cores = Cores::take();
    let (workspace, child) = Workspace::running(&cores, LENIENT);
    kill_process(child_of(&child, "recorder"), Signal::STOP).unwrap();
    let plant = child_of(&child, "plant");
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    wait_until("the plant has ended", || test_kill_process(plant).is_err());
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    // It would wait for the recorder for a minute.
    wait_until("the run is over", || is_dead(Pid::from_child(&child).as_raw_nonzero().get()));
    ended(child, 130);
    assert_eq!(workspace.manifest()["ending"]["kind"], "interrupted", "{}", workspace.manifest()["ending"]);
}
