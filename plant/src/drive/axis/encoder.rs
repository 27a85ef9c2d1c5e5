//! An absolute encoder: quantisation, seeded Gaussian noise and reference marks.
//!
//! Counts are those of the encoder itself; homing and home offset are the axis' matter.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// Counts from one reference mark to the next; count 0 has a mark.
const MARK_PITCH: i32 = 2000;

/// The reference mark passed between two counts: a mark at `to` counts, one at `from` does not. Of several marks, the
/// nearest to `to`.
pub(super) fn mark_between(from: i32, to: i32) -> Option<i32> {
    let below = |count: i32| count.div_euclid(MARK_PITCH);
    // The next mark at or above; a count is never so near to the end of its range.
    let above = |count: i32| below(count.saturating_add(MARK_PITCH - 1));
    if below(to) > below(from) {
        Some(below(to) * MARK_PITCH)
    } else if above(to) < above(from) {
        Some(above(to) * MARK_PITCH)
    } else {
        None
    }
}

/// One axis' encoder.
#[derive(Debug, Clone)]
pub(crate) struct Encoder {
    resolution_m: f64,
    noise_m: f64,
    random: Pcg64Mcg,
}

impl Encoder {
    /// An encoder with its own stream of random numbers.
    pub(crate) fn new(resolution_m: f64, noise_m: f64, seed: u64, axis: usize) -> Self {
        // Odd multiples of the golden ratio keep the streams of neighbouring axes apart.
        let stream = seed ^ (axis as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        Self { resolution_m, noise_m, random: Pcg64Mcg::seed_from_u64(stream) }
    }

    /// The counts read at a true position; beyond the counter's range, its end.
    pub(crate) fn read(&mut self, position_m: f64) -> i32 {
        let noise: f64 = self.random.sample(StandardNormal);
        self.nearest(position_m + self.noise_m * noise)
    }

    /// The count nearest to a position (m); or the increments per second nearest to a velocity (m/s).
    pub(crate) fn nearest(&self, position_m: f64) -> i32 {
        (position_m / self.resolution_m).round() as i32
    }

    /// The position of a count, m.
    pub(crate) fn metres(&self, increments: i32) -> f64 {
        f64::from(increments) * self.resolution_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_the_declared_spread_and_no_bias() {
        let mut encoder = Encoder::new(1e-9, 1e-6, 3, 0);
        let errors: Vec<f64> = (0..20_000)
            .map(|_| {
                let counts = encoder.read(0.27);
                encoder.metres(counts) - 0.27
            })
            .collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let variance = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / errors.len() as f64;
        assert!(mean.abs() < 3e-8, "{mean}");
        assert!((variance.sqrt() - 1e-6).abs() < 3e-8, "{}", variance.sqrt());
    }

    #[test]
    fn without_noise_a_position_is_off_by_half_an_increment_at_most() {
        let mut encoder = Encoder::new(1e-6, 0.0, 1, 0);
        for step in 0..1000 {
            let position_m = 0.27 + f64::from(step) * 1.37e-7;
            let counts = encoder.read(position_m);
            assert!((encoder.metres(counts) - position_m).abs() <= 0.5e-6 + 1e-15);
        }
    }

    #[test]
    fn a_mark_is_passed_in_either_direction_and_not_left_behind_twice() {
        let table = [
            (1999, 2000, Some(2000)),
            (1990, 2010, Some(2000)),
            (2000, 2010, None),
            (2010, 2000, Some(2000)),
            (2000, 1990, None),
            (-1, 1, Some(0)),
            (1, -1, Some(0)),
            (5, 5, None),
            (-2001, -1999, Some(-2000)),
        ];
        for (from, to, mark) in table {
            assert_eq!(mark_between(from, to), mark, "from {from} to {to}");
        }
    }

    #[test]
    fn axes_do_not_share_their_noise() {
        let read = |axis| {
            let mut encoder = Encoder::new(1e-9, 1e-6, 3, axis);
            [(); 8].map(|()| encoder.read(0.0))
        };
        assert_ne!(read(0), read(1));
        assert_eq!(read(1), read(1));
    }
}
