//! Branch and bound: level by level every box is examined, and undecided boxes are halved, until none is left or enough
//! boxes were examined. Shares of volume are exact except for the rounding of the boxes: every halving halves, and of
//! several boxes at the start each counts the same.

use masseter_controller::kinematics::uniqueness::{Finding, InputBox, Proof, Reaches, SolutionKind};
use masseter_model::geometry::{AXIS_NAMES, Mechanism};
use rayon::prelude::*;

use crate::table::{csv, number};

/// A box of inputs and the known bounds of its solutions' reaches.
type Open = (InputBox, Reaches);

/// What a proof decided.
#[derive(Debug, Clone, Default)]
pub struct Proven {
    /// Boxes examined.
    pub examined: usize,
    /// Share of the volume without a solution, 0 to 1.
    pub unsolvable_share: f64,
    /// Share of the volume with at most one solution, 0 to 1.
    pub unique_share: f64,
    /// Boxes that stay undecided; none where all is proven.
    pub undecided: Vec<InputBox>,
}

impl Proven {
    /// The undecided boxes as CSV: both ends of each axis, metres.
    pub fn table(&self) -> String {
        let header = AXIS_NAMES.map(|axis| format!("{axis}_low_m,{axis}_high_m")).join(",");
        let row = |inputs: &InputBox| inputs.axes().map(|axis| [axis.low(), axis.high()].map(number));
        csv(&header, self.undecided.iter().map(row))
    }
}

/// Proves by interval arithmetic that no input of `boxes` has two solutions that meet the paper's conditions and, with a
/// `margin`, have a determinant of at least that. Examines at most `most` boxes; `progress` receives the number of boxes
/// examined and the decided share of the volume.
#[must_use]
pub fn prove(
    mechanism: &Mechanism,
    boxes: Vec<InputBox>,
    margin: Option<f64>,
    most: usize,
    progress: impl Fn(usize, f64),
) -> Proven {
    let proof =
        Proof::new(mechanism, margin.map_or(SolutionKind::PaperConditions, SolutionKind::DeterminantAtLeast));
    let mut share_of_one = 1.0 / boxes.len() as f64;
    let mut open: Vec<Open> = boxes.into_iter().map(|whole| (whole, Proof::any_reaches(&whole))).collect();
    let mut proven = Proven::default();
    while !open.is_empty() && proven.examined + open.len() <= most {
        proven.examined += open.len();
        let mut halves = Vec::new();
        let findings: Vec<Finding> =
            open.par_iter().map(|(inputs, within)| proof.examine(inputs, within)).collect();
        for ((inputs, _), finding) in open.iter().zip(findings) {
            match finding {
                Finding::NoSolution => proven.unsolvable_share += share_of_one,
                Finding::AtMostOne => proven.unique_share += share_of_one,
                Finding::Undecided(within) => halves.extend(inputs.halves().map(|half| (half, within))),
            }
        }
        progress(proven.examined, proven.unsolvable_share + proven.unique_share);
        open = halves;
        share_of_one /= 2.0;
    }
    proven.undecided = open.into_iter().map(|(inputs, _)| inputs).collect();
    proven
}

#[cfg(test)]
mod tests {
    use masseter_controller::kinematics::uniqueness::Enclosure;
    use masseter_model::geometry::MechanismConfig;

    use super::*;

    fn bounded(slide_m: [f64; 3], leg_m: [f64; 3], radius_m: f64, most: usize) -> Proven {
        let around = |value_m: f64| Enclosure::new(value_m - radius_m, value_m + radius_m);
        let whole = InputBox { slide_m: slide_m.map(around), leg_m: leg_m.map(around) };
        let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
        prove(&mechanism, vec![whole], None, most, |_, _| {})
    }

    #[test]
    fn a_region_around_the_neutral_input_is_proven_wholly() {
        let proven = bounded([0.0; 3], [0.27; 3], 3e-3, 3000);
        assert!(proven.undecided.is_empty(), "{proven:?}");
        assert!((proven.unique_share + proven.unsolvable_share - 1.0).abs() < 1e-12);
        assert!(proven.examined > 1, "one box would not show that halving works");
    }

    /// Boxes keep the input with two solutions undecided, however often they are halved.
    #[test]
    fn an_input_with_two_solutions_stays_undecided() {
        let slide_m = [0.010_137_353_8, 0.015_926_592_4, 0.020_840_656_8];
        let leg_m = [0.246_449_456_1, 0.287_523_749_3, 0.270_252_791_5];
        let undecided = bounded(slide_m, leg_m, 1e-3, 200).undecided;
        let holds = |inputs: &InputBox| {
            let axes = inputs.axes().into_iter().zip(slide_m.into_iter().chain(leg_m));
            axes.into_iter().all(|(axis, value_m)| axis.contains(value_m))
        };
        assert!(undecided.iter().any(holds));
    }
}
