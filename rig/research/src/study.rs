//! Everything that the study measures.

use anyhow::ensure;
use masseter_model::geometry::{Mechanism, MechanismConfig};
use masseter_scenario::Scenario;

use crate::forces::{self, Forces};
use crate::maps::{Basins, Map, SLICES};
use crate::motions::{self, Motion};
use crate::pairs::{self, Disagreement};
use crate::solutions::{Multiplicity, SolutionSet};
use crate::speed::{self, Situation};
use crate::trials::Trials;

/// The extent of a study.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Seed of every random number.
    pub seed: u64,
    /// Random guesses of each kind, and random inputs.
    pub samples: usize,
    /// Cells along each side of a map.
    pub cells: usize,
}

/// A study whose inputs are checked.
#[derive(Debug)]
pub struct PreparedStudy {
    mechanism: Mechanism,
    motions: Vec<Motion>,
}

/// The measurements.
#[derive(Debug)]
pub struct Study {
    pub(crate) settings: Settings,
    pub(crate) mechanism: Mechanism,
    pub(crate) trials: Trials,
    pub(crate) pairs: [Disagreement; 3],
    pub(crate) speed: [Situation; 2],
    pub(crate) set: SolutionSet,
    pub(crate) multiplicity: Multiplicity,
    pub(crate) basins: Basins,
    pub(crate) motions: Vec<Motion>,
    pub(crate) maps: [Map; 4],
    pub(crate) forces: Forces,
}

impl Study {
    /// Checks the inputs: the motions of the rig and that of `scenario`, if one is given.
    ///
    /// # Errors
    /// When the scenario has another mechanism than the published one, its recording cannot be used, or a value of its
    /// motion lies outside its range.
    pub fn prepare(scenario: Option<&Scenario>) -> anyhow::Result<PreparedStudy> {
        let published = MechanismConfig::default();
        ensure!(
            scenario.is_none_or(|scenario| scenario.mechanism == published),
            "the study is about the published mechanism; leave [mechanism] out of the scenario"
        );
        let mechanism = Mechanism::new(&published)?;
        let motions = motions::motions(&mechanism, scenario)?;
        Ok(PreparedStudy { mechanism, motions })
    }
}

impl PreparedStudy {
    /// Measures on all cores; `progress` receives each stage.
    ///
    /// # Errors
    /// When the neutral input has no finite set of solutions, or a run of the emulated rig fails.
    pub fn run(self, settings: Settings, progress: impl Fn(&str)) -> anyhow::Result<Study> {
        let Self { mechanism, motions } = self;
        let Settings { seed, samples, cells } = settings;
        progress(&format!("{samples} random guesses of each kind"));
        let trials = Trials::run(&mechanism, samples, seed);
        let pairs = pairs::disagreements(&mechanism, &trials);
        let set = SolutionSet::neutral(&mechanism)?;
        let multiplicity = Multiplicity::count(&mechanism, samples, seed);
        progress(&format!("maps of {cells} by {cells} cells"));
        let basins = Basins::map(&mechanism, &set, cells);
        let middle = set.true_one.pose.translation.vector;
        let maps = SLICES.map(|slice| Map::compute(&mechanism, slice, &middle, cells));
        progress("times");
        let speed = speed::measure(&mechanism, &trials, &motions[0]);
        progress("forces of runs");
        let forces = forces::play()?;
        Ok(Study {
            settings,
            mechanism,
            trials,
            pairs,
            speed,
            set,
            multiplicity,
            basins,
            motions,
            maps,
            forces,
        })
    }
}
