//! `masseter campaign`, `search` and `shrink`: one scenario with many values of its keys, faults and motions.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, ensure};
use clap::Args;
use masseter_campaign::{
    Campaign, CampaignFile, CampaignFolder, CampaignLock, CaseResult, Factor, Method, Report, Sampler,
    Search, StopRules, WorstCase,
};
use masseter_plan::{Overrides, scenario_with_overrides};
use masseter_recording::{RunFolder, time_in_names};
use masseter_scenario::wording::counted;
use masseter_table::{Format, ParquetProgram};
use masseter_terminal::{Exit, Failure, OrFailure, result, status};

use crate::run::request::{ControllerChoice, ControllerKind};
use crate::run::runner::{Runner, word};
use crate::vary::play::{Player, open_cases, plan};
use crate::vary::search::{self, Found};
use crate::vary::shrink::{self, Reason};

/// How many of the worst cases are recorded.
const RECORD: usize = 10;

/// What campaigns and searches share.
#[derive(Debug, Clone, Args)]
struct PlayArgs {
    /// Folder of the results; a campaign begun there goes on [default: campaigns/UTC_TIME-NAME]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Who controls the robot
    #[arg(long, value_enum, default_value_t, hide_default_value = true)]
    controller: ControllerKind,
    /// Record this many of the cases with the smallest margins
    #[arg(long, value_name = "N", default_value_t = RECORD)]
    record: usize,
}

/// A campaign in its folder, in which nobody else plays.
struct Begun {
    campaign: Campaign,
    out: PathBuf,
    folder: CampaignFolder,
    _lock: CampaignLock,
    runner: Runner,
    record: usize,
}

impl Begun {
    fn new(campaign: Campaign, file: &Path, args: &PlayArgs) -> Result<Self, Failure> {
        let by_time = || {
            let name = file.file_stem().unwrap_or_default().to_string_lossy();
            Path::new("campaigns").join(format!("{}-{name}", time_in_names()))
        };
        let out = args.out.clone().unwrap_or_else(by_time);
        let (folder, lock) = CampaignFolder::begin(&out, &campaign).usage()?;
        let runner = Runner::of_verb(ControllerChoice::Own(args.controller))?;
        Ok(Self { campaign, out, folder, _lock: lock, runner, record: args.record })
    }

    fn player(&self) -> Player<'_> {
        Player { runner: &self.runner, folder: &self.folder }
    }

    /// The report on the results, and the worst cases; none if the user interrupts.
    fn report(&self, results: Vec<CaseResult>) -> Result<Option<(Report<'_>, Vec<WorstCase>)>, Failure> {
        let out = word(&self.out.display().to_string());
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
        self.player().report(&self.campaign, results, format, self.record).map(Some)
    }
}

/// The arguments of `campaign`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter campaign friction.toml\n  masseter campaign friction.toml --out campaigns/friction\n\nThe same command with the same --out goes on where a killed campaign was."
)]
pub(super) struct CampaignArgs {
    /// File of the campaign: scenario, sampler, runs, and a [[factor]] for everything that varies
    file: PathBuf,
    #[command(flatten)]
    play: PlayArgs,
    /// Only print the numbers of the cases without a result: a scheduler runs each by 'masseter campaign-case DIR NUMBER'
    #[arg(long, requires = "out")]
    plan: bool,
}

/// Runs the campaign, or the rest of it; [`Exit::Passed`] if enough cases passed.
pub(super) fn campaign(args: &CampaignArgs) -> Result<Exit, Failure> {
    let campaign = plan(&args.file, args.play.controller).usage()?;
    if args.plan && campaign.file.stop_after != StopRules::default() {
        return Err(anyhow!("stop_after: a scheduler runs every case; leave the rule away")).usage();
    }
    let begun = Begun::new(campaign, &args.file, &args.play)?;
    if args.plan {
        let open = open_cases(&begun.campaign, &begun.folder).incomplete()?;
        result(&open.iter().map(|number| number.to_string() + "\n").collect::<String>()).incomplete()?;
        return Ok(Exit::Passed);
    }
    status!("{} cases; results in {}", begun.campaign.case_count(), begun.out.display());
    let results = begun.player().play_all(&begun.campaign)?;
    let Some((report, _)) = begun.report(results)? else { return Ok(Exit::Interrupted) };
    result(&report.in_words(&begun.folder)).incomplete()?;
    Ok(if report.is_success() { Exit::Passed } else { Exit::Failed })
}

/// The arguments of `search`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Example:\n  masseter search friction.toml --minimise incisal.margin --runs 500\n\nThe worst case can be made smaller by 'masseter shrink'."
)]
pub(super) struct SearchArgs {
    /// File of a campaign; its sampler, runs and seeds do not count
    file: PathBuf,
    /// Requirement whose margin gets as small as possible, such as incisal.margin [default: the smallest of all]
    #[arg(long, value_name = "NAME")]
    minimise: Option<String>,
    /// The most runs
    #[arg(long, value_name = "N", default_value_t = 500)]
    runs: usize,
    /// How the next values are chosen
    #[arg(long, value_enum, default_value_t)]
    method: Method,
    /// Seed of the chosen values
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Go on after the first margin below zero
    #[arg(long)]
    go_on: bool,
    #[command(flatten)]
    play: PlayArgs,
}

impl SearchArgs {
    /// The name of the requirement; none for all.
    fn requirement(&self) -> Option<&str> {
        let name = self.minimise.as_deref()?;
        Some(name.strip_suffix(".margin").unwrap_or(name))
    }
}

/// Searches; [`Exit::Failed`] if a margin below zero was found.
pub(super) fn search(args: &SearchArgs) -> Result<Exit, Failure> {
    let mut campaign = plan(&args.file, args.play.controller).usage()?;
    // The archive is that of a random campaign, whose points the search chooses.
    campaign.file = CampaignFile { sampler: Sampler::Random, runs: None, seeds: None, ..campaign.file };
    check_search(&campaign, args).usage()?;
    let begun = Begun::new(campaign, &args.file, &args.play)?;
    status!("at most {} runs; results in {}", args.runs, begun.out.display());
    let SearchArgs { method, runs, seed, go_on: goes_on, .. } = *args;
    let search = Search { method, dimension: begun.campaign.file.factors.len(), runs, seed, goes_on };
    let Found { first, results } =
        search::search(&search, args.requirement(), &begun.campaign, begun.player())?;
    let runs = results.len();
    let Some((report, worst)) = begun.report(results)? else { return Ok(Exit::Interrupted) };
    let found = first.map_or_else(
        || format!("nothing below zero in {runs} runs\n"),
        |first| format!("below zero after {first} runs\n"),
    );
    let again = worst.first().map_or_else(String::new, |worst| format!("again: {}\n", worst.command));
    result(&(found + &again + &report.files(&begun.folder))).incomplete()?;
    Ok(if first.is_some() { Exit::Failed } else { Exit::Passed })
}

fn check_search(campaign: &Campaign, args: &SearchArgs) -> anyhow::Result<()> {
    ensure!(args.runs > 0, "--runs: give at least 1");
    let factors = &campaign.file.factors;
    ensure!(factors.iter().any(Factor::is_continuous), "a search needs a [[factor]] with a range");
    let names: Vec<_> = campaign.base()?.require.iter().map(|require| require.name.clone()).collect();
    ensure!(
        args.requirement().is_none_or(|name| names.iter().any(|known| known == name)),
        "--minimise {}: the scenario has no such requirement; there are: {}",
        args.minimise.as_deref().unwrap_or_default(),
        names.join(", ")
    );
    ensure!(
        !names.is_empty(),
        "a search needs a [[require]] with a limit in numbers: its margin leads the way"
    );
    Ok(())
}

/// The arguments of `shrink`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter shrink campaigns/friction/worst/case-173 --out smallest.toml")]
pub(super) struct ShrinkArgs {
    /// A scenario that fails, or its run: folder, recording.mcap, or a link to either
    path: PathBuf,
    /// Keep the failure of this check [default: the first that fails, or the cause of a safe stop]
    #[arg(long, value_name = "NAME")]
    requirement: Option<String>,
    /// Write the smallest scenario into this file instead of standard output
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Who controls the robot
    #[arg(long, value_enum, default_value_t, hide_default_value = true)]
    controller: ControllerKind,
}

/// Shrinks a scenario, and prints the smallest one.
pub(super) fn shrink(args: &ShrinkArgs) -> Result<Exit, Failure> {
    let path = scenario_of(&args.path).usage()?;
    let scenario = scenario_with_overrides(Some(&path), &Overrides::default()).usage()?;
    let runner = Runner::of_verb(ControllerChoice::Own(args.controller))?;
    let reason = Reason::of(&runner, &scenario, args.requirement.as_deref())?;
    status!("fails by {reason}; shrinking");
    let (text, runs) = shrink::shrink(&runner, &scenario, &reason);
    if runner.is_interrupted() {
        return Ok(Exit::Interrupted);
    }
    status!("{runs} runs");
    match &args.out {
        Some(out) => {
            fs::write(out, &text).with_context(|| format!("cannot write {}", out.display())).incomplete()?;
        }
        None => result(&text).incomplete()?,
    }
    Ok(Exit::Passed)
}

/// The scenario of a file, of a run under any of its names, or of the folder of a case.
fn scenario_of(path: &Path) -> anyhow::Result<PathBuf> {
    if let Ok(run) = RunFolder::open(path) {
        return Ok(run.scenario());
    }
    let inside = path.join("scenario.toml");
    ensure!(!path.is_dir() || inside.is_file(), "{} has no scenario.toml", path.display());
    Ok(if path.is_dir() { inside } else { path.to_owned() })
}
