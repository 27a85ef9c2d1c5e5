//! Random guesses for random feasible inputs: which solver reaches which solution after how many iterations.
//!
//! Each case draws from a generator of its own, so that the order in which cores take them changes nothing.

use std::{collections::BTreeMap, f64::consts::PI};

use masseter_controller::kinematics::{Assembly, MAX_ITERATIONS};
use masseter_model::geometry::{Actuators, LEGS, Mechanism};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use self::Guesses::{AboveBase, Within};
use self::Inputs::{Jaw, Strokes};
use crate::motions::Motion;
use crate::solutions::{SolutionSet, Stream, generator, random_input};
use crate::solver::{Found, NEWTON, PUBLISHED, SOLVERS, Solver, Start, distance_rad};
use crate::tables::{csv, number, quantile};

/// A root counts as the closest when no other is closer by more than this, radians.
const TIE_RAD: f64 = 1e-6;

/// Iterations that are allowed: the paper states no number. The last is no bound in practice.
const CAPS: [u32; 5] = [10, 20, 50, 100, MAX_ITERATIONS];

/// Where inputs come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Inputs {
    /// Anywhere in the strokes.
    Strokes,
    /// Any instant of a motion of the jaw, every motion as often.
    Jaw,
}

impl Inputs {
    /// The name in tables.
    fn name(self) -> &'static str {
        match self {
            Strokes => "whole strokes",
            Jaw => "jaw motions",
        }
    }

    fn draw(self, mechanism: &Mechanism, motions: &[Motion], random: &mut Pcg64Mcg) -> Actuators {
        match self {
            Strokes => random_input(mechanism, random),
            Jaw => motions[random.random_range(0..motions.len())].input(mechanism, random),
        }
    }
}

/// Where guesses come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Guesses {
    /// Every leg within so many degrees of the true angle.
    Within(f64),
    /// Every leg anywhere above the base.
    AboveBase,
}

/// Inputs and their guesses.
pub(crate) type Origin = (Inputs, Guesses);

/// The widest origin.
pub(crate) const ANYWHERE: Origin = (Strokes, AboveBase);
/// All of them, the nearest guesses first.
const ORIGINS: [Origin; 10] = [
    (Strokes, Within(2.0)),
    (Strokes, Within(5.0)),
    (Strokes, Within(10.0)),
    (Strokes, Within(15.0)),
    (Strokes, Within(20.0)),
    (Strokes, Within(30.0)),
    (Strokes, Within(60.0)),
    ANYWHERE,
    (Jaw, Within(5.0)),
    (Jaw, AboveBase),
];

impl Guesses {
    /// The name in tables.
    pub(crate) fn name(self) -> String {
        match self {
            Within(deg) => format!("±{deg}°"),
            AboveBase => "above base".to_owned(),
        }
    }

    /// Leg angles, radians.
    pub(crate) fn draw(self, true_rad: &[f64; LEGS], random: &mut Pcg64Mcg) -> [f64; LEGS] {
        match self {
            Within(deg) => true_rad.map(|angle| {
                let off: f64 = random.random_range(-1.0..=1.0);
                angle + off * deg.to_radians()
            }),
            AboveBase => std::array::from_fn(|_| random.random_range(0.0..PI)),
        }
    }
}

/// A solution that a solver reached, judged against all solutions of its input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reached {
    pub found: Found,
    /// Whether the mechanism can take it.
    pub is_true: bool,
    /// Whether no other solution is closer to the guess.
    pub is_closest: bool,
}

/// The end of an attempt: a solution, or why none was reached.
type TrialResult = Result<Reached, &'static str>;

/// One guess for one input, given to every solver.
#[derive(Debug, Clone)]
pub(crate) struct Trial {
    pub start: Start,
    /// In the order of [`SOLVERS`].
    outcomes: [TrialResult; SOLVERS.len()],
}

impl Trial {
    /// The outcome of one solver.
    pub(crate) fn by(&self, solver: Solver) -> TrialResult {
        let place = SOLVERS.iter().position(|&other| other == solver);
        self.outcomes[place.expect("every solver takes part")]
    }
}

/// All trials: `samples` for each of [`ORIGINS`].
#[derive(Debug, Clone)]
pub(crate) struct Trials {
    sets: Vec<Vec<Trial>>,
}

impl Trials {
    pub(crate) fn run(mechanism: &Mechanism, motions: &[Motion], samples: usize, seed: u64) -> Self {
        let trial = |(inputs, guesses): Origin, case| {
            let mut random = generator(seed, Stream::Trials, case);
            let input = SolutionSet::feasible(mechanism, || inputs.draw(mechanism, motions, &mut random));
            let guess_rad = guesses.draw(&input.true_one.theta_rad, &mut random);
            let start = Start { actuators: input.actuators, guess_rad };
            let outcomes = SOLVERS.map(|solver| {
                let found = solver.attempt(mechanism, &start)?;
                Ok(reached(mechanism, &input, &guess_rad, found))
            });
            Trial { start, outcomes }
        };
        let set = |origin| (0..samples).into_par_iter().map(|case| trial(origin, case)).collect();
        Self { sets: ORIGINS.into_iter().map(set).collect() }
    }

    /// The trials of this origin.
    ///
    /// # Panics
    /// When [`ORIGINS`] lacks it.
    pub(crate) fn with(&self, origin: Origin) -> &[Trial] {
        let set = ORIGINS.iter().position(|&set| set == origin);
        &self.sets[set.expect("trials have that origin")]
    }

    /// The solutions that a solver reaches within so many iterations; `None` where it reaches none.
    fn reached(&self, solver: Solver, origin: Origin, cap: u32) -> impl Iterator<Item = Option<Reached>> {
        let within = move |reached: &Reached| reached.found.iterations <= cap;
        self.with(origin).iter().map(move |trial| trial.by(solver).ok().filter(within))
    }

    /// Success and cost, one row for each origin, solver and cap. Costs are those of the trials in which the solver and
    /// Newton–Raphson with the same residual both reach a solution.
    pub(crate) fn success_table(&self) -> String {
        let row = |(origin, solver, cap): (Origin, Solver, u32)| {
            let hits =
                |is: fn(&Reached) -> bool| self.reached(solver, origin, cap).flatten().filter(is).count();
            let (solved, is_true) = (hits(|_| true), hits(|one| one.is_true));
            let both = self.reached(solver, origin, cap).zip(self.reached(solver.rival(), origin, cap));
            let both: Vec<_> = both.filter_map(|(a, b)| Some([a?.found, b?.found])).collect();
            let costs = [0, 1].map(|side| {
                let iterations = || both.iter().map(|pair| f64::from(pair[side].iterations));
                let evaluations = both.iter().map(|pair| f64::from(pair[side].evaluations));
                [quantile(iterations(), 0.5), quantile(iterations(), 0.9), quantile(evaluations, 0.5)]
                    .map(number)
            });
            let (inputs, guesses) = (origin.0.name(), origin.1.name());
            let trials = self.with(origin).len();
            let reached = [trials, is_true, solved - is_true, hits(|one| one.is_closest), both.len()];
            (inputs, guesses, solver.name, cap, reached, costs)
        };
        let all = ORIGINS.into_iter().flat_map(|origin| SOLVERS.map(|solver| (origin, solver)));
        csv(
            "inputs,guesses,solver,most_iterations,trials,reached_true,reached_other,reached_closest,solved_by_both,\
             iterations_median,iterations_p90,evaluations_median,newton_iterations_median,newton_iterations_p90,\
             newton_evaluations_median",
            all.flat_map(|(origin, solver)| CAPS.map(|cap| row((origin, solver, cap)))),
        )
    }

    /// Distribution of iterations from guesses anywhere above the base.
    pub(crate) fn iterations_table(&self) -> String {
        let rows = SOLVERS.into_iter().flat_map(|solver| {
            let mut taken = BTreeMap::new();
            for reached in self.reached(solver, ANYWHERE, MAX_ITERATIONS).flatten() {
                *taken.entry(reached.found.iterations).or_insert(0) += 1;
            }
            taken.into_iter().map(move |(iterations, trials)| (solver.name, iterations, trials))
        });
        csv("solver,iterations,trials", rows)
    }

    /// Trials above the base in which only one of the two reaches a solution:
    /// the paper's solver alone, Newton–Raphson alone.
    pub(crate) fn alone(&self) -> [usize; 2] {
        [[true, false], [false, true]].map(|wanted| {
            let solved =
                |trial: &&Trial| [PUBLISHED, NEWTON].map(|solver| trial.by(solver).is_ok()) == wanted;
            self.with(ANYWHERE).iter().filter(solved).count()
        })
    }
}

fn reached(mechanism: &Mechanism, input: &SolutionSet, guess_rad: &[f64; LEGS], found: Found) -> Reached {
    let from_guess = |theta_rad: &[f64; LEGS]| distance_rad(theta_rad, guess_rad);
    let least = input.solutions.iter().map(|one| from_guess(&one.theta_rad)).fold(f64::INFINITY, f64::min);
    Reached {
        found,
        is_true: Assembly::new(mechanism, &input.actuators, &found.theta_rad).is_true(),
        is_closest: from_guess(&found.theta_rad) <= least + TIE_RAD,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guesses_stay_within_their_range() {
        let mut random = generator(1, Stream::Trials, 0);
        let truth = [1.4, 1.5, 1.6];
        for (_, guesses) in ORIGINS {
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
