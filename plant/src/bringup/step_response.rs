//! Figures of one way of a jog, from what the drive showed.

use masseter_runtime::clock::SECOND_NS;

use super::watch::Sample;

/// The share of the way at both ends in which the axis may still speed up or slow down.
const RAMP: f64 = 0.2;
/// Fewest looks that give a mean force.
const FEWEST: usize = 3;

/// How an axis went one way. SDO answers are milliseconds apart, so the times are no finer than that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepResponse {
    /// From 10 to 90 % of the way, s.
    pub rise_s: f64,
    /// Furthest beyond the target, m.
    pub overshoot_m: f64,
    /// From the set-point to the last look further than the noise from the end, s.
    pub settled_s: f64,
    /// Mean force (6077h) in the middle of the way, N; none if there were too few looks.
    pub force_n: Option<f64>,
}

impl StepResponse {
    /// Of everything seen since the set-point, from one position to another, m. Nearer than `window_m` is there.
    pub(super) fn new(seen: &[Sample], [from_m, to_m]: [f64; 2], window_m: f64) -> Self {
        let share = |sample: &Sample| (sample.position_m - from_m) / (to_m - from_m);
        let began_ns = seen.first().map_or(0, |sample| sample.at_ns);
        let time_s = |sample: &Sample| (sample.at_ns - began_ns) as f64 / SECOND_NS as f64;
        let reached_s = |part: f64| seen.iter().find(|sample| share(sample) >= part).map_or(f64::NAN, time_s);
        let middle: Vec<f64> = seen
            .iter()
            .take_while(|sample| share(sample) < 1.0 - RAMP)
            .filter(|sample| share(sample) > RAMP)
            .map(|sample| sample.force_n)
            .collect();
        let furthest = seen.iter().map(share).fold(1.0, f64::max);
        let outside = seen.iter().rfind(|sample| (sample.position_m - to_m).abs() > window_m);
        Self {
            rise_s: reached_s(0.9) - reached_s(0.1),
            overshoot_m: (furthest - 1.0) * (to_m - from_m).abs(),
            settled_s: outside.map_or(0.0, time_s),
            force_n: (middle.len() >= FEWEST).then(|| middle.iter().sum::<f64>() / middle.len() as f64),
        }
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::cia402::Statusword;

    use super::*;

    #[test]
    fn a_way_has_its_rise_overshoot_settling_and_force() {
        let places = [0.0, 0.15, 0.3, 0.5, 0.7, 0.95, 1.1, 1.0, 1.0];
        let seen: Vec<_> = (0..)
            .zip(places)
            .map(|(step, share)| Sample {
                at_ns: step * SECOND_NS / 10,
                position_m: 0.3 - 0.001 * share,
                force_n: if (share - 0.5_f64).abs() < 0.01 { -14.0 } else { -8.0 },
                status: Statusword(0),
            })
            .collect();
        let found = StepResponse::new(&seen, [0.3, 0.299], 2e-5);
        assert!((found.rise_s - 0.4).abs() < 1e-9 && (found.settled_s - 0.6).abs() < 1e-9, "{found:?}");
        assert!(
            (found.overshoot_m - 1e-4).abs() < 1e-12 && (found.force_n.unwrap() + 10.0).abs() < 1e-9,
            "{found:?}"
        );
    }
}
