//! The mechanical energy of the bodies.

use super::{Bodies, Motion};
use crate::geometry::{LEGS, Vec3};

/// Energy of all bodies, J.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Energy {
    /// Energy of motion, J.
    pub kinetic_j: f64,
    /// Energy of height; 0 with every centre of mass in the base plane, J.
    pub potential_j: f64,
}

impl Energy {
    /// The energy of bodies in a motion, body by body.
    pub fn new(bodies: &Bodies, motion: &Motion) -> Self {
        let mut energy = Self::of_platform(bodies, motion);
        for leg in 0..LEGS {
            let leg_m = motion.legs.actuators.leg_m[leg];
            let rates = [motion.rates_m_s[leg], motion.rates_m_s[LEGS + leg], motion.swings_rad_s[leg]];
            let masses = [bodies.slide_kg(), bodies.rod.mass_kg, bodies.leg_inertia_kg_m2(leg_m)];
            let squares = masses.iter().zip(rates).map(|(mass, rate)| mass * rate * rate);
            energy.kinetic_j += 0.5 * squares.sum::<f64>();
            let (sin, _) = motion.legs.sin_cos[leg];
            energy.potential_j += bodies.gravity_m_s2 * bodies.leg_moment_kg_m(leg_m) * sin;
        }
        energy
    }

    /// Kinetic and potential energy together, J.
    pub fn total_j(&self) -> f64 {
        self.kinetic_j + self.potential_j
    }

    fn of_platform(bodies: &Bodies, motion: &Motion) -> Self {
        let platform = &bodies.platform;
        let (rotation, omega) = (motion.pose.rotation, motion.omega());
        let centre = rotation * platform.centre_m;
        let velocity = Vec3::from(motion.twist.fixed_rows::<3>(0)) + omega.cross(&centre);
        let turn = rotation.inverse() * omega;
        let kinetic_j =
            0.5 * (platform.mass_kg * velocity.norm_squared() + turn.dot(&(platform.inertia_kg_m2 * turn)));
        let height_m = motion.pose.translation.z + centre.z;
        Self { kinetic_j, potential_j: platform.mass_kg * bodies.gravity_m_s2 * height_m }
    }
}
