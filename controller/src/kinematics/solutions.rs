//! All assemblies of the mechanism for one input.
//!
//! [`LoopSolutions`] holds each solution of the loop equations once, before pose and certificate are computed: the
//! choice of the true solution needs no more. A full description of every solution, [`Solutions`], costs several times
//! as much.

use masseter_model::geometry::{Actuators, LEGS, Mechanism};

use super::certificate::Certificate;
use super::elimination::{Elimination, NEARLY_SINGULAR, SolutionFilter};
use super::legs::{LegAngle, coincide, each, separation_rad};
use super::loop_equations::{LoopEquations, LoopSolution};
use super::solution::{Assembly, Condition, ForwardError, Solution};

/// The most solutions of one input; they come in mirrored pairs.
pub const MOST_SOLUTIONS: usize = 16;

/// Estimates closer than this are one solution if one of them has a certificate, radians on every leg.
const MERGED_WITHIN_RAD: f64 = 1e-6;
/// The same if neither has a certificate: next to a singularity rounding alone moves an estimate this far.
const MERGED_UNCERTIFIED_WITHIN_RAD: f64 = 1e-4;
/// A second solution is looked for unless the certificate excludes one within this distance, radians.
pub(super) const CLOSE_RAD: f64 = 3e-4;
/// Distances of the search for the neighbour of a nearly singular solution, radians along the null direction.
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
pub(super) fn check_input(actuators: &Actuators) -> Result<(), ForwardError> {
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

    /// Adds the second solution of every close pair. Solutions meet in pairs, one on either side of the singularity,
    /// along the null direction of the Jacobian. Newton's iteration reaches the second from beyond it.
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

    /// Doubles a solution at a singularity without a second one: such a solution is at least double, and rounding has
    /// joined the two.
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

    /// Adds a solution unless it is known. Two different solutions that lie close together have determinants of
    /// opposite sign.
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

/// The conditions of the true solution that a platform meets.
pub(super) fn assembly(loops: &LoopEquations<'_>, closed: &LoopSolution) -> Assembly {
    let corners = loops.corners(&closed.leg_angles);
    let determinant = loops.determinant(&closed.residuals);
    Assembly::from_corners(loops.mechanism, &loops.hinges, &corners, determinant)
}

/// Distance of the nearest other solution: the largest difference of any leg's angle, radians.
pub(super) fn nearest_other_rad<'a>(
    leg_angles: &[LegAngle; LEGS],
    all: impl Iterator<Item = &'a [LegAngle; LEGS]>,
) -> Option<f64> {
    let others = all.filter(|other| *other != leg_angles);
    others.map(|other| separation_rad(leg_angles, other)).min_by(f64::total_cmp)
}

/// Every real solution of the equations (the paper, eq. 1) for one input, mirrored ones next to each other.
#[doc(alias("direct kinematics", "assembly modes"))]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solutions {
    solutions: [Option<Solution>; MOST_SOLUTIONS],
}

impl Solutions {
    /// Solves completely; the module `elimination` has the argument for completeness. No solution is a result, not an
    /// error: the mechanism cannot be assembled. Two solutions that rounding does not separate are both there, without
    /// a certificate.
    ///
    /// # Errors
    /// [`ForwardError::NotFinite`], [`ForwardError::NoLength`], and [`ForwardError::Undecided`] where
    /// solutions form a continuum but for rounding.
    pub fn new(mechanism: &Mechanism, actuators: &Actuators) -> Result<Self, ForwardError> {
        check_input(actuators)?;
        let loops = LoopEquations::new(mechanism, actuators);
        let found = LoopSolutions::find(&loops, SolutionFilter::All)?;
        Ok(Self { solutions: found.all.map(|one| one.map(|closed| Solution::new(&loops, &closed))) })
    }

    /// The number of solutions.
    pub fn count(&self) -> usize {
        self.iter().count()
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &Solution> {
        self.solutions.iter().flatten()
    }

    /// The solutions in which the mechanism can stand.
    pub fn true_ones(&self) -> impl Iterator<Item = &Solution> {
        self.iter().filter(|solution| solution.assembly.is_true())
    }

    /// Distance of the nearest other solution from one of these: the largest difference of any leg's angle, radians.
    /// None without another solution.
    pub fn separation_rad(&self, solution: &Solution) -> Option<f64> {
        let others = self.iter().map(|other| &other.leg_angles);
        nearest_other_rad(&solution.leg_angles, others)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::tests::{NearlySingular, mechanisms, nearly_singular, published_mechanism};
    use crate::kinematics::{Method, Options, solve};

    fn boxes() -> impl Strategy<Value = Actuators> {
        let strokes = (prop::array::uniform3(-0.03..0.03f64), prop::array::uniform3(0.24..0.3f64));
        strokes.prop_map(|(slide_m, leg_m)| Actuators { slide_m, leg_m })
    }

    #[test]
    fn the_neutral_input_has_sixteen_of_which_one_is_true() {
        let neutral = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };
        let solutions = Solutions::new(&published_mechanism(), &neutral).unwrap();
        assert_eq!(solutions.count(), MOST_SOLUTIONS);
        let is_above = |solution: &&Solution| solution.assembly.legs_above_base == [true; LEGS];
        assert_eq!(solutions.iter().filter(is_above).count(), 8);
        let mut true_ones = solutions.true_ones();
        let upright = true_ones.next().unwrap();
        assert!((upright.theta_rad[1].to_degrees() - 83.862_391_93).abs() < 1e-7);
        assert_eq!(true_ones.next(), None);
        // The platform turned over, at 71.29° on all legs.
        let next_rad = solutions.separation_rad(upright).unwrap();
        assert!((next_rad.to_degrees() - 12.571).abs() < 1e-2);
    }

    /// Two pairs of them, each 1.5·10⁻⁴ rad apart.
    #[test]
    fn close_solutions_are_not_lost() {
        let actuators = Actuators {
            slide_m: [-0.009_026_317_149_509_48, -0.004_133_527_909_131_813, 0.013_522_157_666_649_465],
            leg_m: [0.299_630_870_761_445_73, 0.296_020_369_546_034_3, 0.286_093_515_131_113_4],
        };
        let solutions = Solutions::new(&published_mechanism(), &actuators).unwrap();
        assert_eq!(solutions.count(), MOST_SOLUTIONS);
        let closest = solutions.iter().filter_map(|one| solutions.separation_rad(one)).fold(1.0, f64::min);
        assert!((closest - 1.5e-4).abs() < 1e-5, "{closest}");
        assert!(solutions.iter().all(|solution| solution.certificate.is_some()));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// The original leg angles of an input are among its solutions, up to the singularity. If rounding does not
        /// separate two solutions, there are two without a certificate.
        #[test]
        fn the_angles_an_input_came_from_are_found_near_singularities(singular in nearly_singular()) {
            let NearlySingular { mechanism, joints, determinant } = singular;
            let solutions = Solutions::new(&mechanism, &joints.actuators).unwrap();
            let known = joints.theta_rad.map(LegAngle::from_rad);
            let within = |limit_rad| {
                let is_near = move |one: &&Solution| separation_rad(&one.leg_angles, &known) < limit_rad;
                solutions.iter().filter(is_near)
            };
            let blurred_rad = 1e-12 / determinant.abs();
            if within(blurred_rad.clamp(1e-9, 1e-6)).any(|solution| solution.certificate.is_some()) {
                return Ok(());
            }
            let close = within(CLOSE_RAD).count();
            let singular = within(CLOSE_RAD).filter(|solution| solution.certificate.is_none()).count();
            prop_assert!(close >= 2 && singular >= 1, "{singular} of {close} at determinant {determinant:e}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        /// The results of random starts are among the solutions, and each solution is valid.
        #[test]
        fn no_start_leads_to_a_solution_that_is_not_there(
            mechanism in mechanisms(), actuators in boxes(),
            guesses in prop::array::uniform32(prop::array::uniform3(-3.2..3.2f64)),
        ) {
            let solutions = Solutions::new(&mechanism, &actuators).unwrap();
            for guess in guesses {
                if let Ok(found) = solve(Method::Newton, &mechanism, &actuators, &guess, &Options::default()) {
                    let is_same = |one: &Solution| coincide(&one.leg_angles, &found.leg_angles, 1e-6);
                    prop_assert!(solutions.iter().any(is_same));
                }
            }
            for solution in solutions.iter() {
                prop_assert!(solution.residual_m < 1e-13);
            }
        }

        /// The four pairs of leg angles on a dense grid have as many sign changes as solutions.
        #[test]
        fn a_dense_grid_counts_no_more_and_no_fewer(mechanism in mechanisms(), actuators in boxes()) {
            const GRID: u32 = 20_000;
            let loops = LoopEquations::new(&mechanism, &actuators);
            let elimination = Elimination::new(&loops);
            let range = elimination.range();
            prop_assume!(range.low < range.high);
            let signs = |index: u32| {
                elimination
                    .leg_angles(range.at(f64::from(index) / f64::from(GRID)))
                    .map(|[_, second, third]| loops.sides[1].value(second, third) > 0.0)
            };
            let mut changes = 0;
            for index in 0..GRID {
                let (before, after) = (signs(index), signs(index + 1));
                changes += before.iter().zip(after).filter(|(before, after)| *before != after).count();
            }
            prop_assert_eq!(Solutions::new(&mechanism, &actuators).unwrap().count(), 2 * changes);
        }
    }
}
