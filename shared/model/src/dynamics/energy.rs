//! The mechanical energy of the bodies, body by body, without the equations of motion.

use nalgebra::Vector3;

use super::bodies::{Bodies, Motion};
use crate::geometry::LEGS;

/// Energy of all bodies, J.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Energy {
    /// Energy of motion, J.
    pub kinetic_j: f64,
    /// Energy of height; 0 with every centre of mass in the base plane, J.
    pub potential_j: f64,
}

impl Energy {
    /// The energy of bodies in a motion.
    pub fn new(bodies: &Bodies, motion: &Motion) -> Self {
        let mut energy = Self::of_platform(bodies, motion);
        let Bodies { carriage_kg, cylinder, rod, gravity_m_s2, .. } = *bodies;
        for leg in 0..LEGS {
            let rod_m = motion.legs.actuators.leg_m[leg] - rod.centre_m;
            let slide_kg = carriage_kg + cylinder.mass_kg + rod.mass_kg;
            let turning_kg_m2 = cylinder.inertia_kg_m2
                + cylinder.mass_kg * cylinder.centre_m.powi(2)
                + rod.inertia_kg_m2
                + rod.mass_kg * rod_m.powi(2);
            let rates = [motion.rates_m_s[leg], motion.rates_m_s[LEGS + leg], motion.swings_rad_s[leg]];
            let squares = [slide_kg, rod.mass_kg, turning_kg_m2]
                .into_iter()
                .zip(rates)
                .map(|(mass, rate)| mass * rate * rate);
            energy.kinetic_j += 0.5 * squares.sum::<f64>();
            let (sin, _) = motion.legs.sin_cos[leg];
            let moment_kg_m = cylinder.mass_kg * cylinder.centre_m + rod.mass_kg * rod_m;
            energy.potential_j += gravity_m_s2 * moment_kg_m * sin;
        }
        energy
    }

    /// Kinetic and potential energy together, J.
    pub fn total_j(&self) -> f64 {
        self.kinetic_j + self.potential_j
    }

    fn of_platform(bodies: &Bodies, motion: &Motion) -> Self {
        let platform = &bodies.platform;
        let rotation = motion.pose.rotation;
        let omega: Vector3<f64> = motion.twist.fixed_rows::<3>(3).into();
        let centre = rotation * platform.centre_m;
        let velocity = motion.twist.fixed_rows::<3>(0) + omega.cross(&centre);
        let turn = rotation.inverse() * omega;
        let kinetic_j =
            0.5 * (platform.mass_kg * velocity.norm_squared() + turn.dot(&(platform.inertia_kg_m2 * turn)));
        let height_m = motion.pose.translation.z + centre.z;
        Self { kinetic_j, potential_j: platform.mass_kg * bodies.gravity_m_s2 * height_m }
    }
}
