//! Random guesses for random feasible inputs: which solver reaches which solution after how many iterations.
//!
//! Each case draws from a generator of its own, so that the order in which cores take them changes nothing.

use std::f64::consts::PI;

use masseter_controller::kinematics::Assembly;
use masseter_model::geometry::{LEGS, Mechanism};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use self::Guesses::{AboveBase, Within};
use crate::solutions::{SolutionSet, Stream, generator};
use crate::solver::{Found, NEWTON, PUBLISHED, SOLVERS, Solver, Start, distance_rad};
use crate::tables::{csv, number, quantile};

/// A root counts as the closest when no other is closer by more than this, radians.
const TIE_RAD: f64 = 1e-6;

/// Where guesses come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Guesses {
    /// Every leg within so many degrees of the true angle.
    Within(f64),
    /// Every leg anywhere above the base.
    AboveBase,
}

/// The origins of the trials' guesses, nearest first.
pub(crate) const GUESSES: [Guesses; 8] = [
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

/// All trials: `samples` for each of [`GUESSES`].
#[derive(Debug, Clone)]
pub(crate) struct Trials {
    sets: Vec<Vec<Trial>>,
}

impl Trials {
    pub(crate) fn run(mechanism: &Mechanism, samples: usize, seed: u64) -> Self {
        let trial = |guesses: Guesses, case| {
            let mut random = generator(seed, Stream::Trials, case);
            let input = SolutionSet::feasible(mechanism, &mut random);
            let guess_rad = guesses.draw(&input.true_one.theta_rad, &mut random);
            let start = Start { actuators: input.actuators, guess_rad };
            let outcomes = SOLVERS.map(|solver| {
                let found = solver.attempt(mechanism, &start)?;
                Ok(reached(mechanism, &input, &guess_rad, found))
            });
            Trial { start, outcomes }
        };
        let set = |guesses| (0..samples).into_par_iter().map(|case| trial(guesses, case)).collect();
        Self { sets: GUESSES.into_iter().map(set).collect() }
    }

    /// The trials with guesses from this origin.
    ///
    /// # Panics
    /// When [`GUESSES`] lacks the origin.
    pub(crate) fn with(&self, guesses: Guesses) -> &[Trial] {
        let set = GUESSES.iter().position(|&set| set == guesses);
        &self.sets[set.expect("guesses are drawn from there")]
    }

    /// The outcomes of one solver with guesses from this origin.
    fn outcomes(&self, solver: Solver, guesses: Guesses) -> impl Iterator<Item = TrialResult> {
        self.with(guesses).iter().map(move |trial| trial.by(solver))
    }

    /// What a solver and Newton–Raphson (same residual) find where both reach a solution.
    fn against_newton(&self, solver: Solver, guesses: Guesses) -> Vec<[Found; 2]> {
        let both = self.outcomes(solver, guesses).zip(self.outcomes(solver.rival(), guesses));
        both.filter_map(|(a, b)| Some([a.ok()?.found, b.ok()?.found])).collect()
    }

    /// Success rates, one row for each solver and origin of guesses.
    pub(crate) fn success_table(&self) -> String {
        let row = |(guesses, solver): (Guesses, Solver)| {
            let reached =
                |is: fn(&Reached) -> bool| self.outcomes(solver, guesses).flatten().filter(is).count();
            let failed = |end: &str| self.outcomes(solver, guesses).filter(|one| *one == Err(end)).count();
            let (trials, solved, is_true) =
                (self.with(guesses).len(), reached(|_| true), reached(|one| one.is_true));
            let known = ["stalled", "singular", "no_convergence"].map(failed);
            let refused = trials - solved - known.iter().sum::<usize>();
            let closest = reached(|one| one.is_closest);
            (guesses.name(), solver.name, trials, [is_true, solved - is_true], known, refused, closest)
        };
        csv(
            "guesses,solver,trials,reached_true,reached_other,stalled,singular,no_convergence,refused,reached_closest",
            every_combination().map(row),
        )
    }

    /// Distribution of iterations from guesses anywhere above the base.
    pub(crate) fn iterations_table(&self) -> String {
        let rows = SOLVERS.into_iter().flat_map(|solver| {
            let reached = self.outcomes(solver, AboveBase).flatten();
            let taken: Vec<_> = reached.map(|reached| reached.found.iterations).collect();
            let end = taken.iter().max().map_or(0, |most| most + 1);
            (0..end).map(move |iterations| {
                (solver.name, iterations, taken.iter().filter(|&&one| one == iterations).count())
            })
        });
        csv("solver,iterations,trials", rows)
    }

    /// Iterations of the paper's variants and of Newton–Raphson where both reach a solution.
    pub(crate) fn cost_table(&self) -> String {
        let row = |(guesses, solver): (Guesses, Solver)| {
            let both = self.against_newton(solver, guesses);
            let costs = [0, 1].map(|side| {
                let iterations = || both.iter().map(|pair| f64::from(pair[side].iterations));
                let evaluations = both.iter().map(|pair| f64::from(pair[side].evaluations));
                [quantile(iterations(), 0.5), quantile(iterations(), 0.9), quantile(evaluations, 0.5)]
                    .map(number)
            });
            (guesses.name(), solver.name, both.len(), costs)
        };
        csv(
            "guesses,solver,solved_by_both,iterations_median,iterations_p90,evaluations_median,\
             newton_iterations_median,newton_iterations_p90,newton_evaluations_median",
            every_combination().filter(|(_, solver)| solver.is_published()).map(row),
        )
    }

    /// Trials above the base in which only one of the two reaches a solution:
    /// the paper's solver alone, Newton–Raphson alone.
    pub(crate) fn alone(&self) -> [usize; 2] {
        [[true, false], [false, true]].map(|wanted| {
            let solved =
                |trial: &&Trial| [PUBLISHED, NEWTON].map(|solver| trial.by(solver).is_ok()) == wanted;
            self.with(AboveBase).iter().filter(solved).count()
        })
    }
}

fn every_combination() -> impl Iterator<Item = (Guesses, Solver)> {
    GUESSES.into_iter().flat_map(|guesses| SOLVERS.map(|solver| (guesses, solver)))
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
