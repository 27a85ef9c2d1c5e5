//! Forward dynamics of the mechanism in task space: forces of six actuators and gravity in, motion of
//! the platform out.
//!
//! The state is the platform's pose and twist. Joint positions come from inverse kinematics and joint
//! rates from the Jacobian. The forward kinematics is never solved here, so the mechanism is an
//! independent oracle for it. With the [equations](masseter_shared::dynamics) of the rigid bodies,
//!
//! M V̇ = Jᵀ(τ − friction) + food − h.
//!
//! A step is one of the leapfrog scheme (Störmer and Verlet): the acceleration of its middle holds for the whole step.
//! The forces of the drives are held too, so that they act exactly. The scheme is of second order, and no energy drifts
//! away or comes in. Terms of h that depend on the twist take it extrapolated from the last step.
//!
//! End stops, play and elasticity are left out, unless a scenario has [faults](super::disturbances) of the mechanism.

use masseter_shared::config::{DynamicsConfig, FaultKindConfig};
use masseter_shared::dynamics::{Bodies, Equations, Motion};
use masseter_shared::geometry::{
    AXES, InverseError, Jacobian, Joints, LimitViolation, Mechanism, Pose, Twist, Vec3,
};
use nalgebra::{Matrix6, UnitQuaternion, Vector6};

use super::disturbances::{AxisMotion, Disturbances, Disturbed};
use super::food::Food;
use super::friction;
use super::load::Load;

/// Pose, twist and joint coordinates of the mechanism.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MechanismState {
    /// The platform in the base frame.
    pub(crate) pose: Pose,
    twist: Twist,
    joints: Joints,
}

impl MechanismState {
    /// Joint positions d₁ d₂ d₃ l₁ l₂ l₃, m.
    pub(crate) fn positions_m(&self) -> [f64; AXES] {
        self.joints.actuators.to_axes()
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
    food: Option<Food>,
    /// None where the scenario has neither faults nor stimuli of the mechanism.
    injected: Option<Injected>,
}

/// What a scenario does to the mechanism.
#[derive(Debug, Clone)]
struct Injected {
    disturbances: Disturbances,
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
    /// Friction that the integration cannot resolve.
    #[error(
        "[dynamics]: too much friction for the masses it brakes; use less, or a dynamics.step_ns of at most {longest_step_ns}"
    )]
    Friction {
        /// The longest step that resolves it, ns.
        longest_step_ns: u64,
    },
    /// Friction that no allowed step resolves.
    #[error(
        "[dynamics]: too much friction for the masses it brakes, and no dynamics.step_ns resolves it; use less"
    )]
    Stiff,
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
        config: DynamicsConfig,
        pose: Pose,
        food: Option<Food>,
    ) -> Result<Self, DynamicsError> {
        let joints = mechanism.inverse(&pose)?;
        if let Err(violation) = mechanism.strokes().check(&joints.actuators) {
            return Err(DynamicsError::Start { initial_leg_m: config.initial_leg_m, violation });
        }
        let (twist, acceleration) = (Twist::zeros(), Twist::zeros());
        let state = MechanismState { pose, twist, joints };
        let bodies = Bodies::from(&config);
        let dynamics = Self { mechanism, config, bodies, state, acceleration, food, injected: None };
        match dynamics.longest_step_ns()? {
            longest_ns if longest_ns < *DynamicsConfig::STEPS_NS.start() => Err(DynamicsError::Stiff),
            longest_step_ns if config.step_ns > longest_step_ns => {
                Err(DynamicsError::Friction { longest_step_ns })
            }
            _ => Ok(dynamics),
        }
    }

    /// Makes the mechanism ready for faults and loads, with the incisal point in the platform frame, m.
    pub(crate) fn prepare_injection(&mut self, incisal_m: [f64; 3]) {
        let strokes = self.mechanism.strokes();
        let disturbances = Disturbances::new(std::array::from_fn(|axis| strokes.of_axis(axis)));
        self.injected = Some(Injected { disturbances, load: Load::new(Vec3::from(incisal_m)) });
    }

    /// A fault of an axis begins.
    pub(crate) fn begin_fault(&mut self, axis: usize, kind: FaultKindConfig, size: f64) {
        let (positions_m, speeds_m_s) = (self.state.positions_m(), self.velocities_m_s(&self.state));
        let (position_m, speed_m_s) = (positions_m[axis], speeds_m_s[axis]);
        let motion = AxisMotion { position_m, speed_m_s, mass_kg: self.bodies.axis_mass_kg()[axis] };
        if let Some(injected) = &mut self.injected {
            injected.disturbances.begin(axis, kind, size, motion);
        }
    }

    /// A fault of an axis ends.
    pub(crate) fn end_fault(&mut self, axis: usize, kind: FaultKindConfig) {
        let position_m = self.state.positions_m()[axis];
        if let Some(injected) = &mut self.injected {
            injected.disturbances.end(axis, kind, position_m);
        }
    }

    /// Whether a fault of an axis has changed something.
    pub(crate) fn has_struck(&self, axis: usize, kind: FaultKindConfig) -> bool {
        let acting = self.injected.as_ref().map(|injected| injected.disturbances.acting(axis));
        acting.is_some_and(|acting| acting.has_struck(kind))
    }

    /// Another mass at the incisal point, kg.
    pub(crate) fn set_payload(&mut self, payload_kg: f64) {
        if let Some(injected) = &mut self.injected {
            injected.load.set_payload(payload_kg);
        }
    }

    /// Takes the forces of the last step from the platform.
    pub(crate) fn release(&mut self) {
        if let Some(injected) = &mut self.injected {
            injected.load.release();
        }
    }

    /// Adds a force (N) and a torque (N m) for the coming step, in base axes. The force acts at a point of the platform (m;
    /// the incisal point when absent).
    pub(crate) fn load(&mut self, wrench: &Vector6<f64>, point_m: Option<[f64; 3]>) {
        if let Some(injected) = &mut self.injected {
            injected.load.push(&self.state.pose, wrench, point_m.map(Vec3::from));
        }
    }

    /// Another food, or none.
    pub(crate) fn set_food(&mut self, food: Option<Food>) {
        self.food = food;
    }

    /// Where the encoders see the axes, m: at the drives' side of each joint.
    pub(crate) fn drive_positions_m(&self) -> [f64; AXES] {
        let joints_m = self.state.positions_m();
        match &self.injected {
            None => joints_m,
            Some(injected) => injected.disturbances.drive_positions_m(joints_m),
        }
    }

    /// The longest step in which friction does not turn a motion into a faster one back: 2 by the greatest
    /// eigenvalue of M⁻¹ Jᵀ C J, C being how steeply friction grows with speed at rest. With M = L Lᵀ it is that of
    /// the symmetric B Bᵀ, B = L⁻¹ Jᵀ √C.
    fn longest_step_ns(&self) -> Result<u64, DynamicsError> {
        let motion = self.motion_of(&self.state);
        let mass = Equations::new(&self.bodies, &motion).mass.cholesky().ok_or(DynamicsError::Mass)?;
        let root = Matrix6::from_diagonal(&friction::damping_n_s_per_m(&self.config).map(f64::sqrt));
        let braked = motion.jacobian.actuators.transpose() * root;
        let braked = mass.l().solve_lower_triangular(&braked).ok_or(DynamicsError::Mass)?;
        let rates_per_s = braked * braked.transpose();
        // The search for eigenvalues never ends with NaN or infinity.
        if !rates_per_s.iter().all(|rate| rate.is_finite()) {
            return Err(DynamicsError::Stiff);
        }
        Ok((2e9 / rates_per_s.symmetric_eigenvalues().max()) as u64)
    }

    /// The force with which the food pushes the jaw open, N.
    pub(crate) fn bite_force_n(&self) -> f64 {
        self.food.as_ref().map_or(0.0, |food| food.force_n)
    }

    /// The present state.
    pub(crate) fn state(&self) -> &MechanismState {
        &self.state
    }

    /// Joint velocities in a state, m/s. They cost more than a step, so that only callers who need them pay.
    pub(crate) fn velocities_m_s(&self, state: &MechanismState) -> [f64; AXES] {
        (self.jacobian_at(state).actuators * state.twist).into()
    }

    /// Applies the actuators' forces (N) for the step that begins.
    pub(crate) fn push(&mut self, force_n: &[f64; AXES]) -> Result<(), DynamicsError> {
        let middle = self.middle()?;
        let motion = self.motion_of(&middle);
        let axes = motion.bias.axes_m_s2;
        let actuators = &motion.jacobian.actuators;
        let speeds_m_s = actuators * self.state.twist;
        let disturbed = self.disturb(middle.positions_m(), &speeds_m_s, force_n);
        let driven_n = disturbed.map_or(Vector6::from(*force_n), |disturbed| disturbed.force_n);
        let axes_n = driven_n - friction::force_n(&self.config, &speeds_m_s);
        let food =
            self.food.as_mut().map_or_else(Vector6::zeros, |food| food.bite(&middle.pose, &self.state.twist));
        let Equations { mut mass, bias, .. } = Equations::new(&self.bodies, &motion);
        let mut wrench = actuators.tr_mul(&axes_n) + food - bias;
        if let (Some(disturbed), Some(injected)) = (disturbed, &self.injected) {
            let Motion { pose, twist, .. } = &motion;
            wrench += injected.load.wrench(pose, twist, self.config.gravity_m_s2)
                + actuators.tr_mul(&disturbed.parted_kg.component_mul(&axes));
            let moved_kg = Matrix6::from_diagonal(&(disturbed.resisting_kg - disturbed.parted_kg));
            mass += injected.load.mass(pose) + actuators.tr_mul(&(moved_kg * actuators));
        }
        self.acceleration = mass.cholesky().ok_or(DynamicsError::Mass)?.solve(&wrench);
        let step_s = self.step_s();
        if let Some(injected) = &mut self.injected {
            let change_m_s2 = actuators * self.acceleration + axes;
            injected.disturbances.settle(&(speeds_m_s + change_m_s2 * step_s));
        }
        Ok(())
    }

    /// What the faults make of the drives' forces (N) in a step, at these positions (m) and speeds (m/s) of the axes; none
    /// where there are no faults.
    fn disturb(
        &mut self,
        positions_m: [f64; AXES],
        speeds_m_s: &Vector6<f64>,
        force_n: &[f64; AXES],
    ) -> Option<Disturbed> {
        let masses_kg = self.bodies.axis_mass_kg();
        let injected = self.injected.as_mut()?;
        let motions = std::array::from_fn(|axis| AxisMotion {
            position_m: positions_m[axis],
            speed_m_s: speeds_m_s[axis],
            mass_kg: masses_kg[axis],
        });
        Some(injected.disturbances.act(&self.config, force_n, motions))
    }

    fn step_s(&self) -> f64 {
        self.config.step_ns as f64 * 1e-9
    }

    /// Moves the mechanism for `dt_s`, a part of the step, under the step's acceleration.
    pub(crate) fn advance(&mut self, dt_s: f64) -> Result<(), DynamicsError> {
        let mean_twist = self.state.twist + self.acceleration * (dt_s / 2.0);
        self.state = self.moved(&mean_twist, dt_s)?;
        self.state.twist += self.acceleration * dt_s;
        if let Some(injected) = &mut self.injected {
            injected.disturbances.advance(dt_s);
        }
        Ok(())
    }

    /// Pose and joints in the middle of the step that begins.
    fn middle(&self) -> Result<MechanismState, DynamicsError> {
        self.moved(&self.state.twist, self.step_s() / 2.0)
    }

    /// The state with pose and joints moved on by a twist.
    fn moved(&self, twist: &Twist, dt_s: f64) -> Result<MechanismState, DynamicsError> {
        let MechanismState { pose, .. } = &self.state;
        let linear = twist.fixed_rows::<3>(0) * dt_s;
        let angular = twist.fixed_rows::<3>(3) * dt_s;
        let mut rotation = UnitQuaternion::from_scaled_axis(angular) * pose.rotation;
        rotation.renormalize();
        let pose = Pose::from_parts((pose.translation.vector + linear).into(), rotation);
        Ok(MechanismState { pose, joints: self.mechanism.inverse(&pose)?, twist: self.state.twist })
    }

    /// The motion in the middle of a step, there with the twist that the last step's acceleration leads to.
    fn motion_of(&self, MechanismState { pose, twist, joints }: &MechanismState) -> Motion {
        let twist = twist + self.acceleration * (self.step_s() / 2.0);
        Motion::of_joints(&self.mechanism, pose, joints, &twist)
    }

    fn jacobian_at(&self, MechanismState { pose, joints, .. }: &MechanismState) -> Jacobian {
        Jacobian::new(&self.mechanism, pose, joints)
    }
}

#[cfg(test)]
mod reference;
#[cfg(test)]
mod tests;
