//! `masseter campaign`, `search` and `shrink`: one scenario with many values of its keys, faults and motions.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use clap::{Args, ValueEnum};
use masseter_campaign::{Campaign, CampaignFolder, Factor, Method, Sampler, Search};
use masseter_plan::{Overrides, scenario_with_overrides};
use masseter_table::{Format, ParquetProgram};
use masseter_terminal::{Exit, Failure, OrFailure, result, status};

use super::arguments::time_in_names;
use crate::run::interrupts::Interrupts;
use crate::run::request::{ControllerChoice, ControllerKind};
use crate::run::runner::{Runner, word};
use crate::vary::hyperqueue::{self, HyperQueue};
use crate::vary::play::{Player, plan};
use crate::vary::search::{self, Found};
use crate::vary::shrink::{self, Reason};

/// How many of the worst cases are recorded.
const RECORD: usize = 10;

/// The arguments of `campaign`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter campaign friction.toml\n  masseter campaign friction.toml --out campaigns/friction\n\nThe same command with the same --out goes on where a killed campaign was."
)]
pub(super) struct CampaignArgs {
    /// File of the campaign: scenario, sampler, runs, and a [[factor]] for everything that varies
    file: PathBuf,
    /// Folder of the results; a campaign that was begun in it goes on [default: campaigns/UTC_TIME-NAME]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Who controls the robot
    #[arg(long, value_enum, default_value_t, hide_default_value = true)]
    controller: ControllerKind,
    /// Where the cases run
    #[arg(long, value_enum, default_value_t)]
    engine: EngineKind,
    /// Folder of HyperQueue's server [default: the one that HyperQueue uses]
    #[arg(long, value_name = "DIR")]
    server_dir: Option<PathBuf>,
    /// Python that has the package hyperqueue [default: python3]
    #[arg(long, value_name = "FILE")]
    python: Option<PathBuf>,
    /// Record this many of the cases with the smallest margins [default: 10]
    #[arg(long, value_name = "N")]
    record: Option<usize>,
}

/// Where the cases of a campaign run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum EngineKind {
    /// On all cores of this machine
    #[default]
    Local,
    /// On the workers of a HyperQueue server, also under Slurm and PBS
    Hyperqueue,
}

/// Runs the campaign, or what is left of it; [`Exit::Passed`] if enough cases passed.
pub(super) fn campaign(args: &CampaignArgs) -> Result<Exit, Failure> {
    let campaign = plan(&args.file, args.controller).usage()?;
    let out = args.out.clone().unwrap_or_else(|| folder_by_time(&args.file));
    let (folder, _lock) = CampaignFolder::begin(&out, &campaign).usage()?;
    let (controller, interrupts) = (ControllerChoice::Own(args.controller), Interrupts::of_verb()?);
    status!("{} cases; results in {}", campaign.case_count(), out.display());
    let runner = Runner { controller: &controller, interrupts: &interrupts };
    let player = Player { runner, folder: &folder };
    let results = match args.engine {
        EngineKind::Local => player.play_all(&campaign),
        EngineKind::Hyperqueue => {
            let hyperqueue =
                HyperQueue { server_dir: args.server_dir.as_deref(), python: args.python.as_deref() };
            hyperqueue::run(&campaign, &folder, hyperqueue, &interrupts)
        }
    }?;
    if interrupts.is_stop_requested() {
        status!(
            "interrupted after {} of {} cases; the same command with --out {} goes on",
            results.len(),
            campaign.case_count(),
            word(&out.display().to_string())
        );
        return Ok(Exit::Interrupted);
    }
    let most = args.record.unwrap_or(RECORD);
    let (report, _) = player.report(&campaign, results, table_format(&out), most)?;
    result(&report.in_words(&folder)).incomplete()?;
    Ok(if report.is_success() { Exit::Passed } else { Exit::Failed })
}

/// The arguments of the hidden verb that runs one case.
#[derive(Debug, Clone, Args)]
pub(super) struct CampaignCaseArgs {
    /// Folder of the campaign
    folder: PathBuf,
    /// Number of the case
    number: usize,
    /// Number of the start of the campaign, at whose interruption the case stops
    start: Option<u64>,
}

/// Runs one case in a process of its own, for engines that start processes.
pub(super) fn run_case(args: &CampaignCaseArgs) -> Result<Exit, Failure> {
    hyperqueue::run_case(&args.folder, args.number, args.start)
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
    method: SearchMethod,
    /// Seed of the chosen values
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Go on after the first margin below zero
    #[arg(long)]
    go_on: bool,
    /// Folder of the results; a search that was begun in it goes on [default: campaigns/UTC_TIME-NAME]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Who controls the robot
    #[arg(long, value_enum, default_value_t, hide_default_value = true)]
    controller: ControllerKind,
    /// Record this many of the cases with the smallest margins [default: 10]
    #[arg(long, value_name = "N")]
    record: Option<usize>,
}

impl SearchArgs {
    /// The name of the requirement; none for all.
    fn requirement(&self) -> Option<&str> {
        let name = self.minimise.as_deref()?;
        Some(name.strip_suffix(".margin").unwrap_or(name))
    }
}

/// How a search chooses the next values.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum SearchMethod {
    /// By the covariance of the best values so far
    #[default]
    CmaEs,
    /// At random
    Random,
}

/// Searches; [`Exit::Failed`] if a margin below zero was found.
pub(super) fn search(args: &SearchArgs) -> Result<Exit, Failure> {
    let mut campaign = plan(&args.file, args.controller).usage()?;
    // The archive is that of a random campaign, whose points the search chooses.
    campaign.file.sampler = Sampler::Random;
    campaign.file.runs = None;
    campaign.file.seeds = None;
    check_search(&campaign, args).usage()?;
    let out = args.out.clone().unwrap_or_else(|| folder_by_time(&args.file));
    let (folder, _lock) = CampaignFolder::begin(&out, &campaign).usage()?;
    let (controller, interrupts) = (ControllerChoice::Own(args.controller), Interrupts::of_verb()?);
    status!("at most {} runs; results in {}", args.runs, out.display());
    let runner = Runner { controller: &controller, interrupts: &interrupts };
    let player = Player { runner, folder: &folder };
    let search = Search {
        method: match args.method {
            SearchMethod::CmaEs => Method::CmaEs,
            SearchMethod::Random => Method::Random,
        },
        dimension: campaign.file.factors.len(),
        runs: args.runs,
        seed: args.seed,
        goes_on: args.go_on,
    };
    let Found { first, results } = search::search(&search, args.requirement(), &campaign, player)?;
    if interrupts.is_stop_requested() {
        status!("interrupted; the same command with --out {} goes on", word(&out.display().to_string()));
        return Ok(Exit::Interrupted);
    }
    let (runs, most) = (results.len(), args.record.unwrap_or(RECORD));
    let (report, worst) = player.report(&campaign, results, table_format(&out), most)?;
    let found = first.map_or_else(
        || format!("nothing below zero in {runs} runs\n"),
        |first| format!("below zero after {first} runs\n"),
    );
    let again = worst.first().map_or_else(String::new, |worst| format!("again: {}\n", worst.command));
    result(&(found + &again + &report.files(&folder))).incomplete()?;
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
    /// A scenario that fails, or the folder of its run
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
    let (controller, interrupts) = (ControllerChoice::Own(args.controller), Interrupts::of_verb()?);
    let runner = Runner { controller: &controller, interrupts: &interrupts };
    let reason = Reason::of(runner, &scenario, args.requirement.as_deref())?;
    status!("fails by {reason}; shrinking");
    let (text, runs) = shrink::shrink(runner, &scenario, &reason);
    if interrupts.is_stop_requested() {
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

/// The scenario of a file, or of a folder of a run or a case.
fn scenario_of(path: &Path) -> anyhow::Result<PathBuf> {
    let inside = path.join("scenario.toml");
    ensure!(!path.is_dir() || inside.is_file(), "{} has no scenario.toml", path.display());
    Ok(if path.is_dir() { inside } else { path.to_owned() })
}

/// Parquet; CSV where the program that writes Parquet is missing, since no result may be lost for that.
fn table_format(out: &Path) -> Format {
    match ParquetProgram::beside_this_one() {
        Ok(program) => Format::Parquet(program),
        Err(missing) => {
            let out = word(&out.display().to_string());
            status!(
                "the table is CSV: {missing}; then the same command with --out {out} writes Parquet, too"
            );
            Format::Csv
        }
    }
}

fn folder_by_time(file: &Path) -> PathBuf {
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    Path::new("campaigns").join(format!("{}-{name}", time_in_names()))
}
