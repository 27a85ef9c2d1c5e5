//! Solvers and their streams of inputs, shared by both benches.
//!
//! Warm solves follow a chewing cycle at 1 kHz, each from the last solution. Cold solves take the same inputs, each
//! from a random guess in (0°, 180°).

mod general_purpose;

use std::f64::consts::{PI, TAU};
use std::fmt;
use std::hint::black_box;

use masseter_controller::kinematics::{ForwardTracker, Method, Options, Solutions, solve, solve_completely};
use masseter_model::geometry::{Actuators, LEGS, Mechanism, MechanismConfig, Pose};
use nalgebra::{Translation3, UnitQuaternion};

/// Inputs of a chewing cycle of 0.46 s, one a millisecond.
pub(crate) const CYCLES: u32 = 460;

/// A solver on a stream of inputs.
pub(crate) struct Work {
    /// The name in the benches.
    pub(crate) name: &'static str,
    /// Prepares the solver. Each call of the result solves the next input.
    pub(crate) start: fn() -> Call,
}

/// Solves the next input.
pub(crate) type Call = Box<dyn FnMut()>;

/// All workloads, in the order of the tables.
pub(crate) const WORKS: &[Work] = &[
    Work { name: "warm: certified", start: warm_certified },
    Work { name: "warm: published", start: || warm(Method::Published) },
    Work { name: "warm: Newton-Raphson", start: || warm(Method::Newton) },
    Work { name: "warm: levenberg-marquardt", start: warm_general_purpose },
    Work { name: "cold: certified true solution", start: cold_certified },
    Work { name: "cold: published, any solution or none", start: || cold(Method::Published) },
    Work { name: "cold: Newton-Raphson, any solution or none", start: || cold(Method::Newton) },
    Work { name: "cold: levenberg-marquardt, any solution or none", start: cold_general_purpose },
    Work { name: "true solution without a guess", start: without_a_guess },
    Work { name: "all solutions: chewing cycle", start: || all_solutions(chewing) },
    Work { name: "all solutions: random inputs", start: || all_solutions(box_of_strokes) },
    Work { name: "all solutions: neutral input", start: || all_solutions(|_| vec![NEUTRAL]) },
    Work { name: "refusal: cannot be assembled", start: refusal },
];

const NEUTRAL: Actuators = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };

impl fmt::Display for Work {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

fn warm_certified() -> Call {
    let mechanism = mechanism();
    let inputs = chewing(&mechanism);
    let mut tracker = ForwardTracker::new(mechanism);
    each(inputs, move |_, input| tracker.update(input))
}

fn warm(method: Method) -> Call {
    let mechanism = mechanism();
    let mut last_rad = [1.4; LEGS];
    each(chewing(&mechanism), move |_, input| {
        let solution = solve(method, &mechanism, input, &last_rad, &Options::default());
        last_rad = solution.as_ref().map_or(last_rad, |solution| solution.theta_rad);
        solution
    })
}

fn warm_general_purpose() -> Call {
    let mechanism = mechanism();
    let mut last_rad = [1.4; LEGS];
    each(chewing(&mechanism), move |_, input| {
        let solved_rad = general_purpose::solve(&mechanism, input, last_rad);
        last_rad = solved_rad.unwrap_or(last_rad);
        solved_rad
    })
}

fn cold_certified() -> Call {
    let mechanism = mechanism();
    each(chewing(&mechanism), move |index, input| {
        ForwardTracker::with_guess(mechanism.clone(), random_guess_rad(index)).update(input)
    })
}

fn cold(method: Method) -> Call {
    let mechanism = mechanism();
    each(chewing(&mechanism), move |index, input| {
        solve(method, &mechanism, input, &random_guess_rad(index), &Options::default())
    })
}

fn cold_general_purpose() -> Call {
    let mechanism = mechanism();
    each(chewing(&mechanism), move |index, input| {
        general_purpose::solve(&mechanism, input, random_guess_rad(index))
    })
}

fn without_a_guess() -> Call {
    let mechanism = mechanism();
    each(chewing(&mechanism), move |_, input| solve_completely(&mechanism, input))
}

fn all_solutions(inputs: fn(&Mechanism) -> Vec<Actuators>) -> Call {
    let mechanism = mechanism();
    each(inputs(&mechanism), move |_, input| Solutions::new(&mechanism, input))
}

fn refusal() -> Call {
    let mechanism = mechanism();
    let input = Actuators { leg_m: [0.30, 0.30, 0.20], ..NEUTRAL };
    each(vec![input], move |_, input| solve_completely(&mechanism, input))
}

/// Solves one input after the other, over and over.
fn each<R>(inputs: Vec<Actuators>, mut solve: impl FnMut(usize, &Actuators) -> R + 'static) -> Call {
    let mut turn = 0;
    Box::new(move || {
        black_box(solve(turn, black_box(&inputs[turn])));
        turn = (turn + 1) % inputs.len();
    })
}

fn mechanism() -> Mechanism {
    Mechanism::new(&MechanismConfig::default()).expect("the default is a mechanism")
}

fn chewing(mechanism: &Mechanism) -> Vec<Actuators> {
    let pose = |cycle: u32| {
        let (sin, cos) = (f64::from(cycle) / f64::from(CYCLES) * TAU).sin_cos();
        Pose::from_parts(
            Translation3::new(0.004 * sin, 0.003 * cos, 0.272 + 0.008 * cos),
            UnitQuaternion::from_euler_angles(0.03 * sin, 0.12 + 0.12 * cos, 0.03 * cos),
        )
    };
    (0..CYCLES).map(|cycle| mechanism.inverse(&pose(cycle)).expect("legs have length").actuators).collect()
}

/// Inputs over the whole box of strokes. One in five has no true solution.
fn box_of_strokes(_: &Mechanism) -> Vec<Actuators> {
    let axis = |index, axis: usize| {
        let share = scattered(index, axis);
        if axis < LEGS { 0.06 * share - 0.03 } else { 0.24 + 0.06 * share }
    };
    (1..=CYCLES as usize).map(|index| Actuators::from_axes(std::array::from_fn(|a| axis(index, a)))).collect()
}

fn random_guess_rad(index: usize) -> [f64; LEGS] {
    std::array::from_fn(|leg| PI * scattered(index, leg))
}

/// Evenly scattered in [0, 1): multiples of an irrational number.
fn scattered(index: usize, axis: usize) -> f64 {
    (index as f64 * [0.819_172_5, 0.671_043_6, 0.549_700_5, 0.450_332_9, 0.368_912_4, 0.302_213_6][axis])
        .fract()
}
