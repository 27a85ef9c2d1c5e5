//! Search for the smallest margin: points of the unit cube whose values are evaluated, by CMA-ES or at random.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// First step of CMA-ES, as a share of each range.
const STEP: f64 = 0.3;
/// The value of a point that says nothing, above every margin: CMA-ES only ranks values.
const NOTHING: f64 = 1e9;
/// Steps below this size change nothing that matters.
const SMALLEST: f64 = 1e-10;
/// Below this share of the largest axis, an axis of the distribution is rounding: a condition of 10¹⁴.
const NARROWEST: f64 = 1e-7;

/// How the next points are chosen.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Method {
    /// By the covariance of the best values so far
    // Hansen, 2016. It begins again elsewhere where it has converged.
    #[default]
    CmaEs,
    /// At random
    // The baseline of every other method.
    Random,
}

/// A search over the unit cube.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::Args)]
pub struct Search {
    /// The most runs
    #[arg(long, value_name = "N", default_value_t = 500)]
    pub runs: usize,
    /// How the next values are chosen
    #[arg(long, value_enum, default_value_t)]
    pub method: Method,
    /// Seed of the chosen values
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Go on after the first margin below zero
    #[arg(long)]
    pub go_on: bool,
}

impl Search {
    /// Evaluates points in so many dimensions until the runs are spent, or a value lies below zero. `evaluate` gets the
    /// number of the evaluation and the point, and is called on all cores at once. Returns the number of evaluations up to
    /// the first value below zero, if there is one.
    pub fn run(&self, dimension: usize, evaluate: impl Fn(usize, &[f64]) -> Value + Sync) -> Option<usize> {
        let (next, first) = (AtomicUsize::new(0), AtomicUsize::new(usize::MAX));
        let has_ended = AtomicBool::new(false);
        let is_over = || has_ended.load(Relaxed) || next.load(Relaxed) >= self.runs;
        let value = |point: &[f64]| {
            let number = if is_over() { self.runs } else { next.fetch_add(1, Relaxed) };
            if number >= self.runs {
                return NOTHING;
            }
            match evaluate(number, point) {
                Value::Margin(margin) => {
                    if margin < 0.0 {
                        first.fetch_min(number + 1, Relaxed);
                        has_ended.fetch_or(!self.go_on, Relaxed);
                    }
                    return margin;
                }
                Value::Nothing => {}
                Value::End => has_ended.store(true, Relaxed),
            }
            NOTHING
        };
        match self.method {
            Method::Random => self.at_random(dimension, is_over, value),
            Method::CmaEs => self.by_covariance(dimension, is_over, value),
        }
        Some(first.into_inner()).filter(|first| *first < usize::MAX)
    }

    fn at_random(&self, dimension: usize, is_over: impl Fn() -> bool, value: impl Fn(&[f64]) -> f64 + Sync) {
        let mut random = Pcg64::seed_from_u64(self.seed);
        while !is_over() {
            let batch = (0..rayon::current_num_threads()).map(|_| anywhere(dimension, &mut random));
            batch.collect::<Vec<_>>().par_iter().for_each(|point| {
                value(point);
            });
        }
    }

    fn by_covariance(
        &self,
        dimension: usize,
        is_over: impl Fn() -> bool,
        value: impl Fn(&[f64]) -> f64 + Sync,
    ) {
        let mut random = Pcg64::seed_from_u64(self.seed);
        let mut start = vec![0.5; dimension];
        let valued = |point: DVector<f64>| {
            let inside: Vec<_> = point.iter().map(|x| reflected(*x)).collect();
            (value(&inside), point)
        };
        while !is_over() {
            let mut generations = Generations::new(start, STEP);
            while !is_over() && !generations.has_converged {
                let points = generations.points(&mut random);
                generations.learn(points.into_par_iter().map(valued).collect());
            }
            start = anywhere(dimension, &mut random);
        }
    }
}

/// A random point.
fn anywhere(dimension: usize, random: &mut Pcg64) -> Vec<f64> {
    (0..dimension).map(|_| random.random()).collect()
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

/// A number folded into \[0, 1) at the ends.
fn reflected(x: f64) -> f64 {
    let folded = x.rem_euclid(2.0);
    let inside = if folded < 1.0 { folded } else { 2.0 - folded };
    inside.min(1.0 - f64::EPSILON)
}

/// The generations of one start of CMA-ES: points around a mean whose covariance follows the best of the points before
/// (N. Hansen, "The CMA Evolution Strategy: A Tutorial", 2016, with positive weights alone). It evaluates nothing:
/// [`Self::points`] gives the points of a generation, [`Self::learn`] reads their values.
struct Generations {
    weights: Vec<f64>,
    mean: DVector<f64>,
    step: f64,
    covariance: DMatrix<f64>,
    /// Turns and stretches a standard normal vector into the distribution's shape: B D of the covariance B D² Bᵀ.
    axes: DMatrix<f64>,
    /// Undoes the shape but not the turn: B D⁻¹ Bᵀ.
    whitening: DMatrix<f64>,
    step_path: DVector<f64>,
    shape_path: DVector<f64>,
    /// Generations learned.
    count: i32,
    /// Whether further generations tell nothing new.
    has_converged: bool,
    /// Generations in which all values were equal, in a row.
    flat: usize,
}

impl Generations {
    /// A search that begins at `mean` with the same step along every axis.
    fn new(mean: Vec<f64>, step: f64) -> Self {
        let n = mean.len();
        let parents = points_of(n) / 2;
        let raw = |rank: usize| f64::midpoint(points_of(n) as f64, 1.0).ln() - (rank as f64 + 1.0).ln();
        let sum: f64 = (0..parents).map(raw).sum();
        Self {
            weights: (0..parents).map(|rank| raw(rank) / sum).collect(),
            mean: DVector::from_vec(mean),
            step,
            covariance: DMatrix::identity(n, n),
            axes: DMatrix::identity(n, n),
            whitening: DMatrix::identity(n, n),
            step_path: DVector::zeros(n),
            shape_path: DVector::zeros(n),
            count: 0,
            has_converged: false,
            flat: 0,
        }
    }

    /// The points of the next generation.
    fn points(&self, random: &mut Pcg64) -> Vec<DVector<f64>> {
        let n = self.mean.len();
        let point = |_| {
            let normal = DVector::from_fn(n, |_, _| random.sample(rand_distr::StandardNormal));
            &self.mean + &self.axes * normal * self.step
        };
        (0..points_of(n)).map(point).collect()
    }

    /// Moves and shapes the distribution by the values of a generation's points; less is better.
    fn learn(&mut self, mut valued: Vec<(f64, DVector<f64>)>) {
        valued.sort_by(|a, b| a.0.total_cmp(&b.0));
        let is_flat = valued.first().map(|best| best.0) == valued.last().map(|worst| worst.0);
        self.flat = if is_flat { self.flat + 1 } else { 0 };
        let n = self.mean.len() as f64;
        let steps: Vec<_> = valued
            .iter()
            .take(self.weights.len())
            .map(|(_, point)| (point - &self.mean) / self.step)
            .collect();
        let weighted = || self.weights.iter().zip(&steps);
        let moved: DVector<f64> = weighted().map(|(weight, step)| step * *weight).sum();
        let effective = 1.0 / self.weights.iter().map(|weight| weight * weight).sum::<f64>();

        // Rates of learning (Hansen, table 1).
        let of_step = (effective + 2.0) / (n + effective + 5.0);
        let of_shape = (4.0 + effective / n) / (n + 4.0 + 2.0 * effective / n);
        let of_path = 2.0 / ((n + 1.3).powi(2) + effective);
        let of_points = (2.0 * (effective - 2.0 + 1.0 / effective) / ((n + 2.0).powi(2) + effective))
            .min(1.0 - of_path)
            .max(0.0);
        let damping = 1.0 + of_step + 2.0 * (((effective - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0);
        // The length of a standard normal vector.
        let length = n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n));

        self.count += 1;
        self.step_path = &self.step_path * (1.0 - of_step)
            + &self.whitening * &moved * (of_step * (2.0 - of_step) * effective).sqrt();
        let expected = (1.0 - (1.0 - of_step).powi(2 * self.count)).sqrt();
        // A step that grows fast does not shape the distribution.
        let is_steady = self.step_path.norm() / expected < (1.4 + 2.0 / (n + 1.0)) * length;
        let share = if is_steady { (of_shape * (2.0 - of_shape) * effective).sqrt() } else { 0.0 };
        self.shape_path = &self.shape_path * (1.0 - of_shape) + &moved * share;
        let forgotten = if is_steady { 0.0 } else { of_path * of_shape * (2.0 - of_shape) };
        let of_all = weighted().map(|(weight, step)| step * step.transpose() * *weight);
        let of_all = of_all.fold(DMatrix::zeros(steps[0].len(), steps[0].len()), |sum, one| sum + one);
        self.covariance = &self.covariance * (1.0 - of_path - of_points + forgotten)
            + &self.shape_path * self.shape_path.transpose() * of_path
            + of_all * of_points;
        self.mean += moved * self.step;
        self.step *= ((of_step / damping) * (self.step_path.norm() / length - 1.0)).min(1.0).exp();
        self.reshape();
    }

    /// The axes of the covariance.
    fn reshape(&mut self) {
        let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(self.covariance.clone());
        let lengths = eigenvalues.map(|square| square.max(0.0).sqrt());
        let (least, most) = (lengths.min(), lengths.max());
        let flat = 10 + 30 * self.mean.len() / points_of(self.mean.len());
        self.has_converged = !(self.step * most).is_finite()
            || self.step * most < SMALLEST
            || least <= NARROWEST * most
            || self.flat > flat;
        if !self.has_converged {
            self.axes = &eigenvectors * DMatrix::from_diagonal(&lengths);
            self.whitening = &eigenvectors
                * DMatrix::from_diagonal(&lengths.map(|length| 1.0 / length))
                * eigenvectors.transpose();
        }
    }
}

/// Points of a generation in so many dimensions.
fn points_of(dimension: usize) -> usize {
    4 + (3.0 * (dimension as f64).ln()).floor() as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Below zero only in a corner of four factors: 0.15⁴, one point in 2000.
    fn corner(point: &[f64]) -> f64 {
        point.iter().map(|u| (u - 0.9).abs()).fold(0.0, f64::max) - 0.075
    }

    fn search(method: Method, seed: u64) -> Search {
        Search { method, runs: 20_000, seed, go_on: false }
    }

    fn median_runs(method: Method) -> usize {
        let find =
            |seed| search(method, seed).run(4, |_, point| Value::Margin(corner(point))).unwrap_or(usize::MAX);
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
            let found = limited.run(4, |_, point| {
                count.fetch_add(1, Relaxed);
                assert!(point.iter().all(|u| (0.0..1.0).contains(u)));
                Value::Margin(1.0)
            });
            assert_eq!((found, count.into_inner()), (None, 37));
        }
    }

    #[test]
    fn what_says_nothing_is_no_finding() {
        let found = Search { runs: 50, ..search(Method::CmaEs, 1) }.run(4, |_, _| Value::Nothing);
        assert_eq!(found, None);
    }

    #[test]
    fn a_number_is_folded_at_the_ends() {
        for (x, inside) in [(0.25, 0.25), (1.25, 0.75), (-0.25, 0.25), (2.25, 0.25)] {
            assert!((reflected(x) - inside).abs() < 1e-12);
        }
    }

    /// Evaluations until the value is below 1e-9.
    fn evaluations(value: impl Fn(&DVector<f64>) -> f64, dimension: usize, seed: u64) -> usize {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut generations = Generations::new(vec![0.5; dimension], 0.3);
        for count in 1..5000 {
            let points = generations.points(&mut random);
            let valued: Vec<_> = points.into_iter().map(|point| (value(&point), point)).collect();
            if valued.iter().any(|(value, _)| *value < 1e-9) {
                return count * valued.len();
            }
            generations.learn(valued);
        }
        usize::MAX
    }

    #[test]
    fn a_long_narrow_valley_is_followed_to_its_end() {
        // Hansen's tutorial, fig. 7: about 6,000 evaluations of Rosenbrock's function in 8 dimensions.
        let rosenbrock = |x: &DVector<f64>| {
            let pairs = x.as_slice().windows(2);
            pairs.map(|pair| 100.0 * (pair[0].powi(2) - pair[1]).powi(2) + (pair[0] - 1.0).powi(2)).sum()
        };
        let mut found: Vec<_> = (1..=7).map(|seed| evaluations(rosenbrock, 8, seed)).collect();
        found.sort_unstable();
        assert!(found[3] < 9000, "{found:?}");
    }

    #[test]
    fn an_ellipsoid_of_a_million_to_one_is_no_hindrance() {
        let ellipsoid = |x: &DVector<f64>| {
            x.iter().enumerate().map(|(axis, x)| 1e6f64.powf(axis as f64 / 5.0) * x * x).sum()
        };
        let found = evaluations(ellipsoid, 6, 1);
        assert!(found < 4000, "{found}");
    }

    #[test]
    fn where_all_values_are_equal_the_search_ends() {
        let mut random = Pcg64::seed_from_u64(1);
        let mut generations = Generations::new(vec![0.5; 3], 0.3);
        for _ in 0..100 {
            let valued = generations.points(&mut random).into_iter().map(|point| (1.0, point)).collect();
            generations.learn(valued);
        }
        assert!(generations.has_converged);
    }
}
