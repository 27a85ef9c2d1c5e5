//! A load cell that measures the bite force of the emulated jaw: `[load_cell]`.

use super::error::ScenarioError;
use super::need::{keyed, require_within};

section! {
    /// The load cell.
    #[derive(Copy)]
    pub struct LoadCellConfig {
        /// Bandwidth of its amplifier, a low-pass of first order, Hz.
        pub bandwidth_hz: f64 = 500.0,
        /// Noise of a sample, rms, N.
        pub noise_n: f64 = 0.1,
        /// What the cell shows without load, N.
        pub offset_n: f64 = 0.0,
        /// Ends of its range on both sides, N: beyond them the cell shows these.
        pub range_n: f64 = 1000.0,
    }
}

impl LoadCellConfig {
    /// Time constant of the low-pass, s.
    pub fn time_s(&self) -> f64 {
        1.0 / (std::f64::consts::TAU * self.bandwidth_hz)
    }

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        let bounds = [(1.0, 1e5), (0.0, 1000.0), (-1000.0, 1000.0), (0.1, 1e5)];
        let values = keyed!("load_cell", self, bandwidth_hz noise_n offset_n range_n);
        let within =
            values.into_iter().zip(bounds).map(|((key, value), (least, most))| (key, value, least, most));
        require_within(&within.collect::<Vec<_>>())
    }
}
