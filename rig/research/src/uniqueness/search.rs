//! Inputs with two solutions that meet the paper's conditions, found at random; from the best of
//! them uphill to where both determinants are greatest. A search proves nothing.

use masseter_controller::kinematics::uniqueness::InputBox;
use masseter_controller::kinematics::{Solution, Solutions};
use masseter_model::geometry::{AXES, AXIS_NAMES, Actuators, Mechanism};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::multiplicity::{CONDITIONS, ORIENTED};
use crate::table::{csv, number};

/// Inputs from which the search goes uphill.
const CLIMBS: usize = 40;
/// Steps of one climb.
const STEPS: u32 = 1500;
/// The first step's length as a share of the stroke; each failure shortens it.
const FIRST_STEP: f64 = 0.3;
/// What is left of a step's length after a failure.
const SHORTER: f64 = 0.995;

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

/// Looks for inputs with two solutions that meet the paper's conditions among so many random inputs of a box.
///
/// ```
/// use masseter_controller::kinematics::uniqueness::InputBox;
/// use masseter_model::geometry::{Mechanism, MechanismConfig};
/// use masseter_research::uniqueness::search;
///
/// let mechanism = Mechanism::new(&MechanismConfig::default())?;
/// let around_neutral = InputBox::uniform([-0.002, 0.002], [0.268, 0.272]);
/// let found = search(&mechanism, &around_neutral, 100, 1);
/// assert_eq!((found.with_one, found.with_two), (100, 0));
/// # Ok::<(), masseter_model::geometry::GeometryError>(())
/// ```
#[must_use]
pub fn search(mechanism: &Mechanism, region: &InputBox, inputs: usize, seed: u64) -> Search {
    let limits: [[f64; 2]; AXES] = region.axes().map(|axis| [axis.low(), axis.high()]);
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
    let mut climbed: Vec<_> =
        found.into_iter().map(|start| climb(mechanism, &limits, start, &mut random)).collect();
    climbed.sort_by(|a, b| b.lesser.total_cmp(&a.lesser));
    Search { with_one, with_two, both_positive, climbed }
}

/// The determinants of an input's solutions that meet the paper's conditions, greatest first.
fn determinants(mechanism: &Mechanism, axes_m: [f64; AXES]) -> Vec<f64> {
    let Ok(solutions) = Solutions::new(mechanism, &Actuators::from_axes(axes_m)) else { return Vec::new() };
    let meets_conditions = |solution: &&Solution| (CONDITIONS[ORIENTED].admit)(&solution.assembly);
    let mut determinants: Vec<f64> =
        solutions.iter().filter(meets_conditions).map(|one| one.determinant).collect();
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
