//! Whether the jaw stands near enough to the first pose of the motion to be eased there.

use masseter_model::geometry::{Mechanism, Pose, Vec3};
use masseter_runtime::messages::codes::Cause;
use masseter_scenario::Scenario;

use crate::safety::Fault;

/// The limit of the way to the first pose.
#[derive(Debug)]
pub(crate) struct StartTolerance {
    /// None where the way may have any length.
    limit_m: Option<f64>,
    /// The incisal point and the corners of the platform, platform frame: no turn leaves all of them in place.
    points: [Vec3; 4],
}

impl StartTolerance {
    pub(crate) fn new(scenario: &Scenario, mechanism: &Mechanism) -> Self {
        let [a1, a2, a3] = *mechanism.platform_corners();
        let points = [Vec3::from(scenario.jaw.reference_point_m), a1, a2, a3];
        Self { limit_m: scenario.start_tolerance_m(), points }
    }

    /// Refuses a start from a pose of which a point is farther from the first pose than allowed.
    pub(crate) fn check(&self, found: &Pose, first: &Pose) -> Result<(), Fault> {
        let Some(limit_m) = self.limit_m else { return Ok(()) };
        let place = |pose: &Pose, point: &Vec3| pose.rotation * point + pose.translation.vector;
        let distances_m = self.points.iter().map(|point| (place(found, point) - place(first, point)).norm());
        let farthest_m = distances_m.fold(0.0, f64::max);
        if farthest_m <= limit_m {
            return Ok(());
        }
        Err(Fault::new(Cause::StartTooFar, farthest_m, limit_m))
    }
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::MechanismConfig;

    use super::*;

    fn tolerance(interfaces: &[&str], tolerance_mm: Option<f64>) -> StartTolerance {
        let mut scenario = Scenario::default();
        scenario.can.interfaces = interfaces.iter().map(|&name| name.to_owned()).collect();
        scenario.controller.start_tolerance_mm = tolerance_mm;
        StartTolerance::new(&scenario, &Mechanism::new(&MechanismConfig::default()).unwrap())
    }

    #[test]
    fn the_way_is_limited_on_real_interfaces_and_where_the_scenario_says_so() {
        let first = Pose::identity();
        let found = Pose::translation(0.0, 0.0, 3e-3);
        assert_eq!(tolerance(&[], None).check(&found, &first), Ok(()));
        assert_eq!(tolerance(&["can0", "can1"], Some(3.1)).check(&found, &first), Ok(()));
        for limited in [tolerance(&["can0", "can1"], None), tolerance(&[], Some(2.0))] {
            let fault = limited.check(&found, &first).unwrap_err();
            assert_eq!((fault.cause, fault.limit), (Cause::StartTooFar, 2e-3));
            assert!((fault.value - 3e-3).abs() < 1e-12);
        }
    }

    #[test]
    fn a_turn_counts_too() {
        let turned = Pose::new(Vec3::zeros(), Vec3::new(0.2, 0.0, 0.0));
        assert!(tolerance(&[], Some(2.0)).check(&turned, &Pose::identity()).is_err());
    }
}
