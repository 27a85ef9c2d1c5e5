//! The forces and moments that the joints of each leg carry, by Newton and Euler from the ball down to the guide.

use std::ops::AddAssign;

use nalgebra::Vector6;

use super::{Bodies, JointAccelerations, Link, Loads, Motion};
use crate::geometry::{LEGS, Twist, Vec3};

/// A force and a moment at a leg's hinge, in the leg's axes: û along the slide, v̂ inward, ẑ up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointWrench {
    /// Force along û, v̂, ẑ, N.
    pub force_n: Vec3,
    /// Moment about û, v̂, ẑ, for the point of the hinge, N m.
    pub moment_nm: Vec3,
}

/// What the joints of a leg carry.
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

/// What the joints of all legs carry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reactions {
    /// Legs 1, 2, 3.
    pub legs: [LegReactions; LEGS],
}

/// A leg's motion in the plane of v̂ and ẑ, and along û.
struct LegMotion {
    /// Along the leg, and across it.
    along: Vec3,
    across: Vec3,
    leg_m: f64,
    stretch_m_s: f64,
    swing_rad_s: f64,
    slide_m_s2: f64,
    stretch_m_s2: f64,
    swing_rad_s2: f64,
    gravity_m_s2: f64,
}

impl Reactions {
    /// The reactions in a motion in which the platform has an acceleration V̇ (m/s², rad/s²) under these forces of the axes
    /// (N): those of [`Equations::inverse`](super::Equations::inverse), or those that [`forward`](super::Equations::forward)
    /// made the acceleration of. Friction of an axis is a part of its force.
    pub fn new(bodies: &Bodies, motion: &Motion, acceleration: &Twist, force_n: &Vector6<f64>) -> Self {
        Self::of_joints(bodies, motion, &motion.accelerations(acceleration), force_n)
    }

    /// The same where the joints' accelerations are known.
    pub fn of_joints(
        bodies: &Bodies,
        motion: &Motion,
        accelerations: &JointAccelerations,
        force_n: &Vector6<f64>,
    ) -> Self {
        let legs = std::array::from_fn(|leg| {
            let (axes, swing_rad_s2) = (accelerations.axes_m_s2, accelerations.hinges_rad_s2[leg]);
            let moving = LegMotion::new(bodies, motion, leg, [axes[leg], axes[LEGS + leg], swing_rad_s2]);
            let equations = bodies.leg(motion, leg);
            let inertial = |place: usize, joint: f64| equations.masses[place] * joint + equations.bias[place];
            let ball_n = Vec3::x() * (force_n[leg] - inertial(0, axes[leg]))
                + moving.along * (force_n[LEGS + leg] - inertial(1, axes[LEGS + leg]))
                - moving.across * (inertial(2, swing_rad_s2) / moving.leg_m);
            LegReactions::new(bodies, &moving, ball_n)
        });
        Self { legs }
    }

    /// What friction depends on, with the forces of the axes (N) that these reactions are of.
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
    fn new(bodies: &Bodies, moving: &LegMotion, ball_n: Vec3) -> Self {
        let at_ball =
            JointWrench { force_n: ball_n, moment_nm: (moving.along * moving.leg_m).cross(&ball_n) };
        let rod_m = bodies.rod_from_hinge_m(moving.leg_m);
        let mut rod = moving.needed_by(&bodies.rod, rod_m, moving.stretch_m_s, moving.stretch_m_s2);
        rod += at_ball;
        let mut hinge = moving.needed_by(&bodies.cylinder, bodies.cylinder.centre_m, 0.0, 0.0);
        hinge += rod;
        let mut guide = hinge;
        guide.force_n += Vec3::new(moving.slide_m_s2, 0.0, moving.gravity_m_s2) * bodies.carriage_kg;
        Self { ball_n, rod, hinge, guide }
    }
}

impl LegMotion {
    fn new(bodies: &Bodies, motion: &Motion, leg: usize, accelerations: [f64; 3]) -> Self {
        let [slide_m_s2, stretch_m_s2, swing_rad_s2] = accelerations;
        let (sin, cos) = motion.legs.sin_cos[leg];
        Self {
            along: Vec3::new(0.0, cos, sin),
            across: Vec3::new(0.0, -sin, cos),
            leg_m: motion.legs.actuators.leg_m[leg],
            stretch_m_s: motion.rates_m_s[LEGS + leg],
            swing_rad_s: motion.swings_rad_s[leg],
            slide_m_s2,
            stretch_m_s2,
            swing_rad_s2,
            gravity_m_s2: bodies.gravity_m_s2,
        }
    }

    /// What a link needs to move so against its weight, with its centre at a distance from the hinge that grows at a speed
    /// and with an acceleration along the leg.
    fn needed_by(&self, link: &Link, arm_m: f64, speed_m_s: f64, acceleration_m_s2: f64) -> JointWrench {
        let swing = self.swing_rad_s;
        let acceleration = Vec3::new(self.slide_m_s2, 0.0, self.gravity_m_s2)
            + self.along * (acceleration_m_s2 - arm_m * swing * swing)
            + self.across * (arm_m * self.swing_rad_s2 + 2.0 * speed_m_s * swing);
        let force_n = acceleration * link.mass_kg;
        let turn_nm = Vec3::x() * (link.inertia_kg_m2 * self.swing_rad_s2);
        JointWrench { force_n, moment_nm: (self.along * arm_m).cross(&force_n) + turn_nm }
    }
}

impl AddAssign for JointWrench {
    fn add_assign(&mut self, other: Self) {
        self.force_n += other.force_n;
        self.moment_nm += other.moment_nm;
    }
}
