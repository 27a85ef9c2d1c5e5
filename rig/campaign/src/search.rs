//! Search for the smallest margin: points of the unit cube whose values are evaluated, by CMA-ES or at random.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use nalgebra::DVector;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use crate::covariance::Generations;

/// First step of CMA-ES, as a share of each range.
const STEP: f64 = 0.3;
/// The value of a point that says nothing, above every margin: CMA-ES only ranks values.
const NOTHING: f64 = 1e9;

/// How the next points are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// By the covariance of the best points so far (Hansen, 2016). It begins again elsewhere where it has converged.
    CmaEs,
    /// Independently: the baseline of every other method.
    Random,
}

/// A search over the unit cube.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Search {
    /// How the next points are chosen.
    pub method: Method,
    /// Factors.
    pub dimension: usize,
    /// The most evaluations.
    pub runs: usize,
    /// The seed of the points.
    pub seed: u64,
    /// Whether the search goes on after a value below zero.
    pub goes_on: bool,
}

impl Search {
    /// Evaluates points until the runs are spent, or a value lies below zero. `evaluate` gets the number of the evaluation and
    /// the point; it returns none where the point says nothing, and is called on all cores at once. Returns the number of
    /// evaluations up to the first value below zero, if there is one.
    pub fn run(&self, evaluate: impl Fn(usize, &[f64]) -> Value + Sync) -> Option<usize> {
        let watch = Watch {
            search: self,
            next: AtomicUsize::new(0),
            is_over: AtomicBool::new(false),
            found: Mutex::new(None),
        };
        let evaluate = |point: &[f64]| watch.evaluate(point, &evaluate);
        match self.method {
            Method::Random => self.at_random(&watch, &evaluate),
            Method::CmaEs => self.by_covariance(&watch, &evaluate),
        }
        watch.found.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    fn at_random(&self, watch: &Watch<'_>, evaluate: &(impl Fn(&[f64]) -> f64 + Sync)) {
        let mut random = Pcg64::seed_from_u64(self.seed);
        while !watch.is_over() {
            let batch: Vec<Vec<f64>> = (0..rayon::current_num_threads())
                .map(|_| (0..self.dimension).map(|_| random.random()).collect())
                .collect();
            batch.par_iter().for_each(|point| {
                evaluate(point);
            });
        }
    }

    fn by_covariance(&self, watch: &Watch<'_>, evaluate: &(impl Fn(&[f64]) -> f64 + Sync)) {
        let mut random = Pcg64::seed_from_u64(self.seed);
        let mut start = vec![0.5; self.dimension];
        while !watch.is_over() {
            let mut generations = Generations::new(start, STEP);
            while !watch.is_over() && !generations.has_converged() {
                let points = generations.points(&mut random);
                let value = |point: &DVector<f64>| {
                    let inside: Vec<_> = point.iter().map(|x| reflected(*x)).collect();
                    evaluate(&inside)
                };
                let valued = points.into_par_iter().map(|point| (value(&point), point)).collect();
                generations.learn(valued);
            }
            start = (0..self.dimension).map(|_| random.random()).collect();
        }
    }
}

/// What an evaluation gives: a value, nothing, or the end of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// The margin.
    Margin(f64),
    /// The point says nothing, as one whose fault never struck.
    Nothing,
    /// The user ends the search.
    End,
}

/// Counts the evaluations, and sees when the search is over.
struct Watch<'a> {
    search: &'a Search,
    next: AtomicUsize,
    is_over: AtomicBool,
    found: Mutex<Option<usize>>,
}

impl Watch<'_> {
    fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed) || self.next.load(Ordering::Relaxed) >= self.search.runs
    }

    fn evaluate(&self, point: &[f64], evaluate: &impl Fn(usize, &[f64]) -> Value) -> f64 {
        if self.is_over() {
            return NOTHING;
        }
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        if number >= self.search.runs {
            return NOTHING;
        }
        match evaluate(number, point) {
            Value::End => {
                self.is_over.store(true, Ordering::Relaxed);
                NOTHING
            }
            Value::Nothing => NOTHING,
            Value::Margin(margin) => {
                if margin < 0.0 {
                    let mut found = self.found.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
                    *found = Some(found.map_or(number + 1, |first: usize| first.min(number + 1)));
                    self.is_over.fetch_or(!self.search.goes_on, Ordering::Relaxed);
                }
                margin
            }
        }
    }
}

/// A number folded into \[0, 1) at the ends.
fn reflected(x: f64) -> f64 {
    let folded = x.rem_euclid(2.0);
    let inside = if folded < 1.0 { folded } else { 2.0 - folded };
    inside.min(1.0 - f64::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Below zero only in a corner of four factors: 0.15⁴, one point in 2000.
    fn corner(point: &[f64]) -> f64 {
        point.iter().map(|u| (u - 0.9).abs()).fold(0.0, f64::max) - 0.075
    }

    fn search(method: Method, seed: u64) -> Search {
        Search { method, dimension: 4, runs: 20_000, seed, goes_on: false }
    }

    fn median_runs(method: Method) -> usize {
        let find =
            |seed| search(method, seed).run(|_, point| Value::Margin(corner(point))).unwrap_or(usize::MAX);
        let mut runs: Vec<_> = (1..=20).map(find).collect();
        runs.sort_unstable();
        runs[10]
    }

    #[test]
    fn cma_es_finds_a_corner_in_a_fifth_of_the_random_runs() {
        let [by_covariance, at_random] = [Method::CmaEs, Method::Random].map(median_runs);
        assert!(by_covariance * 5 <= at_random, "{by_covariance} against {at_random}");
    }

    #[test]
    fn a_search_spends_its_runs_and_no_more() {
        for method in [Method::CmaEs, Method::Random] {
            let count = AtomicUsize::new(0);
            let limited = Search { runs: 37, ..search(method, 1) };
            let found = limited.run(|_, point| {
                count.fetch_add(1, Ordering::Relaxed);
                assert!(point.iter().all(|u| (0.0..1.0).contains(u)));
                Value::Margin(1.0)
            });
            assert_eq!((found, count.into_inner()), (None, 37));
        }
    }

    #[test]
    fn what_says_nothing_is_no_finding() {
        let found = Search { runs: 50, ..search(Method::CmaEs, 1) }.run(|_, _| Value::Nothing);
        assert_eq!(found, None);
    }

    #[test]
    fn a_number_is_folded_at_the_ends() {
        for (x, inside) in [(0.25, 0.25), (1.25, 0.75), (-0.25, 0.25), (2.25, 0.25)] {
            assert!((reflected(x) - inside).abs() < 1e-12);
        }
    }
}
