//! `masseter-research study`: the paper study as a folder of figures, data and a page of claims.

use std::path::PathBuf;

use clap::Args;
use masseter_plan::Overrides;
use masseter_recording::output::new_folder;
use masseter_research::{Settings, Study};
use masseter_scenario::Scenario;
use masseter_terminal::{Exit, result_line, status};

/// The arguments of `study`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter-research study --out study")]
pub(crate) struct StudyArgs {
    /// Folder for figures (SVG), data (CSV) and claims.md; must not exist
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Seed of every random number
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Random guesses of each kind, and random inputs
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(1..))]
    samples: u32,
    /// Cells along each side of a map
    #[arg(long, value_name = "N", default_value_t = 160, value_parser = clap::value_parser!(u32).range(2..=1000))]
    cells: u32,
    /// Recorded jaw motion (CSV of poses or markers) to judge and to draw into the workspace as well
    #[arg(long, value_name = "FILE.csv")]
    trajectory: Option<PathBuf>,
    /// Scenario with a motion to judge as well; for a recording its axes, jaw and limits
    #[arg(long, value_name = "FILE.toml")]
    scenario: Option<PathBuf>,
}

/// Makes the study. A claim of the paper that does not hold is a result, not a failure.
pub(crate) fn study(args: &StudyArgs) -> anyhow::Result<Exit> {
    let prepared = Study::prepare(args.own_scenario()?.as_ref())?;
    new_folder(&args.out)?;
    let settings = Settings { seed: args.seed, samples: args.samples as usize, cells: args.cells as usize };
    let study = prepared.run(settings, |stage| status!("{stage}"))?;
    for claim in masseter_research::write(&study, &args.out, &args.command())? {
        result_line!("{:<13}  {}", claim.judgement.name(), claim.statement)?;
    }
    result_line!("{}", args.out.join("claims.md").display())?;
    Ok(Exit::Passed)
}

impl StudyArgs {
    /// The scenario of a motion beside the rig's own, if one is given.
    fn own_scenario(&self) -> anyhow::Result<Option<Scenario>> {
        if self.scenario.is_none() && self.trajectory.is_none() {
            return Ok(None);
        }
        let overrides = Overrides { trajectory: self.trajectory.clone(), ..Overrides::default() };
        Ok(Some(masseter_plan::scenario_with_overrides(self.scenario.as_deref(), &overrides)?))
    }

    /// The command line that repeats the study.
    fn command(&self) -> String {
        let Self { seed, samples, cells, trajectory, scenario, .. } = self;
        let options = [("trajectory", trajectory), ("scenario", scenario)].into_iter();
        let option =
            |(name, path): (_, &Option<PathBuf>)| Some(format!(" --{name} {}", path.as_ref()?.display()));
        format!("masseter-research study --out DIR --seed {seed} --samples {samples} --cells {cells}")
            + &options.filter_map(option).collect::<String>()
    }
}
