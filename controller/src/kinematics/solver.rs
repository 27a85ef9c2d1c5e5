//! Two iterations for the equations: the paper's (Fig. 2) and plain Newton–Raphson.
//!
//! Both go in the Newton direction. The paper's iteration reduces the increment until the error decreases. This rule
//! stops oscillation and divergence, but may stall in a local minimum. Either iteration finds *a* solution near its
//! guess; [`Assembly`](super::Assembly) judges the solution.
//!
//! The text leaves two things open, and both are options. *The residual*: eq. 1 prints distances, and
//! [`Residual::Distance`] is that reading. *The increment* Δθ: the text says that Δθ is reduced, the Korean summary that
//! the time step is adjusted, and neither says how large it is at first. [`StepRule`] has the readings.
//! With any choice the claims "no oscillation, no divergence" (Figs. 3 and 4) hold in the residual chosen,
//! because its error cannot increase. Whether the iteration then reaches a solution is another matter.

use masseter_model::geometry::{Actuators, LEGS, Mechanism};
use nalgebra::{Matrix3, Vector3};

use super::equations::{Equations, Evaluation};
use super::loop_equations::{LoopEquations, LoopSolution};
use super::solution::{ForwardError, Solution};

/// Upper limit of the iterations in the options.
pub const MAX_ITERATIONS: u32 = 1000;
/// Upper limit of the reductions of one increment in the options.
pub const MAX_HALVINGS: u32 = 40;

/// ε: largest error (eq. 2) of the distances at a solution, cm², for every residual of the iteration. The tolerance,
/// 10⁻¹⁴ m for each side, is a few hundred roundings above the limit of double precision at these sizes.
const EPSILON_CM2: f64 = 1e-24;

/// How to iterate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// The residual of the iteration.
    pub residual: Residual,
    /// The step rule of the paper's algorithm; Newton–Raphson reduces no increment.
    pub step: StepRule,
    /// Iterations allowed; at most [`MAX_ITERATIONS`].
    pub max_iterations: u32,
    /// Reductions of one increment allowed; at most [`MAX_HALVINGS`].
    pub max_halvings: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            residual: Residual::default(),
            step: StepRule::default(),
            max_iterations: 20,
            max_halvings: 12,
        }
    }
}

/// The iteration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// The paper's algorithm: Newton's direction, the increment reduced until the error decreases.
    #[default]
    Published,
    /// Newton–Raphson with the full increment.
    Newton,
}

/// The form of the equations that gives the increment and must decrease.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Residual {
    /// |AᵢAⱼ| − Lᵢⱼ, metres: eq. 1 as printed.
    #[default]
    Distance,
    /// |AᵢAⱼ|² − Lᵢⱼ², m²: the same zeros, smooth where two corners meet.
    SquaredDistance,
}

/// The first increment of every iteration of Fig. 2, which is halved until the error is smaller than before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StepRule {
    /// Newton's increment.
    #[default]
    FullStep,
    /// Newton's increment, shortened so that no leg's angle changes by more than 0.2 rad.
    BoundedStep,
    /// A time step of 0.1 along the continuous method θ̇ = −J⁻¹ f. Each step leaves nine tenths of the residual or more.
    TimeStep,
}

/// The largest change of an angle, rad, and the time step.
const BOUND_RAD: f64 = 0.2;
const TIME_STEP: f64 = 0.1;

impl StepRule {
    /// The first share of Newton's increment.
    fn first_share(self, newton_rad: &Vector3<f64>) -> f64 {
        match self {
            Self::FullStep => 1.0,
            Self::BoundedStep => (BOUND_RAD / newton_rad.amax()).min(1.0),
            Self::TimeStep => TIME_STEP,
        }
    }
}

/// Solves from a guess of the leg angles (radians) by the given method.
///
/// ```
/// use masseter_controller::kinematics::{Method, Options, solve};
/// use masseter_model::geometry::{Actuators, Mechanism, MechanismConfig};
///
/// let mechanism = Mechanism::new(&MechanismConfig::default())?;
/// let neutral = Actuators { slide_m: [0.0; 3], leg_m: [0.27; 3] };
/// let solution = solve(Method::Published, &mechanism, &neutral, &[1.46; 3], &Options::default())?;
/// assert!((solution.theta_rad[0].to_degrees() - 83.862).abs() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Any but [`ForwardError::WrongAssembly`]: whether the solution is the true one is for the caller.
pub fn solve(
    method: Method,
    mechanism: &Mechanism,
    actuators: &Actuators,
    guess_rad: &[f64; LEGS],
    options: &Options,
) -> Result<Solution, ForwardError> {
    solve_traced(method, mechanism, actuators, guess_rad, options, |_| {})
}

/// [`solve`] with a callback for the guess and for every iteration, also of a failure.
///
/// # Errors
/// Those of [`solve`].
pub fn solve_traced(
    method: Method,
    mechanism: &Mechanism,
    actuators: &Actuators,
    guess_rad: &[f64; LEGS],
    options: &Options,
    mut observe: impl FnMut(&Iteration),
) -> Result<Solution, ForwardError> {
    if !actuators.is_finite() || !guess_rad.iter().all(|x| x.is_finite()) {
        return Err(ForwardError::NotFinite);
    }
    let search = Search { equations: Equations::new(mechanism, actuators), method, options };
    let evaluation = search.equations.evaluate(Vector3::from(*guess_rad));
    let mut at = Iteration { number: 0, evaluation, halvings: 0 };
    observe(&at);
    while !at.is_solved() {
        let (iterations, residual_m) = (at.number, at.evaluation.residual_norm_m());
        if iterations == options.max_iterations.min(MAX_ITERATIONS) {
            return Err(ForwardError::NoConvergence { residual_m, iterations });
        }
        let increment = search.newton_increment(&at.evaluation)?;
        let stalled = ForwardError::Stalled { residual_m, iterations: iterations + 1 };
        at = search.advanced(&at, increment).ok_or(stalled)?;
        observe(&at);
    }
    let loops = LoopEquations::new(mechanism, actuators);
    let leg_angles = std::array::from_fn(|leg| super::legs::LegAngle::from_rad(at.evaluation.theta_rad[leg]));
    let closed = LoopSolution { leg_angles, residuals: loops.evaluate(&leg_angles), iterations: at.number };
    Ok(Solution { residual_m: at.evaluation.residual_norm_m(), ..Solution::new(&loops, &closed) })
}

/// Below this the Newton direction is noise; unitless, see [`Equations::determinant`].
const SMALLEST_DETERMINANT: f64 = 1e-10;

/// The constants of the iterations.
struct Search<'a> {
    equations: Equations<'a>,
    method: Method,
    options: &'a Options,
}

/// The record of one iteration; the guess is number 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// From 0.
    pub number: u32,
    /// The resulting leg angles, not wrapped, and the equations there.
    pub evaluation: Evaluation,
    /// Number of reductions of the increment.
    pub halvings: u32,
}

impl Iteration {
    /// Not where the error is no number.
    fn is_solved(&self) -> bool {
        self.evaluation.error_cm2() <= EPSILON_CM2
    }
}

impl Search<'_> {
    /// The residual, in the given form. The sum of its squares must decrease.
    fn residual(&self, at: &Evaluation) -> Vector3<f64> {
        match self.options.residual {
            Residual::Distance => at.residual_m,
            Residual::SquaredDistance => self.equations.squared_residual_m2(at),
        }
    }

    fn error(&self, at: &Evaluation) -> f64 {
        self.residual(at).norm_squared()
    }

    /// −J⁻¹ f, radians.
    fn newton_increment(&self, at: &Evaluation) -> Result<Vector3<f64>, ForwardError> {
        let determinant = self.equations.determinant(at);
        let singular = ForwardError::Singular { determinant, residual_m: at.residual_norm_m() };
        if determinant.is_nan() || determinant.abs() < SMALLEST_DETERMINANT {
            return Err(singular);
        }
        let of_distances = self.equations.jacobian(at);
        let jacobian = match self.options.residual {
            Residual::Distance => of_distances,
            Residual::SquaredDistance => {
                Matrix3::from_diagonal(&(self.equations.distances_m(at) * 2.0)) * of_distances
            }
        };
        let inverse = jacobian.try_inverse().ok_or(singular)?;
        Ok(-(inverse * self.residual(at)))
    }

    /// The inner loop of Fig. 2; none when no allowed reduction decreases the error.
    fn advanced(&self, from: &Iteration, newton: Vector3<f64>) -> Option<Iteration> {
        let evaluate = |share: f64, halvings| {
            let evaluation = self.equations.evaluate(from.evaluation.theta_rad + newton * share);
            Iteration { number: from.number + 1, evaluation, halvings }
        };
        if self.method == Method::Newton {
            return Some(evaluate(1.0, 0));
        }
        let before = self.error(&from.evaluation);
        let mut share = self.options.step.first_share(&newton);
        for halvings in 0..=self.options.max_halvings.min(MAX_HALVINGS) {
            let iteration = evaluate(share, halvings);
            if self.error(&iteration.evaluation) < before {
                return Some(iteration);
            }
            share /= 2.0;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::tests::{angle_between, mechanisms, poses, published_mechanism};

    fn default() -> Options {
        Options::default()
    }

    fn neutral() -> Actuators {
        Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] }
    }

    fn step_rules() -> impl Strategy<Value = StepRule> {
        prop_oneof![Just(StepRule::FullStep), Just(StepRule::BoundedStep), Just(StepRule::TimeStep)]
    }

    #[test]
    fn neutral_pose_of_the_paper() {
        for method in [Method::Published, Method::Newton] {
            let solution =
                solve(method, &published_mechanism(), &neutral(), &[1.5; LEGS], &default()).unwrap();
            assert!(solution.assembly.is_true());
            assert!((solution.pose.translation.z - 0.268_452_355).abs() < 1e-9);
            assert!(solution.iterations <= 6);
        }
    }

    #[test]
    fn no_number_is_refused() {
        let mut actuators = neutral();
        actuators.leg_m[2] = f64::NAN;
        let mechanism = published_mechanism();
        assert_eq!(
            solve(Method::Published, &mechanism, &actuators, &[1.4; LEGS], &default()),
            Err(ForwardError::NotFinite)
        );
        let guess = [1.4, f64::INFINITY, 1.4];
        assert_eq!(
            solve(Method::Newton, &mechanism, &neutral(), &guess, &default()),
            Err(ForwardError::NotFinite)
        );
    }

    /// Leg 1 is shorter than its hinge's distance from the reach of leg 2, so nothing closes.
    #[test]
    fn what_cannot_be_assembled_is_a_typed_error() {
        let actuators = Actuators { slide_m: [0.0; LEGS], leg_m: [0.01, 0.30, 0.30] };
        for method in [Method::Published, Method::Newton] {
            let error = solve(
                method,
                &published_mechanism(),
                &actuators,
                &[1.4; LEGS],
                &Options { max_iterations: MAX_ITERATIONS, ..default() },
            )
            .unwrap_err();
            assert!(["stalled", "no_convergence", "singular"].contains(&error.reason()), "{error}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]

        #[test]
        fn a_near_guess_leads_back_to_the_pose_by_either_method(
            mechanism in mechanisms(),
            pose in poses(20.0),
            off in [-0.02..0.02f64, -0.02..0.02f64, -0.02..0.02f64],
        ) {
            let joints = mechanism.inverse(&pose).unwrap();
            let guess = std::array::from_fn(|leg| joints.theta_rad[leg] + off[leg]);
            // A near guess does not separate two solutions that are closer together than its error.
            let here = Equations::new(&mechanism, &joints.actuators);
            prop_assume!(here.determinant(&here.evaluate(joints.theta_rad.into())).abs() > 0.2);
            let by = |method| solve(method, &mechanism, &joints.actuators, &guess, &default()).unwrap();
            let (published, newton) = (by(Method::Published), by(Method::Newton));
            for solution in [published, newton] {
                prop_assert!((solution.pose.translation.vector - pose.translation.vector).norm() < 1e-10);
                prop_assert!(angle_between(&solution.pose, &pose) < 1e-10);
                prop_assert!(solution.residual_m <= 1e-13);
            }
        }

        /// The test covers every reading of the text with the error of eq. 2.
        #[test]
        fn the_papers_error_never_increases(
            actuators in [-0.03..0.03f64, -0.03..0.03f64, -0.03..0.03f64, 0.24..0.3f64, 0.24..0.3f64, 0.24..0.3f64],
            guess in [-3.0..3.0f64, -3.0..3.0f64, -3.0..3.0f64],
            step in step_rules(),
        ) {
            let options = Options { step, max_iterations: MAX_ITERATIONS, ..default() };
            let mut last_cm2 = f64::INFINITY;
            let mut increased = false;
            let actuators = Actuators::from_axes(actuators);
            let _ = solve_traced(Method::Published, &published_mechanism(), &actuators, &guess, &options, |iteration| {
                // Conversion to cm² may round two neighbouring errors to one.
                let error_cm2 = iteration.evaluation.error_cm2();
                increased |= error_cm2 > last_cm2;
                last_cm2 = error_cm2;
            });
            prop_assert!(!increased);
        }

        #[test]
        fn either_residual_and_every_step_rule_come_to_the_pose_from_near(
            pose in poses(20.0),
            off in [-0.02..0.02f64, -0.02..0.02f64, -0.02..0.02f64],
            step in step_rules(),
        ) {
            let mechanism = published_mechanism();
            let joints = mechanism.inverse(&pose).unwrap();
            let here = Equations::new(&mechanism, &joints.actuators);
            prop_assume!(here.determinant(&here.evaluate(joints.theta_rad.into())).abs() > 0.2);
            let guess = std::array::from_fn(|leg| joints.theta_rad[leg] + off[leg]);
            for residual in [Residual::Distance, Residual::SquaredDistance] {
                let options = Options { residual, step, max_iterations: MAX_ITERATIONS, ..default() };
                let solution = solve(Method::Published, &mechanism, &joints.actuators, &guess, &options).unwrap();
                prop_assert!((solution.pose.translation.vector - pose.translation.vector).norm() < 1e-10);
            }
        }

        #[test]
        fn the_trace_tells_every_step_from_the_guess_to_the_solution(
            pose in poses(20.0),
            off in [-0.2..0.2f64, -0.2..0.2f64, -0.2..0.2f64],
        ) {
            let mechanism = published_mechanism();
            let joints = mechanism.inverse(&pose).unwrap();
            let guess = std::array::from_fn(|leg| joints.theta_rad[leg] + off[leg]);
            let mut trace = Vec::new();
            let solved =
                solve_traced(Method::Published, &mechanism, &joints.actuators, &guess, &default(), |iteration| {
                    trace.push(*iteration);
                });
            prop_assert!(trace[0].evaluation.theta_rad.iter().zip(&guess).all(|(told, given)| (told - given).abs() < f64::EPSILON));
            for (number, pair) in trace.windows(2).enumerate() {
                prop_assert_eq!(pair[1].number as usize, number + 1);
                prop_assert!(pair[1].evaluation.error_cm2() < pair[0].evaluation.error_cm2());
            }
            if let Ok(solution) = solved {
                prop_assert_eq!(solution.iterations as usize, trace.len() - 1);
                prop_assert!(trace[trace.len() - 1].evaluation.error_cm2() <= EPSILON_CM2);
            }
        }

        #[test]
        fn a_bounded_step_turns_no_leg_by_more_than_its_bound(
            actuators in [-0.03..0.03f64, -0.03..0.03f64, -0.03..0.03f64, 0.24..0.3f64, 0.24..0.3f64, 0.24..0.3f64],
            guess in [0.0..3.1f64, 0.0..3.1f64, 0.0..3.1f64],
        ) {
            let options = Options { step: StepRule::BoundedStep, max_iterations: MAX_ITERATIONS, ..default() };
            let (mut last_rad, mut largest_rad) = (Vector3::from(guess), 0.0f64);
            let actuators = Actuators::from_axes(actuators);
            let _ = solve_traced(Method::Published, &published_mechanism(), &actuators, &guess, &options, |iteration| {
                largest_rad = largest_rad.max((iteration.evaluation.theta_rad - last_rad).amax());
                last_rad = iteration.evaluation.theta_rad;
            });
            prop_assert!(largest_rad <= BOUND_RAD * (1.0 + 1e-12), "{}", largest_rad);
        }

        #[test]
        fn any_numbers_end_in_a_result(
            actuators in prop::array::uniform6(prop::num::f64::ANY),
            guess in prop::array::uniform3(prop::num::f64::ANY),
        ) {
            let actuators = Actuators::from_axes(actuators);
            for method in [Method::Published, Method::Newton] {
                if let Ok(solution) = solve(method, &published_mechanism(), &actuators, &guess, &default()) {
                    prop_assert!(solution.residual_m <= 1e-14);
                }
            }
        }
    }
}
