//! `masseter campaign`, `search` and `shrink`: one scenario with many values of its keys, faults and motions.
//!
//! [`masseter_campaign`] holds cases, results and their folder. This module runs the cases: on all cores of this machine, or on
//! the workers of a HyperQueue server. Under virtual time a case needs no recording; the worst ones are played again with one.

pub(crate) mod args;
mod hyperqueue;
mod local;
mod player;
pub(crate) mod search;
pub(crate) mod shrink;
pub(crate) mod worker;
mod worst;

use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use anyhow::{Context, anyhow};
use clap::ValueEnum;
use masseter_campaign::{Campaign, CampaignFile, CampaignFolder, CampaignLock, Report, digest_of_program};
use masseter_plan::{Overrides, scenario_with_overrides};
use masseter_runtime::clock;
use masseter_table::{Format, ParquetProgram};
use masseter_terminal::{Exit, Failure, OrFailure, result, status};

use crate::arguments::{ControllerKind, name_of};
use crate::interrupts::Interrupts;
use crate::run::check_simulated;
use crate::shell::word;
use args::{CampaignArgs, EngineKind};
use player::Player;

/// Where campaigns without `--out` go.
const CAMPAIGNS: &str = "campaigns";
/// How many of the worst cases are recorded.
const RECORD: usize = 10;

/// Runs the campaign, or what is left of it; [`Exit::Passed`] if enough cases passed.
pub(crate) fn campaign(args: &CampaignArgs) -> Result<Exit, Failure> {
    let campaign = plan(&args.file, args.controller).usage()?;
    let out = args.out.clone().unwrap_or_else(|| folder_by_time(&args.file));
    let (folder, _lock) = begin(&out, &campaign)?;
    let interrupts = listen()?;
    status!("{} cases; results in {}", campaign.case_count(), out.display());
    let player = Player { controller: args.controller, interrupts: &interrupts };
    let results = match args.engine {
        EngineKind::Local => local::run(&campaign, &folder, &player),
        EngineKind::Hyperqueue => hyperqueue::run(&campaign, &folder, &args.hyperqueue, &interrupts),
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
    let report = Report::new(&campaign, results, table_format(&out));
    // Whatever becomes of the recordings, the results are there.
    masseter_campaign::write(&report, &folder, &[]).incomplete()?;
    let worst = worst::keep(&report, &campaign, &folder, args.record.unwrap_or(RECORD), &player)?;
    masseter_campaign::write(&report, &folder, &worst).incomplete()?;
    result(&report.text(&folder)).incomplete()?;
    Ok(if report.is_success() { Exit::Passed } else { Exit::Failed })
}

fn begin(out: &Path, campaign: &Campaign) -> Result<(CampaignFolder, CampaignLock), Failure> {
    CampaignFolder::begin(out, campaign).usage()
}

fn listen() -> Result<Interrupts, Failure> {
    Interrupts::listen().context("cannot listen for signals").died()
}

/// The campaign of a file.
fn plan(file: &Path, controller: ControllerKind) -> anyhow::Result<Campaign> {
    let read = CampaignFile::read(file)?;
    let base = scenario_with_overrides(read.scenario.as_deref(), &Overrides::default())?;
    let parent = file.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let campaign = Campaign {
        file: read,
        controller: name_of(&controller),
        program: program()?,
        folder: parent.canonicalize()?,
        base: base.to_toml(),
    };
    campaign.check().with_context(|| file.display().to_string())?;
    // What is wrong with the scenario itself is wrong with every case.
    check_simulated(&base, campaign.file.scenario.as_deref(), controller)
        .context("the scenario of the campaign")?;
    Ok(campaign)
}

/// The digest of this program.
fn program() -> anyhow::Result<String> {
    let digest = std::env::current_exe().and_then(|path| digest_of_program(&path));
    digest.context("cannot read this program")
}

/// The controller of a campaign that has begun.
fn controller_of(campaign: &Campaign) -> anyhow::Result<ControllerKind> {
    ControllerKind::from_str(&campaign.controller, false).map_err(|error| anyhow!(error))
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
    let time = humantime::format_rfc3339_millis(UNIX_EPOCH + clock::wall_time()).to_string();
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    Path::new(CAMPAIGNS).join(format!("{}-{name}", time.replace([':', '-'], "")))
}
