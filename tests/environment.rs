//! Runs on a machine that refuses something: real time, or room on the disk.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{Read, Write};
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use masseter_runtime::clock::{self, SECOND_NS};
use masseter_runtime::messages::State;
use masseter_runtime::messages::codes::ControllerState::Finished;
use masseter_runtime::transport::{Domain, Node, Subscriber};

use crate::common::{
    self, Cores, LENIENT, SharedMemory, Workspace, assert_played, cramped, masseter, skip, stderr, stdout,
    wait_until_it_records,
};
use serde_json::{Value, json};

#[test]
fn refusals_of_the_kernel_are_reported_and_required_real_time_is_exit_3() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 1.0\n[realtime]\ncores = [0, 4000]\n{LENIENT}"));
    let output = workspace.run(&cores, &["--require-rt", "--format", "json"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains("core 4000 refused"), "{}", stderr(&output));
    assert!(!workspace.manifest()["scheduling"]["plant"]["refusals"].as_array().unwrap().is_empty());
    let shown: Value = serde_json::from_str(&stdout(&output)).expect("a summary on standard output");
    assert_eq!(shown["verdict"]["word"], "INVALID", "{shown}");
    // No cycle ran, so nothing kept its time and nothing failed.
    assert_eq!(
        (&shown["verdict"]["timing"]["word"], &shown["verdict"]["checks"]),
        (&"unknown".into(), &json!([]))
    );
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
    let workspace = Workspace::new(&format!("duration_s = 1.0\n{LENIENT}"));
    // The executable and the folder must be reachable for that user.
    let folder = workspace.file("home");
    fs::create_dir(&folder).unwrap();
    let executable = folder.join("masseter");
    common::copy_program(&executable);
    fs::copy(workspace.file("scenario.toml"), folder.join("scenario.toml")).unwrap();
    let status = Command::new("chown").args(["-R", "65534:65534"]).arg(workspace.file("")).status().unwrap();
    assert!(status.success());
    let output = Command::new("setpriv")
        .args(["--reuid=65534", "--regid=65534", "--clear-groups"])
        .arg(&executable)
        .args(["run", "scenario.toml", "--clock", "rt", "--out", "run"])
        .current_dir(&folder)
        .output()
        .unwrap();
    assert_played(&folder.join("run"), output.status, &(stdout(&output) + &stderr(&output)));
    assert!(stderr(&output).contains("SCHED_FIFO 80 refused"), "{}", stderr(&output));
}

/// Root may write into any folder.
#[test]
fn a_run_in_a_read_only_folder_is_reported() {
    let workspace = Workspace::new("duration_s = 0.5\n[checks]\ntracking_rms_mm = 1e-9");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(1));
    let (run, executable) = (workspace.run_folder(), workspace.file("masseter"));
    common::copy_program(&executable);
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

/// A disk of limited size, there as long as this is.
struct SmallDisk<'a>(&'a Path);

impl<'a> SmallDisk<'a> {
    /// In memory.
    fn on(folder: &'a Path, size: &str) -> Option<Self> {
        Self::mount(folder, &["-t", "tmpfs", "-o", &format!("size={size}"), "tmpfs"])
    }

    /// In the file `image`, as a file system that can be frozen.
    fn in_file(folder: &'a Path, image: &Path) -> Option<Self> {
        File::create(image).unwrap().set_len(512 << 20).unwrap();
        let made = Command::new("mkfs.ext4").arg("-q").arg(image).status();
        made.is_ok_and(|status| status.success()).then_some(())?;
        Self::mount(folder, &["-o", "loop", image.to_str()?])
    }

    /// `None` if nothing may be mounted, as by ordinary users and in most containers.
    fn mount(folder: &'a Path, what: &[&str]) -> Option<Self> {
        let mounted = Command::new("mount").args(what).arg(folder).status();
        mounted.is_ok_and(|status| status.success()).then(|| Self(folder))
    }

    /// Lets all writers wait until standard input of the child is closed, also by the end of this test.
    fn freeze(folder: &Path) -> Child {
        let script = "fsfreeze -f \"$1\" && echo frozen && read -r _; fsfreeze -u \"$1\"";
        let mut freeze = Command::new("sh");
        freeze.args(["-c", script, "sh"]).arg(folder).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = freeze.spawn().expect("a shell starts");
        let mut said = [0; 6];
        child.stdout.as_mut().expect("it is piped").read_exact(&mut said).expect("the disk is frozen");
        child
    }

    /// Takes all the room that is left.
    fn fill(folder: &Path) {
        let mut filler = File::create(folder.join("filler")).unwrap();
        while filler.write_all(&[0; 4096]).is_ok() {}
    }
}

impl Drop for SmallDisk<'_> {
    fn drop(&mut self) {
        // The kernel closes the files of a process that has ended a moment later.
        let unmounts = || Command::new("umount").arg(self.0).status().is_ok_and(|status| status.success());
        let unmounted = (0..20).any(|_| {
            unmounts() || {
                clock::sleep(Duration::from_millis(100));
                false
            }
        });
        assert!(unmounted || thread::panicking(), "{} is left mounted", self.0.display());
    }
}

/// A run on a small disk; `None` if such a disk cannot be mounted.
fn run_on_a_small_disk(size: &str, run: impl FnOnce(&Workspace) -> Output) -> Option<Output> {
    let workspace = Workspace::new("");
    let folder = workspace.file("");
    let Some(_disk) = SmallDisk::on(&folder, size) else {
        skip("mounting a small disk is refused");
        return None;
    };
    workspace.write("scenario.toml", LENIENT);
    Some(run(&workspace))
}

/// Follows a rig's states until the controller has finished; how far the motion came, s.
fn played_s(rig: &str) -> f64 {
    let mut states: Option<Subscriber<State>> = None;
    let mut motion_s = 0.0_f64;
    let give_up_ns = clock::now_ns() + 30 * SECOND_NS;
    while clock::now_ns() < give_up_ns {
        // The rig's processes make its domain.
        let domain = Domain::named(rig).unwrap();
        states = states.or_else(|| Subscriber::open(&Node::join(&domain).ok()?).ok());
        while let Some(state) = states.as_ref().and_then(|states| states.receive().unwrap()) {
            motion_s = motion_s.max(state.motion_time_s);
            if state.controller_state == Finished as u32 {
                return motion_s;
            }
        }
        clock::sleep(Duration::from_millis(1));
    }
    panic!("in 30 s the rig did not finish");
}

/// The verdict outlives the disk: on standard output, in the summary and in a later report.
fn assert_judged(small: &Workspace, output: &Output) {
    assert!(stdout(output).contains("\nINCOMPLETE: "), "{}{}", stdout(output), stderr(output));
    assert_eq!(small.summary()["verdict"]["word"], "INCOMPLETE");
    assert_eq!(small.manifest()["ending"]["kind"], "recording_failed");
    let mut files = fs::read_dir(small.run_folder()).unwrap().map(|entry| entry.unwrap().path());
    assert!(!files.any(|file| file.extension() == Some(OsStr::new("part"))));
    fs::remove_file(small.file("filler")).unwrap();
    let again = masseter(&["report", small.run_folder().to_str().unwrap()]);
    assert_eq!(again.status.code(), Some(6), "{}", stderr(&again));
    assert!(stdout(&again).contains("\nINCOMPLETE: "), "{}", stdout(&again));
}

#[test]
fn a_disk_without_room_for_the_run_is_refused_with_figures() {
    let Some(output) = run_on_a_small_disk("2m", |small| {
        let output = small.run_virtual(&["--duration", "3s"]);
        assert!(!small.run_folder().exists());
        output
    }) else {
        return;
    };
    assert_eq!(output.status.code(), Some(6), "{}", stderr(&output));
    assert!(stderr(&output).contains("has 2.1 MB free, and the run may need 20.0 MB"), "{}", stderr(&output));
}

/// In a mount namespace of its own, `/dev/shm` has any size.
#[test]
fn shared_memory_without_room_for_a_rig_is_refused_and_with_just_enough_it_runs() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 1.0\n{LENIENT}"));
    let beside = |size: &str, program: &OsStr| {
        let mount = format!("mount -t tmpfs -o size={size} tmpfs /dev/shm && exec \"$@\"");
        let mut command = Command::new("unshare");
        command.args(["-m", "sh", "-c", &mount, "sh"]).arg(program);
        command
    };
    let run = |size: &str| {
        let rig = workspace.command(&cores, &[]);
        beside(size, rig.get_program()).args(rig.get_args()).output().unwrap()
    };
    if !beside("8m", "true".as_ref()).output().unwrap().status.success() {
        skip("mounting a small /dev/shm is refused");
        return;
    }
    let output = run("8m");
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    let refusal = "/dev/shm has 8.4 MB free, and a rig needs 36.0 MB";
    assert!(stderr(&output).contains(refusal), "{}", stderr(&output));
    assert!(!workspace.run_folder().exists());
    let output = run("35m");
    assert_played(&workspace.run_folder(), output.status, &(stdout(&output) + &stderr(&output)));
}

#[test]
fn a_folder_that_is_no_utf_8_takes_runs_under_both_clocks() {
    let _cores = Cores::take();
    let motion = "[motion]\nkind = 'file'\npath = 'jaw.csv'";
    let workspace = Workspace::new(&format!("{motion}\n{LENIENT}"));
    let row = |i: i32| format!("{},0,0,{},1,0,0,0\n", f64::from(i) * 0.02, -(f64::from(i) * 0.1).sin());
    let rows: String = (0..50).map(row).collect();
    workspace.write("jaw.csv", &format!("time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n{rows}"));
    for clock in ["virtual", "rt"] {
        let name = [format!("run-{clock}-").as_bytes(), b"\xff"].concat();
        let folder = workspace.file("").join(OsStr::from_bytes(&name));
        let mut run = Command::new(common::MASSETER);
        run.arg("run").arg(workspace.file("scenario.toml")).args(["--clock", clock, "--out"]).arg(&folder);
        let output = run.output().unwrap();
        assert_played(&folder, output.status, &(stdout(&output) + &stderr(&output)));
    }
}

#[test]
fn a_full_disk_does_not_stop_the_rig() {
    let cores = Cores::take();
    let name = format!("full-{}", std::process::id());
    let mut motion_s = 0.0;
    let output = run_on_a_small_disk("24m", |small| {
        let rig = small.start(&cores, &["--duration", "3s", "--name", &name]);
        wait_until_it_records(small);
        SmallDisk::fill(&small.file(""));
        motion_s = played_s(&name);
        let output = rig.wait_with_output().unwrap();
        assert_judged(small, &output);
        output
    });
    let Some(output) = output else { return };
    assert_eq!(output.status.code(), Some(6), "{}{}", stdout(&output), stderr(&output));
    assert!(stderr(&output).contains("No space left on device"), "{}", stderr(&output));
    // The motion's own time passes more slowly while it gathers speed and comes to rest.
    assert!(motion_s >= 2.0, "the motion ended at {motion_s} s");
}

#[test]
fn a_full_disk_ends_a_run_under_virtual_time() {
    let output = run_on_a_small_disk("160m", |small| {
        small.write("scenario.toml", &format!("duration_s = 60.0\n{LENIENT}"));
        let rig = small.start_virtual();
        wait_until_it_records(small);
        SmallDisk::fill(&small.file(""));
        let output = rig.wait_with_output().unwrap();
        assert_judged(small, &output);
        output
    });
    let Some(output) = output else { return };
    assert_eq!(output.status.code(), Some(6), "{}{}", stdout(&output), stderr(&output));
    assert!(stderr(&output).contains("the run ends here"), "{}", stderr(&output));
}

#[test]
fn a_full_disk_leaves_a_verdict_of_a_run_in_lockstep() {
    let output = run_on_a_small_disk("160m", |small| {
        let rig = small.start_lockstep(&["--duration", "60s"]);
        let memory = SharedMemory::of_running(&format!("{}-", rig.id()));
        wait_until_it_records(small);
        SmallDisk::fill(&small.file(""));
        let output = rig.wait_with_output().unwrap();
        assert_judged(small, &output);
        assert_eq!(memory.files(), Vec::<String>::new());
        output
    });
    let Some(output) = output else { return };
    assert_eq!(output.status.code(), Some(6), "{}{}", stdout(&output), stderr(&output));
    assert!(stderr(&output).contains("No space left on device"), "{}", stderr(&output));
}

/// The recorder waits for the disk, and plant and controller for the recorder.
#[test]
fn a_disk_that_stands_still_for_five_seconds_changes_no_byte_of_a_run_in_lockstep() {
    let scenario = "duration_s = 25.0";
    let [reference, workspace] = [1, 2].map(|_| Workspace::new(scenario));
    let folder = workspace.file("");
    let Some(_disk) = SmallDisk::in_file(&folder, &reference.file("disk")) else {
        skip("mounting a disk that can be frozen is refused");
        return;
    };
    workspace.write("scenario.toml", scenario);
    assert_eq!(reference.run_virtual(&[]).status.code(), Some(0));
    let rig = workspace.start_lockstep(&[]);
    wait_until_it_records(&workspace);
    let mut freeze = SmallDisk::freeze(&folder);
    clock::sleep(Duration::from_secs(1));
    let recorded_bytes = workspace.recorded_bytes();
    clock::sleep(Duration::from_secs(4));
    assert_eq!(workspace.recorded_bytes(), recorded_bytes);
    drop(freeze.stdin.take());
    assert!(freeze.wait().unwrap().success());
    let output = rig.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
    let recording = workspace.recording();
    assert!(recorded_bytes < recording.len() as u64, "the run was over before the disk stood still");
    assert!(recording == reference.recording());
}

/// A limit on the size of files stands for the full disk.
#[test]
fn a_full_disk_is_exit_6_of_every_verb_that_writes_files() {
    common::demand_parquet();
    let workspace = Workspace::new("duration_s = 0.5");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let run = workspace.run_folder();
    let run = run.to_str().unwrap();
    let verbs: [&[&str]; 3] = [
        &["export", run, "--out"],
        &["export", run, "--format", "csv", "--out"],
        &["recording", "recover", run, "--out"],
    ];
    for (number, verb) in verbs.into_iter().enumerate() {
        let out = workspace.file(&format!("out-{number}"));
        let arguments = [verb, &[out.to_str().unwrap()]].concat();
        let output = cramped(0, &arguments);
        assert_eq!(output.status.code(), Some(6), "{verb:?}: {}", stderr(&output));
        assert!(stderr(&output).contains("File too large"), "{verb:?}: {}", stderr(&output));
    }
    // The same with room.
    for (number, verb) in verbs.into_iter().enumerate() {
        let out = workspace.file(&format!("out-{number}-with-room"));
        let output = masseter(&[verb, &[out.to_str().unwrap()]].concat());
        assert_eq!(output.status.code(), Some(0), "{verb:?}: {}", stderr(&output));
    }
}
