//! Friction and weight that the model lacks, identified from a motion in which nothing touches the jaw. Screws under load
//! are not identified: the motion does not load them.

use masseter_model::geometry::AXES;
use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

/// Speed at which viscous friction counts as much as Coulomb friction in the fit, m/s.
const BRISK_M_S: f64 = 0.05;
/// Weight of the prior that the model is right, in samples.
const PRIOR_SAMPLES: f64 = 20.0;

/// Weighted sums over samples of an axis.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    weight: f64,
    square_n2: f64,
    products: Vector3<f64>,
    features: Matrix3<f64>,
}

impl Sums {
    fn add(&mut self, weight: f64, features: &Vector3<f64>, missing_n: f64) {
        self.weight += weight;
        self.square_n2 += weight * missing_n * missing_n;
        self.products += features * (weight * missing_n);
        self.features += features * features.transpose() * weight;
    }

    /// Root mean square of what these coefficients leave, N.
    fn left_n(&self, coefficients: &Vector3<f64>) -> f64 {
        let square_n2 = self.square_n2 - 2.0 * coefficients.dot(&self.products)
            + coefficients.dot(&(self.features * coefficients));
        (square_n2 / self.weight.max(1.0)).max(0.0).sqrt()
    }
}

/// Sums over the samples of an axis.
#[derive(Debug, Clone, Copy, Default)]
struct AxisSums {
    moving: Sums,
    at_rest: Sums,
    coulomb_n: f64,
    screw_n: f64,
    samples: f64,
}

/// What was found of an axis.
#[derive(Debug, Clone, Copy)]
struct AxisFound {
    /// Offset, friction of either direction, and friction at 50 mm/s beside the model's, N.
    coefficients: Vector3<f64>,
    /// What they leave of a moving axis and of one at rest, rms, as shares of Coulomb friction.
    left: [f64; 2],
    /// Mean force of the screw, N.
    screw_n: f64,
}

/// A calibration, which is learned first and used afterwards.
#[derive(Debug, Clone)]
pub(super) struct Calibration {
    rest_speed_m_s: f64,
    /// Samples that are still to be taken.
    missing_samples: u64,
    sums: [AxisSums; AXES],
    found: Option<[AxisFound; AXES]>,
}

impl Calibration {
    /// From this many samples. An axis is at rest below about this speed.
    pub(super) fn new(samples: u64, rest_speed_m_s: f64) -> Self {
        Self { rest_speed_m_s, missing_samples: samples, sums: [AxisSums::default(); AXES], found: None }
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

    /// Takes a sample: the wrench that the model misses (N, N m), speeds of the axes (m/s), Coulomb friction and forces of
    /// the screws (N). None of a singular pose counts.
    pub(super) fn take_sample(
        &mut self,
        jacobian: &Matrix6<f64>,
        residual: &Vector6<f64>,
        speeds_m_s: &Vector6<f64>,
        [coulomb_n, screw_n]: [&Vector6<f64>; 2],
    ) {
        if self.is_complete() {
            return;
        }
        let Some(missing_n) = jacobian.transpose().lu().solve(&-residual) else { return };
        for axis in 0..AXES {
            let speed_m_s = speeds_m_s[axis];
            let (features, rest) = (self.features(speed_m_s), self.rest(speed_m_s));
            let sums = &mut self.sums[axis];
            sums.at_rest.add(rest, &features, missing_n[axis]);
            sums.moving.add(1.0 - rest, &features, missing_n[axis]);
            sums.coulomb_n += coulomb_n[axis];
            sums.screw_n += screw_n[axis];
            sums.samples += 1.0;
        }
        self.missing_samples -= 1;
        if self.is_complete() {
            self.found = Some(self.sums.map(AxisSums::solve));
        }
    }

    /// Friction and weight of the axes beside the model's, N; zeros until the calibration is complete.
    pub(super) fn beside_model_n(&self, speeds_m_s: &Vector6<f64>) -> Vector6<f64> {
        self.found.map_or(Vector6::zeros(), |found| {
            Vector6::from_fn(|axis, _| found[axis].coefficients.dot(&self.features(speeds_m_s[axis])))
        })
    }

    /// Bounds of what the calibration leaves of friction, and the load of the screws beside that of the calibration, N; none
    /// until the calibration is complete.
    pub(super) fn doubts_n(
        &self,
        speeds_m_s: &Vector6<f64>,
        [coulomb_n, screw_n]: [&Vector6<f64>; 2],
    ) -> Option<[Vector6<f64>; 2]> {
        let found = self.found.as_ref()?;
        let left_n = Vector6::from_fn(|axis, _| {
            let ([moving, at_rest], rest) = (found[axis].left, self.rest(speeds_m_s[axis]));
            2.0 * coulomb_n[axis] * (moving + rest * (at_rest - moving))
        });
        Some([left_n, Vector6::from_fn(|axis, _| (screw_n[axis] - found[axis].screw_n).abs())])
    }
}

impl AxisSums {
    fn solve(self) -> AxisFound {
        let Self { moving, at_rest, coulomb_n, screw_n, samples } = self;
        let features = moving.features + at_rest.features + Matrix3::identity() * PRIOR_SAMPLES;
        // The prior makes the matrix positive definite.
        let inverse = features.try_inverse().unwrap_or_default();
        let coefficients = inverse * (moving.products + at_rest.products);
        let mean_coulomb_n = (coulomb_n / samples).max(f64::MIN_POSITIVE);
        let left = [moving, at_rest].map(|sums| sums.left_n(&coefficients) / mean_coulomb_n);
        AxisFound { coefficients, left, screw_n: screw_n / samples }
    }
}
