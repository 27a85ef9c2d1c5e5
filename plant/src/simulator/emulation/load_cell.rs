//! The load cell between the jaws: a low-pass, an offset, noise and a range.

use masseter_scenario::LoadCellConfig;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// Parts the cell's random numbers from those of the encoders, which have odd multiples of another number.
const STREAM: u64 = 0x4C6F_6164_4365_6C6C;

/// The load cell.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct LoadCell {
    config: LoadCellConfig,
    /// The force behind the low-pass, N.
    passed_n: f64,
    random: Pcg64Mcg,
}

impl LoadCell {
    /// A cell without load.
    pub(super) fn new(config: LoadCellConfig, seed: u64) -> Self {
        Self { config, passed_n: 0.0, random: Pcg64Mcg::seed_from_u64(seed ^ STREAM) }
    }

    /// Takes a bite force (N) over a time (s).
    pub(super) fn follow(&mut self, force_n: f64, time_s: f64) {
        let left = (-time_s / self.config.time_s()).exp();
        self.passed_n = force_n + (self.passed_n - force_n) * left;
    }

    /// A sample, N.
    pub(super) fn read(&mut self) -> f64 {
        let LoadCellConfig { noise_n, offset_n, range_n, .. } = self.config;
        let noise: f64 = self.random.sample(StandardNormal);
        (self.passed_n + offset_n + noise_n * noise).clamp(-range_n, range_n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUIET: LoadCellConfig =
        LoadCellConfig { bandwidth_hz: 100.0, noise_n: 0.0, offset_n: 0.0, range_n: 1000.0 };

    #[test]
    fn a_step_is_shown_behind_a_low_pass_however_finely_the_time_is_cut() {
        let time_s = QUIET.time_s();
        for steps in [1, 10, 1000] {
            let mut cell = LoadCell::new(QUIET, 1);
            (0..steps).for_each(|_| cell.follow(50.0, time_s / f64::from(steps)));
            assert!((cell.read() - 50.0 * (1.0 - (-1.0_f64).exp())).abs() < 1e-9, "{steps}");
        }
    }

    #[test]
    fn the_cell_shows_its_offset_and_no_more_than_its_range() {
        let config = LoadCellConfig { offset_n: 2.0, range_n: 40.0, ..QUIET };
        for (force_n, shown_n) in [(0.0, 2.0), (30.0, 32.0), (39.0, 40.0), (-100.0, -40.0)] {
            let mut cell = LoadCell::new(config, 1);
            cell.follow(force_n, 1.0);
            assert!((cell.read() - shown_n).abs() < 1e-9, "{force_n}");
        }
    }

    #[test]
    fn noise_has_the_declared_spread_and_comes_from_the_seed() {
        let samples_n = |seed| {
            let mut cell = LoadCell::new(LoadCellConfig { noise_n: 0.5, ..QUIET }, seed);
            std::iter::repeat_with(|| cell.read()).take(20_000).collect::<Vec<f64>>()
        };
        let found_n = samples_n(3);
        let rms_n = (found_n.iter().map(|n| n * n).sum::<f64>() / found_n.len() as f64).sqrt();
        assert!((rms_n - 0.5).abs() < 0.015, "{rms_n}");
        assert_eq!(found_n, samples_n(3));
        assert_ne!(found_n, samples_n(4));
    }
}
