//! Random inputs and guesses, each from a generator of its own, so that the order in which cores take
//! them changes nothing.

use std::f64::consts::{PI, TAU};

use masseter_controller::kinematics::{Solution, Solutions};
use masseter_model::geometry::{AXES, Actuators, LEGS, Mechanism};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use self::Guesses::{AboveBase, Within};

/// The experiments that draw; each has streams of its own.
#[derive(Debug, Clone, Copy)]
pub(super) enum Stream {
    Trials = 1,
    Inputs = 2,
}

/// The generator of one case of an experiment.
pub(super) fn generator(seed: u64, stream: Stream, case: usize) -> Pcg64Mcg {
    let stream = (stream as u64) << 56;
    Pcg64Mcg::seed_from_u64(seed.rotate_left(32) ^ stream ^ case as u64)
}

/// An input anywhere in the strokes.
pub(super) fn input(mechanism: &Mechanism, random: &mut Pcg64Mcg) -> Actuators {
    let axes: [f64; AXES] = std::array::from_fn(|axis| {
        let [low_m, high_m] = mechanism.strokes().of_axis(axis);
        random.random_range(low_m..=high_m)
    });
    Actuators::from_axes(axes)
}

/// An input with exactly one true solution.
#[derive(Debug, Clone)]
pub(super) struct Feasible {
    pub actuators: Actuators,
    pub solutions: Solutions,
    pub true_one: Solution,
}

/// Drawn anew until one is feasible: about every other input is.
pub(super) fn feasible(mechanism: &Mechanism, random: &mut Pcg64Mcg) -> Feasible {
    loop {
        let actuators = input(mechanism, random);
        let Ok(solutions) = Solutions::new(mechanism, &actuators) else { continue };
        let mut true_ones = solutions.true_ones().copied();
        if let (Some(true_one), None) = (true_ones.next(), true_ones.next()) {
            return Feasible { actuators, solutions, true_one };
        }
    }
}

/// Where guesses come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Guesses {
    /// Every leg within so many degrees of the true angle.
    Within(f64),
    /// Every leg anywhere above the base.
    AboveBase,
}

/// The origins of the trials' guesses, nearest first.
pub(super) const GUESSES: [Guesses; 8] = [
    Within(2.0),
    Within(5.0),
    Within(10.0),
    Within(15.0),
    Within(20.0),
    Within(30.0),
    Within(60.0),
    AboveBase,
];

impl Guesses {
    /// The name in tables.
    pub(super) fn name(self) -> String {
        match self {
            Within(deg) => format!("±{deg}°"),
            AboveBase => "above base".to_owned(),
        }
    }

    /// Leg angles, radians.
    pub(super) fn draw(self, true_rad: &[f64; LEGS], random: &mut Pcg64Mcg) -> [f64; LEGS] {
        match self {
            Within(deg) => true_rad.map(|angle| {
                let off: f64 = random.random_range(-1.0..=1.0);
                angle + off * deg.to_radians()
            }),
            AboveBase => std::array::from_fn(|_| random.random_range(0.0..PI)),
        }
    }
}

/// The largest difference of any leg's angle, around the circle, radians.
pub(super) fn distance_rad(a: &[f64; LEGS], b: &[f64; LEGS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| ((a - b + PI).rem_euclid(TAU) - PI).abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::MechanismConfig;

    use super::*;

    #[test]
    fn distances_go_the_short_way_round() {
        let distance = distance_rad(&[3.1, 0.0, 1.0], &[-3.1, 0.01, 1.0]);
        assert!((distance - (TAU - 6.2)).abs() < 1e-12);
    }

    #[test]
    fn a_case_depends_only_on_its_number() {
        let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
        let draw = |case| feasible(&mechanism, &mut generator(7, Stream::Trials, case)).actuators;
        assert_eq!(draw(3), draw(3));
        assert_ne!(draw(3), draw(4));
    }

    #[test]
    fn guesses_stay_within_their_range() {
        let mut random = generator(1, Stream::Trials, 0);
        let truth = [1.4, 1.5, 1.6];
        for guesses in GUESSES {
            for _ in 0..100 {
                let guess = guesses.draw(&truth, &mut random);
                match guesses {
                    Within(deg) => assert!(distance_rad(&guess, &truth) <= deg.to_radians() + 1e-12),
                    AboveBase => assert!(guess.iter().all(|angle| angle.sin() >= 0.0)),
                }
            }
        }
    }
}
