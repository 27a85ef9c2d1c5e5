//! Laws of mechanics that the dynamics keep.

use masseter_shared::geometry::MechanismConfig;

use super::*;

fn at_rest(config: DynamicsConfig) -> Dynamics {
    let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
    Dynamics::new(mechanism, config, Pose::translation(0.0, 0.0, 0.268_452_355), without_contact()).unwrap()
}

/// Jaws that never touch.
fn without_contact() -> Occlusion {
    Occlusion::new(&masseter_shared::config::Scenario::default(), &Pose::identity())
}

fn frictionless() -> DynamicsConfig {
    DynamicsConfig {
        slide_friction_n: 0.0,
        viscous_friction_n_s_per_m: 0.0,
        leg_inertia_kg_m2: 0.0,
        ..DynamicsConfig::default()
    }
}

fn step(dynamics: &mut Dynamics, force_n: &[f64; AXES], dt_s: f64) {
    dynamics.push(force_n).unwrap();
    dynamics.advance(dt_s).unwrap();
}

#[test]
fn friction_ends_a_motion_in_stable_steps_and_feeds_it_in_longer_ones() {
    let slow = 1e-6;
    let speed_after = |share_of_longest: f64| {
        let mut dynamics = at_rest(DynamicsConfig { gravity_m_s2: 0.0, ..DynamicsConfig::default() });
        let dt_s = share_of_longest * 1e-9 * dynamics.longest_step_ns().unwrap() as f64;
        dynamics.state.twist = Twist::repeat(slow);
        (0..100).for_each(|_| step(&mut dynamics, &[0.0; AXES], dt_s));
        dynamics.state.twist.amax()
    };
    assert!(speed_after(0.95) < slow);
    assert!(speed_after(1.05) > 10.0 * slow);
}

#[test]
fn forces_that_carry_the_weight_keep_it_at_rest() {
    let mut dynamics = at_rest(frictionless());
    let transposed = dynamics.jacobian_at(dynamics.state()).actuators.transpose();
    let force_n: [f64; AXES] = transposed.lu().solve(&-dynamics.gravity()).unwrap().into();
    for _ in 0..8000 {
        step(&mut dynamics, &force_n, 1.25e-4);
    }
    assert!((dynamics.state().pose.translation.z - 0.268_452_355).abs() < 1e-6);
    assert!(dynamics.state.twist.norm() < 1e-4);
}

#[test]
fn released_it_falls_as_all_its_moving_masses_weigh() {
    let config = frictionless();
    let mut dynamics = at_rest(config);
    step(&mut dynamics, &[0.0; AXES], 1.25e-4);
    let acceleration = dynamics.state.twist[2] / 1.25e-4;
    assert!((-9.9..-9.0).contains(&acceleration), "{acceleration}");
}

/// Kinetic and potential energy, J.
fn energy_j(dynamics: &Dynamics) -> f64 {
    let mass = dynamics.mass(&dynamics.jacobian_at(&dynamics.state), &dynamics.platform_inertia());
    let kinetic = 0.5 * dynamics.state.twist.dot(&(mass * dynamics.state.twist));
    let rods_m: f64 = dynamics.mechanism.corners_at(&dynamics.state.pose).iter().map(|corner| corner.z).sum();
    let config = &dynamics.config;
    let moment = config.platform_mass_kg * dynamics.state.pose.translation.z + config.rod_mass_kg * rods_m;
    kinetic + config.gravity_m_s2 * moment
}

/// The law that ties every term to the mass matrix: none makes or loses energy but the axes' forces.
#[test]
fn work_of_the_axes_is_all_the_energy_gains_even_in_a_tumble() {
    let config = DynamicsConfig { leg_inertia_kg_m2: 0.03, ..frictionless() };
    let mut dynamics = at_rest(config);
    dynamics.state.twist = Twist::new(0.2, -0.1, 0.5, 4.0, -3.0, 2.0);
    let force_n = [3.0, -2.0, 1.0, 2.0, 3.0, 4.0];
    let (start_j, start_m) = (energy_j(&dynamics), dynamics.state().positions_m());
    for _ in 0..50_000 {
        step(&mut dynamics, &force_n, 2e-6);
    }
    let moved_m = dynamics.state().positions_m().into_iter().zip(start_m).map(|(end, start)| end - start);
    let work_j: f64 = moved_m.zip(force_n).map(|(moved_m, force_n)| moved_m * force_n).sum();
    let gained_j = energy_j(&dynamics) - start_j;
    assert!((gained_j - work_j).abs() < 1e-4, "work {work_j} J, gained {gained_j} J of {start_j} J");
}

/// Central differences of the rates along a constant twist agree with J̇V.
#[test]
fn bias_is_the_derivative_of_the_rates() {
    let mut dynamics = at_rest(frictionless());
    dynamics.state.twist = Twist::new(0.1, -0.2, 0.15, 2.0, -3.0, 1.0);
    let after = |seconds: f64| {
        let mut moved = dynamics.clone();
        moved.advance(seconds).unwrap();
        let (jacobian, twist) = (moved.jacobian_at(&moved.state), moved.state.twist);
        (jacobian.actuators * twist, jacobian.hinges * twist)
    };
    let h = 1e-5;
    let ((axes, hinges), (later, before)) =
        (dynamics.bias(&dynamics.jacobian_at(&dynamics.state)), (after(h), after(-h)));
    assert!(((later.0 - before.0) / (2.0 * h) - axes).amax() < 1e-5);
    assert!(((later.1 - before.1) / (2.0 * h) - hinges).amax() < 1e-4);
}

#[test]
fn without_forces_energy_is_only_lost() {
    let config = DynamicsConfig { gravity_m_s2: 0.0, ..DynamicsConfig::default() };
    let mut dynamics = at_rest(config);
    dynamics.state.twist = Twist::new(0.05, 0.02, 0.03, 0.3, -0.2, 0.1);
    let energy = |dynamics: &Dynamics| {
        let mass = dynamics.mass(&dynamics.jacobian_at(&dynamics.state), &dynamics.platform_inertia());
        (dynamics.state.twist.transpose() * mass * dynamics.state.twist)[0]
    };
    let mut before = energy(&dynamics);
    for _ in 0..400 {
        step(&mut dynamics, &[0.0; AXES], 1.25e-4);
        let now = energy(&dynamics);
        assert!(now <= before * (1.0 + 1e-4), "{now} after {before}");
        before = now;
    }
}
