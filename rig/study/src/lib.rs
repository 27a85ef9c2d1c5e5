//! `masseter kinematics`: the paper's study of the forward kinematics again, as data, figures and a page
//! of its claims. It is about the published mechanism. Everything but the times is a function of
//! `--seed`, `--samples` and `--cells`.

mod basins;
mod claims;
mod contender;
mod motions;
mod multiplicity;
mod page;
mod pairs;
mod plot;
mod sample;
mod share;
mod solution_set;
mod speed;
mod table;
mod trials;
pub mod uniqueness;
mod workspace;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use masseter_shared::config::Scenario;
use masseter_shared::geometry::{Mechanism, MechanismConfig, Vec3};
use rayon::prelude::*;

use basins::Basins;
use masseter_plan::Overrides;
use masseter_terminal::{Exit, result_line, status};
use motions::Motion;
use multiplicity::Multiplicity;
use pairs::Pairs;
use plot::Figure;
use solution_set::SolutionSet;
use speed::Speed;
use table::Table;
use trials::Trials;
use workspace::{Map, SLICES};

/// What `kinematics` takes.
#[derive(Debug, Clone, Args)]
pub struct KinematicsArgs {
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
    /// Scenario whose motion is meant, or else the recording's axes, with its jaw and its limits
    #[arg(long, value_name = "FILE.toml")]
    scenario: Option<PathBuf>,
}

/// Everything that was measured.
struct Study {
    mechanism: Mechanism,
    trials: Trials,
    pairs: Pairs,
    speed: Speed,
    set: SolutionSet,
    multiplicity: Multiplicity,
    basins: Basins,
    motions: Vec<Motion>,
    maps: Vec<Map>,
}

/// Carries the verb out. That a claim of the paper does not hold is a result, not a failure.
pub fn kinematics(args: &KinematicsArgs) -> anyhow::Result<Exit> {
    let study = Study::make(args)?;
    study.write(args)
}

impl KinematicsArgs {
    /// The scenario of the motion that is to be looked at beside the rig's own, if one is given.
    fn own_scenario(&self) -> anyhow::Result<Option<Scenario>> {
        if self.scenario.is_none() && self.trajectory.is_none() {
            return Ok(None);
        }
        let overrides = Overrides { trajectory: self.trajectory.clone(), ..Overrides::default() };
        let scenario = masseter_plan::scenario_with_overrides(self.scenario.as_deref(), &overrides)?;
        if scenario.mechanism != MechanismConfig::default() {
            bail!("the study is about the published mechanism; leave [mechanism] out of the scenario");
        }
        Ok(Some(scenario))
    }
}

impl Study {
    fn make(args: &KinematicsArgs) -> anyhow::Result<Self> {
        let mechanism = Mechanism::new(&MechanismConfig::default())?;
        let motions = motions::motions(&mechanism, args.own_scenario()?.as_ref())?;
        masseter_terminal::new_folder(&args.out)?;
        let (samples, cells) = (args.samples as usize, args.cells as usize);
        status!("{samples} random guesses of each kind");
        let trials = Trials::run(&mechanism, samples, args.seed);
        let pairs = Pairs::find(&mechanism, &trials);
        let set = SolutionSet::neutral(&mechanism)?;
        let multiplicity = Multiplicity::count(&mechanism, samples, args.seed);
        status!("maps of {cells} by {cells} cells");
        let basins = Basins::map(&mechanism, &set, cells);
        let middle = set.true_one().map_or_else(Vec3::zeros, |truth| truth.pose.translation.vector);
        let maps = SLICES.map(|slice| Map::of(&mechanism, slice, &middle, cells)).into();
        status!("times");
        let speed = Speed::measure(&mechanism, &trials, &motions[0]);
        Ok(Self { mechanism, trials, pairs, speed, set, multiplicity, basins, motions, maps })
    }

    fn write(&self, args: &KinematicsArgs) -> anyhow::Result<Exit> {
        let figures = plot::figures(self)?;
        let claims = claims::judge(self);
        let page = page::of(self, args, &claims, &figures);
        let folder = &args.out;
        let written = |name: &str| format!("cannot write {}", folder.join(name).display());
        for table in self.tables() {
            table.write(folder).with_context(|| written(table.name))?;
        }
        status!("{} figures", figures.len());
        figures
            .par_iter()
            .try_for_each(|figure| write_figure(folder, figure).with_context(|| written(figure.name)))?;
        fs::write(folder.join("claims.md"), page).with_context(|| written("claims.md"))?;
        for claim in &claims {
            result_line!("{:<13}  {}", claim.verdict.name(), claim.says)?;
        }
        result_line!("{}", folder.join("claims.md").display())?;
        Ok(Exit::Passed)
    }

    fn tables(&self) -> Vec<Table> {
        let mut tables = self.pairs.tables();
        tables.extend([
            self.trials.success_table(),
            self.trials.iterations_table(),
            self.trials.cost_table(),
            self.speed.table(),
            self.set.table(),
            self.multiplicity.table(),
            self.basins.table(),
            motions::table(&self.motions, &self.mechanism),
        ]);
        tables.extend(self.maps.iter().map(Map::table));
        tables
    }
}

fn write_figure(folder: &Path, figure: &Figure) -> anyhow::Result<()> {
    let path = folder.join(figure.name);
    fs::write(path.with_extension("svg"), &figure.svg)?;
    Ok(())
}
