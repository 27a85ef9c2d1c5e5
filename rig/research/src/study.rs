//! What the study measures: a table each.

use masseter_model::geometry::{LEGS, Mechanism, MechanismConfig};

use crate::maps::{SLICES, Slice, basins_table, workspace_table};
use crate::solutions::{SolutionSet, multiplicity_table};
use crate::tables::{csv, number};
use crate::{forces, motions, pairs, speed};

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
pub struct Study {
    mechanism: Mechanism,
    motions: Vec<crate::motions::Motion>,
}

impl Study {
    /// Checks the inputs: the motions of the rig and that of `scenario`, if one is given.
    ///
    /// # Errors
    /// When the scenario has another mechanism than the published one, its recording cannot be used, or a value of its
    /// motion lies outside its range.
    pub fn prepare(scenario: Option<&masseter_scenario::Scenario>) -> anyhow::Result<Self> {
        let published = MechanismConfig::default();
        anyhow::ensure!(
            scenario.is_none_or(|scenario| scenario.mechanism == published),
            "the study is about the published mechanism; leave [mechanism] out of the scenario"
        );
        let mechanism = Mechanism::new(&published)?;
        let motions = motions::motions(&mechanism, scenario)?;
        Ok(Self { mechanism, motions })
    }

    /// Measures on all cores; `progress` receives each stage. Returns names and tables, as CSV.
    ///
    /// # Errors
    /// When the neutral input has no finite set of solutions, or a run of the emulated rig fails.
    pub fn run(
        &self,
        settings: Settings,
        progress: impl Fn(&str),
    ) -> anyhow::Result<Vec<(&'static str, String)>> {
        let Self { mechanism, motions } = self;
        let Settings { seed, samples, cells } = settings;
        progress(&format!("{samples} random guesses of each kind"));
        let trials = crate::trials::Trials::run(mechanism, motions, samples, seed);
        let pairs = pairs::disagreements(mechanism, &trials);
        let set = SolutionSet::neutral(mechanism)?;
        let mut tables = vec![
            ("success", trials.success_table()),
            ("iterations", trials.iterations_table()),
            ("disagreements", pairs::disagreements_table(&pairs, &trials)),
            ("fig8_solutions", set.table(mechanism)),
            ("mechanism", slides_table(mechanism, &set)),
            ("multiplicity", multiplicity_table(mechanism, samples, seed)),
            ("motions", motions::table(motions, mechanism)),
            ("motion_paths", motions::paths_table(motions)),
        ];
        tables.extend(pairs.iter().map(|one| (one.name, one.table())));
        progress(&format!("maps of {cells} by {cells} cells"));
        tables.push(("basins", basins_table(mechanism, &set, cells)));
        let middle = set.true_one.pose.translation.vector;
        let map = |slice: Slice| (slice.name, workspace_table(mechanism, slice, &middle, cells));
        tables.extend(SLICES.map(map));
        progress("times");
        tables.push(("speed", speed::table(mechanism, &trials, &motions[0])));
        progress("forces of runs");
        tables.extend(forces::play()?);
        Ok(tables)
    }
}

/// The legs' hinges at the ends of the slides, and where they are in the neutral input.
fn slides_table(mechanism: &Mechanism, set: &SolutionSet) -> String {
    let [low_m, high_m] = mechanism.strokes().slide_m;
    let rows = (0..LEGS).flat_map(|leg| {
        [("low", low_m), ("neutral", set.actuators.slide_m[leg]), ("high", high_m)].map(|(slide, at_m)| {
            let hinge = mechanism.hinge(leg, at_m);
            (leg + 1, slide, [hinge.x, hinge.y, hinge.z].map(number))
        })
    });
    csv("leg,slide,x_m,y_m,z_m", rows)
}
