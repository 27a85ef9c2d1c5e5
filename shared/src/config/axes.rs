//! End stops and play of the emulated axes: `[dynamics.axes]`.

use super::error::ScenarioError;
use super::need::require_within;

section! {
    /// What limits and loosens the axes. The default stops are steel on steel: 0.1 mm at 1 kN, damped so that a mass of a
    /// kilogram does not bounce.
    #[derive(Copy)]
    pub struct AxesConfig {
        /// Distance from each end of a stroke to the end stop behind it, m.
        pub stop_beyond_m: f64 = 0.002,
        /// Stiffness of an end stop, N/m.
        pub stop_stiffness_n_per_m: f64 = 1e7,
        /// Damping of an end stop, N per m/s.
        pub stop_damping_n_s_per_m: f64 = 5e3,
        /// Play between drive and slide, m.
        pub slide_play_m: f64 = 0.0,
        /// Play between drive and leg, m.
        pub leg_play_m: f64 = 0.0,
    }
}

impl AxesConfig {
    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        require_within(&[
            ("dynamics.axes.stop_beyond_m", self.stop_beyond_m, 0.0, 0.1),
            ("dynamics.axes.stop_stiffness_n_per_m", self.stop_stiffness_n_per_m, 1e3, 1e9),
            ("dynamics.axes.stop_damping_n_s_per_m", self.stop_damping_n_s_per_m, 0.0, 1e6),
            ("dynamics.axes.slide_play_m", self.slide_play_m, 0.0, 0.02),
            ("dynamics.axes.leg_play_m", self.leg_play_m, 0.0, 0.02),
        ])
    }
}
