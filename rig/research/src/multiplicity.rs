//! How many solutions random inputs have, and how many of them meet the paper's two conditions.

use masseter_controller::kinematics::{Assembly, MOST_SOLUTIONS, Solutions};
use masseter_model::geometry::{LEGS, Mechanism};
use rayon::prelude::*;

use super::sample::{self, Stream};
use super::share::Share;
use super::table::csv;

/// Which solutions count.
#[derive(Debug, Clone, Copy)]
pub(super) struct Conditions {
    pub name: &'static str,
    pub admit: fn(&Assembly) -> bool,
}

/// Every solution, then interpretations of the paper's conditions.
pub(super) const CONDITIONS: [Conditions; 4] = [
    Conditions { name: "all", admit: |_| true },
    Conditions {
        name: "conditions 1 and 2, either side of the plane",
        admit: |one| {
            let [first, others @ ..] = one.hinges_below_platform;
            stands(*one) && others == [first; LEGS - 1]
        },
    },
    Conditions {
        name: "conditions 1 and 2, plane oriented",
        admit: |one| stands(*one) && one.hinges_below_platform == [true; LEGS],
    },
    Conditions { name: "these and a positive determinant", admit: Assembly::is_true },
];
/// The place of conditions 1 and 2 with the plane oriented.
pub(super) const ORIENTED: usize = 2;

/// Legs above the base, and A₂ beyond A₃.
fn stands(assembly: Assembly) -> bool {
    assembly.legs_above_base == [true; LEGS] && assembly.corners_in_order
}

/// Counts over random inputs anywhere in the strokes.
#[derive(Debug, Clone)]
pub(super) struct Multiplicity {
    /// The solutions of each input, in the order of [`CONDITIONS`].
    counts: Vec<[usize; CONDITIONS.len()]>,
}

impl Multiplicity {
    /// Inputs whose solutions form a continuum but for rounding are left out; random ones do not.
    pub(super) fn count(mechanism: &Mechanism, inputs: usize, seed: u64) -> Self {
        let counts = |case| {
            let actuators = sample::input(mechanism, &mut sample::generator(seed, Stream::Inputs, case));
            let solutions = Solutions::new(mechanism, &actuators).ok()?;
            let admitted = |admit: fn(&Assembly) -> bool| {
                solutions.iter().filter(|solution| admit(&solution.assembly)).count()
            };
            Some(CONDITIONS.map(|conditions| admitted(conditions.admit)))
        };
        Self { counts: (0..inputs).into_par_iter().filter_map(counts).collect() }
    }

    /// How many inputs have so many solutions.
    pub(super) fn with_solutions(&self, solutions: usize) -> Share {
        Share::count(self.counts.iter().map(|[all, ..]| *all == solutions))
    }

    /// Of the inputs to which conditions leave any solution: to how many they leave more than so many.
    pub(super) fn with_more_than(&self, solutions: usize, conditions: usize) -> Share {
        let left = self.counts.iter().map(|counts| counts[conditions]).filter(|&left| left > 0);
        Share::count(left.map(|left| left > solutions))
    }

    pub(super) fn table(&self) -> String {
        let rows = CONDITIONS.iter().enumerate().flat_map(|(place, conditions)| {
            (0..=MOST_SOLUTIONS).map(move |solutions| {
                let inputs = self.counts.iter().filter(|counts| counts[place] == solutions).count();
                (conditions.name, solutions, inputs)
            })
        });
        csv("counted,solutions,inputs", rows)
    }
}
