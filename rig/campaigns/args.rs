//! The arguments of `masseter campaign`, and of the hidden verb that runs one case of a campaign.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::arguments::ControllerKind;

/// The arguments of `campaign`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter campaign friction.toml\n  masseter campaign friction.toml --out campaigns/friction\n\nThe same command with the same --out goes on where a killed campaign was."
)]
pub(crate) struct CampaignArgs {
    /// File of the campaign: scenario, sampler, runs, and a [[factor]] for everything that varies
    pub file: PathBuf,
    /// Folder of the results; a campaign that was begun in it goes on [default: campaigns/UTC_TIME-NAME]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Who controls the robot
    #[arg(long, value_enum, default_value_t, hide_default_value = true)]
    pub controller: ControllerKind,
    /// Where the cases run
    #[arg(long, value_enum, default_value_t)]
    pub engine: EngineKind,
    #[command(flatten)]
    pub hyperqueue: HyperqueueArgs,
    /// Record this many of the cases with the smallest margins [default: 10]
    #[arg(long, value_name = "N")]
    pub record: Option<usize>,
}

/// Where HyperQueue is.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct HyperqueueArgs {
    /// Folder of HyperQueue's server [default: the one that HyperQueue uses]
    #[arg(long, value_name = "DIR")]
    pub server_dir: Option<PathBuf>,
    /// Python that has the package hyperqueue [default: python3]
    #[arg(long, value_name = "FILE")]
    pub python: Option<PathBuf>,
}

/// Where the cases of a campaign run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum EngineKind {
    /// On all cores of this machine
    #[default]
    Local,
    /// On the workers of a HyperQueue server, also under Slurm and PBS
    Hyperqueue,
}

/// The arguments of the hidden verb that runs one case.
#[derive(Debug, Clone, Args)]
pub(crate) struct CampaignCaseArgs {
    /// Folder of the campaign
    pub folder: PathBuf,
    /// Number of the case
    pub number: usize,
    /// Number of the start of the campaign, at whose interruption the case stops
    pub start: Option<u64>,
}

/// The arguments of `search`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Example:\n  masseter search friction.toml --minimise incisal.margin --runs 500\n\nThe worst case can be made smaller by 'masseter shrink'."
)]
pub(crate) struct SearchArgs {
    /// File of a campaign; its sampler, runs and seeds do not count
    pub file: PathBuf,
    /// Requirement whose margin gets as small as possible, such as incisal.margin [default: the smallest of all]
    #[arg(long, value_name = "NAME")]
    pub minimise: Option<String>,
    /// The most runs
    #[arg(long, value_name = "N", default_value_t = 500)]
    pub runs: usize,
    /// How the next values are chosen
    #[arg(long, value_enum, default_value_t)]
    pub method: SearchMethod,
    /// Seed of the chosen values
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Go on after the first margin below zero
    #[arg(long)]
    pub go_on: bool,
    /// Folder of the results; a search that was begun in it goes on [default: campaigns/UTC_TIME-NAME]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Who controls the robot
    #[arg(long, value_enum, default_value_t, hide_default_value = true)]
    pub controller: ControllerKind,
    /// Record this many of the cases with the smallest margins [default: 10]
    #[arg(long, value_name = "N")]
    pub record: Option<usize>,
}

impl SearchArgs {
    /// The name of the requirement; none for all.
    pub(super) fn requirement(&self) -> Option<&str> {
        let name = self.minimise.as_deref()?;
        Some(name.strip_suffix(".margin").unwrap_or(name))
    }
}

/// How a search chooses the next values.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum SearchMethod {
    /// By the covariance of the best values so far
    #[default]
    CmaEs,
    /// At random
    Random,
}

/// The arguments of `shrink`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter shrink campaigns/friction/worst/case-173 --out smallest.toml")]
pub(crate) struct ShrinkArgs {
    /// A scenario that fails, or the folder of its run
    pub path: PathBuf,
    /// Keep the failure of this check [default: the first that fails, or the cause of a safe stop]
    #[arg(long, value_name = "NAME")]
    pub requirement: Option<String>,
    /// Write the smallest scenario into this file instead of standard output
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Who controls the robot
    #[arg(long, value_enum, default_value_t, hide_default_value = true)]
    pub controller: ControllerKind,
}
