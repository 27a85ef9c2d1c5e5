//! The difference between two poses of the platform.

use super::{Pose, Vec3};

/// How far one pose is from another.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Deviation {
    /// Distance of the platform's origin, m.
    pub origin_m: f64,
    /// Distance of the incisal point, m.
    pub incisal_m: f64,
    /// Angle of the rotation between them, rad.
    pub angle_rad: f64,
}

impl Deviation {
    /// The difference between the poses `a` and `b`, with the incisal point at `incisal_m` in the platform frame.
    pub fn between(a: &Pose, b: &Pose, incisal_m: [f64; 3]) -> Self {
        let incisal = Vec3::from(incisal_m);
        let apart_m = a.translation.vector - b.translation.vector;
        Self {
            origin_m: apart_m.norm(),
            incisal_m: (apart_m + a.rotation * incisal - b.rotation * incisal).norm(),
            angle_rad: a.rotation.angle_to(&b.rotation),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_about_the_origin_moves_the_incisal_point_alone() {
        let turned = Pose::new(Vec3::zeros(), Vec3::new(0.0, 0.0, 0.01));
        let found = Deviation::between(&Pose::identity(), &turned, [0.03, 0.0, 0.5]);
        assert!((found.incisal_m - 0.06 * 0.005f64.sin()).abs() < 1e-15, "{found:?}");
        assert!((found.angle_rad - 0.01).abs() < 1e-15 && found.origin_m == 0.0, "{found:?}");
        let shifted = Pose::translation(0.0, 3e-3, -4e-3);
        let found = Deviation::between(&shifted, &Pose::identity(), [0.03, 0.0, 0.5]);
        assert!((found.origin_m - 5e-3).abs() < 1e-15 && (found.incisal_m - 5e-3).abs() < 1e-15, "{found:?}");
    }
}
