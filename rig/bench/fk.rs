//! `bench fk`: the forward kinematics of the loop, against uncertified iterations.
//!
//! Inputs follow a chewing-like cycle at 1 kHz; every call is timed separately.

use std::f64::consts::TAU;
use std::hint::black_box;

use masseter_controller::kinematics::{
    ForwardError, ForwardTracker, Method, Options, Solution, solve, solve_completely,
};
use masseter_shared::clock;
use masseter_shared::geometry::{Actuators, LEGS, Mechanism, MechanismConfig, Pose};
use nalgebra::{Translation3, UnitQuaternion};

use super::candidate::{Durations, no_durations, record};
use super::comparison::{Comparison, Turn};
use super::thread::on_core;

/// A chewing cycle of 0.46 s, one input a millisecond.
const CYCLES: usize = 460;
/// Calls per round.
const CALLS: usize = 20_000;
/// Guess of an iteration without an earlier solution.
const GUESS_RAD: [f64; LEGS] = [1.4; LEGS];

// The candidates.
const WARM: &str = "warm, certified";
const WARM_NEWTON: &str = "warm, Newton";
const WARM_PAPER: &str = "warm, the paper's iteration";
const COLD: &str = "cold, all solutions";
const COLD_NEWTON: &str = "cold, Newton from one guess";

pub(super) fn measure(rounds: u32, core: usize) -> anyhow::Result<Comparison> {
    let mechanism = &Mechanism::new(&MechanismConfig::default())?;
    let inputs = &*chewing(mechanism)?;
    let options = &Options::default();
    let by = |method| {
        move |input: &Actuators, guess_rad: &[f64; LEGS]| solve(method, mechanism, input, guess_rad, options)
    };
    let (newton, published) = (by(Method::Newton), by(Method::Published));
    let tracked = || {
        let mut tracker = ForwardTracker::new(mechanism.clone());
        each(inputs, |input| tracker.update(input))
    };
    let turns = vec![
        turn(WARM, core, tracked),
        turn(WARM_NEWTON, core, || each_from_the_last(inputs, newton)),
        turn(WARM_PAPER, core, || each_from_the_last(inputs, published)),
        turn(COLD, core, || each(inputs, |input| solve_completely(mechanism, input))),
        turn(COLD_NEWTON, core, || each(inputs, |input| newton(input, &GUESS_RAD))),
    ];
    let measures = "one forward solution, inputs of a chewing cycle at 1 kHz".to_owned();
    let comparison = Comparison::by_turns("fk", measures, rounds, &[core], turns)?;
    Ok(comparison.comparing([(WARM, WARM_NEWTON), (WARM, WARM_PAPER), (COLD, COLD_NEWTON)]))
}

fn turn<'a>(name: &str, core: usize, play: impl Fn() -> Durations + Sync + 'a) -> (String, Turn<'a>) {
    (name.to_owned(), Box::new(move || Ok(on_core(core, &play).into())))
}

fn chewing(mechanism: &Mechanism) -> anyhow::Result<Vec<Actuators>> {
    let pose = |cycle: usize| {
        let (sin, cos) = (cycle as f64 / CYCLES as f64 * TAU).sin_cos();
        Pose::from_parts(
            Translation3::new(0.004 * sin, 0.003 * cos, 0.272 + 0.008 * cos),
            UnitQuaternion::from_euler_angles(0.03 * sin, 0.12 + 0.12 * cos, 0.03 * cos),
        )
    };
    (0..CYCLES).map(|cycle| Ok(mechanism.inverse(&pose(cycle))?.actuators)).collect()
}

/// Times an iteration that starts from its last solution.
fn each_from_the_last(
    inputs: &[Actuators],
    solve: impl Fn(&Actuators, &[f64; LEGS]) -> Result<Solution, ForwardError>,
) -> Durations {
    let mut theta_rad = GUESS_RAD;
    each(inputs, |input| {
        if let Ok(solution) = solve(input, &theta_rad) {
            theta_rad = solution.theta_rad;
        }
    })
}

/// Times each call; the first cycle warms up.
fn each<R>(inputs: &[Actuators], mut solve: impl FnMut(&Actuators) -> R) -> Durations {
    let mut taken = no_durations();
    for (call, input) in inputs.iter().cycle().take(CYCLES + CALLS).enumerate() {
        let from_ns = clock::now_ns();
        black_box(solve(black_box(input)));
        let taken_ns = clock::now_ns() - from_ns;
        if call >= CYCLES {
            record(&mut taken, taken_ns, 1);
        }
    }
    taken
}
