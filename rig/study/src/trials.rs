//! Random guesses for random feasible inputs: who arrives, where, and after how many iterations.

use masseter_controller::kinematics::Assembly;
use masseter_shared::geometry::{Actuators, LEGS, Mechanism};
use rayon::prelude::*;

use super::sample::{self, GUESSES, Guesses, Stream, distance_rad};
use super::share::{Share, median, quantile};
use super::solver::{Attempt, NEWTON, PUBLISHED, SOLVERS, Solver};
use super::table::{Table, number};

/// A root counts as the closest when no other is closer by more than this, radians.
const TIE_RAD: f64 = 1e-6;

/// Where an attempt ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reached {
    /// The true solution.
    True,
    /// A solution in which the mechanism cannot stand.
    Other,
    /// None, for this reason.
    Nothing(&'static str),
}

/// An attempt, judged against all solutions of its input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Judged {
    pub attempt: Attempt,
    pub reached: Reached,
    /// Whether no other solution is closer to the guess.
    pub closest: bool,
}

impl Judged {
    pub(super) fn is_solved(&self) -> bool {
        !matches!(self.reached, Reached::Nothing(_))
    }
}

/// One guess for one input, given to every solver.
#[derive(Debug, Clone)]
pub(super) struct Trial {
    pub actuators: Actuators,
    pub guess_rad: [f64; LEGS],
    /// In the order of [`SOLVERS`].
    pub judged: [Judged; SOLVERS.len()],
}

impl Trial {
    /// How one solver fared.
    pub(super) fn by(&self, solver: Solver) -> &Judged {
        let place = SOLVERS.iter().position(|&other| other == solver);
        &self.judged[place.expect("every solver takes part")]
    }
}

/// All trials: `samples` for each of [`GUESSES`].
#[derive(Debug, Clone)]
pub(super) struct Trials {
    sets: Vec<Vec<Trial>>,
}

impl Trials {
    pub(super) fn run(mechanism: &Mechanism, samples: usize, seed: u64) -> Self {
        let trial = |guesses: Guesses, case| {
            let mut random = sample::generator(seed, Stream::Trials, case);
            let input = sample::feasible(mechanism, &mut random);
            let guess_rad = guesses.draw(&input.true_one.theta_rad, &mut random);
            let judged = SOLVERS.map(|solver| {
                let attempt = solver.attempt(mechanism, &input.actuators, &guess_rad);
                judge(mechanism, &input, &guess_rad, attempt)
            });
            Trial { actuators: input.actuators, guess_rad, judged }
        };
        let set = |guesses| (0..samples).into_par_iter().map(|case| trial(guesses, case)).collect();
        Self { sets: GUESSES.into_iter().map(set).collect() }
    }

    /// The trials with guesses from there.
    ///
    /// # Panics
    /// Where there are none from there: where [`GUESSES`] lacks it.
    pub(super) fn with(&self, guesses: Guesses) -> &[Trial] {
        let set = GUESSES.iter().position(|&set| set == guesses);
        &self.sets[set.expect("guesses are drawn from there")]
    }

    /// How one solver fared with guesses from there.
    pub(super) fn attempts(&self, solver: Solver, guesses: Guesses) -> impl Iterator<Item = &Judged> {
        self.with(guesses).iter().map(move |trial| trial.by(solver))
    }

    /// How often any solution was reached.
    pub(super) fn solved(&self, solver: Solver, guesses: Guesses) -> Share {
        Share::count(self.attempts(solver, guesses).map(Judged::is_solved))
    }

    /// How often the true solution was reached.
    pub(super) fn true_ones(&self, solver: Solver, guesses: Guesses) -> Share {
        Share::count(self.attempts(solver, guesses).map(|judged| judged.reached == Reached::True))
    }

    /// Of what was reached, how often it was the solution closest to the guess.
    pub(super) fn closest(&self, solver: Solver, guesses: Guesses) -> Share {
        let solved = self.attempts(solver, guesses).filter(|judged| judged.is_solved());
        Share::count(solved.map(|judged| judged.closest))
    }

    /// A solver's iterations and Newton–Raphson's (same residual) where both arrive.
    pub(super) fn against_newton(&self, solver: Solver, guesses: Guesses) -> Vec<[Attempt; 2]> {
        let rival = match solver {
            Solver::Published(residual, _) => Solver::Newton(residual),
            Solver::Newton(_) | Solver::Controller => NEWTON,
        };
        let both = self.attempts(solver, guesses).zip(self.attempts(rival, guesses));
        both.filter(|(a, b)| a.is_solved() && b.is_solved()).map(|(a, b)| [a.attempt, b.attempt]).collect()
    }

    /// Success rates, one row for each solver and origin of guesses.
    pub(super) fn success_table(&self) -> Table {
        let header = [
            "guesses",
            "solver",
            "trials",
            "reached_true",
            "reached_other",
            "stalled",
            "singular",
            "no_convergence",
            "refused",
            "reached_closest",
        ];
        let mut rows = Vec::new();
        for guesses in GUESSES {
            for solver in SOLVERS {
                let count = |wanted: &dyn Fn(&Judged) -> bool| {
                    self.attempts(solver, guesses).filter(|judged| wanted(judged)).count()
                };
                let failed = |reason| count(&|judged| judged.reached == Reached::Nothing(reason));
                let [reached_true, other] =
                    [Reached::True, Reached::Other].map(|reached| count(&|judged| judged.reached == reached));
                let known = ["stalled", "singular", "no_convergence"].map(failed);
                let trials = self.with(guesses).len();
                let refused = trials - reached_true - other - known.iter().sum::<usize>();
                let [stalled, singular, unconverged] = known;
                let closest = count(&|judged| judged.is_solved() && judged.closest);
                let counts = [trials, reached_true, other, stalled, singular, unconverged, refused, closest];
                let names = [guesses.name(), solver.name()];
                rows.push(names.into_iter().chain(counts.map(|count| count.to_string())).collect());
            }
        }
        Table::new("success", &header, rows)
    }

    /// Distribution of iterations from guesses anywhere above the base.
    pub(super) fn iterations_table(&self) -> Table {
        let header = ["solver", "iterations", "trials"];
        let mut rows = Vec::new();
        for solver in SOLVERS {
            for (iterations, count) in self.histogram(solver).into_iter().enumerate() {
                rows.push(vec![solver.name(), iterations.to_string(), count.to_string()]);
            }
        }
        Table::new("iterations", &header, rows)
    }

    /// How many solved trials took 0, 1, 2 … iterations, from guesses anywhere above the base.
    pub(super) fn histogram(&self, solver: Solver) -> Vec<usize> {
        let mut counts = Vec::new();
        for judged in self.attempts(solver, Guesses::AboveBase).filter(|judged| judged.is_solved()) {
            let iterations = judged.attempt.iterations as usize;
            if counts.len() <= iterations {
                counts.resize(iterations + 1, 0);
            }
            counts[iterations] += 1;
        }
        counts
    }

    /// What the paper's variants and Newton–Raphson cost where both arrive.
    pub(super) fn cost_table(&self) -> Table {
        let header = [
            "guesses",
            "solver",
            "solved_by_both",
            "iterations_median",
            "iterations_p90",
            "evaluations_median",
            "newton_iterations_median",
            "newton_iterations_p90",
            "newton_evaluations_median",
        ];
        let mut rows = Vec::new();
        for guesses in GUESSES {
            for solver in SOLVERS.into_iter().filter(|one| matches!(one, Solver::Published(..))) {
                let both = self.against_newton(solver, guesses);
                let iterations = |side: usize| both.iter().map(move |pair| f64::from(pair[side].iterations));
                let evaluations =
                    |side: usize| both.iter().map(move |pair| f64::from(pair[side].evaluations));
                let mut row = vec![guesses.name(), solver.name(), both.len().to_string()];
                for side in 0..2 {
                    row.push(number(median(iterations(side).collect())));
                    row.push(number(quantile(iterations(side).collect(), 0.9)));
                    row.push(number(median(evaluations(side).collect())));
                }
                rows.push(row);
            }
        }
        Table::new("cost", &header, rows)
    }

    /// Trials above the base in which one of the two arrives and the other does not:
    /// the paper's solver alone, Newton–Raphson alone.
    pub(super) fn alone(&self) -> [Share; 2] {
        let both = || {
            let newton = self.attempts(NEWTON, Guesses::AboveBase);
            self.attempts(PUBLISHED, Guesses::AboveBase)
                .zip(newton)
                .map(|(a, b)| (a.is_solved(), b.is_solved()))
        };
        [
            Share::count(both().map(|(published, newton)| published && !newton)),
            Share::count(both().map(|(a, b)| b && !a)),
        ]
    }
}

fn judge(
    mechanism: &Mechanism,
    input: &sample::Feasible,
    guess_rad: &[f64; LEGS],
    attempt: Attempt,
) -> Judged {
    let found_rad = match attempt.found_rad {
        Ok(found_rad) => found_rad,
        Err(reason) => return Judged { attempt, reached: Reached::Nothing(reason), closest: false },
    };
    let is_true = Assembly::new(mechanism, &input.actuators, &found_rad).is_true();
    let from_guess = |theta_rad: &[f64; LEGS]| distance_rad(theta_rad, guess_rad);
    let least = input.solutions.iter().map(|one| from_guess(&one.theta_rad)).fold(f64::INFINITY, f64::min);
    Judged {
        attempt,
        reached: if is_true { Reached::True } else { Reached::Other },
        closest: from_guess(&found_rad) <= least + TIE_RAD,
    }
}
