//! Runs that their user ends: by a key, a signal or a closed terminal, before they began and in their midst.

mod common;

use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Stdio};
use std::time::Duration;

use common::{Cores, UNHURRIED, Workspace, child_of, stderr, stdout, wait_until};
use masseter_shared::clock;
use rustix::process::{Pid, Signal, kill_process, kill_process_group, test_kill_process};

#[test]
fn an_interrupt_ends_the_motion_in_order() {
    let cores = Cores::take();
    let (workspace, child) = Workspace::running(&cores, UNHURRIED);
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    assert_eq!(workspace.summary()["figures"]["final_state"], "finished");
}

#[test]
fn a_terminal_that_is_gone_ends_the_motion_in_order() {
    let cores = Cores::take();
    let (workspace, mut child) = Workspace::running(&cores, UNHURRIED);
    let roles = ["controller", "plant", "logger"].map(|role| child_of(&child, role));
    // Nobody reads any more what is said, and the whole group hears of it.
    drop((child.stdout.take(), child.stderr.take()));
    for id in roles.into_iter().chain([Pid::from_child(&child)]) {
        kill_process(id, Signal::HUP).unwrap();
    }
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(workspace.summary()["figures"]["final_state"], "finished");
    assert_eq!(workspace.summary()["figures"]["cut_short"], false);
}

/// Presses again after a while: where these tests run in the background, SIGINT is ignored until somebody listens.
fn interrupt_until_it_ends(child: &mut Child) {
    for look in 0..1000 {
        if child.try_wait().unwrap().is_some() {
            return;
        }
        if look % 200 == 0 {
            // It may end between the two calls.
            let _ = kill_process_group(Pid::from_child(child), Signal::INT);
        }
        clock::sleep(Duration::from_millis(10));
    }
    panic!("interrupts do not end the rig");
}

/// As a terminal sends it: to the supervisor and its processes, which may not listen yet.
#[test]
fn an_interrupt_before_anything_is_recorded_is_one_too() {
    let cores = Cores::take();
    for after_ms in [0, 5, 10, 15, 20, 25, 30, 40, 50, 80, 120, 200] {
        // Soon planned.
        let workspace = Workspace::new(&format!("duration_s = 5.0\n{UNHURRIED}"));
        let mut command = workspace.command(&cores, &[]);
        let mut child =
            command.process_group(0).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        clock::sleep(Duration::from_millis(after_ms));
        interrupt_until_it_ends(&mut child);
        let output = child.wait_with_output().unwrap();
        let (code, signal) = (output.status.code(), output.status.signal());
        let is_told = code == Some(130) || signal == Some(Signal::INT.as_raw());
        assert!(is_told, "after {after_ms} ms: {:?} {}", output.status, stderr(&output));
    }
}

#[test]
fn an_interrupt_hides_no_death() {
    let cores = Cores::take();
    for role in ["plant", "controller", "logger"] {
        let (workspace, child) = Workspace::running(&cores, UNHURRIED);
        let victim = child_of(&child, role);
        kill_process(Pid::from_child(&child), Signal::INT).unwrap();
        kill_process(victim, Signal::KILL).unwrap();
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(4), "{role}: {}{}", stdout(&output), stderr(&output));
        let reason = &workspace.summary()["verdict"]["reason"];
        assert_eq!(reason, &format!("the {role} died: SIGKILL (9)"));
    }
}

#[test]
fn who_insists_is_not_told_that_a_process_died_of_it() {
    let cores = Cores::take();
    let (workspace, child) = Workspace::running(&cores, UNHURRIED);
    kill_process(child_of(&child, "logger"), Signal::STOP).unwrap();
    let plant = child_of(&child, "plant");
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    wait_until("the plant has ended", || test_kill_process(plant).is_err());
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}{}", stdout(&output), stderr(&output));
    assert_eq!(workspace.manifest()["ending"]["kind"], "interrupted", "{}", workspace.manifest()["ending"]);
}

#[test]
fn an_interrupted_motion_may_be_held_for_longer_than_a_process_takes_to_end() {
    let cores = Cores::take();
    let (_workspace, child) =
        Workspace::running(&cores, &UNHURRIED.replace("[controller]", "[controller]\nhold_s = 6.0"));
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}{}", stdout(&output), stderr(&output));
}
