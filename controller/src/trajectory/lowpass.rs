//! A low-pass without delay: a second-order Butterworth filter forwards, then backwards.
//!
//! Both ends are extended by their own point reflection and the filter starts settled, so that the
//! first and the last value stay where they are.

use std::f64::consts::{PI, SQRT_2};

use nalgebra::SVector;

/// How long the reflected ends are, in periods of the corner frequency.
const MARGIN_PERIODS: f64 = 3.0;

/// Filters evenly spaced values so that both passes together reach −3 dB at the corner, which must
/// lie below half the rate.
pub(super) fn lowpass<const N: usize>(
    values: &[SVector<f64, N>],
    rate_hz: f64,
    corner_hz: f64,
) -> Vec<SVector<f64, N>> {
    let margin = ((MARGIN_PERIODS * rate_hz / corner_hz).ceil() as usize).min(values.len().saturating_sub(1));
    let filter = Butterworth::new(rate_hz, corner_hz);
    let mut extended = with_reflected_ends(values, margin);
    filter.run(&mut extended);
    extended.reverse();
    filter.run(&mut extended);
    extended.reverse();
    extended[margin..margin + values.len()].to_vec()
}

fn with_reflected_ends<const N: usize>(values: &[SVector<f64, N>], margin: usize) -> Vec<SVector<f64, N>> {
    let (Some(first), Some(last)) = (values.first(), values.last()) else { return Vec::new() };
    let before = values[1..=margin].iter().rev().map(|value| first * 2.0 - value);
    let after =
        values[values.len() - 1 - margin..values.len() - 1].iter().rev().map(|value| last * 2.0 - value);
    before.chain(values.iter().copied()).chain(after).collect()
}

/// y = b (x + 2x' + x'') − a₁y' − a₂y'', by the bilinear transform.
struct Butterworth {
    b: f64,
    a1: f64,
    a2: f64,
}

impl Butterworth {
    fn new(rate_hz: f64, corner_hz: f64) -> Self {
        // Two passes of a second-order filter multiply its attenuation; this moves −3 dB back.
        let two_passes = (SQRT_2 - 1.0).powf(0.25);
        let k = (PI * corner_hz / rate_hz).tan() / two_passes;
        let scale = 1.0 / (1.0 + SQRT_2 * k + k * k);
        Self { b: k * k * scale, a1: 2.0 * (k * k - 1.0) * scale, a2: (1.0 - SQRT_2 * k + k * k) * scale }
    }

    fn run<const N: usize>(&self, values: &mut [SVector<f64, N>]) {
        let Some(&settled) = values.first() else { return };
        let (mut x1, mut x2, mut y1, mut y2) = (settled, settled, settled, settled);
        for value in values {
            let x = *value;
            *value = (x + x1 * 2.0 + x2) * self.b - y1 * self.a1 - y2 * self.a2;
            (x2, x1, y2, y1) = (x1, x, y1, *value);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector1;

    use super::*;

    const RATE_HZ: f64 = 200.0;

    fn sine(frequency_hz: f64) -> Vec<Vector1<f64>> {
        (0..800)
            .map(|k| Vector1::new((std::f64::consts::TAU * frequency_hz * f64::from(k) / RATE_HZ).sin()))
            .collect()
    }

    fn largest(values: &[Vector1<f64>]) -> f64 {
        values[200..600].iter().map(|value| value[0].abs()).fold(0.0, f64::max)
    }

    #[test]
    fn the_corner_lies_at_minus_three_decibels_and_nothing_is_delayed() {
        for (frequency_hz, gain, tolerance) in
            [(1.0, 1.0, 1e-3), (12.0, 0.5f64.sqrt(), 5e-3), (60.0, 0.0, 5e-3)]
        {
            let filtered = lowpass(&sine(frequency_hz), RATE_HZ, 12.0);
            assert!((largest(&filtered) - gain).abs() < tolerance, "{frequency_hz} Hz");
        }
        let slow = sine(1.0);
        for (before, after) in slow.iter().zip(lowpass(&slow, RATE_HZ, 12.0)) {
            assert!((before[0] - after[0]).abs() < 1e-3);
        }
    }

    #[test]
    fn ends_stay_where_they_are() {
        let ramp: Vec<_> = (0..100).map(|k| Vector1::new(0.3 * f64::from(k) + 2.0)).collect();
        let filtered = lowpass(&ramp, RATE_HZ, 12.0);
        assert_eq!(filtered.len(), ramp.len());
        for (before, after) in ramp.iter().zip(&filtered) {
            assert!((before[0] - after[0]).abs() < 0.02);
        }
        assert!((filtered[0][0] - 2.0).abs() < 1e-3 && (filtered[99][0] - ramp[99][0]).abs() < 1e-3);
    }

    #[test]
    fn short_recordings_are_filtered_too() {
        let few = [1.0, 2.0, 3.0, 4.0].map(Vector1::new);
        assert_eq!(lowpass(&few, RATE_HZ, 12.0).len(), 4);
        assert!(lowpass::<1>(&[], RATE_HZ, 12.0).is_empty());
    }
}
