//! Fig. 5 of the paper in time: the time that each solver takes for a solution. Solvers take turns in one run.

use std::hint::black_box;

use masseter_controller::kinematics::{ForwardTracker, solve};
use masseter_shared::clock;
use masseter_shared::geometry::{Actuators, LEGS, Mechanism};

use super::motions::Motion;
use super::sample::Guesses;
use super::share::{median, quantile};
use super::solver::{COMPARED, NEWTON, Solver};
use super::table::{csv, number};
use super::trials::{Trial, Trials};

/// Cases timed in each situation.
const CASES: usize = 2000;
/// Calls between two readings of the clock: one alone would mostly time the clock.
const CALLS: u32 = 8;
/// A trajectory's cycle, s.
const CYCLE_S: f64 = 1e-3;

/// The start of the iteration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Situation {
    /// From a random guess above the base from which all three solvers reach a solution.
    Random,
    /// From the solution one millisecond of chewing before.
    Warm,
}

/// The time of one solver in one situation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Timing {
    pub situation: Situation,
    pub solver: Solver,
    pub cases: usize,
    pub median_ns: f64,
    pub p99_ns: f64,
    /// Its median over Newton–Raphson's in the same situation.
    pub to_newton: f64,
}

/// All times of a run.
#[derive(Debug, Clone)]
pub(super) struct Speed {
    pub timings: Vec<Timing>,
}

impl Situation {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Random => "random guess above the base",
            Self::Warm => "solution 1 ms before, chewing",
        }
    }
}

impl Speed {
    /// Takes one core; nothing else of the study runs meanwhile.
    pub(super) fn measure(mechanism: &Mechanism, trials: &Trials, chewing: &Motion) -> Self {
        let random = trials.with(Guesses::AboveBase).iter();
        let all_arrive = |trial: &&Trial| COMPARED.into_iter().all(|solver| trial.by(solver).is_ok());
        let random = random.filter(all_arrive).take(CASES);
        let random: Vec<_> = random.map(|trial| (trial.actuators, trial.guess_rad)).collect();
        let mut taken = in_turns(mechanism, Situation::Random, &random);
        taken.extend(in_turns(mechanism, Situation::Warm, &warm(mechanism, chewing)));
        Self { timings: taken }
    }

    /// The time of one of [`COMPARED`].
    pub(super) fn timing(&self, situation: Situation, solver: Solver) -> Timing {
        let wanted = |taken: &&Timing| taken.situation == situation && taken.solver == solver;
        *self.timings.iter().find(wanted).expect("all of COMPARED are timed in every situation")
    }

    pub(super) fn table(&self) -> String {
        let row = |taken: &Timing| {
            let times = [taken.median_ns, taken.p99_ns, taken.to_newton].map(number);
            (taken.situation.name(), taken.solver.name, taken.cases, times)
        };
        csv("start,solver,cases,median_ns,p99_ns,ratio_of_medians_to_newton", self.timings.iter().map(row))
    }
}

/// Inputs of a motion, each with the leg angles of the cycle before.
fn warm(mechanism: &Mechanism, motion: &Motion) -> Vec<(Actuators, [f64; LEGS])> {
    let joints = |cycle: usize| mechanism.inverse(&motion.trajectory.pose(cycle as f64 * CYCLE_S)).ok();
    let steps = (1..=CASES).filter_map(|cycle| Some((joints(cycle)?, joints(cycle - 1)?)));
    steps.map(|(now, before)| (now.actuators, before.theta_rad)).collect()
}

/// Every case goes to every solver before the next case.
fn in_turns(mechanism: &Mechanism, situation: Situation, cases: &[(Actuators, [f64; LEGS])]) -> Vec<Timing> {
    let mut taken_ns = [(); COMPARED.len()].map(|()| Vec::with_capacity(cases.len()));
    for (actuators, guess_rad) in cases {
        for (solver, taken_ns) in COMPARED.into_iter().zip(&mut taken_ns) {
            taken_ns.push(time_ns(solver, mechanism, actuators, guess_rad));
        }
    }
    let place = COMPARED.iter().position(|&solver| solver == NEWTON).expect("Newton–Raphson is compared");
    let newton_ns = median(taken_ns[place].iter().copied());
    let timing = |(solver, sample): (_, Vec<f64>)| {
        let [median_ns, p99_ns] = [0.5, 0.99].map(|share| quantile(sample.iter().copied(), share));
        Timing { situation, solver, cases: cases.len(), median_ns, p99_ns, to_newton: median_ns / newton_ns }
    };
    COMPARED.into_iter().zip(taken_ns).map(timing).collect()
}

/// Time of one solution, ns, without an observer.
fn time_ns(solver: Solver, mechanism: &Mechanism, actuators: &Actuators, guess_rad: &[f64; LEGS]) -> f64 {
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
