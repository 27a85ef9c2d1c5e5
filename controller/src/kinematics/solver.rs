//! Two iterations for the equations: the seed's (Fig. 2) and plain Newton–Raphson.
//!
//! Both go in the Newton direction. The seed's halves the increment until the error (eq. 2)
//! decreases; that stops oscillation and divergence but may stall in a local minimum. Either finds
//! *a* solution near its guess; which one it is, [`Assembly`](super::Assembly) tells.

use masseter_shared::geometry::{Actuators, LEGS, Mechanism};
use nalgebra::Vector3;

use super::closure::{Closed, Closure};
use super::heading::Heading;
use super::{Equations, Evaluation, ForwardError, Solution};

/// No options allow more iterations than this.
pub const MAX_ITERATIONS: u32 = 100;
/// No options allow more halvings of one increment than this.
pub const MAX_HALVINGS: u32 = 40;

/// Below this the Newton direction is noise; unitless, see [`Equations::determinant`].
const SMALLEST_DETERMINANT: f64 = 1e-10;

/// When an iteration ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Solved when no side of the platform is off by more, metres.
    pub tolerance_m: f64,
    /// Iterations allowed; at most [`MAX_ITERATIONS`].
    pub max_iterations: u32,
    /// Halvings of one increment allowed; at most [`MAX_HALVINGS`].
    pub max_halvings: u32,
}

impl Default for Options {
    /// The tolerance lies a few hundred roundings above what double precision reaches at these sizes.
    fn default() -> Self {
        Self { tolerance_m: 1e-14, max_iterations: 20, max_halvings: 12 }
    }
}

/// Which iteration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// The seed's algorithm: Newton's direction, the increment halved until the error decreases.
    #[default]
    Seed,
    /// Newton–Raphson with the full increment.
    Newton,
}

/// Solves from a guess of the leg angles (radians) by the method asked for.
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
    if !actuators.is_finite() || !guess_rad.iter().all(|x| x.is_finite()) {
        return Err(ForwardError::NotFinite);
    }
    let equations = Equations::new(mechanism, actuators);
    let mut at = equations.evaluate(Vector3::from(*guess_rad));
    let mut iterations = 0;
    while at.residual_norm_m() > options.tolerance_m {
        if iterations == options.max_iterations.min(MAX_ITERATIONS) {
            return Err(ForwardError::NoConvergence { residual_m: at.residual_norm_m(), iterations });
        }
        let increment = newton_increment(&equations, &at)?;
        iterations += 1;
        at = match method {
            Method::Newton => equations.evaluate(at.theta_rad + increment),
            Method::Seed => halved_until_better(&equations, &at, increment, options)
                .ok_or(ForwardError::Stalled { residual_m: at.residual_norm_m(), iterations })?,
        };
    }
    let closure = Closure::new(mechanism, actuators);
    let headings = std::array::from_fn(|leg| Heading::from_rad(at.theta_rad[leg]));
    let closed = Closed { headings, closing: closure.evaluate(&headings), iterations };
    Ok(Solution {
        residual_m: at.residual_norm_m(),
        ..Solution::new(mechanism, actuators, &closure, &closed)
    })
}

/// [`solve`] by the seed's algorithm.
///
/// # Errors
/// Those of [`solve`].
pub fn solve_seed(
    mechanism: &Mechanism,
    actuators: &Actuators,
    guess_rad: &[f64; LEGS],
    options: &Options,
) -> Result<Solution, ForwardError> {
    solve(Method::Seed, mechanism, actuators, guess_rad, options)
}

/// [`solve`] by Newton–Raphson.
///
/// # Errors
/// Those of [`solve`], never [`ForwardError::Stalled`].
pub fn solve_newton(
    mechanism: &Mechanism,
    actuators: &Actuators,
    guess_rad: &[f64; LEGS],
    options: &Options,
) -> Result<Solution, ForwardError> {
    solve(Method::Newton, mechanism, actuators, guess_rad, options)
}

/// −J⁻¹ f, radians.
fn newton_increment(equations: &Equations<'_>, at: &Evaluation) -> Result<Vector3<f64>, ForwardError> {
    let determinant = equations.determinant(at);
    let singular = ForwardError::Singular { determinant, residual_m: at.residual_norm_m() };
    if determinant.is_nan() || determinant.abs() < SMALLEST_DETERMINANT {
        return Err(singular);
    }
    let inverse = equations.jacobian(at).try_inverse().ok_or(singular)?;
    Ok(-(inverse * at.residual_m))
}

/// The inner loop of Fig. 2; none when no allowed halving decreases the error.
fn halved_until_better(
    equations: &Equations<'_>,
    at: &Evaluation,
    increment: Vector3<f64>,
    options: &Options,
) -> Option<Evaluation> {
    let mut increment = increment;
    for _ in 0..=options.max_halvings.min(MAX_HALVINGS) {
        let candidate = equations.evaluate(at.theta_rad + increment);
        if candidate.error_m2() < at.error_m2() {
            return Some(candidate);
        }
        increment /= 2.0;
    }
    None
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::samples::{angle_between, mechanisms, poses, seed_mechanism};

    fn default() -> Options {
        Options::default()
    }

    fn neutral() -> Actuators {
        Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] }
    }

    #[test]
    fn neutral_pose_of_the_seed() {
        for method in [Method::Seed, Method::Newton] {
            let solution = solve(method, &seed_mechanism(), &neutral(), &[1.5; LEGS], &default()).unwrap();
            assert!(solution.assembly.is_true());
            assert!((solution.pose.translation.z - 0.268_452_355).abs() < 1e-9);
            assert!(solution.iterations <= 6);
        }
    }

    #[test]
    fn no_number_is_refused() {
        let mut actuators = neutral();
        actuators.leg_m[2] = f64::NAN;
        let mechanism = seed_mechanism();
        assert_eq!(
            solve_seed(&mechanism, &actuators, &[1.4; LEGS], &default()),
            Err(ForwardError::NotFinite)
        );
        let guess = [1.4, f64::INFINITY, 1.4];
        assert_eq!(solve_newton(&mechanism, &neutral(), &guess, &default()), Err(ForwardError::NotFinite));
    }

    /// With leg 1 shorter than its hinge's distance from everything leg 2 reaches, nothing closes.
    #[test]
    fn what_cannot_be_assembled_is_a_typed_error() {
        let actuators = Actuators { slide_m: [0.0; LEGS], leg_m: [0.01, 0.30, 0.30] };
        for method in [Method::Seed, Method::Newton] {
            let error = solve(
                method,
                &seed_mechanism(),
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
            // Two solutions closer together than the guess is accurate are not a near guess's matter.
            let here = Equations::new(&mechanism, &joints.actuators);
            prop_assume!(here.determinant(&here.evaluate(joints.theta_rad.into())).abs() > 0.2);
            let by = |method| solve(method, &mechanism, &joints.actuators, &guess, &default()).unwrap();
            let (seed, newton) = (by(Method::Seed), by(Method::Newton));
            for solution in [seed, newton] {
                prop_assert!((solution.pose.translation.vector - pose.translation.vector).norm() < 1e-10);
                prop_assert!(angle_between(&solution.pose, &pose) < 1e-10);
                prop_assert!(solution.residual_m <= 1e-13);
            }
        }

        #[test]
        fn the_seeds_error_never_increases(
            actuators in [-0.03..0.03f64, -0.03..0.03f64, -0.03..0.03f64, 0.24..0.3f64, 0.24..0.3f64, 0.24..0.3f64],
            guess in [-3.0..3.0f64, -3.0..3.0f64, -3.0..3.0f64],
        ) {
            let mechanism = seed_mechanism();
            let equations = Equations::new(&mechanism, &Actuators::from_axes(actuators));
            let mut at = equations.evaluate(guess.into());
            for _ in 0..MAX_ITERATIONS {
                let Ok(increment) = newton_increment(&equations, &at) else { break };
                let Some(better) = halved_until_better(&equations, &at, increment, &default()) else { break };
                prop_assert!(better.error_m2() < at.error_m2());
                at = better;
            }
        }

        #[test]
        fn any_numbers_end_in_a_result(
            actuators in prop::array::uniform6(prop::num::f64::ANY),
            guess in prop::array::uniform3(prop::num::f64::ANY),
        ) {
            let actuators = Actuators::from_axes(actuators);
            for method in [Method::Seed, Method::Newton] {
                if let Ok(solution) = solve(method, &seed_mechanism(), &actuators, &guess, &default()) {
                    prop_assert!(solution.residual_m <= default().tolerance_m);
                }
            }
        }
    }
}
