//! Food between the teeth of the emulated jaw: `[food]`.

use super::error::ScenarioError;
use super::need::require_within;

section! {
    /// A piece of food that resists the bite. The defaults are a soft round piece of 10 mm between the
    /// first molars on the left side.
    #[derive(Copy)]
    pub struct FoodConfig {
        /// Where the lower jaw bites on it, in the platform frame, m.
        pub point_m: [f64; 3] = [0.0024, 0.0248, 0.0],
        /// Thickness of a fresh piece, m.
        pub thickness_m: f64 = 0.010,
        /// Force against compression, N/m.
        pub stiffness_n_per_m: f64 = 3500.0,
        /// Force against the speed of compression, N per m/s.
        pub damping_n_s_per_m: f64 = 10.0,
        /// Elastic force at which it yields, N; what yields stays flat until the mouth opens wider than a fresh piece is
        /// thick.
        pub yield_n: f64 = 35.0,
    }
}

impl FoodConfig {
    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        let [x_m, y_m, z_m] = self.point_m;
        // The integration of the mechanism resolves these ranges with a wide margin.
        require_within(&[
            ("food.point_m", x_m, -0.5, 0.5),
            ("food.point_m", y_m, -0.5, 0.5),
            ("food.point_m", z_m, -0.5, 0.5),
            ("food.thickness_m", self.thickness_m, 1e-4, 0.05),
            ("food.stiffness_n_per_m", self.stiffness_n_per_m, 1.0, 1e6),
            ("food.damping_n_s_per_m", self.damping_n_s_per_m, 0.0, 1e3),
            ("food.yield_n", self.yield_n, 0.1, 1500.0),
        ])
    }
}
