//! How far an input is from one that can be assembled.
//!
//! The distance is the least root of the paper's error (eq. 2) over all leg angles, that is, the change of
//! the platform's sides that would be needed. A bounded descent from each of a grid of starts finds an upper
//! bound: other angles may come a little closer.

use masseter_model::geometry::{Actuators, Mechanism};
use nalgebra::{Matrix3, Vector3};

use super::Equations;
use super::elimination::Elimination;
use super::leg_angle::LegAngle;
use super::loop_equations::LoopEquations;

/// Values of cos θ₁, each with four sets of angles to start from.
const GRID: u32 = 32;
/// Steps of one descent at most; it ends before when the error hardly decreases or the step hardly turns a leg.
const STEPS: u32 = 40;
/// A step that leaves more than this share of the error is the last.
const HARDLY_LESS: f64 = 1.0 - 1e-5;
/// So is one that turns no leg by more, radians.
const HARDLY_TURNED_RAD: f64 = 1e-7;

/// The least √(f₁² + f₂² + f₃²) found, metres. It takes many times as long as finding that there is no solution.
pub fn nearest_assembly_m(mechanism: &Mechanism, actuators: &Actuators) -> f64 {
    let loops = LoopEquations::new(mechanism, actuators);
    let equations = Equations::new(mechanism, actuators);
    let elimination = Elimination::new(&loops);
    let starts =
        (0..=GRID).flat_map(|index| elimination.leg_angles(2.0 * f64::from(index) / f64::from(GRID) - 1.0));
    let ends_m2 = starts.map(|leg_angles| descended_m2(&equations, leg_angles.map(LegAngle::to_rad).into()));
    ends_m2.fold(f64::INFINITY, f64::min).sqrt()
}

/// Levenberg's and Marquardt's descent: the error at its end, m².
fn descended_m2(equations: &Equations<'_>, start: Vector3<f64>) -> f64 {
    let mut at = equations.evaluate(start);
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let jacobian = equations.jacobian(&at);
        let normal = jacobian.tr_mul(&jacobian);
        let damped = normal + Matrix3::identity() * (damping * normal.trace());
        let Some(factors) = damped.cholesky() else { break };
        let step = factors.solve(&jacobian.tr_mul(&at.residual_m));
        let next = equations.evaluate(at.theta_rad - step);
        let remains = next.error_m2() / at.error_m2();
        if remains < 1.0 {
            (at, damping) = (next, damping * 0.2);
        } else {
            damping *= 5.0;
        }
        if step.amax() < HARDLY_TURNED_RAD || (HARDLY_LESS..1.0).contains(&remains) {
            break;
        }
    }
    at.error_m2()
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::LEGS;
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::tests::{mechanisms, poses, published_mechanism};

    /// Least error over a grid of all three angles above the base, m.
    fn on_a_grid_m(equations: &Equations<'_>) -> f64 {
        let angle = |index: u32| f64::from(index) * std::f64::consts::PI / 60.0;
        let mut least_m2 = f64::INFINITY;
        for (i, j, k) in (0..216_000).map(|n| (n % 60, n / 60 % 60, n / 3600)) {
            let theta_rad = Vector3::new(angle(i), angle(j), angle(k));
            least_m2 = least_m2.min(equations.evaluate(theta_rad).error_m2());
        }
        least_m2.sqrt()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(50))]

        #[test]
        fn nothing_on_a_grid_comes_closer_by_a_hundredth(
            slide_m in prop::array::uniform3(-0.03..0.03f64), leg_m in prop::array::uniform3(0.2..0.34f64),
        ) {
            let (mechanism, actuators) = (published_mechanism(), Actuators { slide_m, leg_m });
            let nearest = nearest_assembly_m(&mechanism, &actuators);
            let on_a_grid = on_a_grid_m(&Equations::new(&mechanism, &actuators));
            prop_assert!(nearest <= 1.01 * on_a_grid + 1e-12, "{nearest} m, on a grid {on_a_grid} m");
        }
    }

    proptest! {
        #[test]
        fn what_can_be_assembled_is_no_distance_from_it(mechanism in mechanisms(), pose in poses(30.0)) {
            let actuators = mechanism.inverse(&pose).unwrap().actuators;
            let found_m = nearest_assembly_m(&mechanism, &actuators);
            prop_assert!(found_m < 1e-7, "{found_m} m");
        }
    }

    /// The start with the least error does not lead to them.
    #[test]
    fn solutions_far_from_the_best_start_are_found() {
        let inputs = [
            (
                [0.013_745_080_593, -0.020_808_585_577, -0.015_397_878_121],
                [0.288_811_952_893, 0.290_133_041_177, 0.309_002_566_259],
            ),
            (
                [0.005_799_786_336, 0.010_761_635_074, 0.005_383_840_607],
                [0.303_309_286_864, 0.318_823_920_414, 0.296_586_935_017],
            ),
            (
                [-0.016_721_740_924, 0.016_531_109_308, 0.017_909_281_663],
                [0.256_198_086_386, 0.268_059_167_258, 0.237_177_919_520],
            ),
        ];
        for (slide_m, leg_m) in inputs {
            let found_m = nearest_assembly_m(&published_mechanism(), &Actuators { slide_m, leg_m });
            assert!(found_m < 1e-7, "{found_m} m");
        }
    }

    /// Two legs so short that they cannot reach each other: their side alone has to give.
    #[test]
    fn legs_that_cannot_meet_are_as_far_off_as_they_are_apart() {
        let actuators = Actuators { slide_m: [0.0; LEGS], leg_m: [0.01, 0.01, 0.06] };
        let mechanism = published_mechanism();
        let found_m = nearest_assembly_m(&mechanism, &actuators);
        assert!(found_m > 0.03 && found_m < 0.05, "{found_m}");
    }
}
