//! The circumstances of a run in the manifest: the machine, the processes' use of it, the setting for wake-ups, and how the
//! processes ended. The verdict on the run is the report's.

use std::collections::BTreeMap;

use masseter_scenario::CpuDmaLatency;
use serde::{Deserialize, Serialize};

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
    /// When it ended, ns of the run's clock: in simulated time, which stands still meanwhile, at once. None where it has no
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
