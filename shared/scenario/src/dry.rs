//! The dry run: the same motion, slow, with little force, and away from the ends of the strokes.

use super::error::ScenarioError;
use super::need::require_within;

section! {
    /// How a dry run differs from the run that it prepares. `masseter run --dry` switches it on.
    #[derive(Copy)]
    pub struct DryConfig {
        /// Whether the run is a dry one. `--dry` sets it, and then also shortens the strokes and lengthens `controller.ease_s`.
        pub is_on: bool = false,
        /// Speed of the motion, as a share of its own.
        pub speed: f64 = 0.1,
        /// Limit of force (object 6072), as a share of the drives' own.
        pub force: f64 = 0.3,
        /// Distance that targets keep from the ends of the strokes, mm.
        pub stroke_margin_mm: f64 = 1.0,
    }
}

impl DryConfig {
    /// The speed of the motion in this run, as a share of its own.
    pub fn speed_now(&self) -> f64 {
        if self.is_on { self.speed } else { 1.0 }
    }

    /// The limit of force in this run, as a share of the drives' own.
    pub fn force_now(&self) -> f64 {
        if self.is_on { self.force } else { 1.0 }
    }

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        require_within(&[
            ("dry.speed", self.speed, 0.01, 0.25),
            ("dry.force", self.force, 0.01, 0.5),
            ("dry.stroke_margin_mm", self.stroke_margin_mm, 0.0, 100.0),
        ])
    }
}
