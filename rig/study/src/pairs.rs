//! Figs. 3 and 4 of the paper: single guesses from which the two iterations go different ways.

use masseter_shared::geometry::{Actuators, LEGS, Mechanism};
use rayon::prelude::*;

use super::sample::Guesses;
use super::share::Share;
use super::solver::{NEWTON, PUBLISHED, Solver};
use super::table::{Table, degrees, number};
use super::trials::{Trial, Trials};

/// Errors in which a cycle is looked for, the last ones of a trace.
const TAIL: usize = 40;
/// Longest cycle.
const LONGEST_PERIOD: usize = 8;
/// How well a cycle repeats, as a share of the error.
const REPEATS_WITHIN: f64 = 1e-3;
/// Iterations within which the error has to fall to look like convergence, and what is left of it.
const AT_FIRST: usize = 3;
const FALLEN_TO: f64 = 0.5;
/// How far it has to rise again afterwards, over what it had fallen to.
const RISEN_BY: f64 = 10.0;

/// What one trace of errors does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Course {
    /// It arrives.
    Converges,
    /// It repeats the same errors for ever.
    Oscillates,
    /// It falls at first, then rises, and never arrives.
    Diverges,
    /// Neither.
    Fails,
}

/// A guess with both traces.
#[derive(Debug, Clone)]
pub(super) struct Pair {
    pub actuators: Actuators,
    pub guess_rad: [f64; LEGS],
    pub published_cm2: Vec<f64>,
    pub newton_cm2: Vec<f64>,
}

/// A way in which the two iterations part.
#[derive(Debug, Clone)]
pub(super) struct Disagreement {
    /// Its table and its figure.
    pub name: &'static str,
    pub title: &'static str,
    /// What Newton–Raphson does.
    pub newton: Course,
    /// The guess that shows it most clearly, if any shows it.
    pub clearest: Option<Pair>,
    /// How often it happens.
    pub share: Share,
}

/// What was found among the guesses above the base.
#[derive(Debug, Clone)]
pub(super) struct Pairs {
    /// Fig. 3: the paper's converges, Newton–Raphson falls at first and then diverges.
    pub diverging: Disagreement,
    /// Fig. 4: the paper's converges, Newton–Raphson oscillates.
    pub oscillating: Disagreement,
    /// Not in the paper: Newton–Raphson converges, the paper's stalls.
    pub stalling: Disagreement,
}

impl Pairs {
    pub(super) fn find(mechanism: &Mechanism, trials: &Trials) -> Self {
        let traced: Vec<_> = trials
            .with(Guesses::AboveBase)
            .par_iter()
            .map(|trial| {
                let pair = Pair::trace(mechanism, trial);
                let solved = |solver| trial.by(solver).is_solved();
                let courses = [
                    course(&pair.published_cm2, solved(PUBLISHED)),
                    course(&pair.newton_cm2, solved(NEWTON)),
                ];
                (courses, pair)
            })
            .collect();
        let disagreement = |name, title, wanted: [Course; 2], clearness: fn(&[f64]) -> f64| {
            let matching = || traced.iter().filter(|(courses, _)| *courses == wanted).map(|(_, pair)| pair);
            let clearness = |pair: &Pair| clearness(&pair.newton_cm2);
            let clearest = matching().max_by(|a, b| clearness(a).total_cmp(&clearness(b)));
            let share = Share { hits: matching().count(), of: traced.len() };
            Disagreement { name, title, newton: wanted[1], clearest: clearest.cloned(), share }
        };
        Self {
            diverging: disagreement(
                "fig3_diverging",
                "Fig. 3: Newton–Raphson diverges",
                [Course::Converges, Course::Diverges],
                fall,
            ),
            oscillating: disagreement(
                "fig4_oscillating",
                "Fig. 4: Newton–Raphson oscillates",
                [Course::Converges, Course::Oscillates],
                swing,
            ),
            stalling: disagreement(
                "fig3b_stalling",
                "Beside Fig. 3: the paper's solver stalls",
                [Course::Fails, Course::Converges],
                fall,
            ),
        }
    }

    /// In the order of their figures.
    pub(super) fn all(&self) -> [&Disagreement; 3] {
        [&self.diverging, &self.oscillating, &self.stalling]
    }

    /// One table a figure; without rows where no such pair was found.
    pub(super) fn tables(&self) -> Vec<Table> {
        let header = [
            "solver",
            "iteration",
            "error_cm2",
            "d1_m",
            "d2_m",
            "d3_m",
            "l1_m",
            "l2_m",
            "l3_m",
            "guess1_deg",
            "guess2_deg",
            "guess3_deg",
        ];
        let table = |disagreement: &Disagreement| {
            let rows = disagreement.clearest.as_ref().map(Pair::rows).unwrap_or_default();
            Table::new(disagreement.name, &header, rows)
        };
        self.all().map(table).into()
    }
}

impl Pair {
    fn trace(mechanism: &Mechanism, trial: &Trial) -> Self {
        let Trial { actuators, guess_rad, .. } = *trial;
        let errors = |solver: Solver| solver.errors_cm2(mechanism, &actuators, &guess_rad);
        Self { actuators, guess_rad, published_cm2: errors(PUBLISHED), newton_cm2: errors(NEWTON) }
    }

    fn rows(&self) -> Vec<Vec<String>> {
        let mut rows = Vec::new();
        for (solver, errors) in [(PUBLISHED, &self.published_cm2), (NEWTON, &self.newton_cm2)] {
            for (iteration, &error) in errors.iter().enumerate() {
                let mut row = vec![solver.short_name().to_owned(), iteration.to_string(), number(error)];
                row.extend(self.actuators.to_axes().map(number));
                row.extend(degrees(&self.guess_rad));
                rows.push(row);
            }
        }
        rows
    }
}

/// Judges a trace of errors, the guess's first.
fn course(errors: &[f64], solved: bool) -> Course {
    if solved {
        Course::Converges
    } else if is_cyclic(errors) {
        Course::Oscillates
    } else if rises_after_falling(errors) {
        Course::Diverges
    } else {
        Course::Fails
    }
}

/// Whether the last errors repeat with some period; a standstill is no cycle.
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
    fn courses_are_told_apart() {
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
