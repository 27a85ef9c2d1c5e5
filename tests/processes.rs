//! Runs in real time: three processes, what they leave, and what becomes of a run when one of them is stopped or dies.
//! Nothing here judges speed.

use std::fs;

use crate::common::{
    Cores, LENIENT, SharedMemory, Workspace, assert_played, check, child_of, has_event, masseter, stderr,
    stdout, wait_until,
};
use rustix::process::{Pid, Signal, kill_process};

#[test]
fn a_run_plays_through_three_processes_and_leaves_nothing_in_shared_memory() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 2.0\n{LENIENT}"));
    let child = workspace.start(&cores, &[]);
    let memory = SharedMemory::of_running(&format!("{}-", child.id()));
    let output = child.wait_with_output().unwrap();
    assert_played(&workspace.run_folder(), output.status, &(stdout(&output) + &stderr(&output)));
    let summary = workspace.summary();
    assert_eq!(check(&summary, "dropped messages")["result"], "passed", "{summary}");
    let scheduling = &workspace.manifest()["scheduling"];
    for role in ["controller", "plant", "recorder"] {
        assert!(scheduling[role]["requested"].is_object(), "{scheduling}");
    }
    assert_eq!(memory.files(), Vec::<String>::new());
    let log = fs::read_to_string(workspace.run_folder().join("can0.log")).unwrap();
    let (_, last_cycle) = log.rsplit_once(" 080#").unwrap();
    assert!(last_cycle.contains(" 201#"), "what it ended with is recorded too: {last_cycle}");
    assert_logged_in_order(&fs::read(workspace.run_folder().join("recording.mcap")).unwrap());
}

#[test]
fn another_controller_runs_through_three_processes() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 1.0\n{LENIENT}"));
    let output = workspace.start(&cores, &["--controller", "hold"]).wait_with_output().unwrap();
    assert_played(&workspace.run_folder(), output.status, &(stdout(&output) + &stderr(&output)));
}

/// Nothing is logged before it was published, nor before what stands above it.
fn assert_logged_in_order(recording: &[u8]) {
    let mut last_ns = 0;
    for message in mcap::MessageStream::new(recording).unwrap() {
        let message = message.unwrap();
        let [published_ns, logged_ns] = [message.publish_time, message.log_time];
        assert!(
            logged_ns >= published_ns.max(last_ns),
            "{}: {published_ns} {logged_ns}",
            message.channel.topic
        );
        last_ns = logged_ns;
    }
}

#[test]
fn a_run_continues_when_its_output_is_not_read() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 3.0\n{LENIENT}"));
    let mut child = workspace.start(&cores, &[]);
    drop((child.stdout.take(), child.stderr.take()));
    let status = child.wait().unwrap();
    assert_played(&workspace.run_folder(), status, "nobody read what it said");
}

#[test]
fn a_motion_that_is_broken_off_does_not_pass() {
    let cores = Cores::take();
    let (workspace, child) = Workspace::running(&cores, LENIENT);
    kill_process(child_of(&child, "controller"), Signal::TERM).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stdout(&output));
    let summary = workspace.summary();
    assert_eq!(check(&summary, "sequence")["result"], "failed", "{summary}");
    assert!(has_event(&summary, "transition", "stop_requested"), "{summary}");
}

#[test]
fn a_controller_that_does_not_end_when_asked_to_is_killed() {
    let cores = Cores::take();
    let (_workspace, child) = Workspace::running(&cores, LENIENT);
    kill_process(child_of(&child, "controller"), Signal::STOP).unwrap();
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(4), "{}{}", stdout(&output), stderr(&output));
    assert!(
        stdout(&output).contains("did not end when it was asked to, and was killed"),
        "{}",
        stdout(&output)
    );
}

#[test]
fn a_controller_that_hangs_ends_the_run() {
    let cores = Cores::take();
    let (workspace, child) = Workspace::running(&cores, LENIENT);
    kill_process(child_of(&child, "controller"), Signal::STOP).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(4), "{}{}", stdout(&output), stderr(&output));
    let reason = &workspace.summary()["verdict"]["reason"];
    assert_eq!(reason, "the controller died: it stopped sending commands, and was killed");
}

#[test]
fn the_processes_of_a_killed_supervisor_end_and_clean_removes_their_files() {
    let cores = Cores::take();
    let (workspace, mut child) = Workspace::running(&cores, LENIENT);
    let memory = SharedMemory::of_running(&format!("{}-", child.id()));
    child.kill().unwrap();
    child.wait().unwrap();
    wait_until("all is swept", || {
        assert_eq!(masseter(&["clean"]).status.code(), Some(0));
        memory.files().is_empty()
    });
    let report = masseter(&["report", workspace.run_folder().to_str().unwrap()]);
    assert_eq!(report.status.code(), Some(4), "{}{}", stdout(&report), stderr(&report));
    assert!(stdout(&report).contains("the supervisor died"), "{}", stdout(&report));
}
