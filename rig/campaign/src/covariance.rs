//! CMA-ES: points around a mean whose covariance follows the best of the points before (N. Hansen, "The CMA Evolution Strategy:
//! A Tutorial", 2016, with positive weights alone).
//!
//! It evaluates nothing: [`Generations::points`] gives the points of a generation, [`Generations::learn`] takes their values.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// Steps below this size change nothing that matters.
const SMALLEST: f64 = 1e-10;
/// Below this share of the largest axis, an axis of the distribution is rounding: a condition of 10¹⁴.
const NARROWEST: f64 = 1e-7;

/// The generations of one start.
pub(crate) struct Generations {
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
    has_converged: bool,
    /// Generations in which all values were equal, in a row.
    flat: usize,
}

impl Generations {
    /// A search that begins at `mean` with the same step along every axis.
    pub(crate) fn new(mean: Vec<f64>, step: f64) -> Self {
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

    /// Whether further generations tell nothing new.
    pub(crate) fn has_converged(&self) -> bool {
        self.has_converged
    }

    /// The points of the next generation.
    pub(crate) fn points(&self, random: &mut Pcg64) -> Vec<DVector<f64>> {
        let n = self.mean.len();
        let point = |_| {
            let normal = DVector::from_fn(n, |_, _| random.sample(StandardNormal));
            &self.mean + &self.axes * normal * self.step
        };
        (0..points_of(n)).map(point).collect()
    }

    /// Moves and shapes the distribution by the values of a generation's points; less is better.
    pub(crate) fn learn(&mut self, mut valued: Vec<(f64, DVector<f64>)>) {
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
    use rand::SeedableRng;

    use super::*;

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
        assert!(generations.has_converged());
    }
}
