//! `bench fk`: the forward kinematics as the loop calls it, against uncertified iterations.
//!
//! Inputs follow a chewing-like cycle at 1 kHz; every call is timed on its own.

use std::f64::consts::TAU;
use std::hint::black_box;

use masseter_controller::kinematics::{ForwardTracker, Options, solve_completely, solve_newton, solve_seed};
use masseter_shared::clock;
use masseter_shared::geometry::{Actuators, LEGS, Mechanism, MechanismConfig, Pose};
use nalgebra::{Translation3, UnitQuaternion};

use super::contest::{Durations, Outcome, Turn, durations, record};
use super::on_core;

/// A chewing cycle of 0.46 s, one input a millisecond.
const CYCLES: usize = 460;
/// Calls a round.
const CALLS: usize = 20_000;

pub(super) fn measure(rounds: u32, core: usize) -> anyhow::Result<Outcome> {
    let mechanism = Mechanism::new(&MechanismConfig::default())?;
    let inputs = chewing(&mechanism)?;
    let (mechanism, inputs) = (&mechanism, inputs.as_slice());
    let options = &Options::default();
    let turns: Vec<(String, Turn)> = vec![
        (
            "warm, certified".to_owned(),
            Box::new(move || {
                let mut tracker = ForwardTracker::new(mechanism.clone());
                Ok(on_core(core, || each(inputs, |input| tracker.update(input))).into())
            }),
        ),
        (
            "warm, Newton".to_owned(),
            Box::new(move || {
                let mut theta_rad = [1.4; LEGS];
                Ok(on_core(core, || {
                    each(inputs, |input| {
                        if let Ok(solution) = solve_newton(mechanism, input, &theta_rad, options) {
                            theta_rad = solution.theta_rad;
                        }
                    })
                })
                .into())
            }),
        ),
        (
            "warm, the paper's iteration".to_owned(),
            Box::new(move || {
                let mut theta_rad = [1.4; LEGS];
                Ok(on_core(core, || {
                    each(inputs, |input| {
                        if let Ok(solution) = solve_seed(mechanism, input, &theta_rad, options) {
                            theta_rad = solution.theta_rad;
                        }
                    })
                })
                .into())
            }),
        ),
        (
            "cold, all solutions".to_owned(),
            Box::new(move || {
                Ok(on_core(core, || each(inputs, |input| solve_completely(mechanism, input))).into())
            }),
        ),
        (
            "cold, Newton from one guess".to_owned(),
            Box::new(move || {
                Ok(on_core(core, || {
                    each(inputs, |input| solve_newton(mechanism, input, &[1.4; LEGS], options))
                })
                .into())
            }),
        ),
    ];
    let measures = "one forward solution, inputs of a chewing cycle at 1 kHz".to_owned();
    Ok(Outcome::of_turns("fk", measures, rounds, core, turns)?.comparing(&[(0, 1), (0, 2), (3, 4)]))
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

/// Times each call; the first cycle warms up.
fn each<R>(inputs: &[Actuators], mut solve: impl FnMut(&Actuators) -> R) -> Durations {
    let mut taken = durations();
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
