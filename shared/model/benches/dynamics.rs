//! The rigid-body dynamics: `cargo bench -p masseter-model --bench dynamics`.

use std::hint::black_box;

use divan::Bencher;
use masseter_model::dynamics::DynamicsConfig;
use masseter_model::dynamics::{Bodies, Equations, Motion, Reactions};
use masseter_model::geometry::{Mechanism, MechanismConfig, Pose, Twist};
use nalgebra::Vector6;

fn main() {
    divan::main();
}

/// Mechanism, bodies, pose, twist and acceleration.
fn moving() -> (Mechanism, Bodies, Pose, Twist, Twist) {
    let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
    let bodies = Bodies::from(&DynamicsConfig::default());
    let pose = Pose::translation(0.003, -0.004, 0.27);
    (mechanism, bodies, pose, Twist::repeat(0.1), Twist::repeat(1.0))
}

/// Forces of the axes from pose, twist and acceleration, with inverse kinematics and Jacobian.
#[divan::bench]
fn inverse_dynamics(bencher: Bencher<'_, '_>) {
    let (mechanism, bodies, pose, twist, acceleration) = moving();
    bencher.bench_local(|| {
        let motion = Motion::new(&mechanism, black_box(&pose), black_box(&twist)).unwrap();
        Equations::new(&bodies, &motion).inverse(&acceleration, &Vector6::zeros())
    });
}

/// The platform's acceleration under forces of the axes, with inverse kinematics and Jacobian.
#[divan::bench]
fn forward_dynamics(bencher: Bencher<'_, '_>) {
    let (mechanism, bodies, pose, twist, _) = moving();
    bencher.bench_local(|| {
        let motion = Motion::new(&mechanism, black_box(&pose), black_box(&twist)).unwrap();
        Equations::new(&bodies, &motion).forward(&Vector6::repeat(3.0), &Vector6::zeros())
    });
}

/// The reactions of a known motion.
#[divan::bench]
fn reactions(bencher: Bencher<'_, '_>) {
    let (mechanism, bodies, pose, twist, acceleration) = moving();
    let motion = Motion::new(&mechanism, &pose, &twist).unwrap();
    bencher.bench_local(|| Reactions::new(&bodies, black_box(&motion), &acceleration, &Vector6::repeat(3.0)));
}
