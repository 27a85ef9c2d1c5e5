//! How far an input is from one that can be assembled.
//!
//! Measured by the least root of the seed's error (eq. 2) over all leg angles, that is, by how much
//! the platform's sides would have to give. It is searched by descent from the best of a grid of
//! starts of a bounded number of steps, so it is an upper bound: other angles may come a little closer.

use masseter_shared::geometry::{Actuators, Mechanism};
use nalgebra::{Matrix3, Vector3};

use super::Equations;
use super::closure::Closure;
use super::elimination::{Elimination, PAIRS};
use super::heading::Heading;

/// Values of cos θ₁ that are tried, four sets of angles each.
const GRID: u32 = 32;
/// Stretches of the grid: from the best start of each, for each of the four sets of angles, one descent. The best
/// starts of all lie next to each other and lead to one place.
const STRETCHES: u32 = 4;
/// Steps of one descent at most; it ends before when the error hardly decreases or the step hardly turns a leg.
const STEPS: u32 = 40;
/// A step that leaves more than this share of the error is the last.
const HARDLY_LESS: f64 = 1.0 - 1e-5;
/// So is one that turns no leg by more, radians.
const HARDLY_TURNED_RAD: f64 = 1e-7;

/// The least √(f₁² + f₂² + f₃²) found, metres. It takes many times as long as finding that there is no solution.
pub fn nearest_assembly_m(mechanism: &Mechanism, actuators: &Actuators) -> f64 {
    let closure = Closure::new(mechanism, actuators);
    let equations = Equations::new(mechanism, actuators);
    let elimination = Elimination::new(&closure);
    let mut least_m2 = f64::INFINITY;
    for stretch in 0..STRETCHES {
        for start in best_starts(&equations, &elimination, stretch) {
            least_m2 = least_m2.min(descended_m2(&equations, start));
        }
    }
    least_m2.sqrt()
}

/// Of each of the four sets of angles the one with the least error in a stretch of the grid.
fn best_starts(
    equations: &Equations<'_>,
    elimination: &Elimination<'_>,
    stretch: u32,
) -> [Vector3<f64>; PAIRS] {
    let mut best = [(f64::INFINITY, Vector3::zeros()); PAIRS];
    let points = GRID / STRETCHES;
    for index in stretch * points..=(stretch + 1) * points {
        let x = 2.0 * f64::from(index) / f64::from(GRID) - 1.0;
        for (best, headings) in best.iter_mut().zip(elimination.headings(x)) {
            let theta_rad = Vector3::from(headings.map(Heading::to_rad));
            let error_m2 = equations.evaluate(theta_rad).error_m2();
            if error_m2 < best.0 {
                *best = (error_m2, theta_rad);
            }
        }
    }
    best.map(|(_, theta_rad)| theta_rad)
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
    use masseter_shared::geometry::LEGS;
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::samples::seed_mechanism;

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
            let (mechanism, actuators) = (seed_mechanism(), Actuators { slide_m, leg_m });
            let nearest = nearest_assembly_m(&mechanism, &actuators);
            let on_a_grid = on_a_grid_m(&Equations::new(&mechanism, &actuators));
            prop_assert!(nearest <= 1.01 * on_a_grid + 1e-12, "{nearest} m, on a grid {on_a_grid} m");
        }
    }

    /// Two legs so short that they cannot reach each other: their side alone has to give.
    #[test]
    fn legs_that_cannot_meet_are_as_far_off_as_they_are_apart() {
        let actuators = Actuators { slide_m: [0.0; LEGS], leg_m: [0.01, 0.01, 0.06] };
        let mechanism = seed_mechanism();
        let found_m = nearest_assembly_m(&mechanism, &actuators);
        assert!(found_m > 0.03 && found_m < 0.05, "{found_m}");
    }
}
