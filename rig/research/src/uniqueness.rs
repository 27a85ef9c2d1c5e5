//! Whether six inputs determine one pose: [`prove`] proves it for boxes of inputs, [`search`] looks for inputs with two
//! solutions that meet the paper's conditions.
//!
//! ```
//! use masseter_model::geometry::{Mechanism, MechanismConfig};
//! use masseter_research::uniqueness::{InputBox, prove};
//!
//! let mechanism = Mechanism::new(&MechanismConfig::default())?;
//! // Slides within ±2 mm, legs of 268 to 272 mm.
//! let inputs = InputBox::uniform([-0.002, 0.002], [0.268, 0.272]);
//! let proven = prove(&mechanism, vec![inputs], None, 3000, |_, _| {});
//! assert!(proven.undecided.is_empty());
//! # Ok::<(), masseter_model::geometry::GeometryError>(())
//! ```

use masseter_controller::kinematics::Solutions;
use masseter_model::geometry::{AXES, AXIS_NAMES, Actuators, Mechanism};
use masseter_plan::RunPlan;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

pub use crate::proof::InputBox;
use crate::proof::{Finding, Proof, Reaches, any_reaches};
use crate::solutions::{CONDITIONS, ORIENTED};
use crate::tables::{csv, number};

/// Inputs from which the search goes uphill.
const CLIMBS: usize = 40;
/// Steps of one climb.
const STEPS: u32 = 1500;
/// The first step's length as a share of the stroke; each failure shortens it.
const FIRST_STEP: f64 = 0.3;
/// The share of a step's length that remains after a failure.
const SHORTER: f64 = 0.995;

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
    /// Boxes that stay undecided; empty if all is proven.
    pub undecided: Vec<InputBox>,
}

impl Proven {
    /// The undecided boxes as CSV: both ends of each axis, metres.
    pub fn table(&self) -> String {
        let header = AXIS_NAMES.map(|axis| format!("{axis}_low_m,{axis}_high_m")).join(",");
        let row = |inputs: &InputBox| inputs.axes.map(|axis| [axis.low, axis.high].map(number));
        csv(&header, self.undecided.iter().map(row))
    }
}

/// Proves by interval arithmetic that no input of `boxes` has two solutions that meet the paper's conditions and, with
/// a `margin`, have a determinant of at least that. Examines at most `most` boxes; `progress` receives the number of
/// boxes examined and the decided share of the volume.
///
/// Level by level every box is examined, and undecided boxes are halved, until none is left or enough boxes were
/// examined. Shares of volume are exact except for the rounding of the boxes: every halving halves, and of several
/// boxes at the start each counts the same.
#[must_use]
pub fn prove(
    mechanism: &Mechanism,
    boxes: Vec<InputBox>,
    margin: Option<f64>,
    most: usize,
    progress: impl Fn(usize, f64),
) -> Proven {
    let proof = Proof { mechanism, margin };
    let mut share_of_one = 1.0 / boxes.len() as f64;
    let mut open: Vec<Open> = boxes.into_iter().map(|whole| (whole, any_reaches(&whole))).collect();
    let mut proven = Proven::default();
    while !open.is_empty() && proven.examined + open.len() <= most {
        proven.examined += open.len();
        let mut halves = Vec::new();
        let findings = open.par_iter().map(|(inputs, within)| proof.examine(inputs, within));
        for ((inputs, _), finding) in open.iter().zip(findings.collect::<Vec<_>>()) {
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

/// An input with two or more solutions that meet the paper's conditions.
#[derive(Debug, Clone, Copy)]
pub struct Ambiguous {
    /// Slides, then legs, metres.
    pub axes_m: [f64; AXES],
    /// The second greatest determinant of these solutions.
    pub lesser: f64,
}

/// The result of a search.
#[derive(Debug, Clone)]
pub struct Search {
    /// Random inputs with a solution that meets the paper's conditions.
    pub with_one: usize,
    /// Random inputs with two of them.
    pub with_two: usize,
    /// Random inputs with two whose determinants are positive.
    pub both_positive: usize,
    /// The best inputs with two, after climbing, greatest lesser determinant first.
    pub climbed: Vec<Ambiguous>,
}

impl Search {
    /// The best inputs as CSV: each axis in metres, and the lesser determinant.
    pub fn table(&self) -> String {
        let header = AXIS_NAMES.map(|axis| format!("{axis}_m")).join(",") + ",lesser_determinant";
        let row = |one: &Ambiguous| (one.axes_m.map(number), number(one.lesser));
        csv(&header, self.climbed.iter().map(row))
    }
}

/// Looks for inputs with two solutions that meet the paper's conditions among so many random inputs of a box; from the
/// best of them uphill to where both determinants are greatest. A search proves nothing.
///
/// ```
/// use masseter_model::geometry::{Mechanism, MechanismConfig};
/// use masseter_research::uniqueness::{InputBox, search};
///
/// let mechanism = Mechanism::new(&MechanismConfig::default())?;
/// let around_neutral = InputBox::uniform([-0.002, 0.002], [0.268, 0.272]);
/// let found = search(&mechanism, &around_neutral, 100, 1);
/// assert_eq!((found.with_one, found.with_two), (100, 0));
/// # Ok::<(), masseter_model::geometry::GeometryError>(())
/// ```
#[must_use]
pub fn search(mechanism: &Mechanism, region: &InputBox, inputs: usize, seed: u64) -> Search {
    let limits: [[f64; 2]; AXES] = region.axes.map(|axis| [axis.low, axis.high]);
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let (mut with_one, mut found) = (0_usize, Vec::new());
    for _ in 0..inputs {
        let axes_m = limits.map(|[low, high]| random.random_range(low..=high));
        let determinants = determinants(mechanism, axes_m);
        with_one += usize::from(!determinants.is_empty());
        found.extend(determinants.get(1).map(|&lesser| Ambiguous { axes_m, lesser }));
    }
    found.sort_by(|a, b| b.lesser.total_cmp(&a.lesser));
    let with_two = found.len();
    let both_positive = found.iter().filter(|one| one.lesser > 0.0).count();
    found.truncate(CLIMBS);
    let climbed = found.into_iter().map(|start| climb(mechanism, &limits, start, &mut random));
    let mut climbed: Vec<_> = climbed.collect();
    climbed.sort_by(|a, b| b.lesser.total_cmp(&a.lesser));
    Search { with_one, with_two, both_positive, climbed }
}

/// The determinants of an input's solutions that meet the paper's conditions, greatest first.
fn determinants(mechanism: &Mechanism, axes_m: [f64; AXES]) -> Vec<f64> {
    let Ok(solutions) = Solutions::new(mechanism, &Actuators::from_axes(axes_m)) else { return Vec::new() };
    let admitted = solutions.iter().filter(|one| (CONDITIONS[ORIENTED].admit)(&one.assembly));
    let mut determinants: Vec<_> = admitted.map(|one| one.determinant).collect();
    determinants.sort_by(|a, b| b.total_cmp(a));
    determinants
}

/// Random steps that raise the lesser determinant, within the limits.
fn climb(
    mechanism: &Mechanism,
    limits: &[[f64; 2]; AXES],
    start: Ambiguous,
    random: &mut Pcg64Mcg,
) -> Ambiguous {
    let (mut best, mut length) = (start, FIRST_STEP);
    for _ in 0..STEPS {
        let mut axes_m = best.axes_m;
        for (value, [low, high]) in axes_m.iter_mut().zip(limits) {
            *value += length * (high - low) * (random.random::<f64>() - 0.5);
            *value = value.clamp(*low, *high);
        }
        match determinants(mechanism, axes_m).get(1) {
            Some(&lesser) if lesser > best.lesser => best = Ambiguous { axes_m, lesser },
            _ => length *= SHORTER,
        }
    }
    best
}

/// Boxes that together contain every input within `around_m` (metres) of the motion's path, in each axis.
///
/// Between two cycles an actuator goes straight from target to target, as the drives interpolate. The path is the
/// desired one; the width must cover the tracking error.
///
/// # Errors
/// When inverse kinematics has no solution on the path.
pub fn boxes(plan: &RunPlan, around_m: f64) -> anyhow::Result<Vec<InputBox>> {
    let period_s = plan.scenario.period_s();
    let cycles = (plan.trajectory.duration_s() / period_s).ceil() as usize;
    let path = (0..=cycles)
        .map(|cycle| Ok(plan.mechanism.inverse(&plan.trajectory.pose(cycle as f64 * period_s))?.actuators))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let around = |stretch: &[Actuators]| {
        let boxes = stretch.iter().map(|input| InputBox::around(input, around_m));
        boxes.reduce(|a, b| a.hull(&b)).expect("a stretch has inputs")
    };
    Ok(stretches(&path, around_m).map(around).collect())
}

/// The path cut where a stretch of it would be wider than this. Each stretch begins with the end of the one before, so that
/// nothing between them is left out.
fn stretches(path: &[Actuators], longest_m: f64) -> impl Iterator<Item = &[Actuators]> {
    let mut rest = path;
    std::iter::from_fn(move || {
        let first = InputBox::around(rest.first()?, 0.0);
        let hulls = rest[1..].iter().scan(first, |hull, input| {
            *hull = hull.hull(&InputBox::around(input, 0.0));
            Some(*hull)
        });
        // A long step is a stretch of its own.
        let steps = hulls.take_while(|hull| hull.width_m() <= longest_m).count().max(1).min(rest.len() - 1);
        let stretch = &rest[..=steps];
        rest = if steps + 1 == rest.len() { &[] } else { &rest[steps..] };
        Some(stretch)
    })
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::MechanismConfig;
    use masseter_scenario::Scenario;

    use super::*;

    fn bounded(slide_m: [f64; 3], leg_m: [f64; 3], radius_m: f64, most: usize) -> Proven {
        let whole = InputBox::around(&Actuators { slide_m, leg_m }, radius_m);
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
            let axes = inputs.axes.into_iter().zip(slide_m.into_iter().chain(leg_m));
            axes.into_iter().all(|(axis, value_m)| axis.contains(value_m))
        };
        assert!(undecided.iter().any(holds));
    }

    fn contains(whole: &InputBox, part: &InputBox) -> bool {
        let axes = whole.axes.iter().zip(&part.axes);
        axes.into_iter().all(|(whole, part)| whole.low <= part.low && part.high <= whole.high)
    }

    /// Every straight piece of the path, with all that is around it, lies in one box.
    #[test]
    fn the_boxes_of_a_motion_hold_its_path_and_what_is_around_it() {
        let around_m = 1e-3;
        let plan = RunPlan::new(Scenario::default()).unwrap();
        let boxes = boxes(&plan, around_m).unwrap();
        let at = |cycle: u32| {
            let pose = plan.trajectory.pose(f64::from(cycle) * plan.scenario.period_s());
            InputBox::around(&plan.mechanism.inverse(&pose).unwrap().actuators, 0.999 * around_m)
        };
        for cycle in 0..10_000 {
            let piece = at(cycle).hull(&at(cycle + 1));
            assert!(boxes.iter().any(|whole| contains(whole, &piece)), "cycle {cycle}");
        }
        assert!(boxes.len() < 5_000, "{} boxes", boxes.len());
    }

    #[test]
    fn a_path_is_cut_where_it_gets_wide_and_a_long_step_is_a_stretch_of_its_own() {
        let at = |mm: f64| Actuators { slide_m: [mm * 1e-3; 3], leg_m: [0.27; 3] };
        let path = [0.0, 0.4, 0.8, 1.2, 5.0, 5.1].map(at);
        let ends: Vec<_> = stretches(&path, 1e-3)
            .map(|stretch| [0, stretch.len() - 1].map(|end| stretch[end].slide_m[0] * 1e3))
            .collect();
        assert_eq!(ends, [[0.0, 0.8], [0.8, 1.2], [1.2, 5.0], [5.0, 5.1]]);
        assert_eq!(stretches(&path[..1], 1e-3).count(), 1);
        assert_eq!(stretches(&[], 1e-3).count(), 0);
    }
}
