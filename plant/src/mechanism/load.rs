//! What a scenario loads the platform with: a mass at the incisal point, and forces and torques of stimuli.

use std::ops::AddAssign;

use masseter_model::geometry::{Pose, Twist, Vec3};
use nalgebra::{Matrix3, Matrix6, Vector6};

/// The wrench of a vertical force (N) at an arm (m) about the platform's origin.
pub(super) fn vertical(force_n: f64, arm: &Vec3) -> Vector6<f64> {
    Vector6::new(0.0, 0.0, force_n, arm.y * force_n, -arm.x * force_n, 0.0)
}

/// The load.
#[derive(Debug, Clone, Copy)]
pub(super) struct Load {
    /// The incisal point in the platform frame, m.
    incisal_m: Vec3,
    payload_kg: f64,
    /// The wrench of the pushes on the platform, about its origin, in base axes.
    pushed: Vector6<f64>,
}

impl Load {
    /// No load yet.
    pub(super) fn new(incisal_m: Vec3) -> Self {
        Self { incisal_m, payload_kg: 0.0, pushed: Vector6::zeros() }
    }

    /// Another mass at the incisal point.
    pub(super) fn set_payload(&mut self, payload_kg: f64) {
        self.payload_kg = payload_kg;
    }

    /// Takes every push away.
    pub(super) fn release(&mut self) {
        self.pushed = Vector6::zeros();
    }

    /// Adds a force (N) and a torque (N m), in base axes. The force acts at a point of the platform (m, platform frame; the
    /// incisal point when absent).
    pub(super) fn push(&mut self, pose: &Pose, wrench: &Vector6<f64>, point_m: Option<Vec3>) {
        let arm = pose.rotation * point_m.unwrap_or(self.incisal_m);
        let moment = arm.cross(&wrench.fixed_rows::<3>(0));
        self.pushed += wrench;
        self.pushed.fixed_rows_mut::<3>(3).add_assign(&moment);
    }

    /// The payload's share of the platform's mass matrix, which is that of a point mass; none without a payload.
    pub(super) fn mass(&self, pose: &Pose) -> Option<Matrix6<f64>> {
        if self.payload_kg == 0.0 {
            return None;
        }
        let mut mass = Matrix6::zeros();
        let across = self.arm(pose).cross_matrix() * self.payload_kg;
        mass.fixed_view_mut::<3, 3>(0, 0).copy_from(&(Matrix3::identity() * self.payload_kg));
        mass.fixed_view_mut::<3, 3>(0, 3).copy_from(&-across);
        mass.fixed_view_mut::<3, 3>(3, 0).copy_from(&across);
        mass.fixed_view_mut::<3, 3>(3, 3).copy_from(&-(across * self.arm(pose).cross_matrix()));
        Some(mass)
    }

    /// The wrench on the platform: forces, the payload's weight, and its centrifugal force.
    pub(super) fn wrench(&self, pose: &Pose, twist: &Twist, gravity_m_s2: f64) -> Vector6<f64> {
        if self.payload_kg == 0.0 {
            return self.pushed;
        }
        let arm = self.arm(pose);
        let omega: Vec3 = twist.fixed_rows::<3>(3).into();
        let force = omega.cross(&omega.cross(&arm)) * -self.payload_kg;
        let moment = arm.cross(&force);
        self.pushed
            + vertical(-self.payload_kg * gravity_m_s2, &arm)
            + Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
    }

    fn arm(&self, pose: &Pose) -> Vec3 {
        pose.rotation * self.incisal_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load() -> Load {
        let mut load = Load::new(Vec3::new(0.03, 0.0, 0.01));
        load.set_payload(2.0);
        load
    }

    #[test]
    fn a_payload_has_the_kinetic_energy_of_a_point_mass() {
        let pose = Pose::rotation(Vec3::new(0.1, 0.2, 0.3));
        let twist = Twist::new(0.1, -0.2, 0.3, 2.0, -1.0, 3.0);
        let (linear, angular): (Vec3, Vec3) =
            (twist.fixed_rows::<3>(0).into(), twist.fixed_rows::<3>(3).into());
        let speed = linear + angular.cross(&(pose.rotation * Vec3::new(0.03, 0.0, 0.01)));
        let energy_j = 0.5 * twist.dot(&(load().mass(&pose).unwrap() * twist));
        assert!((energy_j - speed.norm_squared()).abs() < 1e-12);
    }

    #[test]
    fn its_weight_and_a_force_act_where_they_are_and_a_torque_anywhere() {
        let mut load = load();
        let push = Vector6::new(0.0, 5.0, 0.0, 0.2, 0.0, 0.0);
        load.push(&Pose::identity(), &push, Some(Vec3::new(0.1, 0.0, 0.0)));
        let wrench = load.wrench(&Pose::identity(), &Twist::zeros(), 10.0);
        assert!((wrench - Vector6::new(0.0, 5.0, -20.0, 0.2, 0.6, 0.5)).amax() < 1e-12, "{wrench}");
        load.release();
        assert_eq!(load.wrench(&Pose::identity(), &Twist::zeros(), 0.0), Vector6::zeros());
    }
}
