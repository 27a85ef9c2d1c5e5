//! Fig. 5 of the paper in time: the time that each solver takes for a solution. Solvers take turns in one run.

use std::hint::black_box;

use masseter_controller::kinematics::{ForwardTracker, solve};
use masseter_model::geometry::Mechanism;
use masseter_runtime::clock;

use crate::motions::{CYCLE_S, Motion};
use crate::solver::{Solver, Start, TIMED};
use crate::tables::{csv, number, quantile};
use crate::trials::{ANYWHERE, Trial, Trials};

/// Cases timed in each situation.
const CASES: usize = 2000;
/// Calls between two readings of the clock: one alone would mostly time the clock.
const CALLS: u32 = 8;

/// From random guesses above the base from which all three solvers reach a solution; and from the solution one
/// millisecond of chewing before. Takes one core; nothing else of the study runs meanwhile.
pub(crate) fn table(mechanism: &Mechanism, trials: &Trials, chewing: &Motion) -> String {
    let random = trials.with(ANYWHERE).iter();
    let all_arrive = |trial: &&Trial| TIMED.into_iter().all(|solver| trial.by(solver).is_ok());
    let random: Vec<_> = random.filter(all_arrive).take(CASES).map(|trial| trial.start).collect();
    let situations = [
        ("random guess above the base", random),
        ("solution 1 ms before, chewing", warm(mechanism, chewing)),
    ];
    let rows = situations.into_iter().flat_map(|(name, cases)| {
        let times = in_turns(mechanism, &cases);
        let [_, [newton_ns, _], _] = times;
        TIMED.into_iter().zip(times).map(move |(solver, [median_ns, p99_ns])| {
            (name, solver.name, cases.len(), [median_ns, p99_ns, median_ns / newton_ns].map(number))
        })
    });
    csv("start,solver,cases,median_ns,p99_ns,ratio_of_medians_to_newton", rows)
}

/// Inputs of a motion, each with the leg angles of the cycle before.
fn warm(mechanism: &Mechanism, motion: &Motion) -> Vec<Start> {
    let joints = |cycle: usize| mechanism.inverse(&motion.trajectory.pose(cycle as f64 * CYCLE_S)).ok();
    let steps = (1..=CASES).filter_map(|cycle| Some((joints(cycle)?, joints(cycle - 1)?)));
    steps.map(|(now, before)| Start { actuators: now.actuators, guess_rad: before.theta_rad }).collect()
}

/// Median and 99th percentile of each solver, ns. Every case goes to every solver before the next case.
fn in_turns(mechanism: &Mechanism, cases: &[Start]) -> [[f64; 2]; TIMED.len()] {
    let mut taken_ns = TIMED.map(|_| Vec::with_capacity(cases.len()));
    for start in cases {
        for (solver, taken_ns) in TIMED.into_iter().zip(&mut taken_ns) {
            taken_ns.push(time_ns(solver, mechanism, start));
        }
    }
    taken_ns.map(|sample| [0.5, 0.99].map(|share| quantile(sample.iter().copied(), share)))
}

/// Time of one solution, ns, without an observer.
fn time_ns(solver: Solver, mechanism: &Mechanism, Start { actuators, guess_rad }: &Start) -> f64 {
    if let Some((method, options)) = solver.iteration() {
        return mean_ns(|| {
            solve(method, mechanism, black_box(actuators), black_box(guess_rad), &options).is_ok()
        });
    }
    let tracker = ForwardTracker::with_guess(mechanism.clone(), *guess_rad);
    let mut trackers: Vec<_> = (0..CALLS).map(|_| tracker.clone()).collect();
    let mut fresh = trackers.iter_mut();
    mean_ns(|| fresh.next().map(|tracker| tracker.update(black_box(actuators))))
}

/// The mean over [`CALLS`] calls.
fn mean_ns<R>(mut call: impl FnMut() -> R) -> f64 {
    let from_ns = clock::now_ns();
    for _ in 0..CALLS {
        black_box(call());
    }
    (clock::now_ns() - from_ns) as f64 / f64::from(CALLS)
}
