//! Poses of the platform at rest: level on its legs, at power-on and with the mouth closed.
//!
//! Inverse kinematics alone finds these poses, by bisection.

use masseter_model::geometry::{LEGS, Mechanism, Pose, frame_of_corners};
use masseter_scenario::JawConfig;
use nalgebra::Translation3;

/// The platform with the mouth closed. The pose is taken as level, which is an approximation for a mechanism of unequal
/// sides: the exact pose would take the forward kinematics.
pub(crate) fn closed_mouth(mechanism: &Mechanism, jaw: &JawConfig) -> Pose {
    Translation3::from(jaw.closed_offset_m) * level(mechanism, jaw.closed_leg_m)
}

/// The platform level on three legs of that mean length, turned as the hinges are and above their middle.
pub(crate) fn level(mechanism: &Mechanism, leg_m: f64) -> Pose {
    let hinges = frame_of_corners(&std::array::from_fn(|leg| mechanism.hinge(leg, 0.0)));
    let at_height = |height_m: f64| Pose::translation(0.0, 0.0, height_m) * hinges;
    let mean_leg_m = |height_m: f64| {
        let joints = mechanism.inverse(&at_height(height_m));
        joints.map_or(0.0, |joints| joints.actuators.leg_m.iter().sum::<f64>() / LEGS as f64)
    };
    let (mut low_m, mut high_m) = (0.0, leg_m);
    for _ in 0..60 {
        let middle_m = f64::midpoint(low_m, high_m);
        if mean_leg_m(middle_m) < leg_m { low_m = middle_m } else { high_m = middle_m }
    }
    at_height(low_m)
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::Joints;
    use masseter_scenario::Scenario;

    use super::*;

    /// Joint coordinates of a scenario's platform, level on its initial legs.
    fn level_joints(scenario: &Scenario) -> Joints {
        let mechanism = Mechanism::new(&scenario.mechanism).unwrap();
        mechanism.inverse(&level(&mechanism, scenario.dynamics.initial_leg_m)).unwrap()
    }

    #[test]
    fn the_rig_is_switched_on_level_on_its_initial_legs() {
        let scenario = Scenario::default();
        let joints = level_joints(&scenario).actuators;
        for slide_m in joints.slide_m {
            assert!(slide_m.abs() < 1e-12);
        }
        for leg_m in joints.leg_m {
            assert!((leg_m - scenario.dynamics.initial_leg_m).abs() < 1e-9);
        }
    }

    #[test]
    fn a_turned_base_starts_level_too() {
        let mut scenario = Scenario::default();
        for (slide, leg_deg) in scenario.mechanism.slides.iter_mut().zip([40.0, 160.0, 280.0]) {
            let (sin, cos) = f64::to_radians(leg_deg).sin_cos();
            slide.centre_m = [0.0577 * cos, 0.0577 * sin];
            slide.azimuth_deg = leg_deg + 90.0;
        }
        for slide_m in level_joints(&scenario).actuators.slide_m {
            assert!(slide_m.abs() < 1e-9, "{slide_m}");
        }
    }
}
