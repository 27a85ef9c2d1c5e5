//! Branch and bound: level by level every box is examined and what stays undecided is halved, until
//! nothing is left or the boxes are used up. Shares of volume are exact but for the boxes' own
//! roundings: every halving halves, and of several boxes to begin with each counts the same.

use masseter_controller::kinematics::uniqueness::{Claim, Finding, InputBox, Proof, Reaches};
use masseter_shared::geometry::{AXIS_NAMES, Mechanism};
use masseter_terminal::{result_line, status};
use rayon::prelude::*;

use super::ProveArgs;

/// A box of inputs and what is known of its solutions' reaches.
type Open = (InputBox, Reaches);

/// What the boxes examined so far add up to.
#[derive(Debug, Default)]
struct Tally {
    examined: usize,
    unsolvable_share: f64,
    unique_share: f64,
}

/// Whether all of the boxes are proven, and what of them is undecided as CSV.
pub(super) fn prove(
    args: &ProveArgs,
    mechanism: &Mechanism,
    wholes: Vec<InputBox>,
) -> anyhow::Result<(bool, Vec<String>)> {
    let claim = args.margin.map_or(Claim::PaperConditions, Claim::DeterminantAtLeast);
    let (tally, undecided) = branch_and_bound(&Proof::new(mechanism, claim), wholes, args.boxes);
    result_line!("boxes examined       {}", tally.examined)?;
    result_line!("no solution          {:.4} % of the volume", 100.0 * tally.unsolvable_share)?;
    result_line!("at most one solution {:.4} % of the volume", 100.0 * tally.unique_share)?;
    result_line!("undecided            {} boxes", undecided.len())?;
    let header = AXIS_NAMES.map(|axis| format!("{axis}_low_m,{axis}_high_m")).join(",");
    let row =
        |(inputs, _): &Open| inputs.axes().map(|axis| format!("{},{}", axis.low(), axis.high())).join(",");
    Ok((undecided.is_empty(), std::iter::once(header).chain(undecided.iter().map(row)).collect()))
}

/// The tally, and the boxes that are left when no more than `most` have been examined.
fn branch_and_bound(proof: &Proof, wholes: Vec<InputBox>, most: usize) -> (Tally, Vec<Open>) {
    let mut share_of_one = 1.0 / wholes.len() as f64;
    let mut open: Vec<Open> = wholes.into_iter().map(|whole| (whole, Proof::any_reaches(&whole))).collect();
    let mut tally = Tally::default();
    while !open.is_empty() && tally.examined + open.len() <= most {
        tally.examined += open.len();
        let mut halves = Vec::new();
        let findings: Vec<Finding> =
            open.par_iter().map(|(inputs, within)| proof.examine(inputs, within)).collect();
        for ((inputs, _), finding) in open.iter().zip(findings) {
            match finding {
                Finding::NoSolution => tally.unsolvable_share += share_of_one,
                Finding::AtMostOne => tally.unique_share += share_of_one,
                Finding::Undecided(within) => halves.extend(inputs.halves().map(|half| (half, within))),
            }
        }
        let decided = tally.unsolvable_share + tally.unique_share;
        status!("{} boxes examined, {:.2} % of the volume decided", tally.examined, 100.0 * decided);
        open = halves;
        share_of_one /= 2.0;
    }
    (tally, open)
}

#[cfg(test)]
mod tests {
    use masseter_controller::kinematics::uniqueness::Enclosure;

    use super::*;
    use crate::uniqueness::published;

    fn bounded(slide_m: [f64; 3], leg_m: [f64; 3], radius_m: f64, most: usize) -> (Tally, Vec<Open>) {
        let around = |value_m: f64| Enclosure::new(value_m - radius_m, value_m + radius_m);
        let whole = InputBox { slide_m: slide_m.map(around), leg_m: leg_m.map(around) };
        branch_and_bound(&Proof::new(&published().unwrap(), Claim::PaperConditions), vec![whole], most)
    }

    #[test]
    fn a_region_around_the_neutral_input_is_proven_wholly() {
        let (tally, undecided) = bounded([0.0; 3], [0.27; 3], 3e-3, 3000);
        assert!(undecided.is_empty(), "{tally:?}");
        assert!((tally.unique_share + tally.unsolvable_share - 1.0).abs() < 1e-12);
        assert!(tally.examined > 1, "one box would not show that halving works");
    }

    /// Boxes keep the input with two solutions undecided, however often they are halved.
    #[test]
    fn an_input_with_two_solutions_stays_undecided() {
        let slide_m = [0.010_137_353_8, 0.015_926_592_4, 0.020_840_656_8];
        let leg_m = [0.246_449_456_1, 0.287_523_749_3, 0.270_252_791_5];
        let (_, undecided) = bounded(slide_m, leg_m, 1e-3, 200);
        let holds = |inputs: &InputBox| {
            let axes = inputs.axes().into_iter().zip(slide_m.into_iter().chain(leg_m));
            axes.into_iter().all(|(axis, value_m)| axis.contains(value_m))
        };
        assert!(undecided.iter().any(|(inputs, _)| holds(inputs)));
    }
}
