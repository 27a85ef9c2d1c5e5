//! Shared by the whole-rig tests: the executable under test, its run folders, and how a run is judged.
#![allow(dead_code, reason = "each test file uses its own part")]

pub(crate) mod bus_log;

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::time::Duration;

use masseter_runtime::clock::{self, SECOND_NS};
use rustix::process::Pid;
use serde_json::Value;

/// The executable under test.
pub(crate) const MASSETER: &str = env!("CARGO_BIN_EXE_masseter");

/// Exit codes of a run that passed, and of one whose verdict names the machine as the cause of missed cycles.
pub(crate) const PASSED_OR_INVALID: [Option<i32>; 2] = [Some(0), Some(3)];

/// Sections of a scenario for tests of function in real time.
pub(crate) const LENIENT: &str = include_str!("../lenient.toml");

/// Largest tracking error of a run whose cycles the machine may delay, mm.
const TRACKING_RMS_MM: f64 = 1.0;

/// Longest wait for an event that normally comes within seconds, ns.
const GIVE_UP_NS: u64 = 30 * SECOND_NS;

/// The right to start rigs in real time. Every rig uses the same two cores, so one test at a time has this: a locked
/// file excludes tests in other threads, in other processes (cargo-nextest) and of other working trees.
pub(crate) struct Cores {
    _lock: File,
}

impl Cores {
    /// Waits until no other test has the cores.
    pub(crate) fn take() -> Self {
        let name = format!("masseter-tests-{}.lock", rustix::process::getuid().as_raw());
        let path = std::env::temp_dir().join(name);
        let lock = File::create(path).expect("the lock's file can be made");
        lock.lock().expect("the file can be locked");
        Self { _lock: lock }
    }
}

/// Each third case; every case where EVERY_CASE is in the environment, as in a shard of scripts/nightly.
pub(crate) fn sample<T>(cases: &[T]) -> impl Iterator<Item = &T> {
    cases.iter().step_by(if std::env::var_os("EVERY_CASE").is_some() { 1 } else { 3 })
}

/// Waits until the recording shows that the rig runs.
pub(crate) fn wait_until_it_records(workspace: &Workspace) {
    wait_until("the rig records", || workspace.recorded_bytes() > 500_000);
}

/// Waits until it is so; panics with `what` after [`GIVE_UP_NS`].
pub(crate) fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let give_up_ns = clock::now_ns() + GIVE_UP_NS;
    while !is_so() {
        assert!(
            clock::now_ns() < give_up_ns,
            "within {} s it did not become true that {what}",
            GIVE_UP_NS / SECOND_NS
        );
        clock::sleep(Duration::from_millis(5));
    }
}

/// A temporary folder of a test, with a scenario and a run folder.
pub(crate) struct Workspace {
    folder: tempfile::TempDir,
}

impl Workspace {
    pub(crate) fn new(scenario: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join("scenario.toml"), scenario).expect("the scenario is written");
        Self { folder }
    }

    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.file(name);
        fs::write(&path, text).expect("the file is written");
        path
    }

    /// A rig in real time during a long run.
    pub(crate) fn running(cores: &Cores, scenario: &str) -> (Self, Child) {
        let workspace = Self::new(&format!("duration_s = 60.0\n{scenario}"));
        let child = workspace.start(cores, &[]);
        wait_until_it_records(&workspace);
        (workspace, child)
    }

    /// Starts a run in real time.
    pub(crate) fn start(&self, cores: &Cores, arguments: &[&str]) -> Child {
        let mut command = self.command(cores, arguments);
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("masseter starts")
    }

    /// Runs the rig in real time, to its end.
    pub(crate) fn run(&self, cores: &Cores, arguments: &[&str]) -> Output {
        self.command(cores, arguments).output().expect("masseter starts")
    }

    /// `masseter run` with this scenario into the run folder, in real time, ready to be started.
    pub(crate) fn command(&self, _cores: &Cores, arguments: &[&str]) -> Command {
        let mut command = self.masseter_run(arguments);
        command.args(["--clock", "rt"]);
        command
    }

    fn masseter_run(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(MASSETER);
        command
            .arg("run")
            .arg(self.file("scenario.toml"))
            .arg("--out")
            .arg(self.run_folder())
            .args(arguments);
        command
    }

    /// Runs the rig under virtual time.
    pub(crate) fn run_virtual(&self, arguments: &[&str]) -> Output {
        self.run_simulated("virtual", arguments)
    }

    /// Runs the rig in simulated time: `virtual` or `lockstep`.
    pub(crate) fn run_simulated(&self, clock: &str, arguments: &[&str]) -> Output {
        let mut command = self.masseter_run(arguments);
        command.args(["--clock", clock]).output().expect("masseter starts")
    }

    /// Starts a run under virtual time.
    pub(crate) fn start_virtual(&self) -> Child {
        let mut command = self.masseter_run(&["--clock", "virtual"]);
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("masseter starts")
    }

    /// Starts a run in lockstep.
    pub(crate) fn start_lockstep(&self, arguments: &[&str]) -> Child {
        let mut command = self.masseter_run(arguments);
        command.args(["--clock", "lockstep", "--quiet"]);
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("masseter starts")
    }

    pub(crate) fn run_folder(&self) -> PathBuf {
        self.file("run")
    }

    /// The bytes of the recording.
    pub(crate) fn recording(&self) -> Vec<u8> {
        fs::read(self.run_folder().join("recording.mcap")).expect("a recording")
    }

    /// Length of the recording so far.
    pub(crate) fn recorded_bytes(&self) -> u64 {
        fs::metadata(self.run_folder().join("recording.mcap")).map_or(0, |file| file.len())
    }

    pub(crate) fn summary(&self) -> Value {
        json(&self.run_folder().join("summary.json"))
    }

    pub(crate) fn manifest(&self) -> Value {
        json(&self.run_folder().join("manifest.json"))
    }

    /// The manifest without the digest of its text, to be edited: as a program writes that knows no digest.
    pub(crate) fn manifest_without_digest(&self) -> Value {
        let mut manifest = self.manifest();
        manifest.as_object_mut().expect("an object").remove("digest").expect("a digest");
        manifest
    }
}

/// The process of a running rig that plays `role`, once it runs.
pub(crate) fn child_of(supervisor: &Child, role: &str) -> Pid {
    let mut found = None;
    wait_until(&format!("a {role} runs"), || {
        found = running_child_of(supervisor, role);
        found.is_some()
    });
    found.expect("it was waited for")
}

fn running_child_of(supervisor: &Child, role: &str) -> Option<Pid> {
    let children = fs::read_to_string(format!("/proc/{0}/task/{0}/children", supervisor.id())).ok()?;
    let plays = |id: &i32| {
        let command = fs::read_to_string(format!("/proc/{id}/cmdline")).unwrap_or_default();
        command.split('\0').nth(1) == Some(role)
    };
    let child = children.split_whitespace().filter_map(|id| id.parse().ok()).find(plays)?;
    Pid::from_raw(child)
}

pub(crate) fn json(path: &Path) -> Value {
    let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The check of a run's summary that goes by this name.
pub(crate) fn check<'a>(summary: &'a Value, name: &str) -> &'a Value {
    let checks = summary["verdict"]["checks"].as_array().expect("a list of checks");
    let found = checks.iter().find(|check| check["name"] == name);
    found.unwrap_or_else(|| panic!("no check {name} among {checks:?}"))
}

/// Judges a run in real time by what no disturbance excuses: its verdict is PASS, or INVALID because of the machine; the
/// motion was played to its end; the platform followed.
pub(crate) fn assert_played(run: &Path, status: ExitStatus, said: &str) {
    assert!(PASSED_OR_INVALID.contains(&status.code()), "{status}: {said}");
    let figures = &json(&run.join("summary.json"))["figures"];
    let skipped =
        ["controller_skips", "plant_skips"].map(|of| figures[of]["skipped"].as_u64().expect("a count"));
    assert!(status.success() || skipped.iter().sum::<u64>() > 0, "INVALID without a missed cycle: {said}");
    assert_eq!(figures["final_state"], "finished", "{said}");
    let tracking = &figures["tracking"];
    let rms_mm = tracking["rms_mm"].as_f64().expect("an error of tracking");
    assert!(rms_mm <= TRACKING_RMS_MM, "{tracking}: {said}");
}

/// Whether the summary's events name this cause.
pub(crate) fn has_event(summary: &Value, kind: &str, cause: &str) -> bool {
    let mut events = summary["figures"]["events"].as_array().expect("a list of events").iter();
    events.any(|event| event["kind"] == kind && event["cause"] == cause)
}

/// Whether a process has ended, also if nobody has waited for it.
pub(crate) fn is_dead(pid: i32) -> bool {
    let status = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    status.rsplit_once(") ").is_none_or(|(_, rest)| rest.starts_with(['Z', 'X']))
}

/// Demands the program that writes Parquet files. `cargo test` builds it with the tests of its own package; Cargo knows no way
/// to demand a program of another package.
pub(crate) fn demand_parquet() {
    let program = Path::new(MASSETER).with_file_name("masseter-parquet");
    assert!(program.is_file(), "{} is missing: cargo build -p masseter-parquet", program.display());
}

/// Waits for the end of a process, which exits with this code; returns what it said.
pub(crate) fn ended(child: Child, code: i32) -> String {
    let output = child.wait_with_output().expect("it is a child");
    let said = stdout(&output) + &stderr(&output);
    assert_eq!(output.status.code(), Some(code), "{said}");
    said
}

/// Copies the program by another process: a file that this one has open for writing cannot be executed, and a child
/// that another test starts meanwhile would hold it open.
pub(crate) fn copy_program(to: &Path) {
    let status = Command::new("cp").arg(MASSETER).arg(to).status().expect("cp starts");
    assert!(status.success(), "{}", to.display());
}

pub(crate) fn masseter(arguments: &[&str]) -> Output {
    Command::new(MASSETER).args(arguments).output().expect("masseter starts")
}

/// Runs masseter with a limit on the size of files, in blocks of 512 bytes, as on a full disk.
pub(crate) fn cramped(blocks: u32, arguments: &[&str]) -> Output {
    let limit = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\"");
    Command::new("sh").args(["-c", &limit, "sh", MASSETER]).args(arguments).output().expect("a shell starts")
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Reports that a test is skipped. The harness hides the output of `eprintln!` in a passing test, but not bytes written
/// to standard error directly.
pub(crate) fn skip(why: &str) {
    writeln!(io::stderr(), "SKIPPED: {why}").expect("standard error can be written");
}

/// A rig's files in shared memory.
pub(crate) struct SharedMemory {
    id: String,
}

impl SharedMemory {
    /// Of a running rig with `id` in its name. Waits until the rig has such files, so that their absence later means
    /// something.
    pub(crate) fn of_running(id: &str) -> Self {
        let memory = Self { id: id.to_owned() };
        wait_until("the rig has files in shared memory", || !memory.files().is_empty());
        memory
    }

    /// The names of those that exist.
    pub(crate) fn files(&self) -> Vec<String> {
        let entries = fs::read_dir("/dev/shm").expect("/dev/shm can be listed");
        entries
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .filter(|name| name.starts_with("masseter_") && name.contains(&self.id))
            .collect()
    }
}
