//! Runs in real time: three processes, their deaths, interruption, two rigs at once. Nothing here
//! judges speed.

mod common;

use std::fs;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use common::{
    Workspace, PASSED_OR_INVALID, UNHURRIED, check, child_of, masseter, shared_memory_of, skip, start, stderr,
    stdout, take_the_cores, wait_until_it_records,
};
use masseter_shared::clock;
use rustix::process::{Pid, Signal, kill_process, kill_process_group, test_kill_process};
use serde_json::Value;

/// A rig in the midst of a long run.
fn running() -> (Workspace, Child) {
    running_with(UNHURRIED)
}

fn running_with(scenario: &str) -> (Workspace, Child) {
    let workspace = Workspace::new(&format!("duration_s = 60.0\n{scenario}"));
    let child = start(&workspace, &[]);
    wait_until_it_records(&workspace);
    (workspace, child)
}

#[test]
fn a_run_plays_through_three_processes_and_leaves_nothing_in_shared_memory() {
    let _cores = take_the_cores();
    let workspace = Workspace::new(&format!("duration_s = 2.0\n{UNHURRIED}"));
    let child = start(&workspace, &[]);
    let id = format!("{}-", child.id());
    let output = child.wait_with_output().unwrap();
    assert!(PASSED_OR_INVALID.contains(&output.status.code()), "{}{}", stdout(&output), stderr(&output));
    let summary = workspace.summary();
    assert_eq!(summary["figures"]["final_state"], "finished");
    assert_eq!(check(&summary, "dropped messages")["result"], "passed", "{summary}");
    let scheduling = &workspace.manifest()["scheduling"];
    for role in ["controller", "plant", "logger"] {
        assert!(scheduling[role]["wanted"].is_object(), "{scheduling}");
    }
    assert_eq!(shared_memory_of(&id), Vec::<String>::new());
    let log = fs::read_to_string(workspace.run_folder().join("can0.log")).unwrap();
    let (_, last_cycle) = log.rsplit_once(" 080#").unwrap();
    assert!(last_cycle.contains(" 201#"), "what it ended with is recorded too: {last_cycle}");
}

#[test]
fn an_interrupt_ends_the_motion_in_order() {
    let _cores = take_the_cores();
    let (workspace, child) = running();
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
    assert_eq!(workspace.summary()["figures"]["final_state"], "finished");
}

#[test]
fn a_terminal_that_is_gone_ends_the_motion_in_order() {
    let _cores = take_the_cores();
    let (workspace, mut child) = running();
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

#[test]
fn a_run_goes_on_when_nobody_reads_what_it_says() {
    let _cores = take_the_cores();
    let workspace = Workspace::new(&format!("duration_s = 3.0\n{UNHURRIED}"));
    let mut child = start(&workspace, &[]);
    drop((child.stdout.take(), child.stderr.take()));
    let code = child.wait().unwrap().code();
    assert!(PASSED_OR_INVALID.contains(&code), "{code:?} {}", workspace.summary()["verdict"]);
}

#[test]
fn a_motion_that_somebody_broke_off_does_not_pass() {
    let _cores = take_the_cores();
    let (workspace, child) = running();
    kill_process(child_of(&child, "controller"), Signal::TERM).unwrap();
    let output = child.wait_with_output().unwrap();
    let code = output.status.code();
    assert!(code == Some(1) || code == Some(3), "{code:?} {}", stdout(&output));
    let summary = workspace.summary();
    let sequence = check(&summary, "sequence");
    assert!(sequence["finding"].as_str().unwrap().contains("asked to stop"), "{sequence}");
}

#[test]
fn a_controller_that_does_not_end_when_asked_to_is_killed() {
    let _cores = take_the_cores();
    let (_bench, child) = running();
    kill_process(child_of(&child, "controller"), Signal::STOP).unwrap();
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(4), "{}{}", stdout(&output), stderr(&output));
    assert!(stdout(&output).contains("did not end when asked to"), "{}", stdout(&output));
}

#[test]
fn a_controller_that_hangs_stops_the_rig_though_nobody_asks() {
    let _cores = take_the_cores();
    let (workspace, child) = running();
    kill_process(child_of(&child, "controller"), Signal::STOP).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(4), "{}{}", stdout(&output), stderr(&output));
    let reason = &workspace.summary()["verdict"]["reason"];
    assert_eq!(reason, "the controller died: it sent no command any more, and was killed");
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
    let _cores = take_the_cores();
    for after_ms in [0, 5, 10, 15, 20, 25, 30, 40, 50, 80, 120, 200] {
        // Soon planned.
        let workspace = Workspace::new(&format!("duration_s = 5.0\n{UNHURRIED}"));
        let mut command = workspace.run_command(&[]);
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
    let _cores = take_the_cores();
    for role in ["plant", "controller", "logger"] {
        let (workspace, child) = running();
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
    let _cores = take_the_cores();
    let (workspace, child) = running();
    kill_process(child_of(&child, "logger"), Signal::STOP).unwrap();
    let plant = child_of(&child, "plant");
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    while test_kill_process(plant).is_ok() {
        clock::sleep(Duration::from_millis(10));
    }
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}{}", stdout(&output), stderr(&output));
    assert_eq!(workspace.manifest()["ending"]["kind"], "interrupted", "{}", workspace.manifest()["ending"]);
}

#[test]
fn an_interrupted_motion_may_be_held_for_longer_than_a_process_takes_to_end() {
    let _cores = take_the_cores();
    let (_bench, child) = running_with(&UNHURRIED.replace("[controller]", "[controller]\nhold_s = 6.0"));
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}{}", stdout(&output), stderr(&output));
}

#[test]
fn a_killed_supervisor_takes_its_processes_along_and_clean_sweeps_what_is_left() {
    let _cores = take_the_cores();
    let (workspace, mut child) = running();
    let id = format!("{}-", child.id());
    child.kill().unwrap();
    child.wait().unwrap();
    for _ in 0..500 {
        assert_eq!(masseter(&["clean"]).status.code(), Some(0));
        if shared_memory_of(&id).is_empty() {
            let report = masseter(&["report", workspace.run_folder().to_str().unwrap()]);
            assert_eq!(report.status.code(), Some(4), "{}{}", stdout(&report), stderr(&report));
            assert!(stdout(&report).contains("the supervisor died"), "{}", stdout(&report));
            return;
        }
        clock::sleep(Duration::from_millis(10));
    }
    panic!("left in shared memory: {:?}", shared_memory_of(&id));
}

#[test]
fn two_rigs_on_one_machine_do_not_meet() {
    let _cores = take_the_cores();
    let workspaces =
        [1, 2].map(|seed| Workspace::new(&format!("seed = {seed}\nduration_s = 2.0\n{UNHURRIED}")));
    let children: Vec<_> = workspaces.iter().map(|workspace| start(workspace, &[])).collect();
    for (child, workspace) in children.into_iter().zip(&workspaces) {
        let output = child.wait_with_output().unwrap();
        // Both want the same two cores, so either may be starved into a safe stop; but no message may
        // cross, which a foreign command or a gap in a sequence would show.
        let summary = workspace.summary();
        assert!(!stdout(&output).contains("foreign_command"), "{}", stdout(&output));
        assert_eq!(check(&summary, "dropped messages")["result"], "passed", "{summary}");
    }
}

#[test]
fn a_second_rig_of_the_same_name_is_refused() {
    let _cores = take_the_cores();
    let name = format!("robot-{}", std::process::id());
    let [first, second] = [1, 2].map(|_| Workspace::new(&format!("duration_s = 60.0\n{UNHURRIED}")));
    let running = start(&first, &["--name", &name]);
    wait_until_it_records(&first);
    // The folder for temporary files does not make it another machine.
    let refused = second.run_command(&["--name", &name]).env("TMPDIR", second.file("")).output().unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", stderr(&refused));
    assert!(stderr(&refused).contains(&format!("a rig named '{name}' is running")), "{}", stderr(&refused));
    assert!(!second.run_folder().exists());
    kill_process(Pid::from_child(&running), Signal::INT).unwrap();
    assert_eq!(running.wait_with_output().unwrap().status.code(), Some(130));
    assert_eq!(second.run(&["--name", "../robot"]).status.code(), Some(2));
}

#[test]
fn what_the_kernel_refuses_is_said_and_required_real_time_exits_with_3() {
    let _cores = take_the_cores();
    let workspace = Workspace::new(&format!("duration_s = 1.0\n[realtime]\ncores = [0, 4000]\n{UNHURRIED}"));
    let output = workspace.run(&["--require-rt", "--format", "json"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("core 4000 refused"), "{}", stderr(&output));
    assert!(!workspace.manifest()["scheduling"]["plant"]["refusals"].as_array().unwrap().is_empty());
    let shown: Value = serde_json::from_str(&stdout(&output)).expect("a summary on standard output");
    assert_eq!(shown["verdict"]["word"], "INVALID", "{shown}");
    assert_eq!(shown, workspace.summary());
    assert!(workspace.run_folder().join("junit.xml").exists());
}

/// A disk with room for 2 MiB, there as long as this is.
struct SmallDisk<'a>(&'a Path);

impl<'a> SmallDisk<'a> {
    /// None where nothing may be mounted, as by ordinary users and in most containers.
    fn on(folder: &'a Path) -> Option<Self> {
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", "size=2m", "tmpfs"]).arg(folder);
        mount.status().is_ok_and(|status| status.success()).then(|| Self(folder))
    }
}

impl Drop for SmallDisk<'_> {
    fn drop(&mut self) {
        let unmounted = Command::new("umount").arg(self.0).status().is_ok_and(|status| status.success());
        assert!(unmounted || thread::panicking(), "{} is left mounted", self.0.display());
    }
}

/// What a run says whose folder lies on a small disk; none where that cannot be had.
fn run_on_a_small_disk(arguments: &[&str]) -> Option<Output> {
    let workspace = Workspace::new("");
    let folder = workspace.file("");
    let Some(_disk) = SmallDisk::on(&folder) else {
        skip("mounting a small disk is refused");
        return None;
    };
    workspace.write("scenario.toml", UNHURRIED);
    Some(workspace.run(arguments))
}

#[test]
fn a_full_disk_does_not_stop_the_rig() {
    let _cores = take_the_cores();
    let Some(output) = run_on_a_small_disk(&["--duration", "3s"]) else { return };
    assert_eq!(output.status.code(), Some(6), "{}{}", stdout(&output), stderr(&output));
    let said = stderr(&output);
    assert!(said.contains("the rig goes on"), "{said}");
    assert!(said.contains("No space left on device"), "{said}");
    assert!(said.contains("running       motion    2."), "the rig stopped with its recording: {said}");
}

#[test]
fn a_full_disk_ends_a_run_under_virtual_time() {
    let Some(output) = run_on_a_small_disk(&["--clock", "virtual", "--duration", "3s"]) else { return };
    assert_eq!(output.status.code(), Some(6), "{}{}", stdout(&output), stderr(&output));
    assert!(stderr(&output).contains("the run ends here"), "{}", stderr(&output));
}

#[test]
fn an_ordinary_user_runs_the_rig_without_real_time() {
    let _cores = take_the_cores();
    if !rustix::process::getuid().is_root() {
        skip("needs root to become an ordinary user; every other test here ran as one");
        return;
    }
    let workspace = Workspace::new(&format!("duration_s = 1.0\n{UNHURRIED}"));
    // The executable and the folder must be reachable for that user.
    let folder = workspace.file("home");
    fs::create_dir(&folder).unwrap();
    let executable = folder.join("masseter");
    fs::copy(common::MASSETER, &executable).unwrap();
    fs::copy(workspace.file("scenario.toml"), folder.join("scenario.toml")).unwrap();
    let status = Command::new("chown").args(["-R", "65534:65534"]).arg(workspace.file("")).status().unwrap();
    assert!(status.success());
    let output = Command::new("setpriv")
        .args(["--reuid=65534", "--regid=65534", "--clear-groups"])
        .arg(&executable)
        .args(["run", "scenario.toml", "--out", "run"])
        .current_dir(&folder)
        .output()
        .unwrap();
    let code = output.status.code();
    assert!(code == Some(0) || code == Some(3) || code == Some(5), "{}{}", stdout(&output), stderr(&output));
    assert!(stderr(&output).contains("SCHED_FIFO 80 refused"), "{}", stderr(&output));
}
