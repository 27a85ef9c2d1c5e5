//! One scenario of a suite: run, judged, and kept where it failed.

use std::fs;
use std::path::{Path, PathBuf};

use masseter_report::Judgement;
use masseter_runtime::clock;
use masseter_terminal::{Exit, Failure, in_one_line, status};

use super::args::TestArgs;
use super::case::Case;
use super::outcome::{Outcome, Tested};
use crate::arguments::name_of;
use crate::guarded::guarded;
use crate::interrupts::Interrupts;
use crate::run::args::{ClockKind, RunArgs};
use crate::run::{PreparedRun, judge_unrecorded};
use crate::shell::word;

/// How the scenarios of a suite are run.
pub(super) struct Trials<'a> {
    pub(super) args: &'a TestArgs,
    /// Folder for the runs that failed.
    pub(super) out: &'a Path,
    pub(super) interrupts: &'a Interrupts,
}

/// A run of a scenario, judged.
struct Judged {
    judgement: Judgement,
    folder: Option<PathBuf>,
    retries: u32,
}

impl Trials<'_> {
    /// Runs a scenario by this clock; none if the user interrupts.
    pub(super) fn test(&self, case: &Case, clock: ClockKind) -> Option<Tested> {
        if self.interrupts.is_stop_requested() {
            return None;
        }
        let began_ns = clock::now_ns();
        let judged = guarded(|| {
            if clock == ClockKind::Virtual {
                self.in_virtual_time(case)
            } else {
                self.in_processes(case, clock)
            }
        });
        if self.interrupts.is_stop_requested() {
            return None;
        }
        let took_s = (clock::now_ns() - began_ns) as f64 / 1e9;
        let command = self.command(case, clock);
        let case = case.clone();
        Some(match judged {
            Ok(Judged { judgement, folder, retries }) => {
                let verdict = judgement.verdict;
                let outcome = Outcome::of(&verdict);
                let reason = format!("{}: {}", verdict.word, verdict.reason);
                Tested { case, outcome, reason, verdict: Some(verdict), command, folder, retries, took_s }
            }
            Err(failure) => {
                let (outcome, reason) = (Outcome::Failed, in_one_line(&failure.error));
                Tested { case, outcome, reason, verdict: None, command, folder: None, retries: 0, took_s }
            }
        })
    }

    /// Runs a scenario without a recording. One that does not pass is run again with a recording: the same bytes.
    fn in_virtual_time(&self, case: &Case) -> Result<Judged, Failure> {
        let args = self.run_args(case, ClockKind::Virtual);
        let judgement = judge_unrecorded(&args, self.interrupts)?;
        let unkept = |judgement| Ok(Judged { judgement, folder: None, retries: 0 });
        if !self.is_short(&judgement) || self.interrupts.is_stop_requested() {
            return unkept(judgement);
        }
        let folder = self.folder_of(case);
        let again = match self.recorded(args, &folder) {
            // The result is known without the recording.
            Err(failure) if failure.exit == Exit::Incomplete => {
                status!("masseter: {}: no recording: {}", case.name, in_one_line(&failure.error));
                None
            }
            again => again?,
        };
        let Some(again) = again else { return unkept(judgement) };
        if again.digest != judgement.digest {
            let error = anyhow::anyhow!(
                "the run with a recording ({}) differs from the one without ({}): report this as a defect of masseter",
                again.digest,
                judgement.digest
            );
            return Err(Failure::with(Exit::Failed, error));
        }
        Ok(Judged { judgement: again, folder: Some(folder), retries: 0 })
    }

    /// Runs a scenario in three processes, and again while it fails and tries are left.
    fn in_processes(&self, case: &Case, clock: ClockKind) -> Result<Judged, Failure> {
        let folder = self.folder_of(case);
        let mut retries = 0;
        loop {
            let recorded = self.recorded(self.run_args(case, clock), &folder).and_then(interrupted);
            let is_short = recorded.as_ref().map_or(true, |judgement| self.is_short(judgement));
            if is_short && (retries == self.args.retries || self.interrupts.is_stop_requested()) {
                return Ok(Judged { judgement: recorded?, folder: Some(folder), retries });
            }
            // Only runs that failed are kept; what cannot be removed stays, and does no harm.
            let _ = fs::remove_dir_all(&folder);
            if !is_short {
                return Ok(Judged { judgement: recorded?, folder: None, retries });
            }
            retries += 1;
        }
    }

    /// Runs a scenario into its folder and writes the report; none if the user interrupts before the start.
    fn recorded(&self, args: RunArgs, folder: &Path) -> Result<Option<Judgement>, Failure> {
        let args = RunArgs { out: Some(folder.to_owned()), ..args };
        PreparedRun::new(&args)?.play(self.interrupts)?.judge()
    }

    fn is_short(&self, judgement: &Judgement) -> bool {
        Outcome::of(&judgement.verdict).is_short(self.args.allow_untested)
    }

    fn run_args(&self, case: &Case, clock: ClockKind) -> RunArgs {
        RunArgs {
            scenario: Some(case.path.clone()),
            clock,
            controller: self.args.controller.clone(),
            quiet: true,
            ..RunArgs::default()
        }
    }

    fn folder_of(&self, case: &Case) -> PathBuf {
        self.out.join(case.name.replace(['/', '\\'], "-"))
    }

    /// The command that shows the run again.
    fn command(&self, case: &Case, clock: ClockKind) -> String {
        let controller = self.args.controller.name();
        let controller = controller.map_or_else(String::new, |name| format!(" --controller {}", word(&name)));
        let path = word(&case.path.display().to_string());
        format!("masseter run {path} --clock {}{controller}", name_of(&clock))
    }
}

/// No judgement is an error here: nothing was recorded.
fn interrupted(judgement: Option<Judgement>) -> Result<Judgement, Failure> {
    judgement.ok_or_else(|| Failure::with(Exit::Interrupted, anyhow::anyhow!("interrupted")))
}
