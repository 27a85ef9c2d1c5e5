//! Errors of the platform's pose against the desired one: their root mean squares and their peaks.

use masseter_shared::geometry::Deviation;
use serde::Serialize;

/// Errors of a pose while the motion played; none without samples. The peaks also count the moves to its beginning and
/// the hold at its end, and cycles without a fresh reading.
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
#[derive(Debug, Default)]
pub(super) struct Accumulator {
    pub(super) samples: u64,
    squares: f64,
    largest: f64,
}

impl Accumulator {
    /// Takes a value.
    pub(super) fn add(&mut self, value: f64) {
        self.samples += 1;
        self.squares += value * value;
        self.peak(value);
    }

    /// Takes a value that counts for the maximum alone.
    fn peak(&mut self, value: f64) {
        self.largest = self.largest.max(value);
    }

    /// The root of the mean square; 0 without values.
    pub(super) fn rms(&self) -> f64 {
        (self.squares / self.samples.max(1) as f64).sqrt()
    }
}

/// Collects [`PoseErrors`].
#[derive(Debug, Default)]
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
        let figure = |value: f64| (self.samples() > 0).then_some(value);
        PoseErrors {
            rms_mm: figure(self.origin.rms()),
            max_mm: figure(self.origin.largest),
            incisal_rms_mm: figure(self.incisal.rms()),
            incisal_max_mm: figure(self.incisal.largest),
            rms_deg: figure(self.angle.rms()),
            max_deg: figure(self.angle.largest),
        }
    }
}
