//! `manifest.json`: scenario, machine, scheduling and end of a run; the processes' use of the machine and the setting for
//! wake-ups. The verdict on the run is the judge's.

use std::{collections::BTreeMap, io, time::UNIX_EPOCH};

use masseter_model::geometry::AXES;
use masseter_runtime::{clock, named::Declared, realtime::scheduling::Obtained};
use masseter_scenario::input::{MOST_KEPT_BYTES, read_text};
use masseter_scenario::{CpuDmaLatency, Scenario};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::folder::RunFolder;

/// The name of what a recording says of the circumstances at the start.
pub(super) const AT_START: &str = "circumstances.json";
/// The clock of runs in real time.
const REAL_TIME: &str = "rt";
/// Version of the manifest's form.
const FORM: u32 = 1;

/// How the text begins.
const OPEN: &str = "{\n";
/// The end of the supervisor, until the real end is written.
const UNJUDGED: &str = "it did not live to judge the run, or could not write how it ended";

/// The circumstances of a run.
///
/// ```
/// use masseter_recording::{MachineInfo, Manifest, RunFolder};
/// use masseter_scenario::Scenario;
///
/// let machine = MachineInfo { cpu: "any".into(), cores: 2, kernel: "Linux".into(), is_virtual: false };
/// let manifest = Manifest::new("0.1.0", Scenario::default(), 10.0, "virtual", machine);
/// let parent = tempfile::tempdir()?;
/// let folder = RunFolder::create(&parent.path().join("run"))?;
/// manifest.write(&folder)?;
/// assert_eq!(Manifest::read(&folder)?, manifest);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of this form.
    pub form: u32,
    /// The build of the program, as `masseter --version` says it.
    pub masseter: String,
    /// When the run began, UTC.
    pub began: String,
    /// By how much UTC was ahead of the run's clock then, ns; none in simulated time.
    #[serde(default)]
    pub wall_ahead_ns: Option<i64>,
    /// `rt`, `lockstep` or `virtual`.
    pub clock: String,
    /// Who controlled the robot, if not the motion controller of the rig: `hold`, `external` or the path of a program.
    #[serde(default)]
    pub controller: Option<String>,
    /// The signals and parameters of the controller; parameters with their values at the start.
    #[serde(default)]
    pub declared: Declared,
    /// The scenario as resolved.
    #[serde(with = "masseter_scenario::embedded")]
    pub scenario: Scenario,
    /// Duration of the motion, s.
    pub motion_s: f64,
    /// What the plan warns of.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// What the plan demands of the axes at full speed; none but in a dry run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub full_speed: Option<FullSpeed>,
    /// The machine.
    pub machine: Machine,
    /// The scheduling that each process requested and obtained; empty under virtual time.
    pub scheduling: BTreeMap<String, Obtained>,
    /// Request to `/dev/cpu_dma_latency` and its result; none in simulated time.
    pub cpu_dma_latency: Option<DmaLatency>,
    /// The command against what disturbs real-time runs most on this machine, if one is known and the run is in real time.
    #[serde(default)]
    pub mending_command: Option<String>,
    /// Resources that the processes used in their steady state; empty in simulated time.
    pub usage: RunUsage,
    /// The faults that the supervisor carried out on processes.
    #[serde(default)]
    pub process_faults: Vec<ProcessFault>,
    /// How the run ended.
    pub ending: Ending,
}

/// The largest demands of the motion at full speed, by the plan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FullSpeed {
    /// Velocity of each axis, m/s.
    pub velocity_m_s: [f64; AXES],
    /// Acceleration of each axis, m/s².
    pub acceleration_m_s2: [f64; AXES],
}

impl Manifest {
    /// The circumstances that are known before the start of a run by this build of the program.
    pub fn new(build: &str, scenario: Scenario, motion_s: f64, clock: &str, machine: Machine) -> Self {
        let began = humantime::format_rfc3339_seconds(UNIX_EPOCH + clock::wall_time());
        Self {
            form: FORM,
            masseter: build.to_owned(),
            began: began.to_string(),
            wall_ahead_ns: if clock == REAL_TIME { clock::wall_ahead_ns() } else { None },
            clock: clock.to_owned(),
            controller: None,
            declared: Declared::default(),
            scenario,
            motion_s,
            warnings: Vec::new(),
            full_speed: None,
            machine,
            scheduling: BTreeMap::new(),
            cpu_dma_latency: None,
            mending_command: None,
            usage: RunUsage::default(),
            process_faults: Vec::new(),
            ending: Ending::died("supervisor", UNJUDGED.to_owned()),
        }
    }

    /// The facts known at the start beside the scenario, as JSON. Without what differs between runs in simulated time, whose
    /// recordings are equal.
    pub(crate) fn at_start(&self) -> String {
        let mut known = json!({ "masseter": self.masseter, "motion_s": self.motion_s });
        if self.is_in_real_time() {
            known["began"] = json!(self.began);
            known["clock"] = json!(self.clock);
            known["machine"] = json!(self.machine);
        }
        format!("{known:#}\n")
    }

    /// Whether a program controlled the robot, and none of the rig's controllers.
    pub fn is_of_program(&self) -> bool {
        self.controller.as_deref().is_some_and(|name| name != "hold")
    }

    /// Whether the clock was the machine's.
    pub fn is_in_real_time(&self) -> bool {
        self.clock == REAL_TIME
    }

    /// Whether what [`Self::at_start`] wrote is of a run in real time.
    pub(super) fn says_real_time(at_start: &[u8]) -> bool {
        serde_json::from_slice::<Value>(at_start).is_ok_and(|known| known["clock"] == REAL_TIME)
    }

    /// The first refused request for scheduling, with its remedy, and the process that made it.
    pub fn refusal(&self) -> Option<(&str, &str)> {
        self.scheduling
            .iter()
            .find_map(|(process, obtained)| Some((process.as_str(), obtained.refusals.first()?.as_str())))
    }

    /// Writes the file completely or not at all, with a digest of its text as the first line.
    pub fn write(&self, folder: &RunFolder) -> io::Result<()> {
        let text = serde_json::to_string_pretty(self)? + "\n";
        let (open, rest) = text.split_at(OPEN.len());
        folder.keep(&folder.manifest(), &[open, &digest_line(&digest(&text)), rest].concat())
    }

    /// Reads the file. One whose text was changed after the run is refused; the digest is no seal against those who compute
    /// another one.
    pub fn read(folder: &RunFolder) -> io::Result<Self> {
        #[derive(Deserialize)]
        struct Form {
            form: u32,
            /// None of an older build.
            digest: Option<String>,
        }
        let text = read_text(&folder.manifest(), MOST_KEPT_BYTES)?;
        let Form { form, digest: written } = serde_json::from_str(&text)?;
        if form != FORM {
            return Err(io::Error::other(format!("it has form {form}, this program reads form {FORM}")));
        }
        if let Some(written) = written {
            let found = digest(&text.replacen(&digest_line(&written), "", 1));
            if found != written {
                return Err(io::Error::other(format!(
                    "it was changed after the run: its text has the digest {found}, not {written}; restore the file, or play the \
                     scenario again"
                )));
            }
        }
        let manifest: Self = serde_json::from_str(&text)?;
        manifest.scenario.validate().map_err(io::Error::other)?;
        manifest.declared.check().map_err(io::Error::other)?;
        Ok(manifest)
    }
}

fn digest(text: &str) -> String {
    format!("{:08x}", crc32fast::hash(text.as_bytes()))
}

fn digest_line(digest: &str) -> String {
    format!("  \"digest\": \"{digest}\",\n")
}

/// Resources that a process used in its steady state: CPU time and page faults of all threads, the rest of the main
/// thread, which runs the loop.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Usage {
    /// Duration covered, s.
    pub observed_s: f64,
    /// CPU time, s.
    pub cpu_s: f64,
    /// Times it gave up its core to wait.
    pub voluntary_switches: u64,
    /// Times its core was taken from it.
    pub involuntary_switches: u64,
    /// Page faults served from memory.
    pub minor_faults: u64,
    /// Page faults served from disk.
    pub major_faults: u64,
}

impl Usage {
    /// Share of a core: CPU time over the time observed, 0 when nothing was.
    pub fn share(&self) -> f64 {
        if self.observed_s > 0.0 { self.cpu_s / self.observed_s } else { 0.0 }
    }
}

/// Resources that all processes used, by name, and time stolen from the machine.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RunUsage {
    /// Each process.
    pub processes: BTreeMap<String, Usage>,
    /// Time that the hypervisor ran something else while a core of this machine was ready to run, as far as it reports
    /// that, s.
    pub stolen_s: f64,
    /// The largest jump of the wall clock: it was set, or the machine was suspended, s.
    #[serde(default)]
    pub clock_jump_s: f64,
    /// By process: where the thread of its loop slept less often than it had deadlines, in the order of time.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub loops: BTreeMap<String, Vec<LoopInterval>>,
}

/// Growth of the kernel's counters of the thread that runs a loop, between two samples of the supervisor.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LoopInterval {
    /// The first sample, ns of the run's clock.
    pub from_ns: u64,
    /// The second, ns of the run's clock.
    pub to_ns: u64,
    /// CPU time, ns; `None` if the kernel does not count it.
    pub cpu_ns: Option<u64>,
    /// Time for which it was ready and had no core, ns; `None` if the kernel does not count it.
    pub queued_ns: Option<u64>,
    /// Time that the hypervisor took from its core, ns, in steps of 10 ms; `None` if the hypervisor does not report it.
    pub stolen_ns: Option<u64>,
    /// Times it gave up its core to wait.
    pub voluntary_switches: u64,
    /// Times its core was taken from it.
    pub involuntary_switches: u64,
    /// Page faults served from disk.
    pub major_faults: u64,
    /// Whether a signal or a debugger had stopped it at the second sample.
    #[serde(default)]
    pub is_stopped: bool,
}

/// Request to `/dev/cpu_dma_latency`, and its result.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DmaLatency {
    /// The scenario's choice.
    #[serde(alias = "wanted")]
    pub requested: CpuDmaLatency,
    /// The machine's limit as read back, µs; none when it was left alone.
    pub limit_us: Option<i32>,
    /// Why an explicit request was refused, and the remedy.
    pub refusal: Option<String>,
}

/// The machine a run was made on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Processor model.
    pub cpu: String,
    /// Cores that may be used.
    pub cores: usize,
    /// Kernel name, release and version.
    pub kernel: String,
    /// Whether a hypervisor runs it.
    #[serde(rename = "virtual")]
    pub is_virtual: bool,
}

/// A fault of a process that the supervisor carried out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProcessFault {
    /// Number in the scenario's list, from 1.
    pub number: usize,
    /// When it struck, ns of the run's clock.
    pub struck_ns: u64,
    /// When it ended, ns of the run's clock: in simulated time, which stands still meanwhile, at once. `None` if it has no
    /// end, or the run ended before.
    #[serde(default)]
    pub ended_ns: Option<u64>,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Ending {
    /// The motion was played to its end.
    Completed,
    /// The controller stopped safely because of a fault.
    SafeStop,
    /// A process died.
    Died {
        /// Which.
        process: String,
        /// Exit code or signal.
        how: String,
    },
    /// The controller did not begin the motion, or did not end, by its deadline.
    Overdue,
    /// The user interrupted it.
    Interrupted,
    /// Real time was required and refused.
    NotStarted,
    /// The recorder could not write everything.
    RecordingFailed,
}

impl Ending {
    /// The death of a process.
    pub fn died(process: &str, how: String) -> Self {
        Self::Died { process: process.to_owned(), how }
    }
}
