//! The forward solvers side by side, in one run: `cargo bench -p masseter-controller`.
//!
//! Warm solves follow a chewing-like loop at 1 kHz; each call takes the next of its inputs.

use std::cell::Cell;
use std::f64::consts::{PI, TAU};

use divan::{Bencher, black_box};
use masseter_controller::kinematics::{ForwardTracker, Method, Options, Solutions, solve, solve_completely};
use masseter_shared::geometry::{Actuators, LEGS, Mechanism, MechanismConfig, Pose};
use nalgebra::{Translation3, UnitQuaternion};

const CYCLES: usize = 460;

fn main() {
    divan::main();
}

fn mechanism() -> Mechanism {
    Mechanism::new(&MechanismConfig::default()).expect("the default is a mechanism")
}

/// A chewing cycle of 0.46 s, one input a millisecond.
fn chewing(mechanism: &Mechanism) -> Vec<Actuators> {
    let pose = |cycle: usize| {
        let (sin, cos) = (cycle as f64 / CYCLES as f64 * TAU).sin_cos();
        Pose::from_parts(
            Translation3::new(0.004 * sin, 0.003 * cos, 0.272 + 0.008 * cos),
            UnitQuaternion::from_euler_angles(0.03 * sin, 0.12 + 0.12 * cos, 0.03 * cos),
        )
    };
    (0..CYCLES).map(|cycle| mechanism.inverse(&pose(cycle)).expect("legs have length").actuators).collect()
}

/// Evenly scattered in [0, 1): multiples of an irrational number.
fn scattered(index: usize, axis: usize) -> f64 {
    (index as f64 * [0.819_172_5, 0.671_043_6, 0.549_700_5, 0.450_332_9, 0.368_912_4, 0.302_213_6][axis])
        .fract()
}

/// Inputs over the whole box of strokes, of which one in five has no true solution.
fn box_of_strokes() -> Vec<Actuators> {
    let axis = |index, axis: usize| {
        let share = scattered(index, axis);
        if axis < LEGS { 0.06 * share - 0.03 } else { 0.24 + 0.06 * share }
    };
    (1..=CYCLES).map(|index| Actuators::from_axes(std::array::from_fn(|a| axis(index, a)))).collect()
}

/// Calls with one input after the other, over and over.
fn each<R>(bencher: Bencher<'_, '_>, inputs: &[Actuators], mut solve: impl FnMut(usize, &Actuators) -> R) {
    let turn = Cell::new(0);
    bencher.bench_local(|| {
        let index = turn.get();
        turn.set((index + 1) % inputs.len());
        solve(index, black_box(&inputs[index]))
    });
}

#[divan::bench(sample_size = 460)]
fn warm_certified(bencher: Bencher<'_, '_>) {
    let mechanism = mechanism();
    let inputs = chewing(&mechanism);
    let mut tracker = ForwardTracker::new(mechanism);
    each(bencher, &inputs, |_, input| tracker.update(input));
}

#[divan::bench(sample_size = 460)]
fn cold_from_a_random_guess(bencher: Bencher<'_, '_>) {
    let mechanism = mechanism();
    let inputs = chewing(&mechanism);
    each(bencher, &inputs, |index, input| {
        let guess = std::array::from_fn(|leg| PI * scattered(index, leg));
        ForwardTracker::with_guess(mechanism.clone(), guess).update(input)
    });
}

#[divan::bench(sample_size = 460)]
fn completely_without_a_guess(bencher: Bencher<'_, '_>) {
    let mechanism = mechanism();
    let inputs = chewing(&mechanism);
    each(bencher, &inputs, |_, input| solve_completely(&mechanism, input));
}

#[divan::bench(sample_size = 460)]
fn all_solutions_of_a_chewing_cycle(bencher: Bencher<'_, '_>) {
    let mechanism = mechanism();
    let inputs = chewing(&mechanism);
    each(bencher, &inputs, |_, input| Solutions::new(&mechanism, input));
}

#[divan::bench(sample_size = 460)]
fn all_solutions_over_the_box(bencher: Bencher<'_, '_>) {
    let mechanism = mechanism();
    each(bencher, &box_of_strokes(), |_, input| Solutions::new(&mechanism, input));
}

#[divan::bench(sample_size = 460)]
fn all_solutions_of_the_neutral_input(bencher: Bencher<'_, '_>) {
    let mechanism = mechanism();
    let neutral = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };
    each(bencher, &[neutral], |_, input| Solutions::new(&mechanism, input));
}

#[divan::bench(sample_size = 460)]
fn refusing_the_unassemblable(bencher: Bencher<'_, '_>) {
    let mechanism = mechanism();
    let input = Actuators { slide_m: [0.0; LEGS], leg_m: [0.30, 0.30, 0.20] };
    each(bencher, &[input], |_, input| solve_completely(&mechanism, input));
}

/// The two iterations of the seed's comparison, warm, without a certificate.
#[divan::bench(sample_size = 460, args = [Method::Seed, Method::Newton])]
fn warm_uncertified(bencher: Bencher<'_, '_>, method: Method) {
    let mechanism = mechanism();
    let inputs = chewing(&mechanism);
    let mut last_rad = [1.4; LEGS];
    each(bencher, &inputs, |_, input| {
        let solution = solve(method, &mechanism, input, &last_rad, &Options::default());
        last_rad = solution.as_ref().map_or(last_rad, |solution| solution.theta_rad);
        solution
    });
}

/// The same from random guesses: whatever root, or none, they end at.
#[divan::bench(sample_size = 460, args = [Method::Seed, Method::Newton])]
fn uncertified_from_a_random_guess(bencher: Bencher<'_, '_>, method: Method) {
    let mechanism = mechanism();
    let inputs = chewing(&mechanism);
    each(bencher, &inputs, |index, input| {
        let guess_rad = std::array::from_fn(|leg| PI * scattered(index, leg));
        solve(method, &mechanism, input, &guess_rad, &Options::default())
    });
}
