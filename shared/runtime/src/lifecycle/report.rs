//! The reports of a process to the supervisor, and the supervisor's orders.

use masseter_scenario::input::{excerpt, sentence};
use serde::{Deserialize, Serialize};

use crate::named::{Declared, NameError};
use crate::realtime::scheduling::Obtained;

/// Longest silence that a process can report, s.
const LONGEST_SILENCE_S: f64 = 1e7;
/// Most refusals of the kernel, for core, priority and memory.
const MOST_REFUSALS: usize = 3;

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

/// The report of another process' silence, in lockstep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Silence {
    /// The silent process.
    pub process: Party,
    /// The cycle of the wait.
    pub cycle: u64,
    /// The length of the silence, s.
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
    /// A due fault of a process, which the supervisor carries out.
    Due {
        /// Its place in the scenario's list.
        fault: usize,
        /// Now, ns of the run's clock.
        now_ns: u64,
    },
    /// An attached program has ended its work. The own processes end with an exit code instead.
    Ended(End),
}

/// The reason why a line is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The line has another form.
    #[error("'{line}' is no report of this version: {reason}")]
    Form {
        /// The beginning of the line.
        line: String,
        /// The error of the reader.
        reason: String,
    },
    /// The signals and parameters do not fit into a recording.
    #[error("{0}")]
    Declared(#[from] NameError),
    /// More refusals than the kernel can give.
    #[error("it reports {0} refusals of the kernel: there are at most {MOST_REFUSALS}")]
    Refusals(usize),
    /// An impossibly long silence.
    #[error("it reports a silence of {0:e} s: use 0 to {LONGEST_SILENCE_S:e} s")]
    Silence(f64),
}

impl Report {
    /// The report in a line of a process, with values and texts fit for recording and display. Cuts its sentences to
    /// 200 characters.
    ///
    /// # Errors
    /// [`ReportError`].
    pub fn read(line: &str) -> Result<Self, ReportError> {
        let mut report = serde_json::from_str(line).map_err(|error| ReportError::Form {
            line: excerpt(line),
            reason: excerpt(&error.to_string()),
        })?;
        match &mut report {
            Self::Ready { scheduling: Obtained { refusals, .. }, declared } => {
                declared.check()?;
                if refusals.len() > MOST_REFUSALS {
                    return Err(ReportError::Refusals(refusals.len()));
                }
                for refusal in refusals {
                    *refusal = sentence(refusal);
                }
            }
            Self::Silence(Silence { silent_s, .. }) if !(0.0..=LONGEST_SILENCE_S).contains(silent_s) => {
                return Err(ReportError::Silence(*silent_s));
            }
            Self::Ended(End::Failed { reason }) => *reason = sentence(reason),
            Self::Silence(_) | Self::Due { .. } | Self::Ended(_) => {}
        }
        Ok(report)
    }
}

/// The outcome of an attached program's work.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// The program has completed its task.
    Finished,
    /// A fault ended the motion.
    SafeStop,
    /// The program cannot go on.
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
    /// In lockstep: the due fault has struck, or has failed to.
    Struck,
    /// The request for an orderly end. The rig's own processes get SIGTERM instead.
    Stop,
    /// The rig refuses the program: its report does not fit into a recording or a display.
    Refused {
        /// The reason, with the limit.
        reason: String,
    },
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

#[cfg(test)]
mod tests {
    use masseter_scenario::input::is_printable;

    use super::*;

    const SCHEDULING: &str = r#"{"requested":{"core":null,"fifo_priority":null,"locked_memory":false},"core":null,"fifo_priority":null,"locked_memory":false,"refusals":REFUSALS}"#;

    fn ready(refusals: &str, declared: &str) -> String {
        let scheduling = SCHEDULING.replace("REFUSALS", refusals);
        format!(r#"{{"ready":{{"scheduling":{scheduling},"declared":{declared}}}}}"#)
    }

    #[test]
    fn what_cannot_be_recorded_or_shown_is_refused_with_the_limit() {
        for (line, limit) in [
            (ready("[]", r#"{"signals":[{"name":"</script>","unit":"","about":""}]}"#), "lower-case letters"),
            (
                ready("[]", r#"{"signals":[{"name":"a","unit":"\u001b[2J","about":""}]}"#),
                "printable characters",
            ),
            (ready(r#"["","","",""]"#, "{}"), "at most 3"),
            (r#"{"silence":{"process":"plant","cycle":1,"silent_s":1e308}}"#.to_owned(), "0 to 1e7 s"),
            (r#"{"silence":{"process":"plant","cycle":1,"silent_s":-1}}"#.to_owned(), "0 to 1e7 s"),
            ("\u{1b}[2J".repeat(10_000), "no report of this version"),
            (format!(r#"{{"{}":1}}"#, "\\u001b".repeat(10_000)), "no report of this version"),
        ] {
            let refusal = Report::read(&line).unwrap_err().to_string();
            assert!(refusal.contains(limit) && is_printable(&refusal, 600), "{refusal}");
        }
    }

    #[test]
    fn sentences_are_short_and_command_nothing() {
        let hostile = format!("\\u001b[31m\\n{}", "z".repeat(1000));
        let line = ready(&format!(r#"["{hostile}"]"#), "{}");
        let Ok(Report::Ready { scheduling, .. }) = Report::read(&line) else { panic!("no report") };
        let failed = format!(r#"{{"ended":{{"failed":{{"reason":"{hostile}"}}}}}}"#);
        let Ok(Report::Ended(End::Failed { reason })) = Report::read(&failed) else { panic!("no report") };
        for sentence in [&scheduling.refusals[0], &reason] {
            assert!(sentence.starts_with("\\u{1b}[31m\\n") && sentence.chars().count() <= 201, "{sentence}");
        }
    }
}
