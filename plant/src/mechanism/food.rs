//! Food between the teeth: a wrench on the platform while the jaw closes on it.
//!
//! One point of the lower jaw bites vertically against its place in the closed mouth. Food compressed by c pushes
//! with k c + d ċ and never pulls. It yields where k c would exceed its strength. The next piece appears when the mouth
//! opens wide enough for it. Teeth that touch, lateral forces, and food that spreads or breaks are left out.

use masseter_shared::config::FoodConfig;
use masseter_shared::geometry::{Pose, Twist, Vec3};
use nalgebra::{Point3, Vector6};

/// The wrench of a vertical force (N) at an arm (m) about the platform's origin.
pub(super) fn vertical(force_n: f64, arm: &Vec3) -> Vector6<f64> {
    Vector6::new(0.0, 0.0, force_n, arm.y * force_n, -arm.x * force_n, 0.0)
}

/// A piece of food with its remaining thickness.
#[derive(Debug, Clone)]
pub(crate) struct Food {
    config: FoodConfig,
    /// Height of the upper tooth in the base frame, m.
    upper_m: f64,
    thickness_m: f64,
    /// Force on the lower tooth at the last bite, downwards, N.
    pub(super) force_n: f64,
}

impl Food {
    /// A fresh piece for a mouth that is closed in that pose of the platform.
    pub(crate) fn new(config: FoodConfig, closed: &Pose) -> Self {
        let upper_m = (closed * Point3::from(config.point_m)).z;
        Self { config, upper_m, thickness_m: config.thickness_m, force_n: 0.0 }
    }

    /// Bites at a pose and twist of the platform. Returns the food's wrench on the platform: force (N), then moment
    /// (N m) about the platform's origin, in base axes.
    pub(crate) fn bite(&mut self, pose: &Pose, twist: &Twist) -> Vector6<f64> {
        let arm = pose.rotation * Vec3::from(self.config.point_m);
        let (linear, angular): (Vec3, Vec3) =
            (twist.fixed_rows::<3>(0).into(), twist.fixed_rows::<3>(3).into());
        let gap_m = self.upper_m - (pose.translation.z + arm.z);
        self.press(gap_m, (linear + angular.cross(&arm)).z);
        vertical(-self.force_n, &arm)
    }

    fn press(&mut self, gap_m: f64, closing_m_s: f64) {
        let FoodConfig { thickness_m, stiffness_n_per_m, damping_n_s_per_m, yield_n, .. } = self.config;
        if gap_m >= thickness_m {
            self.thickness_m = thickness_m;
        }
        self.thickness_m = self.thickness_m.min(gap_m + yield_n / stiffness_n_per_m);
        let compression_m = self.thickness_m - gap_m;
        self.force_n = if compression_m > 0.0 {
            (stiffness_n_per_m * compression_m + damping_n_s_per_m * closing_m_s).max(0.0)
        } else {
            0.0
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONFIG: FoodConfig = FoodConfig {
        point_m: [0.0, 0.02, 0.0],
        thickness_m: 0.010,
        stiffness_n_per_m: 4000.0,
        damping_n_s_per_m: 0.0,
        yield_n: 20.0,
    };

    fn food() -> Food {
        Food::new(CONFIG, &Pose::translation(0.0, 0.0, 0.27))
    }

    /// Force at each opening in turn, mm and N.
    fn forces(openings_mm: &[f64]) -> Vec<f64> {
        let mut food = food();
        let at = |opening_mm: f64| Pose::translation(0.0, 0.0, 0.27 - opening_mm * 1e-3);
        openings_mm
            .iter()
            .map(|&opening_mm| {
                food.bite(&at(opening_mm), &Twist::zeros());
                food.force_n
            })
            .collect()
    }

    #[test]
    fn it_resists_yields_stays_flat_and_is_replaced() {
        let openings_mm = [15.0, 10.0, 8.0, 5.0, 3.0, 4.0, 9.0, 7.0, 10.0, 8.0];
        let expected_n = [0.0, 0.0, 8.0, 20.0, 20.0, 16.0, 0.0, 4.0, 0.0, 8.0];
        for (found_n, expected_n) in forces(&openings_mm).into_iter().zip(expected_n) {
            assert!((found_n - expected_n).abs() < 1e-9, "{found_n} N, expected {expected_n} N");
        }
    }

    #[test]
    fn its_wrench_acts_at_the_tooth_and_its_damping_never_pulls() {
        let mut food = Food { config: FoodConfig { damping_n_s_per_m: 100.0, ..CONFIG }, ..food() };
        let pose = Pose::translation(0.0, 0.0, 0.268);
        let closing = food.bite(&pose, &Twist::new(0.0, 0.0, 0.05, 0.0, 0.0, 0.0));
        assert!((food.force_n - 25.0).abs() < 1e-9, "{}", food.force_n);
        // (0, 20 mm, 0) × (0, 0, −25 N)
        assert!((closing - Vector6::new(0.0, 0.0, -25.0, -0.5, 0.0, 0.0)).amax() < 1e-9, "{closing}");
        let opening = food.bite(&pose, &Twist::new(0.0, 0.0, -0.5, 0.0, 0.0, 0.0));
        assert_eq!((food.force_n, opening.amax()), (0.0, 0.0));
    }
}
