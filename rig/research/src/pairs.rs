//! Figs. 3 and 4 of the paper: single guesses from which the two iterations behave differently.

use masseter_model::geometry::Mechanism;
use rayon::prelude::*;

use self::Course::{Converges, Diverges, Fails, Oscillates};
use crate::solver::{NEWTON, PUBLISHED, Start};
use crate::tables::{csv, degrees, number};
use crate::trials::{ANYWHERE, Trial, Trials};

/// Errors in which a cycle is looked for, the last ones of a trace.
const TAIL: usize = 40;
/// Longest cycle.
const LONGEST_PERIOD: usize = 8;
/// How well a cycle repeats, as a share of the error.
const REPEATS_WITHIN: f64 = 1e-3;
/// Iterations within which the error must fall to look like convergence, and the share that is left then.
const AT_FIRST: usize = 3;
const FALLEN_TO: f64 = 0.5;
/// Factor by which the error must rise again.
const RISEN_BY: f64 = 10.0;

/// How an iteration ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Course {
    /// It reaches a solution.
    Converges,
    /// It repeats the same errors for ever.
    Oscillates,
    /// Its error falls at first, then rises, and it reaches no solution.
    Diverges,
    /// Neither.
    Fails,
}

/// The errors (eq. 2) of the guess and after every iteration.
#[derive(Debug, Clone)]
struct Trace {
    errors_cm2: Vec<f64>,
    course: Course,
}

/// A guess with the traces of the paper's solver and of Newton–Raphson.
#[derive(Debug, Clone)]
struct Pair {
    start: Start,
    traces: [Trace; 2],
}

/// A way in which the two iterations disagree.
#[derive(Debug, Clone)]
pub(crate) struct Disagreement {
    /// Its table and its figure.
    pub name: &'static str,
    /// The guess that shows it most clearly, if any shows it.
    clearest: Option<Pair>,
    /// How many guesses show it.
    trials: usize,
}

/// Fig. 3: the paper's converges, Newton–Raphson falls at first and then diverges. Fig. 4: the paper's converges,
/// Newton–Raphson oscillates. Not in the paper: Newton–Raphson converges, the paper's stalls.
pub(crate) fn disagreements(mechanism: &Mechanism, trials: &Trials) -> [Disagreement; 3] {
    let trials = trials.with(ANYWHERE).par_iter();
    let pairs: Vec<_> = trials.map(|trial| Pair::trace(mechanism, trial)).collect();
    let disagreement = |name, courses: [Course; 2], clearness: fn(&[f64]) -> f64| {
        let courses_of = |pair: &Pair| pair.traces.each_ref().map(|trace| trace.course);
        let matching = || pairs.iter().filter(|pair| courses_of(pair) == courses);
        let clearness = |pair: &Pair| clearness(&pair.traces[1].errors_cm2);
        let clearest = matching().max_by(|a, b| clearness(a).total_cmp(&clearness(b))).cloned();
        Disagreement { name, clearest, trials: matching().count() }
    };
    [
        disagreement("fig3_diverging", [Converges, Diverges], fall),
        disagreement("fig4_oscillating", [Converges, Oscillates], swing),
        disagreement("fig3b_stalling", [Fails, Converges], fall),
    ]
}

/// How many trials show each, and in how many only one of the two reaches a solution.
pub(crate) fn disagreements_table(disagreements: &[Disagreement], trials: &Trials) -> String {
    let of = trials.with(ANYWHERE).len();
    let alone = ["published_alone", "newton_alone"].into_iter().zip(trials.alone());
    let all = disagreements.iter().map(|one| (one.name, one.trials)).chain(alone);
    csv("disagreement,trials,of", all.map(|(name, trials)| (name, trials, of)))
}

impl Disagreement {
    /// Without rows where no such pair was found.
    pub(crate) fn table(&self) -> String {
        let mut rows = Vec::new();
        if let Some(Pair { start, traces }) = &self.clearest {
            for (solver, trace) in [PUBLISHED, NEWTON].iter().zip(traces) {
                for (iteration, error) in trace.errors_cm2.iter().enumerate() {
                    let guess = (start.actuators.to_axes().map(number), start.guess_rad.map(degrees));
                    rows.push((solver.name, iteration, number(*error), guess));
                }
            }
        }
        csv("solver,iteration,error_cm2,d1_m,d2_m,d3_m,l1_m,l2_m,l3_m,guess1_deg,guess2_deg,guess3_deg", rows)
    }
}

impl Pair {
    fn trace(mechanism: &Mechanism, trial: &Trial) -> Self {
        let traces = [PUBLISHED, NEWTON].map(|solver| {
            let errors_cm2 = solver.errors_cm2(mechanism, &trial.start);
            Trace { course: course(&errors_cm2, trial.by(solver).is_ok()), errors_cm2 }
        });
        Self { start: trial.start, traces }
    }
}

/// Judges a trace of errors, the guess's first.
fn course(errors: &[f64], solved: bool) -> Course {
    if solved {
        Converges
    } else if is_cyclic(errors) {
        Oscillates
    } else if rises_after_falling(errors) {
        Diverges
    } else {
        Fails
    }
}

/// Whether the last errors repeat with a period of at least two iterations.
fn is_cyclic(errors: &[f64]) -> bool {
    let Some(tail) = errors.len().checked_sub(TAIL).map(|from| &errors[from..]) else { return false };
    let same = |a: f64, b: f64| (a - b).abs() <= REPEATS_WITHIN * a.abs().max(b.abs());
    let repeats = |period: usize| tail.iter().zip(&tail[period..]).all(|(&a, &b)| same(a, b));
    !repeats(1) && (2..=LONGEST_PERIOD).any(repeats)
}

/// How much the error falls at first: the figure shows the guess at which it falls most.
fn fall(errors: &[f64]) -> f64 {
    let least = errors.iter().take(AT_FIRST + 1).copied().fold(f64::INFINITY, f64::min);
    errors.first().map_or(0.0, |guess| guess / least)
}

/// Greatest over least error of the cycle at the end: the figure shows the guess with the widest.
fn swing(errors: &[f64]) -> f64 {
    let tail = &errors[errors.len().saturating_sub(TAIL)..];
    let extreme = |pick: fn(f64, f64) -> f64| tail.iter().copied().reduce(pick).unwrap_or(1.0);
    extreme(f64::max) / extreme(f64::min)
}

fn rises_after_falling(errors: &[f64]) -> bool {
    let Some((&guess, _)) = errors.split_first() else { return false };
    let seeming = errors.iter().take(AT_FIRST + 1).enumerate().min_by(|a, b| a.1.total_cmp(b.1));
    seeming.is_some_and(|(at, &least)| {
        least <= FALLEN_TO * guess && errors[at..].iter().any(|&error| error >= RISEN_BY * least)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn endless(formula: impl Fn(usize) -> f64) -> Vec<f64> {
        (0..=100).map(formula).collect()
    }

    #[test]
    fn courses_are_distinguished() {
        let cycle = endless(|n| if n < 10 { 100.0 - n as f64 } else { [3.0, 5.0, 9.0][n % 3] });
        let away = endless(|n| if n < 3 { 10f64.powi(-(n as i32)) } else { 5.0 + (n as f64).sin() });
        let standing = endless(|_| 2.0);
        let wild = endless(|n| 3.0 + (n as f64 * n as f64).sin());
        assert_eq!(course(&cycle, false), Course::Oscillates);
        assert_eq!(course(&away, false), Course::Diverges);
        assert_eq!(course(&standing, false), Course::Fails);
        assert_eq!(course(&wild, false), Course::Fails);
        assert_eq!(course(&[1.0, 1e-25], true), Course::Converges);
        assert_eq!(course(&[], false), Course::Fails);
    }
}
