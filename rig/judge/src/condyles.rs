//! An estimate of the load of both condyles: the forces on them that would hold the jaw alone, without muscles.
//!
//! The jaw is the rigid platform with its mass. Two points cannot take a moment about the line between them: muscles would,
//! and load the condyles in turn. What the two press against each other along that line is taken as 0. So this is no load of
//! a human joint; it shows how a bite and the inertia share out between left and right.

use masseter_model::dynamics::{Bodies, Platform};
use masseter_model::geometry::{Jacobian, Mechanism, Pose, Twist, Vec3};
use masseter_recording::jaw_points;
use masseter_runtime::messages::{Contact, Truth};
use masseter_scenario::Scenario;

use crate::poses::true_pose;

/// The jaw of a scenario.
#[derive(Debug, Clone)]
pub(crate) struct Condyles {
    mechanism: Mechanism,
    platform: Platform,
    gravity_m_s2: f64,
    /// Left and right, platform frame, m.
    points_m: [Vec3; 2],
    cycle_s: f64,
}

impl Condyles {
    /// None for a mechanism that no run has.
    pub(crate) fn new(scenario: &Scenario) -> Option<Self> {
        let mechanism = Mechanism::new(&scenario.mechanism).ok()?;
        let Bodies { platform, gravity_m_s2, .. } = Bodies::from(&scenario.dynamics);
        let [_, left, right] = jaw_points(&scenario.jaw);
        Some(Self {
            mechanism,
            platform,
            gravity_m_s2,
            points_m: [left, right],
            cycle_s: scenario.period_s(),
        })
    }

    /// The forces on the left and the right condyle, base axes, N, from two consecutive cycles and the contact of the second.
    pub(crate) fn forces_n(&self, [before, now]: [&Truth; 2], contact: &Contact) -> Option<[Vec3; 2]> {
        let ((_, before), (pose, twist)) = (self.motion(before)?, self.motion(now)?);
        let loads = contact.teeth().map(|tooth| (Vec3::from(tooth.place_m), Vec3::from(tooth.force_n)));
        Some(self.shared(&pose, &twist, &((twist - before) / self.cycle_s), loads))
    }

    fn motion(&self, truth: &Truth) -> Option<(Pose, Twist)> {
        let pose = true_pose(truth)?;
        let jacobian = Jacobian::of_legs(&self.mechanism, &self.mechanism.legs(&pose).ok()?);
        Some((pose, jacobian.actuators.lu().solve(&Twist::from(truth.joint_m_s))?))
    }

    /// Shares the forces on the teeth (each with its place, platform frame), the weight and the inertia.
    fn shared(
        &self,
        pose: &Pose,
        twist: &Twist,
        acceleration: &Twist,
        loads: impl Iterator<Item = (Vec3, Vec3)>,
    ) -> [Vec3; 2] {
        let parts =
            |of: &Twist| -> (Vec3, Vec3) { (of.fixed_rows::<3>(0).into(), of.fixed_rows::<3>(3).into()) };
        let ((_, omega), (linear, angular)) = (parts(twist), parts(acceleration));
        let [left, right] = self.points_m.map(|point_m| pose.rotation * point_m);
        let (middle, across) = ((left + right) / 2.0, (left - right) / 2.0);
        let centre = pose.rotation * self.platform.centre_m;
        let of_centre = linear + angular.cross(&centre) + omega.cross(&omega.cross(&centre));
        let turn = pose.rotation.to_rotation_matrix();
        let inertia = turn * self.platform.inertia_kg_m2 * turn.inverse();
        // What is wanted at first, then without what the teeth give.
        let mut force_n = (of_centre + Vec3::z() * self.gravity_m_s2) * self.platform.mass_kg;
        let mut moment =
            inertia * angular + omega.cross(&(inertia * omega)) + (centre - middle).cross(&force_n);
        for (place_m, load_n) in loads {
            force_n -= load_n;
            moment -= (pose.rotation * place_m - middle).cross(&load_n);
        }
        let apart_n = moment.cross(&across) / across.norm_squared();
        [(force_n + apart_n) / 2.0, (force_n - apart_n) / 2.0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shared(scenario: &Scenario, acceleration: Twist, loads: &[(Vec3, Vec3)]) -> [Vec3; 2] {
        let condyles = Condyles::new(scenario).unwrap();
        condyles.shared(&Pose::identity(), &Twist::zeros(), &acceleration, loads.iter().copied())
    }

    fn near(found: Vec3, expected: [f64; 3]) -> bool {
        (found - Vec3::from(expected)).norm() < 1e-9
    }

    /// A light jaw with condyles 0.1 m apart, bitten in the middle, beside the left condyle, and outside both.
    #[test]
    fn a_bite_is_shared_by_the_law_of_the_lever() {
        let mut scenario = Scenario::default();
        scenario.dynamics.platform_mass_kg = 0.001;
        scenario.jaw.bonwill_side_m = 0.1;
        let weight_n = 0.001 * Condyles::new(&scenario).unwrap().gravity_m_s2;
        for (left_m, shares) in
            [(0.0, [0.5, 0.5]), (0.05, [1.0, 0.0]), (0.1, [1.5, -0.5]), (-0.025, [0.25, 0.75])]
        {
            let bite = (Vec3::new(0.03, left_m, 0.0), Vec3::new(0.0, 0.0, -100.0));
            let found = shared(&scenario, Twist::zeros(), &[bite]);
            for (found, share) in found.into_iter().zip(shares) {
                assert!(near(found, [0.0, 0.0, 100.0 * share + weight_n / 2.0]), "{left_m} m: {found}");
            }
        }
    }

    #[test]
    fn without_a_bite_the_condyles_bear_weight_and_inertia_of_the_jaw() {
        let scenario = Scenario::default();
        let gravity_m_s2 = Condyles::new(&scenario).unwrap().gravity_m_s2;
        let [left, right] = shared(&scenario, Twist::new(2.0, 0.0, 4.0, 0.0, 0.0, 0.0), &[]);
        let mass_kg = scenario.dynamics.platform_mass_kg;
        assert!(near(left + right, [2.0 * mass_kg, 0.0, (gravity_m_s2 + 4.0) * mass_kg]), "{left} {right}");
        // A turn to the left about the vertical through the centre of mass: couples of the condyles along x.
        let [left, right] = shared(&scenario, Twist::new(0.0, 0.0, -gravity_m_s2, 0.0, 0.0, 10.0), &[]);
        let across_m = scenario.jaw.bonwill_side_m;
        let couple_n = 10.0 * scenario.dynamics.platform_inertia_kg_m2[2] / across_m;
        assert!(near(left, [-couple_n, 0.0, 0.0]) && near(right, [couple_n, 0.0, 0.0]), "{left} {right}");
    }
}
