//! The messages between a process of the rig and its supervisor: JSON, one a line. No data of the run travel here.

use serde::{Deserialize, Serialize};

use crate::named::Declared;
use crate::realtime::scheduling::Obtained;

/// A process of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Party {
    /// The controller.
    Controller,
    /// The plant.
    Plant,
    /// The recorder.
    Recorder,
}

impl Party {
    /// Its name, which is also its subcommand.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Controller => "controller",
            Self::Plant => "plant",
            Self::Recorder => "recorder",
        }
    }
}

/// The report that another process has stopped answering, in lockstep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Silence {
    /// The silent process.
    pub process: Party,
    /// The cycle in which it was waited for.
    pub cycle: u64,
    /// For how long, s.
    pub silent_s: f64,
}

/// A message of a process to the supervisor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Report {
    /// The ports are open.
    Ready {
        /// The requested and the granted scheduling.
        scheduling: Obtained,
        /// The signals and parameters of a controller.
        #[serde(default)]
        declared: Declared,
    },
    /// Another process has stopped answering, in lockstep.
    Silence(Silence),
    /// A fault of a process is due, which the supervisor carries out.
    Due {
        /// Its place in the scenario's list.
        fault: usize,
        /// Now, ns of the run's clock.
        now_ns: u64,
    },
    /// An attached program has ended its work. The own processes end with an exit code instead.
    Ended(End),
}

/// How an attached program ended its work.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// It did what it was asked to.
    Finished,
    /// A fault ended the motion.
    SafeStop,
    /// It cannot go on.
    Failed {
        /// Why.
        reason: String,
    },
}

/// A message of the supervisor to a process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// Start of the first cycle.
    Start(Start),
    /// In lockstep: the fault that was due has struck, or could not.
    Struck,
    /// Come to an orderly end. The own processes get SIGTERM instead.
    Stop,
}

/// The start of the first cycle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Time of the first SYNC, ns of `CLOCK_MONOTONIC`.
    pub epoch_ns: u64,
    /// Process ids of controller and plant, for the recorder.
    pub loops: [u32; 2],
    /// The signals and parameters of the controller, for the recorder.
    pub declared: Declared,
}

/// A message as its line.
///
/// # Panics
/// Never: messages are plain data.
pub fn line(message: &impl Serialize) -> String {
    serde_json::to_string(message).expect("plain data") + "\n"
}
