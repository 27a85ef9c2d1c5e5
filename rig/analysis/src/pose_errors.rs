//! Errors of the platform's pose against the desired one: their root mean squares and their peaks. A pose that is none is
//! infinitely far.

use masseter_model::geometry::{Deviation, Pose};
use masseter_runtime::messages::pose_from_fields;
use serde::Serialize;

/// A quaternion's length may differ from 1 by so much: single precision and more.
const LENGTH_TOLERANCE: f64 = 1e-3;

/// The pose in a message; none where a number is not finite or the quaternion is no rotation.
pub(super) fn pose(position_m: [f64; 3], quaternion_wxyz: [f64; 4]) -> Option<Pose> {
    let length = quaternion_wxyz.iter().map(|part| part * part).sum::<f64>().sqrt();
    let is_pose = position_m.iter().all(|x| x.is_finite()) && (length - 1.0).abs() <= LENGTH_TOLERANCE;
    is_pose.then(|| pose_from_fields(position_m, quaternion_wxyz))
}

/// How far two poses are apart.
pub(super) fn deviation(a: Option<&Pose>, b: Option<&Pose>, incisal_m: [f64; 3]) -> Deviation {
    const NOWHERE: Deviation =
        Deviation { origin_m: f64::INFINITY, incisal_m: f64::INFINITY, angle_rad: f64::INFINITY };
    a.zip(b).map_or(NOWHERE, |(a, b)| Deviation::between(a, b, incisal_m))
}

/// The worse of two errors; what is no number is infinite.
pub(super) fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::INFINITY } else { a.max(b) }
}

/// Errors of a pose while the motion played; none without samples. The peaks also count the moves to its beginning, the
/// hold at its end, the sample at which a safe stop began, and cycles without a fresh reading.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct PoseErrors {
    /// Root mean square distance of the platform's origin, mm.
    pub rms_mm: Option<f64>,
    /// Largest distance, mm.
    pub max_mm: Option<f64>,
    /// Root mean square distance of the incisal point, mm.
    pub incisal_rms_mm: Option<f64>,
    /// Largest distance, mm.
    pub incisal_max_mm: Option<f64>,
    /// Root mean square angle, degrees.
    pub rms_deg: Option<f64>,
    /// Largest angle, degrees.
    pub max_deg: Option<f64>,
}

/// Root mean square and maximum of what is added.
#[derive(Debug, Clone, Default)]
pub(super) struct Accumulator {
    pub(super) samples: u64,
    squares: f64,
    largest: Option<f64>,
}

impl Accumulator {
    /// Takes a value.
    pub(super) fn add(&mut self, value: f64) {
        self.samples += 1;
        self.squares += worse(value, 0.0).powi(2);
        self.peak(value);
    }

    /// Takes a value that counts for the maximum alone.
    fn peak(&mut self, value: f64) {
        self.largest = Some(worse(self.largest.unwrap_or(0.0), value));
    }

    /// The root of the mean square; 0 without values.
    pub(super) fn rms(&self) -> f64 {
        (self.squares / self.samples.max(1) as f64).sqrt()
    }
}

/// Collects [`PoseErrors`].
#[derive(Debug, Clone, Default)]
pub(super) struct PoseErrorSums {
    origin: Accumulator,
    incisal: Accumulator,
    angle: Accumulator,
}

impl PoseErrorSums {
    pub(super) fn add(&mut self, deviation: &Deviation) {
        self.each(deviation, Accumulator::add);
    }

    pub(super) fn peak(&mut self, deviation: &Deviation) {
        self.each(deviation, Accumulator::peak);
    }

    fn each(&mut self, deviation: &Deviation, take: fn(&mut Accumulator, f64)) {
        take(&mut self.origin, deviation.origin_m * 1e3);
        take(&mut self.incisal, deviation.incisal_m * 1e3);
        take(&mut self.angle, deviation.angle_rad.to_degrees());
    }

    pub(super) fn samples(&self) -> u64 {
        self.origin.samples
    }

    pub(super) fn finish(&self) -> PoseErrors {
        let rms = |sum: &Accumulator| (sum.samples > 0).then(|| sum.rms());
        PoseErrors {
            rms_mm: rms(&self.origin),
            max_mm: self.origin.largest,
            incisal_rms_mm: rms(&self.incisal),
            incisal_max_mm: self.incisal.largest,
            rms_deg: rms(&self.angle),
            max_deg: self.angle.largest,
        }
    }
}
