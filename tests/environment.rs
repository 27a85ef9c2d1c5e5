//! What a run does where the machine refuses it something: real time, or room on the disk.

mod common;

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::thread;

use common::{Cores, UNHURRIED, Workspace, skip, stderr, stdout};
use serde_json::Value;

#[test]
fn what_the_kernel_refuses_is_said_and_required_real_time_exits_with_3() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 1.0\n[realtime]\ncores = [0, 4000]\n{UNHURRIED}"));
    let output = workspace.run(&cores, &["--require-rt", "--format", "json"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("core 4000 refused"), "{}", stderr(&output));
    assert!(!workspace.manifest()["scheduling"]["plant"]["refusals"].as_array().unwrap().is_empty());
    let shown: Value = serde_json::from_str(&stdout(&output)).expect("a summary on standard output");
    assert_eq!(shown["verdict"]["word"], "INVALID", "{shown}");
    assert_eq!(shown, workspace.summary());
    assert!(workspace.run_folder().join("junit.xml").exists());
}

#[test]
fn an_ordinary_user_runs_the_rig_without_real_time() {
    let _cores = Cores::take();
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

/// Root may write into any folder.
#[test]
fn a_run_in_a_folder_that_takes_nothing_is_reported_all_the_same() {
    let workspace = Workspace::new("duration_s = 0.5\n[checks]\ntracking_rms_mm = 1e-9");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(1));
    let (run, executable) = (workspace.run_folder(), workspace.file("masseter"));
    fs::copy(common::MASSETER, &executable).unwrap();
    let status = Command::new("chmod").args(["-R", "a=rX"]).arg(workspace.file("")).status().unwrap();
    assert!(status.success());
    let mut report = Command::new("setpriv");
    if rustix::process::getuid().is_root() {
        report.args(["--reuid=65534", "--regid=65534", "--clear-groups"]);
    }
    let output = report.arg(&executable).arg("report").arg(&run).args(["--format", "json"]).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let shown: Value = serde_json::from_str(&stdout(&output)).expect("a summary on standard output");
    assert_eq!(shown["verdict"]["word"], "FAIL");
    let warning = format!("cannot write {}", run.display());
    assert!(stderr(&output).contains(&warning), "{}", stderr(&output));
    assert_eq!(stderr(&output).lines().count(), 1, "{}", stderr(&output));
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
fn run_on_a_small_disk(run: impl FnOnce(&Workspace) -> Output) -> Option<Output> {
    let workspace = Workspace::new("");
    let folder = workspace.file("");
    let Some(_disk) = SmallDisk::on(&folder) else {
        skip("mounting a small disk is refused");
        return None;
    };
    workspace.write("scenario.toml", UNHURRIED);
    Some(run(&workspace))
}

#[test]
fn a_full_disk_does_not_stop_the_rig() {
    let cores = Cores::take();
    let Some(output) = run_on_a_small_disk(|small| small.run(&cores, &["--duration", "3s"])) else { return };
    assert_eq!(output.status.code(), Some(6), "{}{}", stdout(&output), stderr(&output));
    let said = stderr(&output);
    assert!(said.contains("the rig goes on"), "{said}");
    assert!(said.contains("No space left on device"), "{said}");
    assert!(said.contains("running       motion    2."), "the rig stopped with its recording: {said}");
}

#[test]
fn a_full_disk_ends_a_run_under_virtual_time() {
    let Some(output) = run_on_a_small_disk(|small| small.run_virtual(&["--duration", "3s"])) else { return };
    assert_eq!(output.status.code(), Some(6), "{}{}", stdout(&output), stderr(&output));
    assert!(stderr(&output).contains("the run ends here"), "{}", stderr(&output));
}
