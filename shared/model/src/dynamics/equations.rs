//! The equations of motion M V̇ + h = Jᵀ τ + w at one instant, and their two solutions.

use nalgebra::{Matrix3, Matrix6, Vector6};

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
        Self::with_added(bodies, motion, &Vector6::zeros())
    }

    /// The same with a further mass on each axis, kg, which may be negative. It resists the change of the axis' speed, and adds
    /// neither weight nor bias.
    pub fn with_added(bodies: &Bodies, motion: &Motion, added_kg: &Vector6<f64>) -> Self {
        let mut sums = Sums::of_platform(bodies, motion);
        let (actuators, hinges) = (&motion.jacobian.actuators, &motion.jacobian.hinges);
        for leg in 0..LEGS {
            let LegEquations { masses: [slide_kg, rod_kg, turning], bias } = bodies.leg(motion, leg);
            let directions: [Vec3; 3] = [
                actuators.fixed_view::<1, 3>(leg, 0).transpose(),
                actuators.fixed_view::<1, 3>(LEGS + leg, 0).transpose(),
                hinges.fixed_view::<1, 3>(leg, 0).transpose(),
            ];
            let forces = [
                slide_kg * motion.bias.axes_m_s2[leg] + bias[0],
                rod_kg * motion.bias.axes_m_s2[LEGS + leg] + bias[1],
                turning * motion.bias.hinges_rad_s2[leg] + bias[2],
            ];
            let masses = [slide_kg + added_kg[leg], rod_kg + added_kg[LEGS + leg], turning];
            let (mut inertia, mut force) = (Matrix3::zeros(), Vec3::zeros());
            for ((direction, mass), along) in directions.iter().zip(masses).zip(forces) {
                inertia.ger(mass, direction, direction, 1.0);
                force += direction * along;
            }
            // A row of the Jacobian is (d, arm × d), so a leg acts as a body in its ball.
            sums.add_at(&motion.legs.arms_m[leg], &inertia, &force);
        }
        Self { mass: sums.mass(), bias: sums.bias(), actuators: motion.jacobian.actuators }
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
}

/// What all bodies need for an acceleration of the platform, about its origin, in blocks of force and moment.
struct Sums {
    /// Force by linear acceleration, which is symmetric.
    linear: Matrix3<f64>,
    /// Moment by linear acceleration; force by angular acceleration is its transpose.
    coupling: Matrix3<f64>,
    /// Moment by angular acceleration.
    angular: Matrix3<f64>,
    /// Without acceleration.
    force: Vec3,
    moment: Vec3,
}

impl Sums {
    /// F = m (a + ω×(ω×c) + g ẑ), N = I ω̇ + ω×Iω + c×F for the centre of mass c.
    fn of_platform(bodies: &Bodies, motion: &Motion) -> Self {
        let platform = &bodies.platform;
        let rotation = motion.pose.rotation.to_rotation_matrix().into_inner();
        let inertia = rotation * platform.inertia_kg_m2 * rotation.transpose();
        let (omega, centre) = (motion.omega(), rotation * platform.centre_m);
        let pull = omega.cross(&omega.cross(&centre)) + Vec3::z() * bodies.gravity_m_s2;
        let mut sums = Self {
            linear: Matrix3::zeros(),
            coupling: Matrix3::zeros(),
            angular: inertia,
            force: Vec3::zeros(),
            moment: omega.cross(&(inertia * omega)),
        };
        let mass = Matrix3::from_diagonal_element(platform.mass_kg);
        sums.add_at(&centre, &mass, &(pull * platform.mass_kg));
        sums
    }

    /// Adds a body at an arm from the platform's origin: its inertia against the acceleration of that point, which is symmetric,
    /// and the force that the body needs without one.
    fn add_at(&mut self, arm: &Vec3, inertia: &Matrix3<f64>, force: &Vec3) {
        let crossed = |matrix: &Matrix3<f64>| {
            Matrix3::from_columns(&[0, 1, 2].map(|column| arm.cross(&matrix.column(column))))
        };
        let coupling = crossed(inertia);
        self.linear += inertia;
        self.coupling += coupling;
        self.angular += crossed(&coupling.transpose());
        self.force += force;
        self.moment += arm.cross(force);
    }

    fn mass(&self) -> Matrix6<f64> {
        let mut mass = Matrix6::zeros();
        mass.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.linear);
        mass.fixed_view_mut::<3, 3>(3, 0).copy_from(&self.coupling);
        mass.fixed_view_mut::<3, 3>(0, 3).copy_from(&self.coupling.transpose());
        mass.fixed_view_mut::<3, 3>(3, 3).copy_from(&self.angular);
        mass
    }

    fn bias(&self) -> Vector6<f64> {
        let (force, moment) = (&self.force, &self.moment);
        Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
    }
}
