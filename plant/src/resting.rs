//! Where the mechanism stands before it moves: level on its legs, where it is switched on and where the mouth is closed.
//!
//! Found by inverse kinematics alone.

use masseter_shared::config::{DynamicsConfig, JawConfig};
use masseter_shared::geometry::{LEGS, Mechanism, Pose};
use nalgebra::Translation3;

use crate::dynamics::Dynamics;
use crate::error::PlantError;

/// The platform where the mouth is closed. Taken as level, which a mechanism of unequal sides need not be there: the
/// pose itself would take the forward kinematics.
pub(crate) fn closed_mouth(mechanism: &Mechanism, jaw: &JawConfig) -> Pose {
    Translation3::from(jaw.closed_offset_m) * level(mechanism, jaw.closed_leg_m)
}

/// The platform level on three legs of that mean length, turned as the hinges are and above their middle: the height
/// is found by bisection.
fn level(mechanism: &Mechanism, leg_m: f64) -> Pose {
    let hinges = mechanism.pose_from_corners(&std::array::from_fn(|leg| mechanism.hinge(leg, 0.0)));
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

/// At rest, level on legs of the initial length.
pub(crate) fn resting(mechanism: Mechanism, config: &DynamicsConfig) -> Result<Dynamics, PlantError> {
    let pose = level(&mechanism, config.initial_leg_m);
    if let Ok(joints) = mechanism.inverse(&pose)
        && let Err(violation) = mechanism.strokes().check(&joints.actuators)
    {
        return Err(PlantError::Start { initial_leg_m: config.initial_leg_m, violation });
    }
    Ok(Dynamics::new(mechanism, *config, pose)?)
}

#[cfg(test)]
mod tests {
    use masseter_shared::config::Scenario;

    use super::*;
    use crate::build::build_emulation;
    use crate::core::check;

    #[test]
    fn the_rig_is_switched_on_level_on_its_initial_legs() {
        let scenario = Scenario::default();
        let truth = build_emulation(&scenario, 0).unwrap().truth();
        let [d1, d2, d3, l1, l2, l3] = truth.joint_m;
        for slide_m in [d1, d2, d3] {
            assert!(slide_m.abs() < 1e-12);
        }
        for leg_m in [l1, l2, l3] {
            assert!((leg_m - scenario.dynamics.initial_leg_m).abs() < 1e-9);
        }
    }

    #[test]
    fn the_rig_may_be_switched_on_with_its_legs_at_either_end() {
        for initial_leg_m in Scenario::default().mechanism.strokes.leg_m {
            let mut scenario = Scenario::default();
            scenario.dynamics.initial_leg_m = initial_leg_m;
            assert_eq!(check(&scenario), Ok(()), "{initial_leg_m}");
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
        let truth = build_emulation(&scenario, 0).unwrap().truth();
        for slide_m in &truth.joint_m[..LEGS] {
            assert!(slide_m.abs() < 1e-9, "{slide_m}");
        }
    }
}
