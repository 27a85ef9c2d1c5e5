//! Teeth that touch each other: a tooth gives way in its ligament, at first easily, then less.
//!
//! The stiffness is an assumption: no measured one is known.

use masseter_model::geometry::Vec3;
use masseter_scenario::TeethConfig;

use super::grip::{Friction, Grip};
use super::law;
use super::pair::Touch;

/// The contact of a pair of teeth.
#[derive(Debug, Clone)]
pub(super) struct Enamel {
    clearance_m: f64,
    soft_n_per_m: f64,
    soft_up_to_n: f64,
    stiff_n_per_m: f64,
    damping_s_per_m: f64,
    friction: Friction,
    grip: Grip,
}

impl Enamel {
    pub(super) fn new(teeth: &TeethConfig) -> Self {
        let &TeethConfig { clearance_m, soft_n_per_m, soft_up_to_n, stiff_n_per_m, damping_s_per_m, .. } =
            teeth;
        let friction = Friction { coefficient: teeth.friction, stiffness_n_per_m: stiff_n_per_m };
        Self {
            clearance_m,
            soft_n_per_m,
            soft_up_to_n,
            stiff_n_per_m,
            damping_s_per_m,
            friction,
            grip: Grip::default(),
        }
    }

    /// The force on the lower tooth, base axes, N.
    pub(super) fn force_n(&mut self, touch: &Touch) -> Vec3 {
        let elastic_n = self.elastic_n(-touch.gap_m - self.clearance_m);
        let normal_n = law::force_n(elastic_n, self.damping_s_per_m, touch.closing_m_s);
        touch.normal * -normal_n + self.grip.force_n(touch, normal_n, self.friction)
    }

    /// The force of a compression, N.
    fn elastic_n(&self, compression_m: f64) -> f64 {
        let soft_n = self.soft_n_per_m * compression_m;
        if soft_n <= self.soft_up_to_n {
            return soft_n.max(0.0);
        }
        self.soft_up_to_n + self.stiff_n_per_m * (compression_m - self.soft_up_to_n / self.soft_n_per_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tooth_is_soft_up_to_4_n_and_then_ten_times_stiffer() {
        let enamel = Enamel::new(&TeethConfig::default());
        for (compression_um, expected_n) in [(-5.0, 0.0), (10.0, 2.0), (20.0, 4.0), (30.0, 24.0)] {
            let found_n = enamel.elastic_n(compression_um * 1e-6);
            assert!((found_n - expected_n).abs() < 1e-9, "{found_n} N at {compression_um} µm");
        }
    }
}
