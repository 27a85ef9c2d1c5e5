//! End stops and play of the emulated axes: `[dynamics.axes]`.

use masseter_model::dynamics::AxesConfig;

use super::error::ScenarioError;
use super::need::require_within;

pub(super) fn validate(axes: &AxesConfig) -> Result<(), ScenarioError> {
    require_within(&[
        ("dynamics.axes.stop_beyond_m", axes.stop_beyond_m, 0.0, 0.1),
        ("dynamics.axes.stop_stiffness_n_per_m", axes.stop_stiffness_n_per_m, 1e3, 1e9),
        ("dynamics.axes.stop_damping_n_s_per_m", axes.stop_damping_n_s_per_m, 0.0, 1e6),
        ("dynamics.axes.slide_play_m", axes.slide_play_m, 0.0, 0.02),
        ("dynamics.axes.leg_play_m", axes.leg_play_m, 0.0, 0.02),
    ])
}
