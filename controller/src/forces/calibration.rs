//! Friction and weight that the model lacks, identified from a motion in which nothing touches the jaw. Screws under load
//! are not identified: the motion does not load them.

use masseter_model::geometry::AXES;
use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};

/// Speed at which viscous friction counts as much as Coulomb friction in the fit, m/s.
const BRISK_M_S: f64 = 0.05;
/// Weight of the prior that the model is right, in samples.
const PRIOR_SAMPLES: f64 = 20.0;

/// Features of an axis: an offset, the direction of its motion, its speed.
const FEATURES: usize = 3;
/// Features of all axes, as they move the platform vertically.
const VERTICAL: usize = FEATURES * AXES;

/// Weighted sums over samples with N features.
#[derive(Debug, Clone, Copy)]
struct Sums<const N: usize> {
    weight: f64,
    square_n2: f64,
    products: SVector<f64, N>,
    features: SMatrix<f64, N, N>,
}

impl<const N: usize> Default for Sums<N> {
    fn default() -> Self {
        Self { weight: 0.0, square_n2: 0.0, products: SVector::zeros(), features: SMatrix::zeros() }
    }
}

impl<const N: usize> Sums<N> {
    fn add(&mut self, weight: f64, features: &SVector<f64, N>, missing_n: f64) {
        self.weight += weight;
        self.square_n2 += weight * missing_n * missing_n;
        self.products += features * (weight * missing_n);
        self.features.ger(weight, features, features, 1.0);
    }

    /// Root mean square of what these coefficients leave, N.
    fn left_n(&self, coefficients: &SVector<f64, N>) -> f64 {
        let square_n2 = self.square_n2 - 2.0 * coefficients.dot(&self.products)
            + coefficients.dot(&(self.features * coefficients));
        (square_n2 / self.weight.max(1.0)).max(0.0).sqrt()
    }
}

/// An instant of the motion, as friction sees it.
#[derive(Debug)]
pub(super) struct Loaded<'a> {
    /// Speeds of axes for the platform's twist.
    pub jacobian: &'a Matrix6<f64>,
    /// Speeds of the axes, m/s.
    pub speeds_m_s: &'a Vector6<f64>,
    /// Coulomb friction of the axes, N.
    pub coulomb_n: &'a Vector6<f64>,
    /// Forces that the screws transmit, N.
    pub screw_n: &'a Vector6<f64>,
}

impl Loaded<'_> {
    /// How far Coulomb friction of the axes moves the vertical force, N.
    fn vertical_coulomb_n(&self) -> Vector6<f64> {
        self.jacobian.column(2).abs().component_mul(self.coulomb_n)
    }
}

/// What was found.
#[derive(Debug, Clone, Copy)]
struct Found {
    /// Of each axis: offset, friction of either direction, and friction at 50 mm/s beside the model's, N.
    coefficients: [Vector3<f64>; AXES],
    /// What they leave of the vertical force in motion and at rest, rms, as shares of its Coulomb friction.
    left: [f64; 2],
    /// Mean forces of the screws, N.
    screw_n: Vector6<f64>,
}

/// A calibration, which is learned first and used afterwards.
#[derive(Debug, Clone)]
pub(super) struct Calibration {
    rest_speed_m_s: f64,
    samples: u64,
    /// Samples that are still to be taken.
    missing_samples: u64,
    axes: [Sums<FEATURES>; AXES],
    /// The vertical force of the axes in motion and at rest.
    vertical: [Sums<VERTICAL>; 2],
    /// Sums of the samples, N.
    coulomb_n: f64,
    screw_n: Vector6<f64>,
    found: Option<Found>,
}

impl Calibration {
    /// From this many samples. An axis is at rest below about this speed.
    pub(super) fn new(samples: u64, rest_speed_m_s: f64) -> Self {
        Self {
            rest_speed_m_s,
            samples,
            missing_samples: samples,
            axes: [Sums::default(); AXES],
            vertical: [Sums::default(); 2],
            coulomb_n: 0.0,
            screw_n: Vector6::zeros(),
            found: None,
        }
    }

    /// Whether all samples were taken.
    pub(super) fn is_complete(&self) -> bool {
        self.missing_samples == 0
    }

    /// How much an axis of this speed is at rest, 0 to 1.
    pub(super) fn rest(&self, speed_m_s: f64) -> f64 {
        (-(speed_m_s / self.rest_speed_m_s).powi(2)).exp()
    }

    fn features(&self, speed_m_s: f64) -> Vector3<f64> {
        Vector3::new(1.0, (speed_m_s / self.rest_speed_m_s).tanh(), speed_m_s / BRISK_M_S)
    }

    /// Takes a sample with the wrench that the model misses (N, N m). None of a singular pose counts.
    pub(super) fn take_sample(&mut self, residual: &Vector6<f64>, at: &Loaded<'_>) {
        if self.is_complete() {
            return;
        }
        let Some(missing_n) = at.jacobian.transpose().lu().solve(&-residual) else { return };
        let mut vertical = SVector::<f64, VERTICAL>::zeros();
        for axis in 0..AXES {
            let features = self.features(at.speeds_m_s[axis]);
            self.axes[axis].add(1.0, &features, missing_n[axis]);
            vertical
                .fixed_rows_mut::<FEATURES>(FEATURES * axis)
                .copy_from(&(features * at.jacobian[(axis, 2)]));
        }
        let coulomb_n = at.vertical_coulomb_n();
        let rest = coulomb_n.dot(&self.rests(at)) / coulomb_n.sum().max(f64::MIN_POSITIVE);
        let [moving, resting] = &mut self.vertical;
        moving.add(1.0 - rest, &vertical, -residual[2]);
        resting.add(rest, &vertical, -residual[2]);
        self.coulomb_n += coulomb_n.sum();
        self.screw_n += at.screw_n;
        self.missing_samples -= 1;
        if self.is_complete() {
            self.found = Some(self.solve());
        }
    }

    fn rests(&self, at: &Loaded<'_>) -> Vector6<f64> {
        at.speeds_m_s.map(|speed_m_s| self.rest(speed_m_s))
    }

    fn solve(&self) -> Found {
        let coefficients = self.axes.map(|Sums { products, features, .. }| {
            // The prior makes the matrix positive definite.
            let inverse = (features + Matrix3::identity() * PRIOR_SAMPLES).try_inverse();
            inverse.unwrap_or_default() * products
        });
        let all = SVector::from_iterator(coefficients.iter().flatten().copied());
        let samples = self.samples as f64;
        let mean_coulomb_n = (self.coulomb_n / samples).max(f64::MIN_POSITIVE);
        let left = self.vertical.each_ref().map(|sums| sums.left_n(&all) / mean_coulomb_n);
        Found { coefficients, left, screw_n: self.screw_n / samples }
    }

    /// Friction and weight of the axes beside the model's, N; zeros until the calibration is complete.
    pub(super) fn beside_model_n(&self, speeds_m_s: &Vector6<f64>) -> Vector6<f64> {
        self.found.map_or(Vector6::zeros(), |found| {
            Vector6::from_fn(|axis, _| found.coefficients[axis].dot(&self.features(speeds_m_s[axis])))
        })
    }

    /// Doubts in the vertical force, N, none until the calibration is complete: what the calibration leaves of friction, and
    /// what the screws lose (as shares) of the load beside that of the calibration. An axis at rest holds at most a share
    /// `breakaway` of its Coulomb friction. Where the calibration found an axis at rest without friction, as smooth laws have
    /// it, its screw hides nothing there either.
    pub(super) fn doubts_n(
        &self,
        at: &Loaded<'_>,
        losses: &Vector6<f64>,
        breakaway: f64,
    ) -> Option<[f64; 2]> {
        let Found { left: [moving, at_rest], screw_n, .. } = self.found.as_ref()?;
        let held = (2.0 * at_rest).min(breakaway);
        let rests = self.rests(at);
        let left = rests.map(|rest| 2.0 * moving + rest * (held - 2.0 * moving));
        let lost = rests.map(|rest| 1.0 + rest * (held.min(1.0) - 1.0));
        let beside_n = (at.screw_n - screw_n).abs().component_mul(losses).component_mul(&lost);
        Some([at.vertical_coulomb_n().dot(&left), at.jacobian.column(2).abs().dot(&beside_n)])
    }
}
