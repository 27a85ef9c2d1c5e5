//! Laws of mechanics that hold for any bodies, poses and motions.

use nalgebra::{Matrix3, Matrix6, Translation3, UnitQuaternion, Vector6};
use proptest::prelude::*;

use super::*;
use crate::geometry::{LEGS, Mechanism, MechanismConfig, Pose, Twist, Vec3};

fn mechanism() -> Mechanism {
    Mechanism::new(&MechanismConfig::default()).unwrap()
}

/// Bodies with all inertias, and centres of mass beside the origins.
fn bodies() -> impl Strategy<Value = Bodies> {
    let link = || {
        (0.1..1.0f64, 0.0..0.2f64, 0.0..3e-3f64).prop_map(|(mass_kg, centre_m, inertia_kg_m2)| Link {
            mass_kg,
            centre_m,
            inertia_kg_m2,
        })
    };
    let platform = (0.1..1.0f64, [-0.02..0.02f64, -0.02..0.02f64, -0.02..0.02f64], turn()).prop_map(
        |(mass_kg, centre_m, turn)| {
            let axes = turn.to_rotation_matrix().into_inner();
            let principal = Matrix3::from_diagonal(&Vec3::new(2e-4, 3e-4, 4e-4));
            let inertia_kg_m2 = axes * principal * axes.transpose();
            Platform { mass_kg, centre_m: Vec3::from(centre_m), inertia_kg_m2 }
        },
    );
    (0.1..2.0f64, link(), link(), platform, 0.0..10.0f64).prop_map(
        |(carriage_kg, cylinder, rod, platform, gravity_m_s2)| Bodies {
            carriage_kg,
            cylinder,
            rod,
            platform,
            gravity_m_s2,
        },
    )
}

fn turn() -> impl Strategy<Value = UnitQuaternion<f64>> {
    [-0.5..0.5f64, -0.5..0.5f64, -0.5..0.5f64]
        .prop_map(|turn| UnitQuaternion::from_scaled_axis(Vec3::from(turn)))
}

fn pose() -> impl Strategy<Value = Pose> {
    ([-0.03..0.03f64, -0.03..0.03f64, 0.24..0.3f64], turn())
        .prop_map(|([x, y, z], turn)| Pose::from_parts(Translation3::new(x, y, z), turn))
}

fn six(most: f64) -> impl Strategy<Value = Vector6<f64>> {
    prop::array::uniform6(-most..most).prop_map(Vector6::from)
}

/// Speeds up to 0.2 m/s and 2 rad/s.
fn twist() -> impl Strategy<Value = Twist> {
    six(0.2).prop_map(|twist| twist.component_mul(&Vector6::new(1.0, 1.0, 1.0, 10.0, 10.0, 10.0)))
}

/// The pose after a short time at a constant twist.
fn moved(pose: &Pose, twist: &Twist, seconds: f64) -> Pose {
    let linear = twist.fixed_rows::<3>(0) * seconds;
    let angular = twist.fixed_rows::<3>(3) * seconds;
    Pose::from_parts(
        Translation3::from(pose.translation.vector + linear),
        UnitQuaternion::from_scaled_axis(angular) * pose.rotation,
    )
}

proptest! {
    /// Central differences of the rates along a constant twist agree with J̇V.
    #[test]
    fn bias_is_the_derivative_of_the_rates(pose in pose(), twist in twist()) {
        let mechanism = mechanism();
        let at = |seconds| Motion::new(&mechanism, &moved(&pose, &twist, seconds), &twist).unwrap();
        let h = 1e-5;
        let (before, now, after) = (at(-h), at(0.0), at(h));
        prop_assert!(((after.rates_m_s - before.rates_m_s) / (2.0 * h) - now.bias.axes_m_s2).amax() < 1e-5);
        let swings = (after.swings_rad_s - before.swings_rad_s) / (2.0 * h);
        prop_assert!((swings - now.bias.hinges_rad_s2).amax() < 1e-4);
    }

    /// Forward dynamics gives back the acceleration of inverse dynamics within 10⁻⁹.
    #[test]
    fn forward_dynamics_undoes_inverse_dynamics(
        bodies in bodies(), pose in pose(), twist in twist(), acceleration in six(20.0), wrench in six(50.0),
    ) {
        let equations = Equations::new(&bodies, &Motion::new(&mechanism(), &pose, &twist).unwrap());
        let force_n = equations.inverse(&acceleration, &wrench).unwrap();
        let found = equations.forward(&force_n, &wrench).unwrap();
        prop_assert!((found - acceleration).norm() <= 1e-9 * acceleration.norm(), "{found} {acceleration}");
    }

    /// Only forces change the energy of the bodies, by their power. This law covers every term of M and h.
    #[test]
    fn energy_changes_by_the_power_of_the_forces(
        bodies in bodies(), pose in pose(), twist in twist(), force_n in six(50.0), wrench in six(5.0),
    ) {
        let mechanism = mechanism();
        let motion = Motion::new(&mechanism, &pose, &twist).unwrap();
        let acceleration = Equations::new(&bodies, &motion).forward(&force_n, &wrench).unwrap();
        let energy_j = |seconds: f64| {
            let pose = moved(&pose, &(twist + acceleration * (seconds / 2.0)), seconds);
            let twist = twist + acceleration * seconds;
            Energy::new(&bodies, &Motion::new(&mechanism, &pose, &twist).unwrap()).total_j()
        };
        let h = 1e-6;
        let found_w = (energy_j(h) - energy_j(-h)) / (2.0 * h);
        let power_w = force_n.dot(&motion.rates_m_s) + wrench.dot(&twist);
        prop_assert!((found_w - power_w).abs() < 1e-5 * (1.0 + power_w.abs()), "{found_w} W, forces {power_w} W");
    }

    #[test]
    fn an_added_mass_resists_its_axis_alone(
        bodies in bodies(), pose in pose(), twist in twist(), added_kg in six(2.0),
    ) {
        let motion = Motion::new(&mechanism(), &pose, &twist).unwrap();
        let (without, with) =
            (Equations::new(&bodies, &motion), Equations::with_added(&bodies, &motion, &added_kg));
        let rows = &motion.jacobian.actuators;
        let expected = without.mass + rows.transpose() * Matrix6::from_diagonal(&added_kg) * rows;
        prop_assert!((with.mass - expected).amax() < 1e-12);
        prop_assert_eq!(with.bias, without.bias);
    }

    /// M gives the energy of motion.
    #[test]
    fn the_mass_matrix_gives_the_kinetic_energy(bodies in bodies(), pose in pose(), twist in twist()) {
        let motion = Motion::new(&mechanism(), &pose, &twist).unwrap();
        let kinetic_j = 0.5 * twist.dot(&(Equations::new(&bodies, &motion).mass * twist));
        let energy = Energy::new(&bodies, &motion);
        prop_assert!((kinetic_j - energy.kinetic_j).abs() < 1e-12 * (1.0 + kinetic_j));
    }

    /// Newton's and Euler's laws hold for each body, from both sides.
    #[test]
    fn reactions_of_all_joints_balance(
        bodies in bodies(), pose in pose(), twist in twist(), force_n in six(50.0),
    ) {
        let mechanism = mechanism();
        let motion = Motion::new(&mechanism, &pose, &twist).unwrap();
        let acceleration = Equations::new(&bodies, &motion).forward(&force_n, &Vector6::zeros()).unwrap();
        let Reactions { legs } = Reactions::new(&bodies, &motion, &acceleration, &force_n);
        let mut at_platform = Vector6::zeros();
        for (leg, reactions) in legs.iter().enumerate() {
            prop_assert!(reactions.hinge.moment_nm.x.abs() < 1e-9, "a hinge has no moment about its axis");
            prop_assert!((reactions.guide.force_n.x - force_n[leg]).abs() < 1e-9, "the slide's axis pushes along");
            let (sin, cos) = motion.legs.sin_cos[leg];
            let along_leg = reactions.rod.force_n.dot(&Vec3::new(0.0, cos, sin));
            prop_assert!((along_leg - force_n[LEGS + leg]).abs() < 1e-9, "the leg's axis pushes the rod");
            let axes = [mechanism.slide_direction(leg), mechanism.inward_direction(leg), Vec3::z()];
            let force = Matrix3::from_columns(&axes) * reactions.ball_n;
            let moment = (pose.rotation * mechanism.platform_corners()[leg]).cross(&force);
            at_platform += Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
        }
        let massless = Link { mass_kg: 0.0, centre_m: 0.0, inertia_kg_m2: 0.0 };
        let alone = Bodies { carriage_kg: 0.0, cylinder: massless, rod: massless, ..bodies };
        let platform = Equations::new(&alone, &motion);
        let needed = platform.mass * acceleration + platform.bias;
        prop_assert!((at_platform - needed).amax() < 1e-9, "three balls carry the platform: {at_platform} {needed}");
    }
}

#[test]
fn at_rest_the_guides_carry_the_whole_weight() {
    let bodies = Bodies::from(&super::DynamicsConfig::default());
    let pose = Pose::translation(0.004, -0.003, 0.27);
    let motion = Motion::new(&mechanism(), &pose, &Twist::zeros()).unwrap();
    let force_n = Equations::new(&bodies, &motion).inverse(&Twist::zeros(), &Vector6::zeros()).unwrap();
    let Reactions { legs } = Reactions::new(&bodies, &motion, &Twist::zeros(), &force_n);
    let carried_n: f64 = legs.iter().map(|reactions| reactions.guide.force_n.z).sum();
    assert!((carried_n - (3.0 * 1.6 + 0.5) * 9.81).abs() < 1e-9, "{carried_n}");
}

#[test]
fn a_pose_without_control_of_the_platform_has_no_inverse_dynamics() {
    let bodies = Bodies::from(&super::DynamicsConfig::default());
    let mut motion = Motion::new(&mechanism(), &Pose::translation(0.0, 0.0, 0.27), &Twist::zeros()).unwrap();
    motion.jacobian.actuators.fill(0.0);
    assert_eq!(Equations::new(&bodies, &motion).inverse(&Twist::zeros(), &Vector6::zeros()), None);
}
