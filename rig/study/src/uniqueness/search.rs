//! Inputs with two solutions that meet the paper's conditions, found at random; from the best of
//! them uphill to where both determinants are as great as they get. It proves nothing.

use masseter_controller::kinematics::{Solution, Solutions};
use masseter_shared::geometry::{AXES, AXIS_NAMES, Actuators, LEGS, Mechanism};
use masseter_terminal::result_line;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::SearchArgs;

/// Inputs from which the search goes uphill.
const CLIMBS: usize = 40;
/// Steps of one climb.
const STEPS: u32 = 1500;
/// The first step's length as a share of the stroke; each failure shortens it.
const FIRST_STEP: f64 = 0.3;
/// What is left of a step's length after a failure.
const SHORTER: f64 = 0.995;

/// An input with two or more standing solutions.
#[derive(Debug, Clone, Copy)]
struct Found {
    axes_m: [f64; AXES],
    /// The second greatest determinant of its standing solutions.
    lesser: f64,
}

/// Whether no input with two true solutions was found, and those found as CSV.
pub(super) fn search(args: &SearchArgs, mechanism: &Mechanism) -> anyhow::Result<(bool, Vec<String>)> {
    let limits: [[f64; 2]; AXES] = args.region.inputs(mechanism).axes().map(|axis| [axis.low(), axis.high()]);
    let mut random = Pcg64Mcg::seed_from_u64(args.seed);
    let (mut standing, mut found) = (0_usize, Vec::new());
    for _ in 0..args.inputs {
        let axes_m = limits.map(|[low, high]| random.random_range(low..=high));
        let determinants = determinants(mechanism, axes_m);
        standing += usize::from(!determinants.is_empty());
        found.extend(determinants.get(1).map(|&lesser| Found { axes_m, lesser }));
    }
    found.sort_by(|a, b| b.lesser.total_cmp(&a.lesser));
    let both_positive = found.iter().filter(|one| one.lesser > 0.0).count();
    result_line!("random inputs                                     {}", args.inputs)?;
    result_line!("with a solution that meets the paper's conditions {standing}")?;
    result_line!("with two of them                                  {}", found.len())?;
    result_line!("with two whose determinants are positive          {both_positive}")?;
    found.truncate(CLIMBS);
    let mut climbed: Vec<Found> =
        found.into_iter().map(|start| climb(mechanism, &limits, start, &mut random)).collect();
    climbed.sort_by(|a, b| b.lesser.total_cmp(&a.lesser));
    if let Some(best) = climbed.first() {
        result_line!(
            "greatest lesser determinant, after climbing       {:.4} at {:?}",
            best.lesser,
            best.axes_m
        )?;
    }
    let header = AXIS_NAMES.map(|axis| format!("{axis}_m")).join(",") + ",lesser_determinant";
    let row = |one: &Found| one.axes_m.map(|value| value.to_string()).join(",") + &format!(",{}", one.lesser);
    let ambiguous = climbed.iter().any(|one| one.lesser > 0.0);
    Ok((!ambiguous, std::iter::once(header).chain(climbed.iter().map(row)).collect()))
}

/// The determinants of an input's standing solutions, greatest first.
fn determinants(mechanism: &Mechanism, axes_m: [f64; AXES]) -> Vec<f64> {
    let Ok(solutions) = Solutions::new(mechanism, &Actuators::from_axes(axes_m)) else { return Vec::new() };
    let stands = |solution: &&Solution| {
        let assembly = &solution.assembly;
        assembly.legs_above_base == [true; LEGS]
            && assembly.hinges_below_platform == [true; LEGS]
            && assembly.corners_in_order
    };
    let mut determinants: Vec<f64> = solutions.iter().filter(stands).map(|one| one.determinant).collect();
    determinants.sort_by(|a, b| b.total_cmp(a));
    determinants
}

/// Random steps that raise the lesser determinant, within the limits.
fn climb(mechanism: &Mechanism, limits: &[[f64; 2]; AXES], start: Found, random: &mut Pcg64Mcg) -> Found {
    let (mut best, mut length) = (start, FIRST_STEP);
    for _ in 0..STEPS {
        let mut axes_m = best.axes_m;
        for (value, [low, high]) in axes_m.iter_mut().zip(limits) {
            *value += length * (high - low) * (random.random::<f64>() - 0.5);
            *value = value.clamp(*low, *high);
        }
        match determinants(mechanism, axes_m).get(1) {
            Some(&lesser) if lesser > best.lesser => best = Found { axes_m, lesser },
            _ => length *= SHORTER,
        }
    }
    best
}
