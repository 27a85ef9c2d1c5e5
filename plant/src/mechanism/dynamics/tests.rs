//! Laws of mechanics that the dynamics keep.

use masseter_shared::dynamics::Energy;
use masseter_shared::geometry::MechanismConfig;

use super::*;

fn at_rest(config: DynamicsConfig) -> Dynamics {
    let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
    Dynamics::new(mechanism, config, Pose::translation(0.0, 0.0, 0.268_452_355), None).unwrap()
}

fn frictionless() -> DynamicsConfig {
    DynamicsConfig { slide_friction_n: 0.0, viscous_friction_n_s_per_m: 0.0, ..DynamicsConfig::default() }
}

/// One step of the configured length.
fn step(dynamics: &mut Dynamics, force_n: &[f64; AXES]) {
    dynamics.push(force_n).unwrap();
    dynamics.advance(dynamics.step_s()).unwrap();
}

#[test]
fn friction_ends_a_motion_in_stable_steps_and_feeds_it_in_longer_ones() {
    let slow = 1e-6;
    let speed_after = |share_of_longest: f64| {
        let mut dynamics = at_rest(DynamicsConfig { gravity_m_s2: 0.0, ..DynamicsConfig::default() });
        dynamics.config.step_ns = (share_of_longest * dynamics.longest_step_ns().unwrap() as f64) as u64;
        dynamics.state.twist = Twist::repeat(slow);
        (0..100).for_each(|_| step(&mut dynamics, &[0.0; AXES]));
        dynamics.state.twist.amax()
    };
    assert!(speed_after(0.95) < slow);
    assert!(speed_after(1.05) > 10.0 * slow);
}

#[test]
fn forces_that_carry_the_weight_keep_it_at_rest() {
    let mut dynamics = at_rest(frictionless());
    let equations = Equations::new(&dynamics.bodies, &dynamics.motion_of(&dynamics.state));
    let force_n = equations.inverse(&Twist::zeros(), &Vector6::zeros()).unwrap().into();
    (0..8000).for_each(|_| step(&mut dynamics, &force_n));
    assert!((dynamics.state().pose.translation.z - 0.268_452_355).abs() < 1e-6);
    assert!(dynamics.state.twist.norm() < 1e-4);
}

#[test]
fn released_it_falls_as_all_its_moving_masses_weigh() {
    let config = frictionless();
    let mut dynamics = at_rest(config);
    step(&mut dynamics, &[0.0; AXES]);
    let acceleration = dynamics.state.twist[2] / 1.25e-4;
    assert!((-9.9..-9.0).contains(&acceleration), "{acceleration}");
}

fn energy(dynamics: &Dynamics) -> Energy {
    let MechanismState { pose, twist, joints } = &dynamics.state;
    Energy::new(&dynamics.bodies, &Motion::of_joints(&dynamics.mechanism, pose, joints, twist))
}

/// The mechanism hangs on soft springs, one at each axis, N/m.
const SPRING_N_PER_M: f64 = 200.0;

/// Swings for 10 s. Returns the largest kinetic energy and, for each second, the largest change of the total.
fn swing(config: DynamicsConfig, start: Twist) -> (f64, [f64; 10]) {
    let mut dynamics = at_rest(config);
    dynamics.state.twist = start;
    let rest_m = [0.0, 0.0, 0.0, 0.28, 0.28, 0.28];
    let stretched_m = |state: &MechanismState| Vector6::from(state.positions_m()) - Vector6::from(rest_m);
    let total_j = |dynamics: &Dynamics| {
        let springs_j = 0.5 * SPRING_N_PER_M * stretched_m(&dynamics.state).norm_squared();
        energy(dynamics).total_j() + springs_j
    };
    let (start_j, mut kinetic_j) = (total_j(&dynamics), 0.0_f64);
    let drift_j = std::array::from_fn(|_| {
        (0..1_000_000_000 / config.step_ns).fold(0.0_f64, |most_j, _| {
            // A spring is a part of the mechanism: unlike a drive, the spring feels the middle of the step.
            let force_n = stretched_m(&dynamics.middle().unwrap()) * -SPRING_N_PER_M;
            step(&mut dynamics, &force_n.into());
            kinetic_j = kinetic_j.max(energy(&dynamics).kinetic_j);
            most_j.max((total_j(&dynamics) - start_j).abs())
        })
    });
    (kinetic_j, drift_j)
}

#[test]
fn ten_seconds_of_free_swing_keep_the_energy_within_a_thousandth() {
    let config = DynamicsConfig { platform_centre_m: [0.01, -0.004, 0.012], ..frictionless() };
    for start in [Twist::new(0.05, -0.08, 0.05, 1.0, -0.5, 2.0), Twist::new(0.0, 0.1, -0.1, -2.0, 1.0, 0.0)] {
        let (kinetic_j, drift_j) = swing(config, start);
        println!("kinetic energy {kinetic_j:.4} J, largest change of the energy in each second:");
        println!("{:.4?} ‰", drift_j.map(|drift_j| 1e3 * drift_j / kinetic_j));
        assert!(drift_j.iter().all(|drift_j| *drift_j <= 1e-3 * kinetic_j), "{drift_j:?} of {kinetic_j} J");
    }
}

/// None of the equations' terms makes or loses energy but the axes' forces.
#[test]
fn work_of_the_axes_is_all_the_energy_gains_even_in_a_tumble() {
    let mut dynamics = at_rest(DynamicsConfig { step_ns: 2_000, ..frictionless() });
    dynamics.state.twist = Twist::new(0.2, -0.1, 0.5, 4.0, -3.0, 2.0);
    let force_n = [3.0, -2.0, 1.0, 2.0, 3.0, 4.0];
    let (start_j, start_m) = (energy(&dynamics).total_j(), dynamics.state().positions_m());
    (0..50_000).for_each(|_| step(&mut dynamics, &force_n));
    let moved_m = dynamics.state().positions_m().into_iter().zip(start_m).map(|(end, start)| end - start);
    let work_j: f64 = moved_m.zip(force_n).map(|(moved_m, force_n)| moved_m * force_n).sum();
    let gained_j = energy(&dynamics).total_j() - start_j;
    assert!((gained_j - work_j).abs() < 1e-4, "work {work_j} J, gained {gained_j} J of {start_j} J");
}

#[test]
fn without_forces_energy_is_only_lost() {
    let config = DynamicsConfig { gravity_m_s2: 0.0, ..DynamicsConfig::default() };
    let mut dynamics = at_rest(config);
    dynamics.state.twist = Twist::new(0.05, 0.02, 0.03, 0.3, -0.2, 0.1);
    let mut before = energy(&dynamics).total_j();
    for _ in 0..400 {
        step(&mut dynamics, &[0.0; AXES]);
        let now = energy(&dynamics).total_j();
        assert!(now <= before * (1.0 + 1e-4), "{now} after {before}");
        before = now;
    }
}
