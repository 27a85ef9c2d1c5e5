//! Forward dynamics of the mechanism in task space: forces of six actuators and gravity in, motion of
//! the platform out.
//!
//! The state is the platform's pose and twist. Joint positions come from inverse kinematics and joint
//! rates from the Jacobian. The forward kinematics is never solved here, so the mechanism is an
//! independent oracle for it. The masses are the platform with the jaw, the carriages (moved by the slides)
//! and the rods (moved along and across by the legs); carriages and rods are constant joint inertias. With J the
//! Jacobian of slides, legs and hinges and M_q their inertias,
//!
//! (M_platform + Jᵀ M_q J) V̇ = Jᵀ(τ − friction − M_q J̇V) + gravity + contact − gyroscopic moment.
//!
//! End stops, play and elasticity are left out, unless a scenario has [faults](super::disturbances) of the mechanism.

use masseter_shared::config::{DynamicsConfig, FaultKindConfig};
use masseter_shared::geometry::{
    AXES, InverseError, Jacobian, Joints, LEGS, LimitViolation, Mechanism, Pose, Twist, Vec3,
};
use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector3, Vector6};

use super::contact::{ContactError, Food, Occlusion};
use super::disturbances::{AxisMotion, Disturbances, Disturbed};
use super::friction;
use super::load::{Load, vertical};

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
    state: MechanismState,
    /// V̇ under the forces that act.
    acceleration: Twist,
    occlusion: Occlusion,
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
        config: DynamicsConfig,
        pose: Pose,
        occlusion: Occlusion,
    ) -> Result<Self, DynamicsError> {
        let joints = mechanism.inverse(&pose)?;
        if let Err(violation) = mechanism.strokes().check(&joints.actuators) {
            return Err(DynamicsError::Start { initial_leg_m: config.initial_leg_m, violation });
        }
        let (twist, acceleration) = (Twist::zeros(), Twist::zeros());
        let state = MechanismState { pose, twist, joints };
        let dynamics = Self { mechanism, config, state, acceleration, occlusion, injected: None };
        let mass = dynamics.mass(&dynamics.jacobian_at(&state), &dynamics.platform_inertia());
        dynamics.occlusion.check(&mass, config.step_ns)?;
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
        let motion = AxisMotion { position_m, speed_m_s, mass_kg: self.axis_mass_kg()[axis] };
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
        self.occlusion.set_food(food);
    }

    /// Teeth and food.
    pub(crate) fn occlusion(&mut self) -> &mut Occlusion {
        &mut self.occlusion
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
        let jacobian = self.jacobian_at(&self.state);
        let mass = self.mass(&jacobian, &self.platform_inertia()).cholesky().ok_or(DynamicsError::Mass)?;
        let root = Matrix6::from_diagonal(&friction::damping_n_s_per_m(&self.config).map(f64::sqrt));
        let braked = jacobian.actuators.transpose() * root;
        let braked = mass.l().solve_lower_triangular(&braked).ok_or(DynamicsError::Mass)?;
        let rates_per_s = braked * braked.transpose();
        // The search for eigenvalues never ends with NaN or infinity.
        if !rates_per_s.iter().all(|rate| rate.is_finite()) {
            return Err(DynamicsError::Stiff);
        }
        Ok((2e9 / rates_per_s.symmetric_eigenvalues().max()) as u64)
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
        (self.jacobian_at(state).actuators * state.twist).into()
    }

    /// Applies the actuators' forces (N) from now on: the platform keeps the acceleration of this state until
    /// the next call.
    pub(crate) fn push(&mut self, force_n: &[f64; AXES]) -> Result<(), DynamicsError> {
        let jacobian = self.jacobian_at(&self.state);
        let (axes, hinges) = self.bias(&jacobian);
        let inertia = self.platform_inertia();
        let disturbed = self.disturb(&jacobian, force_n);
        let driven_n = disturbed.map_or(Vector6::from(*force_n), |disturbed| disturbed.force_n);
        let axes_n = driven_n
            - friction::force_n(&self.config, &(jacobian.actuators * self.state.twist))
            - self.axis_mass_kg().component_mul(&axes);
        let contact = self.occlusion.push(&self.state.pose, &self.state.twist, self.step_s());
        let hinges_nm = hinges * -self.config.leg_inertia_kg_m2;
        let mut wrench = jacobian.actuators.tr_mul(&axes_n)
            + jacobian.hinges.tr_mul(&hinges_nm)
            + self.gravity()
            + contact
            - self.gyroscopic(&inertia);
        let mut mass = self.mass(&jacobian, &inertia);
        if let (Some(disturbed), Some(injected)) = (disturbed, &self.injected) {
            let MechanismState { pose, twist, .. } = &self.state;
            wrench += injected.load.wrench(pose, twist, self.config.gravity_m_s2)
                + jacobian.actuators.tr_mul(&disturbed.parted_kg.component_mul(&axes));
            let moved_kg = Matrix6::from_diagonal(&(disturbed.resisting_kg - disturbed.parted_kg));
            mass += injected.load.mass(pose) + jacobian.actuators.tr_mul(&(moved_kg * jacobian.actuators));
        }
        let solver = mass.cholesky().ok_or(DynamicsError::Mass)?;
        self.acceleration = solver.solve(&wrench);
        let step_s = self.step_s();
        if let Some(injected) = &mut self.injected {
            let change_m_s2 = jacobian.actuators * self.acceleration + axes;
            let speeds_m_s = jacobian.actuators * self.state.twist + change_m_s2 * step_s;
            injected.disturbances.settle(&speeds_m_s);
        }
        Ok(())
    }

    /// What the faults make of the drives' forces (N) in a step; none where there are no faults.
    fn disturb(&mut self, jacobian: &Jacobian, force_n: &[f64; AXES]) -> Option<Disturbed> {
        let (positions_m, masses_kg) = (self.state.positions_m(), self.axis_mass_kg());
        let injected = self.injected.as_mut()?;
        let speeds_m_s = jacobian.actuators * self.state.twist;
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

    /// Integrates over `dt_s`: semi-implicit Euler.
    pub(crate) fn advance(&mut self, dt_s: f64) -> Result<(), DynamicsError> {
        let MechanismState { pose, twist, joints } = &mut self.state;
        *twist += self.acceleration * dt_s;
        let linear = twist.fixed_rows::<3>(0) * dt_s;
        let angular = twist.fixed_rows::<3>(3) * dt_s;
        let mut rotation = UnitQuaternion::from_scaled_axis(angular) * pose.rotation;
        rotation.renormalize();
        *pose = Pose::from_parts((pose.translation.vector + linear).into(), rotation);
        *joints = self.mechanism.inverse(pose)?;
        if let Some(injected) = &mut self.injected {
            injected.disturbances.advance(dt_s);
        }
        Ok(())
    }

    fn jacobian_at(&self, MechanismState { pose, joints, .. }: &MechanismState) -> Jacobian {
        Jacobian::new(&self.mechanism, pose, joints)
    }

    /// Inertia of the platform about its origin in base axes, kg m².
    fn platform_inertia(&self) -> Matrix3<f64> {
        let rotation = self.state.pose.rotation.to_rotation_matrix().into_inner();
        rotation
            * Matrix3::from_diagonal(&Vec3::from(self.config.platform_inertia_kg_m2))
            * rotation.transpose()
    }

    /// Mass that each axis moves along itself, kg.
    fn axis_mass_kg(&self) -> Vector6<f64> {
        let (rod, slide) = (self.config.rod_mass_kg, self.config.carriage_mass_kg + self.config.rod_mass_kg);
        Vector6::new(slide, slide, slide, rod, rod, rod)
    }

    /// J̇V: accelerations of axes (m/s²) and hinges (rad/s²) while the twist stays constant.
    ///
    /// A corner is then accelerated by ω×(ω×r) alone. Slide and leg see their component of it, the leg
    /// also the centrifugal lθ̇², the hinge the Coriolis −2l̇θ̇/l. The first three columns of a row of the
    /// Jacobian are the direction to project on.
    fn bias(&self, jacobian: &Jacobian) -> (Vector6<f64>, Vector3<f64>) {
        let MechanismState { pose, twist, joints } = &self.state;
        let omega: Vec3 = twist.fixed_rows::<3>(3).into();
        let rates = jacobian.actuators * twist;
        let swings = jacobian.hinges * twist;
        let along_axes = jacobian.actuators.fixed_columns::<3>(0);
        let about_hinges = jacobian.hinges.fixed_columns::<3>(0);
        let (mut axes, mut hinges) = (Vector6::zeros(), Vector3::zeros());
        for (leg, corner) in self.mechanism.platform_corners().iter().enumerate() {
            let corner = omega.cross(&omega.cross(&(pose.rotation * corner)));
            let (length_m, swing, stretch) = (joints.actuators.leg_m[leg], swings[leg], rates[LEGS + leg]);
            axes[leg] = (along_axes.row(leg) * corner).x;
            axes[LEGS + leg] = (along_axes.row(LEGS + leg) * corner).x + length_m * swing * swing;
            hinges[leg] = (about_hinges.row(leg) * corner).x - 2.0 * stretch * swing / length_m;
        }
        (axes, hinges)
    }

    /// Mass matrix against the twist: platform + Jᵀ·M·J of slides and rods + hinges.
    fn mass(&self, jacobian: &Jacobian, platform_inertia: &Matrix3<f64>) -> Matrix6<f64> {
        let config = &self.config;
        let mut moved = jacobian.actuators;
        for (mut row, mass_kg) in moved.row_iter_mut().zip(&self.axis_mass_kg()) {
            row *= *mass_kg;
        }
        let mut mass = jacobian.actuators.tr_mul(&moved);
        mass += jacobian.hinges.tr_mul(&jacobian.hinges) * config.leg_inertia_kg_m2;
        for i in 0..3 {
            mass[(i, i)] += config.platform_mass_kg;
        }
        let mut rotational = mass.fixed_view_mut::<3, 3>(3, 3);
        rotational += platform_inertia;
        mass
    }

    /// Weight of platform and rods as a wrench on the platform; a rod's centre is taken at its joint.
    fn gravity(&self) -> Vector6<f64> {
        let DynamicsConfig { platform_mass_kg, rod_mass_kg, gravity_m_s2, .. } = self.config;
        let platform = vertical(-platform_mass_kg * gravity_m_s2, &Vec3::zeros());
        self.mechanism.platform_corners().iter().fold(platform, |wrench, corner| {
            wrench + vertical(-rod_mass_kg * gravity_m_s2, &(self.state.pose.rotation * corner))
        })
    }

    /// ω × Iω of the platform.
    fn gyroscopic(&self, platform_inertia: &Matrix3<f64>) -> Vector6<f64> {
        let omega: Vec3 = self.state.twist.fixed_rows::<3>(3).into();
        let moment = omega.cross(&(platform_inertia * omega));
        Vector6::new(0.0, 0.0, 0.0, moment.x, moment.y, moment.z)
    }
}

#[cfg(test)]
mod tests;
