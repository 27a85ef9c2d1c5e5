//! Attacks by other users of the machine: they can neither stop, read nor trick a rig.
//!
//! Root becomes a victim and a stranger with `setpriv`; without root these tests are skipped.

use std::fs::{self, DirBuilder, File};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt, chown, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::common::{
    Cores, LENIENT, MASSETER, Workspace, assert_played, copy_program, masseter, skip, stderr, stdout,
    wait_until,
};
use rustix::process::getuid;

const STRANGER: u32 = 61_000;

/// A user without any rights, with a folder for an executable of its own and everything that it leaves.
struct Victim {
    id: u32,
    workspace: Workspace,
}

impl Victim {
    /// None without the right to become this user. Every test has a user of its own, and so a runtime folder.
    fn new(id: u32, scenario: &str) -> Option<Self> {
        if !getuid().is_root() {
            skip("needs root to become other users");
            return None;
        }
        let workspace = Workspace::new(scenario);
        let folder = workspace.file("");
        fs::set_permissions(&folder, PermissionsExt::from_mode(0o755)).unwrap();
        copy_program(&folder.join("masseter"));
        for path in [folder.clone(), folder.join("masseter"), folder.join("scenario.toml")] {
            chown(path, Some(id), Some(id)).unwrap();
        }
        let victim = Self { id, workspace };
        victim.remove_runtime_folder();
        Some(victim)
    }

    fn runtime_folder(&self) -> PathBuf {
        format!("/dev/shm/masseter-{}", self.id).into()
    }

    /// Those that are tried where strangers hold the first.
    fn further_folders(&self) -> Vec<PathBuf> {
        (1..8).map(|number| format!("/dev/shm/masseter-{}-{number}", self.id).into()).collect()
    }

    fn remove_further_folders(&self) {
        self.further_folders().iter().for_each(|folder| drop(fs::remove_dir_all(folder)));
    }

    fn remove_runtime_folder(&self) {
        self.remove_further_folders();
        let folder = self.runtime_folder();
        let _ = fs::remove_file(&folder);
        let _ = fs::remove_dir_all(&folder);
    }

    fn masseter(&self, arguments: &[&str]) -> Command {
        let mut command = as_user(self.id, self.workspace.file("masseter").to_str().unwrap());
        command.args(arguments).current_dir(self.workspace.file("")).env_remove("XDG_RUNTIME_DIR");
        command
    }

    fn clean(&self) -> Output {
        self.masseter(&["clean"]).output().unwrap()
    }

    /// A domain without a process; its folder. Others may look into the runtime folder, until the victim's next command.
    fn leave_a_dead_domain(&self) -> PathBuf {
        let dead = self.runtime_folder().join("dead");
        let made = as_user(self.id, "mkdir").arg("-p").arg(&dead).status().unwrap();
        assert!(made.success());
        fs::write(dead.join("lock"), "abc").unwrap();
        self.own(&dead.join("lock"));
        dead
    }

    fn own(&self, path: &Path) {
        chown(path, Some(self.id), Some(self.id)).unwrap();
    }
}

impl Drop for Victim {
    fn drop(&mut self) {
        self.remove_runtime_folder();
    }
}

fn as_user(id: u32, program: &str) -> Command {
    let mut command = Command::new("setpriv");
    command.args([&format!("--reuid={id}"), &format!("--regid={id}"), "--clear-groups", program]);
    command
}

/// Whether the stranger gets this done. A program that is missing or ends by a signal shows nothing.
fn stranger_can(program: &str, arguments: &[&str]) -> bool {
    let mut command = as_user(STRANGER, program);
    let command = command.args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
    let code = command.status().unwrap().code().expect("the program ends by itself");
    assert!(![126, 127].contains(&code), "{program} cannot be run");
    code == 0
}

fn mode(path: &Path) -> u32 {
    fs::symlink_metadata(path).unwrap().mode() & 0o777
}

#[test]
fn a_folder_of_a_stranger_is_not_used_and_without_any_other_the_error_says_what_to_do() {
    let Some(victim) = Victim::new(61_001, "") else { return };
    let (folder, precious) = (victim.runtime_folder(), victim.workspace.write("precious", "content"));
    victim.own(&precious);
    assert!(stranger_can("mkdir", &["-m", "777", folder.to_str().unwrap()]));
    // The lock would be opened through this link.
    symlink(&precious, folder.join(".turn")).unwrap();
    for (number, other) in victim.further_folders().into_iter().enumerate() {
        let dead = other.join(format!("dead-{number}"));
        let made = as_user(victim.id, "mkdir").args(["-m", "700", "-p"]).args([&other, &dead]).status();
        assert!(made.unwrap().success());
    }
    let cleaned = victim.clean();
    assert_eq!(cleaned.status.code(), Some(0), "{}", stderr(&cleaned));
    for number in 0..victim.further_folders().len() {
        assert!(stdout(&cleaned).contains(&format!("dead-{number}:")), "{}", stdout(&cleaned));
    }
    victim.remove_further_folders();
    assert_eq!(victim.clean().status.code(), Some(0));
    assert_eq!(mode(&victim.further_folders()[0]), 0o700);
    victim.remove_further_folders();
    for other in victim.further_folders() {
        assert!(stranger_can("mkdir", &[other.to_str().unwrap()]));
    }
    let long = victim.workspace.file(&"x".repeat(60));
    let squatted = victim.masseter(&["clean"]).env("XDG_RUNTIME_DIR", &long).output().unwrap();
    assert_eq!(squatted.status.code(), Some(2), "{}", stderr(&squatted));
    for what in [
        "is not a private folder",
        folder.to_str().unwrap(),
        "set XDG_RUNTIME_DIR",
        "is passed over: its path has",
    ] {
        assert!(stderr(&squatted).contains(what), "{}", stderr(&squatted));
    }
    assert_eq!(fs::read_to_string(&precious).unwrap(), "content");

    // A private folder of the session helps.
    let session = victim.workspace.file("s");
    fs::create_dir(&session).unwrap();
    fs::set_permissions(&session, PermissionsExt::from_mode(0o700)).unwrap();
    victim.own(&session);
    let output = victim.masseter(&["clean"]).env("XDG_RUNTIME_DIR", &session).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert_eq!(mode(&session.join("masseter")), 0o700);
}

#[test]
fn a_link_in_place_of_the_folder_is_not_followed() {
    let Some(victim) = Victim::new(61_002, "") else { return };
    let elsewhere = victim.workspace.file("elsewhere");
    fs::create_dir(&elsewhere).unwrap();
    victim.own(&elsewhere);
    let link = victim.runtime_folder();
    assert!(stranger_can("ln", &["-s", elsewhere.to_str().unwrap(), link.to_str().unwrap()]));
    let cleaned = victim.clean();
    assert_eq!(cleaned.status.code(), Some(0), "{}", stderr(&cleaned));
    assert_eq!(fs::read_dir(&elsewhere).unwrap().count(), 0);
}

#[test]
fn a_stranger_cannot_hold_the_lock() {
    let Some(victim) = Victim::new(61_003, "") else { return };
    victim.leave_a_dead_domain();
    assert_eq!(victim.clean().status.code(), Some(0));
    let lock = victim.runtime_folder().join(".turn");
    assert!(lock.exists());
    assert!(!stranger_can("flock", &["--nonblock", lock.to_str().unwrap(), "true"]));
}

#[test]
fn a_lock_that_is_held_too_long_ends_in_an_error_that_names_the_process() {
    let session = tempfile::tempdir().unwrap();
    fs::set_permissions(session.path(), PermissionsExt::from_mode(0o700)).unwrap();
    // A domain is swept under the lock.
    let leave_a_dead_domain = || {
        let dead = session.path().join("masseter/dead");
        DirBuilder::new().mode(0o700).recursive(true).create(dead).unwrap();
    };
    leave_a_dead_domain();
    let clean = || {
        let mut command = Command::new(MASSETER);
        command.arg("clean").env("XDG_RUNTIME_DIR", session.path()).output().unwrap()
    };
    assert_eq!(clean().status.code(), Some(0));
    let lock = File::open(session.path().join("masseter/.turn")).unwrap();
    lock.lock().unwrap();
    leave_a_dead_domain();
    let output = clean();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    let holder = format!("process {} (", std::process::id());
    assert!(stderr(&output).contains(&holder), "{}", stderr(&output));
    drop(lock);
    assert_eq!(clean().status.code(), Some(0));
}

#[test]
fn a_file_of_a_stranger_is_reported_and_blocks_nobody() {
    let Some(victim) = Victim::new(61_004, "") else { return };
    let dead = victim.leave_a_dead_domain();
    let file = format!("/dev/shm/masseter_{}_dead.abc_x", victim.id);
    assert!(stranger_can("touch", &[&file]));
    let output = victim.clean();
    fs::remove_file(&file).unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stderr(&output).contains(&format!("cannot remove {file}")), "{}", stderr(&output));
    assert!(!dead.exists());
}

/// The stranger waits for the first file, whose name shows the prefix of all others.
#[test]
fn a_stranger_that_makes_files_of_every_run_stops_none() {
    let cores = Cores::take();
    let Some(victim) = Victim::new(61_006, &format!("duration_s = 1.0\n{LENIENT}")) else { return };
    let script = format!(
        "while :; do for file in /dev/shm/masseter_{}_*.global_mgmt; do
           prefix=${{file%%.*}}.$(echo ${{file#*.}} | cut -c 1-17); case $prefix in *[*]*) ;; *) touch ${{prefix}}x; exit;; esac
         done; done",
        victim.id
    );
    let mut squatting = as_user(STRANGER, "sh").args(["-c", &script]).stderr(Stdio::null()).spawn().unwrap();
    let output =
        victim.masseter(&["run", "scenario.toml", "--clock", "rt", "--out", "run"]).output().unwrap();
    squatting.kill().unwrap();
    squatting.wait().unwrap();
    drop(cores);
    let prefix = format!("/dev/shm/masseter_{}_", victim.id);
    let left = fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap().path());
    let left: Vec<_> = left.filter(|path| path.to_string_lossy().starts_with(&prefix)).collect();
    for path in &left {
        fs::remove_file(path).unwrap();
    }
    assert_eq!(left.len(), 1, "{left:?}: {}", stderr(&output));
    assert!(stderr(&output).contains("cannot remove /dev/shm/masseter_"), "{}", stderr(&output));
    assert_played(&victim.workspace.run_folder(), output.status, &(stdout(&output) + &stderr(&output)));
}

#[test]
fn nothing_of_a_run_can_be_read_by_a_stranger() {
    let cores = Cores::take();
    let Some(victim) = Victim::new(61_005, &format!("duration_s = 2.0\n{LENIENT}")) else { return };
    let mut run = victim.masseter(&["run", "scenario.toml", "--clock", "rt", "--out", "run"]);
    let run = run.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait_until("the rig records", || victim.workspace.recorded_bytes() > 500_000);

    let prefix = format!("masseter_{}_", victim.id);
    let shared = fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap().path());
    let shared: Vec<_> = shared.filter(|path| path.to_string_lossy().contains(&prefix)).collect();
    assert!(shared.len() > 10, "{shared:?}");
    for path in &shared {
        assert_eq!(mode(path) & 0o077, 0, "{path:?} {:o}", mode(path));
    }
    let folder = victim.workspace.run_folder();
    let recording = folder.join("recording.mcap");
    for path in [&shared[0], &recording, &victim.runtime_folder().join(".turn")] {
        assert!(!stranger_can("cat", &[path.to_str().unwrap()]), "{path:?}");
    }
    let output = run.wait_with_output().unwrap();
    drop(cores);
    assert_played(&folder, output.status, &(stdout(&output) + &stderr(&output)));
    assert_eq!((mode(&folder), mode(&recording)), (0o700, 0o600));
    let folder = folder.to_str().unwrap();
    assert!(!stranger_can("ls", &[folder]));
    let program = victim.workspace.file("masseter");
    let report = as_user(STRANGER, program.to_str().unwrap()).args(["report", folder]).output().unwrap();
    assert_eq!(report.status.code(), Some(2), "{}", stdout(&report));
    assert!(stderr(&report).contains("cannot be read: Permission denied"), "{}", stderr(&report));
}

#[test]
fn a_run_is_readable_by_whom_its_user_says() {
    for (who, folder, file) in [("owner", 0o700, 0o600), ("group", 0o750, 0o640), ("all", 0o755, 0o644)] {
        let workspace = Workspace::new("duration_s = 0.5");
        let output = workspace.run_virtual(&["--readable-by", who]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let run = workspace.run_folder();
        assert_eq!(mode(&run), folder, "{who}");
        // A later report makes its files for the same readers.
        fs::remove_file(run.join("summary.json")).unwrap();
        assert_eq!(masseter(&["report", run.to_str().unwrap()]).status.code(), Some(0));
        for name in ["recording.mcap", "manifest.json", "scenario.toml", "summary.json"] {
            assert_eq!(mode(&run.join(name)), file, "{who} {name}");
        }
    }
}
