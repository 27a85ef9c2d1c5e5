//! Two iterations for the equations: the paper's (Fig. 2) and plain Newton–Raphson.
//!
//! Both go in the Newton direction. The paper's reduces the increment until the error decreases; that
//! stops oscillation and divergence but may stall in a local minimum. Either finds *a* solution near
//! its guess; [`Assembly`](super::Assembly) judges which one.
//!
//! The text leaves two things open, and both are options. *The residual*: eq. 1 prints distances, and
//! [`Residual::Distance`] is that reading. *The step rule*: "the increment is reduced" names no
//! factor and no amount of decrease. [`StepRule::Halving`] follows the flow chart literally; its
//! reference 13 (Numerical Recipes, chapter 9) minimises with [`StepRule::QuadraticBacktracking`].
//! With any choice the claims "no oscillation, no divergence" (Figs. 3 and 4) hold in the residual chosen,
//! because its error cannot increase. Whether the iteration then reaches a solution is another matter.

mod options;
mod search;

use masseter_model::geometry::{Actuators, LEGS, Mechanism};
pub use options::{MAX_HALVINGS, MAX_ITERATIONS, Method, Options, Residual, StepRule};
pub use search::Iteration;
use search::Search;

use super::leg_angle::LegAngle;
use super::loop_equations::{LoopEquations, LoopSolution};
use super::{Equations, ForwardError, Solution};

/// Solves from a guess of the leg angles (radians) by the method asked for.
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
    let mut at = Iteration::guess(&search.equations, guess_rad);
    observe(&at);
    while at.is_above(options.epsilon_cm2) {
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
    let leg_angles = std::array::from_fn(|leg| LegAngle::from_rad(at.evaluation.theta_rad[leg]));
    let closed = LoopSolution { leg_angles, residuals: loops.evaluate(&leg_angles), iterations: at.number };
    Ok(Solution { residual_m: at.evaluation.residual_norm_m(), ..Solution::new(&loops, &closed) })
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
        prop_oneof![
            Just(StepRule::Halving),
            Just(StepRule::CautiousHalving),
            Just(StepRule::QuadraticBacktracking)
        ]
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

    /// With leg 1 shorter than its hinge's distance from everything leg 2 reaches, nothing closes.
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
            // A near guess cannot separate two solutions that are closer together than its error.
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

        /// With every reading of the text that goes by the error of eq. 2.
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
                let options = Options { residual, step, ..default() };
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
                for leg in 0..LEGS {
                    let arrived = pair[0].evaluation.theta_rad[leg] + pair[1].increment_rad[leg];
                    prop_assert!((arrived - pair[1].evaluation.theta_rad[leg]).abs() < f64::EPSILON);
                }
            }
            if let Ok(solution) = solved {
                prop_assert_eq!(solution.iterations as usize, trace.len() - 1);
                prop_assert!(trace[trace.len() - 1].evaluation.error_cm2() <= default().epsilon_cm2);
            }
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
