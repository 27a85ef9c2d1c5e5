//! Forward dynamics of the mechanism in task space: forces of six actuators and gravity in, motion of
//! the platform out.
//!
//! The state is the platform's pose and twist. Joint positions come from inverse kinematics and joint rates from the
//! Jacobian. This module never solves the forward kinematics, so the mechanism is an independent oracle for them. With
//! the [equations](masseter_model::dynamics) of the rigid bodies,
//!
//! M V̇ = Jᵀ(τ − friction) + contact − h.
//!
//! A step follows the leapfrog scheme (Störmer and Verlet): the acceleration of its middle holds for the whole step.
//! The forces of the drives are constant over the step, and so act exactly. The scheme is of second order, and the
//! energy does not drift. Terms of h that depend on the twist take the twist extrapolated from the last step.
//!
//! The parts are rigid, without elasticity. Inverse kinematics alone finds the poses at rest, by bisection.

#[cfg(test)]
mod tests;

use std::ops::AddAssign;

use masseter_model::dynamics::{Bodies, DynamicsConfig, Energy, Equations, Motion, Reactions};
use masseter_model::geometry::{AXES, Actuators, LEGS, Mechanism, Pose, Twist, Vec3, frame_of_corners};
use nalgebra::{Matrix3, Matrix6, Quaternion, Translation3, UnitQuaternion, Vector6};

use super::axes::{Axes, AxesForces, AxisFaults, AxisMotion};
use super::contact::Occlusion;
use super::friction::Braking;
use super::ledger::{Ledger, StepForces};
use crate::error::DynamicsError;

/// Pose, twist and joint coordinates of the mechanism.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
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
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Dynamics {
    mechanism: Mechanism,
    config: DynamicsConfig,
    bodies: Bodies,
    pub(crate) state: MechanismState,
    /// V̇ in the present step.
    acceleration: Twist,
    pub(crate) occlusion: Occlusion,
    braking: Braking,
    pub(crate) axes: Axes,
    pub(crate) load: Load,
    pub(crate) ledger: Ledger,
    /// Energy of height at the start, J.
    start_j: f64,
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
        occlusion.check_step(&Equations::new(&bodies, &motion).mass, config.step_ns)?;
        Ok(Self {
            braking: Braking::new(config, &bodies),
            axes: Axes::new(&config.axes, &mechanism, state.positions_m(), &bodies.axis_mass_kg()),
            load: Load::new(Vec3::from(incisal_m)),
            ledger: Ledger::default(),
            start_j: Energy::new(&bodies, &motion).potential_j,
            mechanism,
            config: *config,
            bodies,
            state,
            acceleration,
            occlusion,
        })
    }

    /// Sets the effects of faults on an axis from now on.
    pub(crate) fn set_faults(&mut self, axis: usize, faults: AxisFaults) {
        let speed_m_s = self.velocities_m_s(&self.state)[axis];
        let motion = AxisMotion { position_m: self.state.positions_m()[axis], speed_m_s };
        self.axes.each[axis].set_faults(faults, motion);
    }

    /// Adds a force (N) and a torque (N m) for the coming step, in base axes. The force acts at a point of the platform (m;
    /// the incisal point when absent).
    pub(crate) fn load(&mut self, wrench: &Vector6<f64>, point_m: Option<[f64; 3]>) {
        self.load.push(&self.state.pose, wrench, point_m.map(Vec3::from));
    }

    /// Positions of the axes at the encoders, m: the drives' side of each joint.
    pub(crate) fn drive_positions_m(&self) -> [f64; AXES] {
        self.axes.drive_positions_m(self.state.positions_m())
    }

    /// The motion of a state: with joint velocities, whose computation costs more than a step and is no part of a step.
    fn motion_of(&self, state: &MechanismState) -> Motion {
        Motion::new(&self.mechanism, &state.pose, &state.twist).expect("a pose that was reached has joints")
    }

    /// Joint velocities in a state, m/s, and the energy of the bodies that the axes move; that of height since the start.
    pub(crate) fn motion_and_energy(&self, state: &MechanismState) -> ([f64; AXES], Energy) {
        let motion = self.motion_of(state);
        let speeds_m_s = motion.rates_m_s;
        let energy = Energy::new(&self.bodies, &motion);
        let parted_j = 0.5 * self.axes.parted_kg().dot(&speeds_m_s.component_mul(&speeds_m_s));
        let (kinetic_j, potential_j) = (energy.kinetic_j - parted_j, energy.potential_j - self.start_j);
        (speeds_m_s.into(), Energy { kinetic_j, potential_j })
    }

    /// Joint velocities in a state, m/s.
    fn velocities_m_s(&self, state: &MechanismState) -> [f64; AXES] {
        self.motion_of(state).rates_m_s.into()
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
        let load = self.load.wrench(&motion.pose, &motion.twist, self.config.gravity_m_s2);
        let wrench = actuators.tr_mul(&axes_n) - joints * twist + contact + load - bias;
        mass += joints * step_s;
        let payload = self.load.mass(&motion.pose);
        if let Some(payload) = payload {
            mass += payload;
        }
        self.acceleration = mass.cholesky().ok_or(DynamicsError::Mass)?.solve(&wrench);
        let acceleration = self.acceleration;
        let forces_on_bodies = StepForces {
            axes: &forces,
            speeds_m_s,
            joints: joints * -(twist + acceleration * step_s),
            contact,
            others: load - payload.map_or(Vector6::zeros(), |payload| payload * acceleration),
        };
        self.ledger.begin(&forces_on_bodies, &motion, &twist, &acceleration, step_s);
        self.end_step(&motion, &speeds_m_s, &forces);
        Ok(())
    }

    /// Ends a step with these initial speeds of the axes: parts with a state get the new speeds and the loads.
    fn end_step(&mut self, motion: &Motion, speeds_m_s: &Vector6<f64>, forces: &AxesForces) {
        let step_s = self.step_s();
        let accelerations = motion.accelerations(&self.acceleration);
        let changes_m_s = accelerations.axes_m_s2 * step_s;
        let speeds_m_s = speeds_m_s + changes_m_s;
        let forces_n = forces.force_n - forces.resisting_kg.component_mul(&changes_m_s) / step_s;
        let loads = Reactions::of_joints(&self.bodies, motion, &accelerations, &forces_n).loads(&forces_n);
        self.braking.apply_loads(&loads, &speeds_m_s, step_s);
        self.axes.solve_drive_sides(&speeds_m_s);
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
        self.ledger.advance(dt_s);
        Ok(())
    }

    /// The motion in the middle of the coming step, with the twist by the last step's acceleration.
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

/// The wrench of a vertical force (N) at an arm (m) about the platform's origin.
pub(super) fn vertical(force_n: f64, arm: &Vec3) -> Vector6<f64> {
    Vector6::new(0.0, 0.0, force_n, arm.y * force_n, -arm.x * force_n, 0.0)
}

/// The load.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(crate) struct Load {
    /// The incisal point in the platform frame, m.
    incisal_m: Vec3,
    /// Mass at the incisal point.
    pub(crate) payload_kg: f64,
    /// The wrench of the pushes on the platform, about its origin, in base axes.
    pub(crate) pushed: Vector6<f64>,
}

impl Load {
    /// No load yet.
    pub(super) fn new(incisal_m: Vec3) -> Self {
        Self { incisal_m, payload_kg: 0.0, pushed: Vector6::zeros() }
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

/// The platform level on three legs of that mean length, turned as the hinges are, and shifted from above their middle. For a
/// mechanism of unequal sides the level pose is an approximation of the closed mouth, whose exact pose needs the forward
/// kinematics.
pub(crate) fn level(mechanism: &Mechanism, leg_m: f64, offset_m: [f64; 3]) -> Pose {
    let hinges = frame_of_corners(&std::array::from_fn(|leg| mechanism.hinge(leg, 0.0)));
    let at_height = |height_m: f64| Pose::translation(0.0, 0.0, height_m) * hinges;
    let mean_leg_m = |height_m: f64| {
        let joints = mechanism.inverse(&at_height(height_m));
        joints.map_or(0.0, |joints| joints.actuators.leg_m.iter().sum::<f64>() / LEGS as f64)
    };
    let (mut low_m, mut high_m) = (0.0, leg_m);
    for _ in 0..60 {
        let middle_m = f64::midpoint(low_m, high_m);
        if mean_leg_m(middle_m) < leg_m { low_m = middle_m } else { high_m = middle_m }
    }
    Translation3::from(offset_m) * at_height(low_m)
}

#[cfg(test)]
mod load_tests {
    use super::*;

    fn load() -> Load {
        let mut load = Load::new(Vec3::new(0.03, 0.0, 0.01));
        load.payload_kg = 2.0;
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
        load.pushed.fill(0.0);
        assert_eq!(load.wrench(&Pose::identity(), &Twist::zeros(), 0.0), Vector6::zeros());
    }
}

#[cfg(test)]
mod resting_tests {
    use masseter_model::geometry::Joints;
    use masseter_scenario::Scenario;

    use super::*;

    /// Joint coordinates of a scenario's platform, level on its initial legs.
    fn level_joints(scenario: &Scenario) -> Joints {
        let mechanism = Mechanism::new(&scenario.mechanism).unwrap();
        mechanism.inverse(&level(&mechanism, scenario.dynamics.initial_leg_m, [0.0; 3])).unwrap()
    }

    #[test]
    fn the_rig_is_switched_on_level_on_its_initial_legs() {
        let scenario = Scenario::default();
        let joints = level_joints(&scenario).actuators;
        for slide_m in joints.slide_m {
            assert!(slide_m.abs() < 1e-12);
        }
        for leg_m in joints.leg_m {
            assert!((leg_m - scenario.dynamics.initial_leg_m).abs() < 1e-9);
        }
    }

    #[test]
    fn a_turned_base_starts_level_too() {
        let mut scenario = Scenario::default();
        for (slide, leg_deg) in scenario.mechanism.slides.iter_mut().zip([40.0, 160.0, 280.0]) {
            let (sin, cos) = f64::to_radians(leg_deg).sin_cos();
            slide.centre_m = [0.0577 * cos, 0.0577 * sin];
            slide.azimuth_deg = leg_deg + 90.0;
        }
        for slide_m in level_joints(&scenario).actuators.slide_m {
            assert!(slide_m.abs() < 1e-9, "{slide_m}");
        }
    }
}
