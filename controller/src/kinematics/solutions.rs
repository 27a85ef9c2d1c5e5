//! All ways in which the mechanism can be assembled for one input.

use masseter_model::geometry::{Actuators, Mechanism};

use super::elimination::SolutionFilter;
use super::loop_equations::{LoopEquations, LoopSolution};
use super::loop_solutions::{LoopSolutions, MOST_SOLUTIONS, check, nearest_other_rad};
use super::{ForwardError, Solution};

/// Every real solution of the equations (the paper, eq. 1) for one input, mirrored ones next to each other.
#[doc(alias("direct kinematics", "assembly modes"))]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solutions {
    solutions: [Option<Solution>; MOST_SOLUTIONS],
    count: usize,
}

impl Solutions {
    /// Solves completely; the module `elimination` has the reason why nothing is missed. No solution is a result, not
    /// an error: the mechanism cannot be assembled. Two solutions that rounding does not separate are both there,
    /// without a certificate.
    ///
    /// # Errors
    /// [`ForwardError::NotFinite`], [`ForwardError::NoLength`], and [`ForwardError::Undecided`] where
    /// solutions form a continuum but for rounding.
    pub fn new(mechanism: &Mechanism, actuators: &Actuators) -> Result<Self, ForwardError> {
        check(actuators)?;
        let loops = LoopEquations::new(mechanism, actuators);
        let found = LoopSolutions::find(&loops, SolutionFilter::All)?;
        let solution = |closed: LoopSolution| Solution::new(&loops, &closed);
        Ok(Self { solutions: found.all.map(|one| one.map(solution)), count: found.count })
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &Solution> {
        self.solutions.iter().flatten()
    }

    /// The solutions in which the mechanism can stand.
    pub fn true_ones(&self) -> impl Iterator<Item = &Solution> {
        self.iter().filter(|solution| solution.assembly.is_true())
    }

    /// How far the nearest other solution is from one of these: the largest difference of any leg's
    /// angle, radians. None where there is no other.
    pub fn separation_rad(&self, solution: &Solution) -> Option<f64> {
        let others = self.iter().map(|other| &other.leg_angles);
        nearest_other_rad(&solution.leg_angles, others)
    }
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::LEGS;
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::elimination::Elimination;
    use crate::kinematics::leg_angle::{LegAngle, coincide, separation_rad};
    use crate::kinematics::loop_solutions::CLOSE_RAD;
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

        /// The leg angles that an input was made from are among its solutions, up to the singularity. Where rounding
        /// leaves open which of two solutions is which, there are two without a certificate.
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

        /// What random starts lead to is among the solutions, and each of these is one.
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

        /// The four pairs of leg angles, watched on a dense grid: as many changes of sign as solutions.
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
