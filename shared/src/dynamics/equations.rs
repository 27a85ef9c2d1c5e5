//! The equations of motion M V̇ + h = Jᵀ τ + w at one instant, and their two solutions.

use nalgebra::{Matrix6, Vector6};

use super::bodies::LegEquations;
use super::{Bodies, Motion};
use crate::geometry::{LEGS, Twist, Vec3};

/// The equations of motion at a pose and a twist of the platform.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Equations {
    /// M: against the platform's acceleration, kg, kg m, kg m². It is symmetric.
    pub mass: Matrix6<f64>,
    /// h: centrifugal, Coriolis and gyroscopic terms, and minus the weight; N and N m.
    pub bias: Vector6<f64>,
    /// J: rates of the axes from the twist.
    actuators: Matrix6<f64>,
}

impl Equations {
    /// The equations of bodies in a motion: those of the platform, and those of each leg's joints, projected on the
    /// platform by d'Alembert's principle.
    pub fn new(bodies: &Bodies, motion: &Motion) -> Self {
        let mut equations = Self::of_platform(bodies, motion);
        let (actuators, hinges) = (&motion.jacobian.actuators, &motion.jacobian.hinges);
        for leg in 0..LEGS {
            let joints = [
                (actuators.row(leg).transpose(), motion.bias.axes_m_s2[leg]),
                (actuators.row(LEGS + leg).transpose(), motion.bias.axes_m_s2[LEGS + leg]),
                (hinges.row(leg).transpose(), motion.bias.hinges_rad_s2[leg]),
            ];
            let LegEquations { masses, bias } = bodies.leg(motion, leg);
            for (((row, acceleration), mass), bias) in joints.into_iter().zip(masses).zip(bias) {
                equations.mass.ger(mass, &row, &row, 1.0);
                equations.bias += row * (mass * acceleration + bias);
            }
        }
        equations
    }

    /// The platform's acceleration V̇ (m/s², rad/s²) under forces of the axes (N) and a wrench on the platform. None where
    /// a value is not finite.
    pub fn forward(&self, force_n: &Vector6<f64>, wrench: &Vector6<f64>) -> Option<Twist> {
        let driving = self.actuators.tr_mul(force_n) + wrench - self.bias;
        Some(self.mass.cholesky()?.solve(&driving))
    }

    /// The forces of the axes (N) under which the platform has an acceleration V̇ (m/s², rad/s²), with a wrench on the
    /// platform. None in a singular pose.
    pub fn inverse(&self, acceleration: &Twist, wrench: &Vector6<f64>) -> Option<Vector6<f64>> {
        let needed = self.mass * acceleration + self.bias - wrench;
        self.actuators.transpose().lu().solve(&needed)
    }

    /// F = m (a + ω×(ω×c) + g ẑ), N = I ω̇ + ω×Iω + c×F for the centre of mass c.
    fn of_platform(bodies: &Bodies, motion: &Motion) -> Self {
        let platform = &bodies.platform;
        let rotation = motion.pose.rotation.to_rotation_matrix().into_inner();
        let inertia = rotation * platform.inertia_kg_m2 * rotation.transpose();
        let (omega, centre) = (motion.omega(), rotation * platform.centre_m);
        let moment = centre.cross_matrix() * platform.mass_kg;
        let mut mass = Matrix6::zeros();
        mass.fixed_view_mut::<3, 3>(0, 0).fill_diagonal(platform.mass_kg);
        mass.fixed_view_mut::<3, 3>(0, 3).copy_from(&-moment);
        mass.fixed_view_mut::<3, 3>(3, 0).copy_from(&moment);
        mass.fixed_view_mut::<3, 3>(3, 3).copy_from(&(inertia - moment * centre.cross_matrix()));
        let pull = omega.cross(&omega.cross(&centre)) + Vec3::z() * bodies.gravity_m_s2;
        let force = pull * platform.mass_kg;
        let turn = omega.cross(&(inertia * omega)) + centre.cross(&force);
        let bias = Vector6::new(force.x, force.y, force.z, turn.x, turn.y, turn.z);
        Self { mass, bias, actuators: motion.jacobian.actuators }
    }
}
