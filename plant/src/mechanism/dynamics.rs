//! Forward dynamics of the mechanism in task space: forces of six actuators and gravity in, motion of
//! the platform out.
//!
//! The state is the platform's pose and twist. Joint positions come from inverse kinematics and joint
//! rates from the Jacobian. The forward kinematics is never solved here, so the mechanism is an
//! independent oracle for it. With the [equations](masseter_model::dynamics) of the rigid bodies,
//!
//! M V̇ = Jᵀ(τ − friction) + contact − h.
//!
//! A step is one of the leapfrog scheme (Störmer and Verlet): the acceleration of its middle holds for the whole step.
//! The forces of the drives are held too, so that they act exactly. The scheme is of second order, and no energy drifts
//! away or comes in. Terms of h that depend on the twist take it extrapolated from the last step.
//!
//! The parts are rigid: elasticity is left out.

use masseter_model::dynamics::{Bodies, Equations, Motion, Reactions};
use masseter_model::geometry::{
    AXES, Actuators, InverseError, Jacobian, LimitViolation, Mechanism, Pose, Twist, Vec3,
};
use masseter_scenario::{DynamicsConfig, FaultKindConfig};
use nalgebra::{Quaternion, UnitQuaternion, Vector6};

use super::axes::{Axes, AxesForces, AxisMotion};
use super::contact::{ContactError, Food, Occlusion};
use super::friction::Braking;
use super::load::Load;

/// Pose, twist and joint coordinates of the mechanism.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MechanismState {
    /// The platform in the base frame.
    pub(crate) pose: Pose,
    twist: Twist,
    actuators: Actuators,
}

impl MechanismState {
    /// Joint positions d₁ d₂ d₃ l₁ l₂ l₃, m.
    pub(crate) fn positions_m(&self) -> [f64; AXES] {
        self.actuators.to_axes()
    }
}

/// The moving mechanism.
#[derive(Debug, Clone)]
pub(crate) struct Dynamics {
    mechanism: Mechanism,
    config: DynamicsConfig,
    bodies: Bodies,
    state: MechanismState,
    /// V̇ in the present step.
    acceleration: Twist,
    occlusion: Occlusion,
    braking: Braking,
    axes: Axes,
    load: Load,
}

/// Dynamics that cannot be built or cannot be integrated.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum DynamicsError {
    /// The pose has no joint coordinates.
    #[error("the mechanism came to a pose without joint coordinates: {0}")]
    Inverse(#[from] InverseError),
    /// The mass matrix cannot be inverted: masses or inertias are not positive.
    #[error("the mechanism's mass matrix is not positive definite; check [dynamics]")]
    Mass,
    /// Contact between the jaws that the integration cannot resolve.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// Initial legs on which the platform cannot be level within the strokes.
    #[error(
        "dynamics.initial_leg_m = {initial_leg_m}: {violation}; choose legs, and an initial_offset_m, with which the level \
         platform is within its strokes"
    )]
    Start {
        /// Length of the legs, m.
        initial_leg_m: f64,
        /// The joint that is outside its stroke.
        violation: LimitViolation,
    },
}

impl Dynamics {
    /// The mechanism at rest in a pose of the platform, which must be within the strokes.
    pub(crate) fn new(
        mechanism: Mechanism,
        config: &DynamicsConfig,
        pose: Pose,
        occlusion: Occlusion,
        incisal_m: [f64; 3],
    ) -> Result<Self, DynamicsError> {
        let actuators = mechanism.actuators(&pose)?;
        if let Err(violation) = mechanism.strokes().check(&actuators) {
            return Err(DynamicsError::Start { initial_leg_m: config.initial_leg_m, violation });
        }
        let (twist, acceleration) = (Twist::zeros(), Twist::zeros());
        let state = MechanismState { pose, twist, actuators };
        let bodies = Bodies::from(config);
        let motion = Motion::new(&mechanism, &pose, &twist)?;
        occlusion.check(&Equations::new(&bodies, &motion).mass, config.step_ns)?;
        Ok(Self {
            braking: Braking::new(config, &bodies),
            axes: Axes::new(&config.axes, &mechanism, state.positions_m(), &bodies.axis_mass_kg()),
            load: Load::new(Vec3::from(incisal_m)),
            mechanism,
            config: *config,
            bodies,
            state,
            acceleration,
            occlusion,
        })
    }

    /// A fault of an axis begins.
    pub(crate) fn begin_fault(&mut self, axis: usize, kind: FaultKindConfig, size: f64) {
        let speed_m_s = self.velocities_m_s(&self.state)[axis];
        let motion = AxisMotion { position_m: self.state.positions_m()[axis], speed_m_s };
        self.axes.begin_fault(axis, kind, size, motion);
    }

    /// A fault of an axis ends.
    pub(crate) fn end_fault(&mut self, axis: usize, kind: FaultKindConfig) {
        let speed_m_s = self.velocities_m_s(&self.state)[axis];
        let motion = AxisMotion { position_m: self.state.positions_m()[axis], speed_m_s };
        self.axes.end_fault(axis, kind, motion);
    }

    /// Whether a fault of an axis has changed something.
    pub(crate) fn has_struck(&self, axis: usize, kind: FaultKindConfig) -> bool {
        self.axes.acting(axis).has_struck(kind)
    }

    /// The next axis that has run into one of its end stops, with its speed, m/s.
    pub(crate) fn take_stop_hit(&mut self) -> Option<(usize, f64)> {
        self.axes.take_stop_hit()
    }

    /// Another mass at the incisal point, kg.
    pub(crate) fn set_payload(&mut self, payload_kg: f64) {
        self.load.set_payload(payload_kg);
    }

    /// Takes the forces of the last step from the platform.
    pub(crate) fn release(&mut self) {
        self.load.release();
    }

    /// Adds a force (N) and a torque (N m) for the coming step, in base axes. The force acts at a point of the platform (m;
    /// the incisal point when absent).
    pub(crate) fn load(&mut self, wrench: &Vector6<f64>, point_m: Option<[f64; 3]>) {
        self.load.push(&self.state.pose, wrench, point_m.map(Vec3::from));
    }

    /// Another food, or none.
    pub(crate) fn set_food(&mut self, food: Option<Food>) {
        self.occlusion.set_food(food);
    }

    /// Teeth and food.
    pub(crate) fn occlusion(&mut self) -> &mut Occlusion {
        &mut self.occlusion
    }

    /// Where the encoders see the axes, m: at the drives' side of each joint.
    pub(crate) fn drive_positions_m(&self) -> [f64; AXES] {
        self.axes.drive_positions_m(self.state.positions_m())
    }

    /// The vertical force of food and upper teeth on the jaw, downwards, N.
    pub(crate) fn bite_force_n(&self) -> f64 {
        self.occlusion.bite_force_n()
    }

    /// The present state.
    pub(crate) fn state(&self) -> &MechanismState {
        &self.state
    }

    /// Joint velocities in a state, m/s. They cost more than a step, so that only callers who need them pay.
    pub(crate) fn velocities_m_s(&self, state: &MechanismState) -> [f64; AXES] {
        let legs = self.mechanism.legs(&state.pose).expect("a pose that was reached has joints");
        (Jacobian::of_legs(&self.mechanism, &legs).actuators * state.twist).into()
    }

    /// Applies the actuators' forces (N) for the step that begins.
    pub(crate) fn push(&mut self, force_n: &[f64; AXES]) -> Result<(), DynamicsError> {
        let (twist, step_s) = (self.state.twist, self.step_s());
        let motion = self.middle()?;
        let positions_m = motion.legs.actuators.to_axes();
        let bias_m_s2 = motion.bias.axes_m_s2;
        let actuators = &motion.jacobian.actuators;
        let speeds_m_s = actuators * twist;
        let forces = self.axes.act(force_n, positions_m, &speeds_m_s, &self.braking, step_s);
        let contact = self.occlusion.push(&motion.pose, &twist, step_s);
        let joints = self.braking.of_joints(&motion);
        let moved_kg = forces.resisting_kg - forces.parted_kg;
        let Equations { mut mass, bias, .. } = Equations::with_added(&self.bodies, &motion, &moved_kg);
        let axes_n = forces.force_n + forces.parted_kg.component_mul(&bias_m_s2);
        let wrench = actuators.tr_mul(&axes_n) - joints * twist
            + contact
            + self.load.wrench(&motion.pose, &motion.twist, self.config.gravity_m_s2)
            - bias;
        mass += joints * step_s;
        if let Some(payload) = self.load.mass(&motion.pose) {
            mass += payload;
        }
        self.acceleration = mass.cholesky().ok_or(DynamicsError::Mass)?.solve(&wrench);
        self.settle(&motion, &speeds_m_s, &forces);
        Ok(())
    }

    /// Ends a step that began with these speeds of the axes: what remembers something learns the new speeds and the loads.
    fn settle(&mut self, motion: &Motion, speeds_m_s: &Vector6<f64>, forces: &AxesForces) {
        let step_s = self.step_s();
        let accelerations = motion.accelerations(&self.acceleration);
        let changes_m_s = accelerations.axes_m_s2 * step_s;
        let speeds_m_s = speeds_m_s + changes_m_s;
        let forces_n = forces.force_n - forces.resisting_kg.component_mul(&changes_m_s) / step_s;
        let loads = Reactions::of_joints(&self.bodies, motion, &accelerations, &forces_n).loads(&forces_n);
        self.braking.settle(&loads, &speeds_m_s, step_s);
        self.axes.settle(&speeds_m_s);
    }

    fn step_s(&self) -> f64 {
        self.config.step_ns as f64 * 1e-9
    }

    /// Moves the mechanism for `dt_s`, a part of the step, under the step's acceleration.
    pub(crate) fn advance(&mut self, dt_s: f64) -> Result<(), DynamicsError> {
        let mean_twist = self.state.twist + self.acceleration * (dt_s / 2.0);
        let pose = self.moved(&mean_twist, dt_s);
        let twist = self.state.twist + self.acceleration * dt_s;
        self.state = MechanismState { pose, twist, actuators: self.mechanism.actuators(&pose)? };
        self.axes.advance(dt_s);
        Ok(())
    }

    /// The motion in the middle of the step that begins, there with the twist that the last step's acceleration leads to.
    fn middle(&self) -> Result<Motion, DynamicsError> {
        let half_s = self.step_s() / 2.0;
        let twist = self.state.twist + self.acceleration * half_s;
        Ok(Motion::new(&self.mechanism, &self.moved(&self.state.twist, half_s), &twist)?)
    }

    /// The pose moved on by a twist.
    fn moved(&self, twist: &Twist, dt_s: f64) -> Pose {
        let MechanismState { pose, .. } = &self.state;
        let linear = twist.fixed_rows::<3>(0) * dt_s;
        let angular: Vec3 = twist.fixed_rows::<3>(3) * dt_s;
        let mut rotation = turn(&angular) * pose.rotation;
        rotation.renormalize_fast();
        Pose::from_parts((pose.translation.vector + linear).into(), rotation)
    }
}

/// The rotation by a vector, rad. A step turns so little that two terms of each series suffice: the third, h⁶/720 for half
/// the angle h, is less than a rounding.
fn turn(angle_rad: &Vec3) -> UnitQuaternion<f64> {
    const SERIES_SUFFICES: f64 = 1e-5;
    let half = angle_rad / 2.0;
    let square = half.norm_squared();
    if square > SERIES_SUFFICES {
        return UnitQuaternion::from_scaled_axis(*angle_rad);
    }
    let cos = 1.0 - square / 2.0 * (1.0 - square / 12.0);
    let sinc = 1.0 - square / 6.0 * (1.0 - square / 20.0);
    UnitQuaternion::new_unchecked(Quaternion::from_imag(half * sinc) + Quaternion::from_real(cos))
}

#[cfg(test)]
mod reference;
#[cfg(test)]
mod tests;
