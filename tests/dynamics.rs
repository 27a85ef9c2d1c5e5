//! The forces that a run records balance the motion that it records.

use masseter_model::dynamics::{Bodies, Equations, Motion};
use masseter_model::geometry::{Jacobian, Mechanism, MechanismConfig, Pose, Twist};
use masseter_runtime::messages::{Truth, pose_from_fields};
use masseter_scenario::DynamicsConfig;

use crate::common::{Workspace, stdout};
use masseter_recording::{Reader, Recorded};
use nalgebra::Vector6;

/// The greatest imbalance of an axis, rms, N.
const BALANCED_N: f64 = 0.05;
const DOCUMENT: &str = include_str!("../docs/dynamics.md");

fn truths(workspace: &Workspace) -> Vec<Truth> {
    let mut reader = Reader::open(&workspace.run_folder().join("recording.mcap")).unwrap();
    let mut truths = Vec::new();
    while let Some(message) = reader.next_message().unwrap() {
        if let Recorded::Truth(truth) = message {
            truths.push(truth);
        }
    }
    truths
}

fn pose_of(truth: &Truth) -> Pose {
    pose_from_fields(truth.position_m, truth.quaternion_wxyz)
}

/// The platform's twist, of the rates of the joints.
fn twist_of(mechanism: &Mechanism, truth: &Truth) -> Twist {
    let pose = pose_of(truth);
    let jacobian = Jacobian::new(mechanism, &pose, &mechanism.inverse(&pose).unwrap());
    jacobian.actuators.lu().solve(&Vector6::from(truth.joint_m_s)).unwrap()
}

/// The mean forces that the motion between two samples needs: those of its middle.
fn needed_n(mechanism: &Mechanism, bodies: &Bodies, [before, after]: [&Truth; 2]) -> Vector6<f64> {
    let twists = [before, after].map(|truth| twist_of(mechanism, truth));
    let between_s = (after.sampled_ns - before.sampled_ns) as f64 * 1e-9;
    let acceleration = (twists[1] - twists[0]) / between_s;
    let pose = pose_of(before).lerp_slerp(&pose_of(after), 0.5);
    let motion = Motion::new(mechanism, &pose, &((twists[0] + twists[1]) / 2.0)).unwrap();
    Equations::new(bodies, &motion).inverse(&acceleration, &Vector6::zeros()).unwrap()
}

/// Imbalance of every axis, rms, N.
fn imbalance_n(truths: &[Truth], forces_of: impl Fn(&Truth) -> Vector6<f64>) -> Vector6<f64> {
    let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
    let bodies = Bodies::from(&DynamicsConfig::default());
    let squares = truths.windows(2).map(|pair| {
        let off_n = forces_of(&pair[1]) - needed_n(&mechanism, &bodies, [&pair[0], &pair[1]]);
        off_n.component_mul(&off_n)
    });
    (squares.sum::<Vector6<f64>>() / (truths.len() - 1) as f64).map(f64::sqrt)
}

/// The drives' work of a chewing cycle goes into friction, food and teeth, and nothing is left over.
#[test]
fn the_ledger_of_a_chewing_cycle_closes_with_friction_food_and_teeth() {
    let quantity = "| energy of a chewing cycle with friction, food and teeth: what work does not explain, of the drives' work |";
    let is_stated = |line: &str| line.starts_with(quantity) && line.ends_with("| 0.1 % |");
    assert!(DOCUMENT.lines().any(is_stated), "docs/dynamics.md has no row: {quantity}");
    for model in ["smooth", "lugre"] {
        let workspace = Workspace::new(&format!(
            "duration_s = 5.0\n[motion]\nkind = 'chewing'\ncycle_rate_hz = 1.0\n[food]\n[teeth]\n\
             [dynamics.friction]\nmodel = '{model}'\n"
        ));
        let output = workspace.run_virtual(&[]);
        assert!(output.status.success(), "{}", stdout(&output));
        let truths = truths(&workspace);
        let gap_j = |truth: &Truth| truth.kinetic_j + truth.potential_j - truth.work_j.iter().sum::<f64>();
        for cycle in truths[truths.len() - 4100..].chunks_exact(1000) {
            let motors_j = cycle.windows(2).map(|pair| (pair[1].work_j[0] - pair[0].work_j[0]).abs());
            let share = (gap_j(&cycle[999]) - gap_j(&cycle[0])).abs() / motors_j.sum::<f64>();
            let works_j: Vec<_> =
                (0..6).map(|kind| cycle[999].work_j[kind] - cycle[0].work_j[kind]).collect();
            println!("{quantity} {:.6} % | 0.1 % | {model}: {works_j:.4?} J", 100.0 * share);
            assert!(share <= 1e-3, "{model}: {share}");
        }
    }
}

#[test]
fn mean_forces_balance_the_chewing_motion_and_samples_do_not() {
    for rate_hz in [1.43, 2.17] {
        let workspace = Workspace::new(&format!(
            "duration_s = 4.0\n[motion]\nkind = 'chewing'\ncycle_rate_hz = {rate_hz}\n\
             [dynamics.friction]\nmodel = 'none'\n"
        ));
        let output = workspace.run_virtual(&[]);
        assert!(output.status.success(), "{}", stdout(&output));
        let truths = truths(&workspace);
        // Before that the brakes hold the axes, and the controller brings the jaw to its start.
        let chewing = &truths[truths.len() - 3000..truths.len() - 100];
        let of_means = imbalance_n(chewing, |truth| Vector6::from(truth.force_n));
        let of_samples = imbalance_n(chewing, |truth| Vector6::from(truth.force_sample_n));
        let quantity = format!(
            "| recorded mean forces against inverse dynamics, {rate_hz} Hz, without friction: rms of the worst axis |"
        );
        println!("{quantity} {:.4} N | {BALANCED_N} N |", of_means.max());
        println!("{rate_hz} Hz: samples off by {:.4?} N rms", of_samples.as_slice());
        let is_stated =
            |line: &str| line.starts_with(&quantity) && line.ends_with(&format!("| {BALANCED_N} N |"));
        assert!(DOCUMENT.lines().any(is_stated), "docs/dynamics.md has no row: {quantity}");
        assert!(of_means.max() <= BALANCED_N, "{of_means}");
        assert!(of_samples.max() > BALANCED_N, "{of_samples}");
    }
}
