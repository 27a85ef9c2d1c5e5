//! Answers to a reference: `tests/foreign/rigid_bodies.py` writes bodies and motions, and judges what is found here.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use masseter_model::dynamics::{Energy, Reactions};
use masseter_runtime::messages::{pose_fields, pose_from_fields};
use masseter_scenario::Scenario;

use super::*;

/// Steps in which one row of forces acts: 1 ms.
const STEPS_PER_ROW: usize = 8;

/// Rows of numbers.
fn rows<const N: usize>(file: &Path) -> Vec<[f64; N]> {
    let row = |line: &str| -> [f64; N] {
        let numbers: Vec<f64> = line.split(',').map(|number| number.parse().unwrap()).collect();
        numbers.try_into().unwrap()
    };
    fs::read_to_string(file).unwrap().lines().map(row).collect()
}

fn line(numbers: impl IntoIterator<Item = f64>) -> String {
    let numbers: Vec<String> = numbers.into_iter().map(|number| number.to_string()).collect();
    numbers.join(",")
}

/// Pose and twist of a row.
fn motion_of(row: &[f64]) -> (Pose, Twist) {
    let (position_m, quaternion_wxyz) = (row[..3].try_into().unwrap(), row[3..7].try_into().unwrap());
    (pose_from_fields(position_m, quaternion_wxyz), Twist::from_column_slice(&row[7..13]))
}

/// Forces of the axes, energies, and the reactions in each leg, of every motion.
fn answers(mechanism: &Mechanism, bodies: &Bodies, folder: &Path) -> String {
    let mut answers = String::new();
    for row in rows::<25>(&folder.join("motions.csv")) {
        let (pose, twist) = motion_of(&row);
        let [acceleration, wrench] = [13, 19].map(|from| Vector6::from_column_slice(&row[from..from + 6]));
        let motion = Motion::new(mechanism, &pose, &twist).unwrap();
        let force_n = Equations::new(bodies, &motion).inverse(&acceleration, &wrench).unwrap();
        let Energy { kinetic_j, potential_j } = Energy::new(bodies, &motion);
        let Reactions { legs } = Reactions::new(bodies, &motion, &acceleration, &force_n);
        let loads = legs.iter().flat_map(|leg| {
            let wrenches = [leg.rod, leg.hinge, leg.guide];
            let vectors = wrenches.into_iter().flat_map(|wrench| [wrench.force_n, wrench.moment_nm]);
            std::iter::once(leg.ball_n).chain(vectors).flat_map(<[f64; 3]>::from)
        });
        let numbers = force_n.iter().copied().chain([kinetic_j, potential_j]).chain(loads);
        writeln!(answers, "{}", line(numbers)).unwrap();
    }
    answers
}

/// The way from a start under given forces: the pose after each millisecond.
fn path(mechanism: Mechanism, config: &DynamicsConfig, folder: &Path) -> String {
    let [start] = *rows::<13>(&folder.join("start.csv")) else { panic!("one start") };
    let (pose, twist) = motion_of(&start);
    let mut dynamics =
        Dynamics::new(mechanism, config, pose, Occlusion::new(&Scenario::default(), &pose), [0.0; 3])
            .unwrap();
    dynamics.state.twist = twist;
    let mut path = String::new();
    for force_n in rows::<AXES>(&folder.join("forces.csv")) {
        for _ in 0..STEPS_PER_ROW {
            dynamics.push(&force_n).unwrap();
            dynamics.advance(dynamics.step_s()).unwrap();
        }
        let (position_m, quaternion_wxyz) = pose_fields(&dynamics.state.pose);
        writeln!(path, "{}", line(position_m.into_iter().chain(quaternion_wxyz))).unwrap();
    }
    path
}

#[test]
#[ignore = "tests/foreign/rigid_bodies.py runs it"]
fn answers_a_reference() {
    let folder = PathBuf::from(std::env::var_os("MASSETER_REFERENCE").expect("the folder of the reference"));
    for case in fs::read_dir(folder).unwrap() {
        let folder = case.unwrap().path();
        let scenario = Scenario::read(&folder.join("dynamics.toml")).unwrap();
        let mechanism = Mechanism::new(&scenario.mechanism).unwrap();
        let bodies = Bodies::from(&scenario.dynamics);
        fs::write(folder.join("answers.csv"), answers(&mechanism, &bodies, &folder)).unwrap();
        fs::write(folder.join("path.csv"), path(mechanism, &scenario.dynamics, &folder)).unwrap();
    }
}
