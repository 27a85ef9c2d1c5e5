//! The cases of a campaign: planned from its file, played on all cores of this machine, the worst of them recorded.
//!
//! [`masseter_campaign`] holds cases, results and their folder. Under virtual time a case needs no recording.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use clap::ValueEnum;
use masseter_campaign::{
    Campaign, CampaignFile, CampaignFolder, Case, CaseResult, FolderError, Report, StopRules, WorstCase,
    digest_of_program,
};
use masseter_table::{Format, ParquetProgram};
use masseter_terminal::in_one_line;

use crate::prelude::*;
use crate::run::request::{ClockKind, ControllerChoice, ControllerKind, name_of};
use crate::run::runner::{Judged, Runner, Source, word};

/// Time between two lines of progress, ns.
const PROGRESS_EVERY_NS: u64 = 5_000_000_000;
/// Folder of the worst cases.
const WORST: &str = "worst";

/// The campaign of a file.
pub(crate) fn plan(file: &Path, controller: ControllerKind) -> anyhow::Result<Campaign> {
    let read = CampaignFile::read(file)?;
    let base = scenario_with(read.scenario.as_deref(), &[])?;
    let parent = file.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let campaign = Campaign {
        file: read,
        controller: name_of(&controller),
        program: this_program()?,
        folder: parent.canonicalize()?,
        base: base.to_toml(),
    };
    campaign.check_factors().with_context(|| file.display().to_string())?;
    // A mistake in the scenario itself is in every case.
    crate::run::resolve_simulated(&base, campaign.file.scenario.as_deref(), controller.builder())
        .context("the scenario of the campaign")?;
    Ok(campaign)
}

/// The digest of this program.
pub(super) fn this_program() -> anyhow::Result<String> {
    let digest = std::env::current_exe().and_then(|path| digest_of_program(&path));
    digest.context("cannot read this program")
}

/// Plays a case of a campaign in this process, for a scheduler, unless its result is there. Any result is success: the
/// campaign judges.
pub(crate) fn play_case(folder: &Path, number: usize) -> Result<Exit, Failure> {
    // A worker that is killed takes its case along: no orphan computes what the next worker computes again.
    crate::run::end_with_parent(rustix::process::getppid()).died()?;
    let (folder, campaign) = CampaignFolder::open(folder).usage()?;
    let kind =
        ControllerKind::from_str(&campaign.controller, false).map_err(|error| anyhow!(error)).usage()?;
    if this_program().usage()? != campaign.program {
        return Err(anyhow!("another build of masseter began the campaign; begin another one")).usage();
    }
    let count = campaign.case_count();
    if number >= count {
        return Err(anyhow!("the campaign has cases 0 to {}", count.saturating_sub(1))).usage();
    }
    let player = Player { runner: Runner::of_verb(ControllerChoice::Own(kind))?, folder, campaign };
    let result = player.result_of(&player.campaign.case(&player.campaign.points(), number))?;
    Ok(if result.is_some() { Exit::Passed } else { Exit::Interrupted })
}

/// Plays the cases of a campaign, and keeps their results in its folder.
pub(crate) struct Player {
    pub(crate) campaign: Campaign,
    pub(crate) folder: CampaignFolder,
    pub(crate) runner: Runner,
}

impl Player {
    /// The numbers of the cases without a result.
    pub(crate) fn open_cases(&self) -> Result<Vec<usize>, FolderError> {
        let points = self.campaign.points();
        let mut open = Vec::new();
        for number in 0..self.campaign.case_count() {
            if self.folder.result_of(&self.campaign.case(&points, number))?.is_none() {
                open.push(number);
            }
        }
        Ok(open)
    }

    /// The result of a case: the kept one, or that of playing it now; none if the user interrupts.
    pub(super) fn result_of(&self, case: &Case) -> Result<Option<CaseResult>, Failure> {
        if let Some(kept) = self.folder.result_of(case).incomplete()? {
            return Ok(Some(kept));
        }
        let attempt = self.folder.attempt(case).incomplete()?;
        let Some(result) = self.play(case)? else { return Ok(None) };
        attempt.keep_result(&result, case.scenario.as_ref().ok()).incomplete()?;
        Ok(Some(result))
    }

    /// Plays a case and judges it; none if the user interrupts. What the machine refuses, such as memory, is no result.
    fn play(&self, case: &Case) -> Result<Option<CaseResult>, Failure> {
        let began_ns = clock::now_ns();
        let unrun = |word: &str, exit: Exit, reason: String| {
            Ok(Some(CaseResult::without_run(case, word, exit as u8, reason)))
        };
        let scenario = match &case.scenario {
            Ok(scenario) => scenario,
            Err(reason) => return unrun(CaseResult::REFUSED, Exit::Usage, reason.clone()),
        };
        let judged = self.runner.play(Source::Scenario(scenario));
        if self.runner.is_interrupted() {
            return Ok(None);
        }
        let took_s = || (clock::now_ns() - began_ns) as f64 / 1e9;
        match judged {
            Ok(Judged { verdict, figures }) => Ok(Some(CaseResult::new(case, &verdict, &figures, took_s()))),
            Err(Failure { exit: exit @ Exit::Usage, error }) => {
                unrun(CaseResult::REFUSED, exit, in_one_line(&error))
            }
            Err(Failure { exit: exit @ Exit::Died, error }) => {
                unrun(CaseResult::DIED, exit, in_one_line(&error))
            }
            Err(failure) => Err(failure),
        }
    }

    /// Plays the cases on all cores in the order of their numbers, and stops by the rules of the campaign. Returns
    /// what has ended, in any order.
    pub(crate) fn play_all(&self) -> Result<Vec<CaseResult>, Failure> {
        let campaign = &self.campaign;
        let points = campaign.points();
        let next = AtomicUsize::new(0);
        let tally = Mutex::new(Tally::new(campaign.case_count(), campaign.file.stop_after));
        let work = || -> Result<Vec<CaseResult>, Failure> {
            let mut ended = Vec::new();
            while !self.runner.is_interrupted() && !lock(&tally).is_over() {
                let number = next.fetch_add(1, Ordering::Relaxed);
                if number >= campaign.case_count() {
                    break;
                }
                let case = campaign.case(&points, number);
                let Some(result) = self.result_of(&case)? else { break };
                lock(&tally).count(&result);
                // Cases of equal content have one result.
                ended.push(CaseResult { number, ..result });
            }
            Ok(ended)
        };
        let ended = rayon::broadcast(|_| {
            // The others need not go on after an error.
            work().inspect_err(|_| next.store(usize::MAX / 2, Ordering::Relaxed))
        });
        Ok(ended.into_iter().collect::<Result<Vec<_>, _>>()?.concat())
    }

    /// Writes report and table of the results, records this many of the worst cases, and reports these, too. None if the
    /// user interrupts.
    pub(crate) fn report(
        &self,
        results: Vec<CaseResult>,
        most: usize,
    ) -> Result<Option<(Report<'_>, Vec<WorstCase>)>, Failure> {
        let out = word(&self.folder.path().display().to_string());
        if self.runner.is_interrupted() {
            let ended = counted(results.len() as u64, "case");
            status!("interrupted after {ended}; the same command with --out {out} goes on");
            return Ok(None);
        }
        // CSV where the program that writes Parquet is missing, since no result may be lost for that.
        let format = ParquetProgram::beside_this_one().map_or_else(
            |missing| {
                status!(
                    "the table is CSV: {missing}; then the same command with --out {out} writes Parquet, too"
                );
                Format::Csv
            },
            Format::Parquet,
        );
        let report = Report::new(&self.campaign, results, format);
        // Whatever becomes of the recordings, the results are there.
        masseter_campaign::write(&report, &self.folder, &[]).incomplete()?;
        let worst = self.keep_worst(&report, most)?;
        masseter_campaign::write(&report, &self.folder, &worst).incomplete()?;
        Ok(Some((report, worst)))
    }

    /// Writes the scenarios of the worst cases. Those that ran are recorded, byte by byte as they ran before.
    fn keep_worst(&self, report: &Report<'_>, most: usize) -> Result<Vec<WorstCase>, Failure> {
        let parent = self.folder.file(WORST);
        let unmade = || format!("cannot make {}", parent.display());
        fs::create_dir_all(&parent).with_context(unmade).incomplete()?;
        let mut kept = Vec::new();
        for result in report.worst(most) {
            let Ok(scenario) = self.campaign.case_of(result).scenario else { continue };
            let run = parent.join(format!("case-{}-{}", result.number, result.id));
            let file = run.with_extension("toml");
            let written = fs::write(&file, scenario.to_toml());
            written.with_context(|| format!("cannot write {}", file.display())).incomplete()?;
            if !result.digest.is_empty() && !run.exists() {
                self.record(&file, &run, result)?;
            }
            let command = self.runner.command(file.as_path().into(), ClockKind::Virtual);
            kept.push(WorstCase { number: result.number, command, run: run.exists().then_some(run) });
        }
        Ok(kept)
    }

    fn record(&self, file: &Path, run: &Path, result: &CaseResult) -> Result<(), Failure> {
        let unfinished = run.with_extension("part");
        let _ = fs::remove_dir_all(&unfinished);
        let name = format!("case {}", result.number);
        let again = self.runner.record_again(&name, file.into(), &unfinished, &result.digest)?;
        again.ok_or_else(|| Failure::with(Exit::Interrupted, anyhow!("interrupted")))?;
        fs::rename(&unfinished, run).with_context(|| format!("cannot make {}", run.display())).incomplete()
    }
}

/// The value of a mutex, which no thread holds when it panics.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What has ended so far.
struct Tally {
    of: usize,
    rules: StopRules,
    began_ns: u64,
    said_ns: u64,
    ended: usize,
    failures: usize,
}

impl Tally {
    fn new(of: usize, rules: StopRules) -> Self {
        let now_ns = clock::now_ns();
        Self { of, rules, began_ns: now_ns, said_ns: now_ns, ended: 0, failures: 0 }
    }

    /// Whether a rule ends the campaign.
    fn is_over(&self) -> bool {
        self.rules.failures.is_some_and(|most| self.failures >= most)
            || self.rules.time_s.is_some_and(|most_s| self.lasted_s() >= most_s)
    }

    fn count(&mut self, result: &CaseResult) {
        self.ended += 1;
        self.failures += usize::from(!result.has_passed());
        let now_ns = clock::now_ns();
        if now_ns - self.said_ns >= PROGRESS_EVERY_NS {
            self.said_ns = now_ns;
            let left_s = self.lasted_s() / self.ended as f64 * (self.of - self.ended) as f64;
            let Self { ended, of, failures, .. } = self;
            status!("{ended} of {of} cases, {failures} did not pass, about {left_s:.0} s left");
        }
    }

    fn lasted_s(&self) -> f64 {
        (clock::now_ns() - self.began_ns) as f64 / 1e9
    }
}
