//! The equations of motion M V̇ + h = Jᵀ τ + w at one instant, and their two solutions. Also the forces and moments in
//! the joints of each leg. The equations contain no friction.

use nalgebra::{Matrix3, Matrix6, Vector6};

use super::bodies::{Bodies, JointAccelerations, LegEquations, Link, Motion};
use super::friction::Loads;
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
    /// The equations of bodies in a motion. D'Alembert's principle projects the equations of each leg's joints on the
    /// platform.
    pub fn new(bodies: &Bodies, motion: &Motion) -> Self {
        Self::with_added(bodies, motion, &Vector6::zeros())
    }

    /// The equations with a further mass on each axis, kg, which may be negative. The mass resists the change of the
    /// axis' speed, and adds neither weight nor bias.
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
        sums.into_equations(&motion.jacobian.actuators)
    }

    /// The platform's acceleration V̇ (m/s², rad/s²) under forces of the axes (N) and a wrench on the platform. `None` if
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

/// Force and moment that all bodies need for an acceleration of the platform, about its origin, in blocks.
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

    /// Adds a body at an arm from the platform's origin. `inertia` is symmetric and resists the acceleration of that
    /// point; the body needs `force` at zero acceleration.
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

    fn into_equations(self, actuators: &Matrix6<f64>) -> Equations {
        let Self { linear, coupling, angular, force, moment } = self;
        let mut mass = Matrix6::zeros();
        mass.fixed_view_mut::<3, 3>(0, 0).copy_from(&linear);
        mass.fixed_view_mut::<3, 3>(3, 0).copy_from(&coupling);
        mass.fixed_view_mut::<3, 3>(0, 3).copy_from(&coupling.transpose());
        mass.fixed_view_mut::<3, 3>(3, 3).copy_from(&angular);
        let bias = Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
        Equations { mass, bias, actuators: *actuators }
    }
}

/// A force and a moment at a leg's hinge, in the leg's axes: û along the slide, v̂ inward, ẑ up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointWrench {
    /// Force along û, v̂, ẑ, N.
    pub force_n: Vec3,
    /// Moment about û, v̂, ẑ, for the point of the hinge, N m.
    pub moment_nm: Vec3,
}

/// Reactions in the joints of a leg.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LegReactions {
    /// Force of the rod on the platform at the ball, along û, v̂, ẑ, N.
    pub ball_n: Vec3,
    /// Of the cylinder on the rod, the force of the leg's axis along the rod included.
    pub rod: JointWrench,
    /// Of the carriage on the cylinder; the hinge has no moment about û.
    pub hinge: JointWrench,
    /// Of the base on the carriage. Its force along û is that of the slide's axis; the guide carries the rest.
    pub guide: JointWrench,
}

/// Reactions in the joints of all legs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reactions {
    /// Legs 1, 2, 3.
    pub legs: [LegReactions; LEGS],
}

impl Reactions {
    /// The reactions in a motion with the platform's acceleration V̇ (m/s², rad/s²) and the forces of the axes (N).
    /// Acceleration and forces belong together by [`Equations::inverse`] or [`Equations::forward`]. Friction of an axis
    /// is a part of its force.
    pub fn new(bodies: &Bodies, motion: &Motion, acceleration: &Twist, force_n: &Vector6<f64>) -> Self {
        Self::of_joints(bodies, motion, &motion.accelerations(acceleration), force_n)
    }

    /// The reactions for known accelerations of the joints.
    pub fn of_joints(
        bodies: &Bodies,
        motion: &Motion,
        accelerations: &JointAccelerations,
        force_n: &Vector6<f64>,
    ) -> Self {
        let (axes, hinges) = (&accelerations.axes_m_s2, &accelerations.hinges_rad_s2);
        let legs = std::array::from_fn(|leg| {
            let joints = [axes[leg], axes[LEGS + leg], hinges[leg]];
            LegReactions::new(bodies, motion, leg, joints, [force_n[leg], force_n[LEGS + leg]])
        });
        Self { legs }
    }

    /// The loads that friction depends on. `force_n` are the axes' forces of these reactions, N.
    pub fn loads(&self, force_n: &Vector6<f64>) -> Loads {
        let across = |load: &Vec3| load.yz().norm();
        Loads {
            guide_n: self.legs.map(|leg| across(&leg.guide.force_n)),
            guide_nm: self.legs.map(|leg| across(&leg.guide.moment_nm)),
            screw_n: force_n.abs().into(),
            hinge_n: self.legs.map(|leg| leg.hinge.force_n.norm()),
            ball_n: self.legs.map(|leg| leg.ball_n.norm()),
        }
    }
}

impl LegReactions {
    /// The reactions by Newton and Euler, from the ball down to the guide. Accelerations are in the order d, l, θ;
    /// forces are those of the leg's two axes, N.
    fn new(bodies: &Bodies, motion: &Motion, leg: usize, accelerations: [f64; 3], axes_n: [f64; 2]) -> Self {
        let [slide_m_s2, stretch_m_s2, swing_rad_s2] = accelerations;
        let (leg_m, (sin, cos)) = (motion.legs.actuators.leg_m[leg], motion.legs.sin_cos[leg]);
        let (stretch_m_s, swing_rad_s) = (motion.rates_m_s[LEGS + leg], motion.swings_rad_s[leg]);
        let (along, across) = (Vec3::new(0.0, cos, sin), Vec3::new(0.0, -sin, cos));
        let carried_m_s2 = Vec3::new(slide_m_s2, 0.0, bodies.gravity_m_s2);
        // Force and moment that a link needs for its motion against its weight. Speed and acceleration along the leg
        // are those of the distance from the hinge to its centre.
        let needed_by = |link: &Link, arm_m: f64, speed_m_s: f64, acceleration_m_s2: f64| {
            let acceleration = carried_m_s2
                + along * (acceleration_m_s2 - arm_m * swing_rad_s * swing_rad_s)
                + across * (arm_m * swing_rad_s2 + 2.0 * speed_m_s * swing_rad_s);
            let force_n = acceleration * link.mass_kg;
            let turn_nm = Vec3::x() * (link.inertia_kg_m2 * swing_rad_s2);
            JointWrench { force_n, moment_nm: (along * arm_m).cross(&force_n) + turn_nm }
        };
        let LegEquations { masses, bias } = bodies.leg(motion, leg);
        let inertial = |place: usize, joint: f64| masses[place] * joint + bias[place];
        let ball_n = Vec3::x() * (axes_n[0] - inertial(0, slide_m_s2))
            + along * (axes_n[1] - inertial(1, stretch_m_s2))
            - across * (inertial(2, swing_rad_s2) / leg_m);
        let at_ball = JointWrench { force_n: ball_n, moment_nm: (along * leg_m).cross(&ball_n) };
        let rod_m = bodies.rod_from_hinge_m(leg_m);
        let rod = needed_by(&bodies.rod, rod_m, stretch_m_s, stretch_m_s2).with(&at_ball);
        let hinge = needed_by(&bodies.cylinder, bodies.cylinder.centre_m, 0.0, 0.0).with(&rod);
        let guide = JointWrench { force_n: hinge.force_n + carried_m_s2 * bodies.carriage_kg, ..hinge };
        Self { ball_n, rod, hinge, guide }
    }
}

impl JointWrench {
    fn with(self, other: &Self) -> Self {
        Self { force_n: self.force_n + other.force_n, moment_nm: self.moment_nm + other.moment_nm }
    }
}
