//! Every solution of the loop equations for one input, each once, before pose and certificate are computed.
//!
//! The choice of the true solution needs no more. A full description of every solution costs several times as much:
//! see [`Solutions`](super::Solutions).

use masseter_model::geometry::{Actuators, LEGS};

use super::elimination::{Elimination, NEARLY_SINGULAR, SolutionFilter};
use super::leg_angle::{LegAngle, coincide, separation_rad};
use super::legs::each;
use super::loop_equations::{LoopEquations, LoopSolution};
use super::{Assembly, Certificate, Condition, ForwardError};

/// The most solutions of one input; they come in mirrored pairs.
pub const MOST_SOLUTIONS: usize = 16;

/// Estimates closer than this are one solution if one of them has a certificate, radians on every leg.
const MERGED_WITHIN_RAD: f64 = 1e-6;
/// The same if neither has: rounding alone moves an estimate this far next to a singularity.
const MERGED_UNCERTIFIED_WITHIN_RAD: f64 = 1e-4;
/// A second solution is looked for unless the certificate excludes one within this distance, radians.
pub(super) const CLOSE_RAD: f64 = 3e-4;
/// How far from a nearly singular solution its neighbour is looked for, radians along the null direction.
const NEIGHBOUR_DISTANCES_RAD: [f64; 12] =
    [1e-7, 3e-7, 1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2];
/// Iterations to the neighbour; where two solutions meet, each iteration only halves the error.
const NEIGHBOUR_ITERATIONS: u32 = 40;
/// A leg shorter than this has no direction, metres.
const SHORTEST_LEG_M: f64 = 1e-9;

/// Solutions of the loop equations, none twice, mirrored ones next to each other.
#[derive(Debug, Clone, Copy)]
pub(super) struct LoopSolutions {
    pub all: [Option<LoopSolution>; MOST_SOLUTIONS],
    pub count: usize,
    overflowed: bool,
}

/// Inputs on which the equations are defined.
pub(super) fn check(actuators: &Actuators) -> Result<(), ForwardError> {
    if !actuators.is_finite() {
        return Err(ForwardError::NotFinite);
    }
    match (0..LEGS).find(|&leg| actuators.leg_m[leg] < SHORTEST_LEG_M) {
        Some(leg) => Err(ForwardError::NoLength { leg, leg_m: actuators.leg_m[leg] }),
        None => Ok(()),
    }
}

impl LoopSolutions {
    /// All that pass the filter, or [`ForwardError::Undecided`].
    pub(super) fn find(loops: &LoopEquations<'_>, filter: SolutionFilter) -> Result<Self, ForwardError> {
        let mut solutions = Self { all: [None; MOST_SOLUTIONS], count: 0, overflowed: false };
        let isolated = Elimination::new(loops).solve(filter, |closed| solutions.add_pair(loops, &closed));
        solutions.add_neighbours(loops);
        solutions.double_singular_ones(loops);
        if isolated.is_err() || solutions.overflowed {
            return Err(ForwardError::Undecided { solutions: solutions.count });
        }
        Ok(solutions)
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &LoopSolution> {
        self.all.iter().flatten()
    }

    /// The solutions in which the mechanism can stand.
    pub(super) fn true_ones(&self, loops: &LoopEquations<'_>) -> impl Iterator<Item = &LoopSolution> {
        let is_above = |closed: &&LoopSolution| closed.leg_angles.iter().all(|leg_angle| leg_angle.sin > 0.0);
        self.iter().filter(is_above).filter(|closed| assembly(loops, closed).is_true())
    }

    /// A solution that rounding does not separate from another, if the mechanism can stand in one of the two.
    pub(super) fn singular_one(&self, loops: &LoopEquations<'_>) -> Option<&LoopSolution> {
        let is_singular = |closed: &&LoopSolution| {
            loops.determinant(&closed.residuals).abs() <= NEARLY_SINGULAR && !is_certified(loops, closed)
        };
        let may_be_true = |closed: &&LoopSolution| {
            assembly(loops, closed)
                .violated()
                .is_none_or(|violated| violated == Condition::PositiveDeterminant)
        };
        self.iter().filter(is_singular).find(may_be_true)
    }

    /// Adds the second solution of every close pair. Solutions meet in pairs, one on either side of the singularity, along
    /// the null direction of the Jacobian. Newton's iteration reaches the second from beyond it.
    fn add_neighbours(&mut self, loops: &LoopEquations<'_>) {
        let mut index = 0;
        while let Some(closed) = self.all.get(index).copied().flatten() {
            index += 1;
            if closed.leg_angles[0].sin < 0.0 || is_alone(loops, &closed) {
                continue;
            }
            let direction = closed.residuals.null_direction();
            for distance_rad in NEIGHBOUR_DISTANCES_RAD.into_iter().flat_map(|distance| [distance, -distance])
            {
                let start = each(|leg| closed.leg_angles[leg].stepped(distance_rad * direction[leg]));
                if let Some(neighbour) = loops.close(&start, NEIGHBOUR_ITERATIONS) {
                    self.add_pair(loops, &neighbour);
                }
            }
        }
    }

    /// Adds the second of two solutions that rounding has made one: a solution at a singularity is at least double.
    fn double_singular_ones(&mut self, loops: &LoopEquations<'_>) {
        for index in 0..self.count {
            let Some(closed) = self.all[index] else { continue };
            let is_double = loops.determinant(&closed.residuals).abs() <= NEARLY_SINGULAR
                && !is_certified(loops, &closed)
                && !(0..self.count).any(|other| {
                    other != index
                        && self.all[other]
                            .is_some_and(|other| coincide(&other.leg_angles, &closed.leg_angles, CLOSE_RAD))
                });
            if is_double {
                self.push(&closed);
            }
        }
    }

    fn add_pair(&mut self, loops: &LoopEquations<'_>, closed: &LoopSolution) {
        self.add(loops, closed);
        self.add(loops, &closed.mirrored());
    }

    /// Adds a solution unless it is known. Two different solutions that lie close together have determinants of opposite
    /// sign.
    fn add(&mut self, loops: &LoopEquations<'_>, closed: &LoopSolution) {
        let is_positive = |closed: &LoopSolution| closed.residuals.determinant() > 0.0;
        let is_same = |known: &LoopSolution| {
            coincide(&known.leg_angles, &closed.leg_angles, MERGED_UNCERTIFIED_WITHIN_RAD)
                && is_positive(known) == is_positive(closed)
                && (coincide(&known.leg_angles, &closed.leg_angles, MERGED_WITHIN_RAD)
                    || !(is_certified(loops, known) || is_certified(loops, closed)))
        };
        if !self.iter().any(is_same) {
            self.push(closed);
        }
    }

    fn push(&mut self, closed: &LoopSolution) {
        match self.all.get_mut(self.count) {
            Some(place) => {
                *place = Some(*closed);
                self.count += 1;
            }
            None => self.overflowed = true,
        }
    }
}

/// Whether no other solution is closer than [`CLOSE_RAD`].
fn is_alone(loops: &LoopEquations<'_>, closed: &LoopSolution) -> bool {
    let is_alone = |proof: Certificate| proof.unique_within_rad > CLOSE_RAD;
    loops.determinant(&closed.residuals).abs() > NEARLY_SINGULAR
        || Certificate::new(loops, &closed.residuals).is_some_and(is_alone)
}

fn is_certified(loops: &LoopEquations<'_>, closed: &LoopSolution) -> bool {
    Certificate::new(loops, &closed.residuals).is_some()
}

/// Which conditions of the true solution a platform meets.
pub(super) fn assembly(loops: &LoopEquations<'_>, closed: &LoopSolution) -> Assembly {
    let corners = loops.corners(&closed.leg_angles);
    let determinant = loops.determinant(&closed.residuals);
    Assembly::from_corners(loops.mechanism, &loops.hinges, &corners, determinant)
}

/// How far the nearest of the others is, by the largest difference of any leg's angle, radians.
pub(super) fn nearest_other_rad<'a>(
    leg_angles: &[LegAngle; LEGS],
    all: impl Iterator<Item = &'a [LegAngle; LEGS]>,
) -> Option<f64> {
    let others = all.filter(|other| *other != leg_angles);
    others.map(|other| separation_rad(leg_angles, other)).min_by(f64::total_cmp)
}
