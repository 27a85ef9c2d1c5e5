//! A suite: the scenarios of folders, each run with its own verdict.
//!
//! Under virtual time they run on all cores, without a recording; a scenario that fails is run again with one. Runs
//! with processes come one after the other, since all of them use the same cores.

pub(crate) mod cases;
pub(crate) mod choice;

use masseter_judge::Verdict;
use masseter_report::suite::{Attempt, TestedScenario};
use masseter_terminal::in_one_line;
use rayon::prelude::*;

use self::cases::Case;
use crate::prelude::*;
use crate::run::request::ClockKind;
use crate::run::runner::{Runner, Source};

/// How the scenarios of a suite are run.
pub(crate) struct Suite<'a> {
    pub(crate) runner: Runner,
    /// The clock of the scenarios that can have it.
    pub(crate) clock: ClockKind,
    /// How often a run with processes is tried again: see [`asks_for_another`].
    pub(crate) retries: usize,
    pub(crate) allows_untested: bool,
    /// Folder for the runs that are kept, which nothing makes before.
    pub(crate) out: &'a Path,
}

impl Suite<'_> {
    /// Runs the scenarios, those with processes last; returns the results in the order of the scenarios. Tells of each
    /// scenario that is over.
    pub(crate) fn run_all(
        &self,
        cases: &[Case],
        tell: impl Fn(&TestedScenario) -> anyhow::Result<()> + Sync,
    ) -> anyhow::Result<Vec<TestedScenario>> {
        let clocked = cases.iter().map(|case| (case, self.clock_of(case))).enumerate();
        let (alone, together): (Vec<_>, Vec<_>) =
            clocked.partition(|(_, (_, clock))| *clock != ClockKind::Virtual);
        if self.clock == ClockKind::Virtual && !alone.is_empty() {
            let names: Vec<_> = alone.iter().map(|(_, (case, _))| case.name.as_str()).collect();
            status!("in lockstep, one after the other, because they need processes: {}", names.join(", "));
        }
        let run = |(number, (case, clock)): (usize, (&Case, ClockKind))| {
            let tested = self.test(case, clock)?;
            Some(tell(&tested).map(|()| (number, tested)))
        };
        let mut all: Vec<_> = together.into_par_iter().filter_map(run).collect::<Result<_, _>>()?;
        for case in alone {
            all.extend(run(case).transpose()?);
        }
        // Nothing is in it if every run with processes passed.
        let _ = fs::remove_dir(self.out);
        all.sort_by_key(|(number, _)| *number);
        Ok(all.into_iter().map(|(_, tested)| tested).collect())
    }

    /// The clock of a scenario: virtual time has no processes that could be killed, and none for a program of the user.
    fn clock_of(&self, case: &Case) -> ClockKind {
        let is_program = self.runner.controller.builder().is_none();
        match self.clock {
            ClockKind::Virtual if is_program || case.needs_processes => ClockKind::Lockstep,
            clock => clock,
        }
    }

    /// Runs a scenario by this clock; none if the user interrupts.
    fn test(&self, case: &Case, clock: ClockKind) -> Option<TestedScenario> {
        if self.runner.is_interrupted() {
            return None;
        }
        let began_ns = clock::now_ns();
        let attempts = match clock {
            ClockKind::Virtual => vec![self.in_virtual_time(case)],
            _ => self.in_processes(case, clock),
        };
        if self.runner.is_interrupted() {
            return None;
        }
        Some(TestedScenario {
            name: case.name.clone(),
            file: case.path.clone(),
            tags: case.tags.clone(),
            attempts,
            is_simulated: clock != ClockKind::Rt,
            allows_untested: self.allows_untested,
            command: self.runner.command(case.file(), clock),
            took_s: (clock::now_ns() - began_ns) as f64 / 1e9,
        })
    }

    /// Runs a scenario without a recording. One that does not pass is run again with a recording: the same bytes.
    fn in_virtual_time(&self, case: &Case) -> Attempt {
        let played = self.runner.play(Source::File(case.file()));
        let attempt = attempt(played.map(|judged| judged.verdict), None);
        let Ok(unrecorded) = &attempt.verdict else { return attempt };
        if !attempt.is_short(self.allows_untested) || self.runner.is_interrupted() {
            return attempt;
        }
        let folder = self.folder_of(case, 0);
        match self.runner.record_again("the run", case.file(), &folder, &unrecorded.digest) {
            Ok(Some(again)) => Attempt { verdict: Ok(again), folder: Some(folder) },
            Ok(None) => attempt,
            // The result is known without the recording.
            Err(failure) if failure.exit == Exit::Incomplete => {
                status!("masseter: {}: no recording: {}", case.name, in_one_line(&failure.error));
                attempt
            }
            Err(failure) => self::attempt(Err(failure), Some(folder)),
        }
    }

    /// Runs a scenario in three processes, and again as long as another try is asked for. Keeps every attempt of a
    /// scenario that did not pass at once.
    fn in_processes(&self, case: &Case, clock: ClockKind) -> Vec<Attempt> {
        // Nothing was recorded.
        let unstarted = || Failure::with(Exit::Interrupted, anyhow!("interrupted"));
        let mut attempts = Vec::new();
        loop {
            let folder = self.folder_of(case, attempts.len());
            let recorded = self.runner.record(case.file(), clock, &folder);
            let judged = recorded.and_then(|verdict| verdict.ok_or_else(unstarted));
            attempts.push(attempt(judged, Some(folder)));
            let has_tries = attempts.len() <= self.retries && !self.runner.is_interrupted();
            if !has_tries || !asks_for_another(clock, &attempts, self.allows_untested) {
                break;
            }
        }
        if let [only] = attempts.as_mut_slice()
            && !only.is_short(self.allows_untested)
        {
            // What cannot be removed stays, and does no harm.
            let _ = only.folder.take().map(fs::remove_dir_all);
        }
        attempts
    }

    fn folder_of(&self, case: &Case, retries: usize) -> PathBuf {
        let name = case.name.replace(['/', '\\', '['], "-").replace(']', "");
        self.out.join(if retries == 0 { name } else { format!("{name}-retry-{retries}") })
    }
}

/// Whether another try tells more. In real time, after a run that the machine spoiled, and no other: a failure is the
/// rig's. In simulated time a failure must come again the same, as long as it does.
fn asks_for_another(clock: ClockKind, attempts: &[Attempt], allows_untested: bool) -> bool {
    let Some((last, before)) = attempts.split_last() else { return true };
    if clock == ClockKind::Rt {
        return last.is_invalid();
    }
    last.is_short(allows_untested) && before.last().is_none_or(|before| before.is_same(last))
}

/// An attempt; its folder counts only if it exists.
fn attempt(judged: Result<Verdict, Failure>, folder: Option<PathBuf>) -> Attempt {
    let verdict = judged.map_err(|failure| in_one_line(&failure.error));
    Attempt { verdict, folder: folder.filter(|folder| folder.exists()) }
}

#[cfg(test)]
mod tests {
    use masseter_judge::Analysis;
    use masseter_recording::{MachineInfo, Manifest};
    use masseter_runtime::named::Declared;
    use masseter_scenario::Scenario;

    use super::*;

    fn attempt_with(exit_code: Exit, digest: &str) -> Attempt {
        let machine = MachineInfo { cpu: String::new(), cores: 2, kernel: String::new(), is_virtual: false };
        let manifest = Manifest::new("0.1.0", Scenario::default(), 10.0, "rt", machine);
        let figures = Analysis::new(&manifest.scenario, &Declared::default()).finish(false, &[]);
        let mut verdict = Verdict::new(&manifest, &figures);
        verdict.exit_code = exit_code;
        digest.clone_into(&mut verdict.digest);
        Attempt { verdict: Ok(verdict), folder: None }
    }

    #[test]
    fn in_real_time_only_what_the_machine_spoiled_is_tried_again() {
        for (exit, asks) in [
            (Exit::Passed, false),
            (Exit::Failed, false),
            (Exit::SafeStop, false),
            (Exit::Died, false),
            (Exit::Incomplete, false),
            (Exit::Invalid, true),
        ] {
            assert_eq!(asks_for_another(ClockKind::Rt, &[attempt_with(exit, "a")], false), asks, "{exit:?}");
        }
        let refused = attempt(Err(Failure::with(Exit::Usage, anyhow!("wrong"))), None);
        assert!(!asks_for_another(ClockKind::Rt, &[refused], false));
    }

    #[test]
    fn in_simulated_time_a_failure_is_tried_again_until_it_differs() {
        let asks = |attempts: &[Attempt]| asks_for_another(ClockKind::Lockstep, attempts, false);
        let [failed, other, passed] = [(Exit::Failed, "a"), (Exit::Failed, "b"), (Exit::Passed, "a")]
            .map(|(exit, digest)| attempt_with(exit, digest));
        assert!(asks(std::slice::from_ref(&failed)) && asks(&[failed.clone(), failed.clone()]));
        assert!(!asks(&[failed.clone(), other]) && !asks(&[failed, passed.clone()]) && !asks(&[passed]));
    }
}
