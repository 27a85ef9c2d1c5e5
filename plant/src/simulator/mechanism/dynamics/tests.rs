//! Laws of mechanics of the dynamics.

use masseter_model::dynamics::{AxesConfig, FrictionConfig, FrictionModel};
use masseter_model::geometry::MechanismConfig;

use super::*;
use crate::simulator::emulation::jaw::occlusion;

fn at_rest(config: &DynamicsConfig) -> Dynamics {
    let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
    Dynamics::new(
        mechanism,
        config,
        Pose::translation(0.0, 0.0, 0.268_452_355),
        without_contact(),
        [0.03, 0.0, 0.0],
    )
    .unwrap()
}

/// Jaws that never touch.
fn without_contact() -> Occlusion {
    occlusion(&masseter_scenario::Scenario::default(), &Pose::identity())
}

/// Without friction, and with its end stops far away.
fn free() -> DynamicsConfig {
    let axes = AxesConfig { stop_beyond_m: 0.1, ..AxesConfig::default() };
    let friction = FrictionConfig { model: FrictionModel::None, ..FrictionConfig::default() };
    DynamicsConfig { axes, friction, ..DynamicsConfig::default() }
}

/// One step of the configured length.
fn step(dynamics: &mut Dynamics, force_n: &[f64; AXES]) {
    dynamics.push(force_n).unwrap();
    dynamics.advance(dynamics.step_s()).unwrap();
}

#[test]
fn friction_of_any_size_ends_a_motion_and_never_turns_it_round() {
    for model in [FrictionModel::Smooth, FrictionModel::Lugre] {
        for slide_friction_n in [8.0, 1000.0] {
            let friction = FrictionConfig { model, ..FrictionConfig::default() };
            let config =
                DynamicsConfig { gravity_m_s2: 0.0, slide_friction_n, friction, ..DynamicsConfig::default() };
            let mut dynamics = at_rest(&config);
            dynamics.state.twist = Twist::new(0.05, 0.02, 0.03, 0.3, -0.2, 0.1);
            for _ in 0..4000 {
                let before_j = energy(&dynamics).total_j();
                step(&mut dynamics, &[0.0; AXES]);
                // Bristles give back what they hold.
                let held_j = if model == FrictionModel::Lugre { 10e-6 * slide_friction_n } else { 0.0 };
                assert!(
                    energy(&dynamics).total_j() <= before_j * (1.0 + 1e-4) + held_j,
                    "{model:?} {slide_friction_n} N"
                );
            }
            assert!(
                dynamics.state.twist.amax() < 1e-3,
                "{model:?} {slide_friction_n} N: {}",
                dynamics.state.twist
            );
        }
    }
}

/// Way of a slide under a force from one time to another (s), mm, with the weight carried.
fn drift_mm(model: FrictionModel, push_n: f64, [from_s, until_s]: [f64; 2]) -> f64 {
    let friction = FrictionConfig { model, ..FrictionConfig::default() };
    let mut dynamics = at_rest(&DynamicsConfig { friction, ..DynamicsConfig::default() });
    let equations = Equations::new(&dynamics.bodies, &motion(&dynamics));
    let carrying_n = equations.inverse(&Twist::zeros(), &Vector6::zeros()).unwrap();
    let force_n = carrying_n + Vector6::new(push_n, 0.0, 0.0, 0.0, 0.0, 0.0);
    let mut position_after_m = |seconds: f64| {
        (0..(seconds / dynamics.step_s()) as u32).for_each(|_| step(&mut dynamics, &force_n.into()));
        dynamics.state.positions_m()[0]
    };
    let (start_m, end_m) = (position_after_m(from_s), position_after_m(until_s - from_s));
    1e3 * (end_m - start_m)
}

#[test]
fn bristles_hold_a_slide_up_to_the_breakaway_force_where_the_smooth_curve_creeps() {
    // Seals 5 N, the guide 0.1 N under the weight; breakaway 1.2 times as much.
    assert!(drift_mm(FrictionModel::Lugre, 4.0, [0.5, 1.0]).abs() < 1e-4);
    assert!(drift_mm(FrictionModel::Smooth, 4.0, [0.5, 1.0]) > 0.05);
    assert!(drift_mm(FrictionModel::Lugre, 12.0, [0.0, 0.2]) > 1.0);
}

#[test]
fn an_axis_that_runs_into_its_end_stop_says_so_once_and_stays_there() {
    let mut dynamics = at_rest(&DynamicsConfig { axes: AxesConfig::default(), ..free() });
    let force_n = [0.0, 0.0, 0.0, 60.0, 60.0, 60.0];
    let hits: Vec<_> = (0..4000)
        .filter_map(|_| {
            step(&mut dynamics, &force_n);
            dynamics.axes.take_stop_hit()
        })
        .collect();
    assert_eq!(hits.iter().map(|(axis, _)| *axis).collect::<Vec<_>>(), [3, 4, 5]);
    assert!(hits.iter().all(|(_, speed_m_s)| *speed_m_s > 0.05), "{hits:?}");
    let [_, _, _, leg_m, ..] = dynamics.state.positions_m();
    assert!((leg_m - 0.302).abs() < 1e-4, "{leg_m} m");
}

#[test]
fn forces_that_carry_the_weight_keep_it_at_rest() {
    let mut dynamics = at_rest(&free());
    let equations = Equations::new(&dynamics.bodies, &motion(&dynamics));
    let force_n = equations.inverse(&Twist::zeros(), &Vector6::zeros()).unwrap().into();
    (0..8000).for_each(|_| step(&mut dynamics, &force_n));
    assert!((dynamics.state.pose.translation.z - 0.268_452_355).abs() < 1e-6);
    assert!(dynamics.state.twist.norm() < 1e-4);
}

#[test]
fn released_it_falls_as_all_its_moving_masses_weigh() {
    let config = free();
    let mut dynamics = at_rest(&config);
    step(&mut dynamics, &[0.0; AXES]);
    let acceleration = dynamics.state.twist[2] / 1.25e-4;
    assert!((-9.9..-9.0).contains(&acceleration), "{acceleration}");
}

fn motion(dynamics: &Dynamics) -> Motion {
    Motion::new(&dynamics.mechanism, &dynamics.state.pose, &dynamics.state.twist).unwrap()
}

fn energy(dynamics: &Dynamics) -> Energy {
    Energy::new(&dynamics.bodies, &motion(dynamics))
}

/// The mechanism hangs on soft springs, one at each axis, N/m.
const SPRING_N_PER_M: f64 = 200.0;

/// Swings for 10 s. Returns the largest kinetic energy and, for each second, the largest change of the total.
fn swing(config: &DynamicsConfig, start: Twist) -> (f64, [f64; 10]) {
    let mut dynamics = at_rest(config);
    dynamics.state.twist = start;
    let rest_m = [0.0, 0.0, 0.0, 0.28, 0.28, 0.28];
    let stretched_m = |at: &Actuators| Vector6::from(at.to_axes()) - Vector6::from(rest_m);
    let total_j = |dynamics: &Dynamics| {
        let springs_j = 0.5 * SPRING_N_PER_M * stretched_m(&dynamics.state.actuators).norm_squared();
        energy(dynamics).total_j() + springs_j
    };
    let (start_j, mut kinetic_j) = (total_j(&dynamics), 0.0_f64);
    let drift_j = std::array::from_fn(|_| {
        (0..1_000_000_000 / config.step_ns).fold(0.0_f64, |most_j, _| {
            // A spring is a part of the mechanism: unlike a drive, a spring acts by the middle of the step.
            let force_n = stretched_m(&dynamics.middle().unwrap().legs.actuators) * -SPRING_N_PER_M;
            step(&mut dynamics, &force_n.into());
            kinetic_j = kinetic_j.max(energy(&dynamics).kinetic_j);
            most_j.max((total_j(&dynamics) - start_j).abs())
        })
    });
    (kinetic_j, drift_j)
}

#[test]
fn ten_seconds_of_free_swing_keep_the_energy_within_a_thousandth() {
    let quantity =
        "| energy, 10 s of free swing on springs at 125 µs a step, of the greatest kinetic energy |";
    let is_stated = |line: &str| line.starts_with(quantity) && line.ends_with("| 0.1 % |");
    let document = include_str!("../../../../../docs/dynamics.md");
    assert!(document.lines().any(is_stated), "docs/dynamics.md has no row: {quantity}");
    let config = DynamicsConfig { platform_centre_m: [0.01, -0.004, 0.012], ..free() };
    for start in [Twist::new(0.05, -0.08, 0.05, 1.0, -0.5, 2.0), Twist::new(0.0, 0.1, -0.1, -2.0, 1.0, 0.0)] {
        let (kinetic_j, drift_j) = swing(&config, start);
        let drift = drift_j.iter().copied().fold(0.0, f64::max) / kinetic_j;
        println!("{quantity} {:.4} % | 0.1 % |", 100.0 * drift);
        assert!(drift_j.iter().all(|drift_j| *drift_j <= 1e-3 * kinetic_j), "{drift_j:?} of {kinetic_j} J");
    }
}

/// None of the equations' terms makes or loses energy but the axes' forces.
#[test]
fn work_of_the_axes_is_all_the_energy_gains_even_in_a_tumble() {
    let mut dynamics = at_rest(&DynamicsConfig { step_ns: 2_000, ..free() });
    dynamics.state.twist = Twist::new(0.2, -0.1, 0.5, 4.0, -3.0, 2.0);
    let force_n = [3.0, -2.0, 1.0, 2.0, 3.0, 4.0];
    let (start_j, start_m) = (energy(&dynamics).total_j(), dynamics.state.positions_m());
    (0..50_000).for_each(|_| step(&mut dynamics, &force_n));
    let moved_m = dynamics.state.positions_m().into_iter().zip(start_m).map(|(end, start)| end - start);
    let work_j: f64 = moved_m.zip(force_n).map(|(moved_m, force_n)| moved_m * force_n).sum();
    let gained_j = energy(&dynamics).total_j() - start_j;
    assert!((gained_j - work_j).abs() < 1e-4, "work {work_j} J, gained {gained_j} J of {start_j} J");
}

/// Energy without work, and what the drives have done, J.
fn gap_and_motors_j(dynamics: &Dynamics) -> [f64; 2] {
    let work_j = dynamics.ledger.work_j;
    let (_, energy) = dynamics.motion_and_energy(&dynamics.state);
    [energy.total_j() - work_j.iter().sum::<f64>(), work_j[0]]
}

/// Springs and dampers as drives swing the jaw with a payload at 2 Hz; steps are cut, as SYNCs cut them.
#[test]
fn the_ledger_of_every_cycle_closes_within_a_thousandth_with_any_friction_and_play() {
    for model in [FrictionModel::None, FrictionModel::Smooth, FrictionModel::Lugre] {
        for leg_play_m in [0.0, 5e-5] {
            let friction = FrictionConfig { model, ..FrictionConfig::default() };
            let axes = AxesConfig { leg_play_m, ..AxesConfig::default() };
            let mut dynamics = at_rest(&DynamicsConfig { friction, axes, ..DynamicsConfig::default() });
            dynamics.load.payload_kg = 0.3;
            let start_m = dynamics.state.positions_m();
            for cycle in 0..4 {
                let (before_j, mut turned_over_j) = (gap_and_motors_j(&dynamics), 0.0);
                for step in 0..4000 {
                    let phase = std::f64::consts::TAU * f64::from(step) / 4000.0;
                    let positions_m = dynamics.drive_positions_m();
                    let speeds_m_s = dynamics.velocities_m_s(&dynamics.state);
                    let force_n = std::array::from_fn(|axis| {
                        let target_m = start_m[axis] + 5e-3 * (phase + axis as f64).sin() * phase.min(1.0);
                        2e4 * (target_m - positions_m[axis]) - 100.0 * speeds_m_s[axis]
                    });
                    let motors_j = dynamics.ledger.work_j[0];
                    dynamics.push(&force_n).unwrap();
                    let step_s = dynamics.step_s();
                    for share in [0.3, 0.7] {
                        dynamics.advance(share * step_s).unwrap();
                    }
                    turned_over_j += (dynamics.ledger.work_j[0] - motors_j).abs();
                }
                let gap_j = gap_and_motors_j(&dynamics)[0] - before_j[0];
                println!("{model:?}, play {leg_play_m}, cycle {cycle}: {gap_j:e} J of {turned_over_j} J");
                assert!(gap_j.abs() <= 1e-3 * turned_over_j, "{model:?} {leg_play_m}");
            }
            let is_lost = dynamics.ledger.work_j[1..4].iter().all(|work_j| *work_j < 0.0);
            assert_eq!(is_lost, model != FrictionModel::None, "{:?}", dynamics.ledger);
        }
    }
}

#[test]
fn without_forces_energy_is_only_lost() {
    let config = DynamicsConfig { gravity_m_s2: 0.0, ..DynamicsConfig::default() };
    let mut dynamics = at_rest(&config);
    dynamics.state.twist = Twist::new(0.05, 0.02, 0.03, 0.3, -0.2, 0.1);
    let mut before = energy(&dynamics).total_j();
    for _ in 0..400 {
        step(&mut dynamics, &[0.0; AXES]);
        let now = energy(&dynamics).total_j();
        assert!(now <= before * (1.0 + 1e-4), "{now} after {before}");
        before = now;
    }
}

#[test]
fn a_step_turns_as_far_as_the_exponential_of_its_vector() {
    for angle_rad in [0.0, 1e-9, 1e-4, 6.3e-3, 6.4e-3, 1.0] {
        let vector = Vec3::new(0.6, 0.0, -0.8) * angle_rad;
        let distance = turn(&vector).coords - UnitQuaternion::from_scaled_axis(vector).coords;
        assert!(distance.norm() < 4e-16, "{angle_rad} rad: {:e}", distance.norm());
    }
}

mod reference {
    //! Answers to a reference: `tests/foreign/rigid_bodies.py` writes bodies and motions, and judges what is found here.

    use std::fmt::Write as _;
    use std::fs;
    use std::path::{Path, PathBuf};

    use masseter_model::dynamics::Reactions;
    use masseter_runtime::messages::{pose_fields, pose_from_fields};
    use masseter_scenario::Scenario;

    use super::super::*;
    use super::Energy;
    use crate::simulator::emulation::jaw::occlusion;

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
            let [acceleration, wrench] =
                [13, 19].map(|from| Vector6::from_column_slice(&row[from..from + 6]));
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
            Dynamics::new(mechanism, config, pose, occlusion(&Scenario::default(), &pose), [0.0; 3]).unwrap();
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
        let folder =
            PathBuf::from(std::env::var_os("MASSETER_REFERENCE").expect("the folder of the reference"));
        for case in fs::read_dir(folder).unwrap() {
            let folder = case.unwrap().path();
            let scenario = Scenario::read(&folder.join("dynamics.toml")).unwrap();
            let mechanism = Mechanism::new(&scenario.mechanism).unwrap();
            let bodies = Bodies::from(&scenario.dynamics);
            fs::write(folder.join("answers.csv"), answers(&mechanism, &bodies, &folder)).unwrap();
            fs::write(folder.join("path.csv"), path(mechanism, &scenario.dynamics, &folder)).unwrap();
        }
    }
}
