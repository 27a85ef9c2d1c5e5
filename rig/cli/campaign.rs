//! `masseter campaign`, `search` and `shrink`: one scenario with many values of its keys, faults and motions.

use masseter_campaign::{Campaign, CampaignFile, CampaignFolder, Factor, Sampler, Search, StopRules};

use crate::prelude::*;
use crate::run::request::{ControllerChoice, ControllerKind};
use crate::run::runner::Runner;
use crate::vary::play::{Player, plan};
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

impl PlayArgs {
    /// A campaign in its folder, in which nobody else plays.
    fn begin(&self, campaign: Campaign, file: &Path) -> Result<Player, Failure> {
        let by_time = || {
            let name = file.file_stem().unwrap_or_default().to_string_lossy();
            Path::new("campaigns").join(format!("{}-{name}", masseter_recording::time_in_names()))
        };
        let folder = CampaignFolder::begin(&self.out.clone().unwrap_or_else(by_time), &campaign).usage()?;
        Ok(Player { campaign, folder, runner: Runner::of_verb(ControllerChoice::Own(self.controller))? })
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
    let player = args.play.begin(campaign, &args.file)?;
    if args.plan {
        let open = player.open_cases().incomplete()?;
        result(&open.iter().map(|number| number.to_string() + "\n").collect::<String>()).incomplete()?;
        return Ok(Exit::Passed);
    }
    status!("{} cases; results in {}", player.campaign.case_count(), player.folder.path().display());
    let results = player.play_all()?;
    let Some((report, _)) = player.report(results, args.play.record)? else { return Ok(Exit::Interrupted) };
    result(&report.in_words(&player.folder)).incomplete()?;
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
    #[command(flatten)]
    search: Search,
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

/// Searches; [`Exit::Failed`] if a margin below zero was found, or no run was judged.
pub(super) fn search(args: &SearchArgs) -> Result<Exit, Failure> {
    let mut campaign = plan(&args.file, args.play.controller).usage()?;
    // The archive is that of a random campaign, whose points the search chooses.
    campaign.file = CampaignFile { sampler: Sampler::Random, runs: None, seeds: None, ..campaign.file };
    check_search(&campaign, args).usage()?;
    let player = args.play.begin(campaign, &args.file)?;
    status!("at most {} runs; results in {}", args.search.runs, player.folder.path().display());
    let Found { first, results } = search::search(&args.search, args.requirement(), &player)?;
    let runs = results.len();
    let judged = results.iter().filter(|result| result.is_judged()).count();
    let Some((report, worst)) = player.report(results, args.play.record)? else {
        return Ok(Exit::Interrupted);
    };
    let found = match (first, runs - judged) {
        (Some(first), _) => format!("below zero after {}\n", counted(first as u64, "run")),
        (None, 0) => format!("nothing below zero in {}\n", counted(runs as u64, "run")),
        (None, others) => format!("nothing below zero in {runs} runs, of which {others} were not judged\n"),
    };
    let again = worst.first().map_or_else(String::new, |worst| format!("again: {}\n", worst.command));
    result(&(found + &again + &report.files(&player.folder))).incomplete()?;
    // Where nothing was judged, nothing was searched.
    Ok(if first.is_some() || judged == 0 { Exit::Failed } else { Exit::Passed })
}

fn check_search(campaign: &Campaign, args: &SearchArgs) -> anyhow::Result<()> {
    ensure!(args.search.runs > 0, "--runs: give at least 1");
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
    let scenario = scenario_with(Some(&path), &[]).usage()?;
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
