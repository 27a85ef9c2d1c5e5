//! Stimuli that act in the plant: pushes on the jaw, food, payload.

use masseter_scenario::{FoodConfig, FrictionModel, Shape, StimulusConfig};

use super::*;

/// Beginning and duration of the stimuli, s of the motion.
const AT_S: f64 = 0.05;
const FOR_S: f64 = 0.2;

fn stimulus() -> StimulusConfig {
    StimulusConfig { for_s: Some(FOR_S), ..StimulusConfig::at(AT_S) }
}

fn bench_with(stimulus: StimulusConfig) -> (Bench, [f64; AXES]) {
    let mut dynamics = Scenario::default().dynamics;
    dynamics.friction.model = FrictionModel::None;
    let scenario = Scenario { stimulus: vec![stimulus], dynamics, ..Scenario::default() };
    scenario.validate().unwrap();
    let mut bench = Bench::new(&scenario);
    bench.enable();
    bench.controller_state = ControllerState::Running;
    let held_m = bench.reading.position_m;
    (bench, held_m)
}

fn hold(bench: &mut Bench, held_m: [f64; AXES], cycles: usize) {
    (0..cycles).for_each(|_| bench.cycle(Some(&|_| (held_m, DriveRequest::Enable))));
}

/// Force and moment about the platform's origin that the axes give the platform, N and N m.
fn wrench(bench: &Bench) -> nalgebra::Vector6<f64> {
    let [w, x, y, z] = bench.truth.quaternion_wxyz;
    let rotation = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
    let pose = Pose::from_parts(Vec3::from(bench.truth.position_m).into(), rotation);
    let joints = bench.mechanism.inverse(&pose).unwrap();
    let jacobian = masseter_model::geometry::Jacobian::new(&bench.mechanism, &pose, &joints);
    jacobian.actuators.tr_mul(&nalgebra::Vector6::from(bench.truth.force_n))
}

/// The change of the axes' wrench in the second half of a stimulus, and after it; a mean of 50 ms, for the loops hunt.
fn wrench_changes(stimulus: StimulusConfig) -> [nalgebra::Vector6<f64>; 2] {
    let (mut bench, held_m) = bench_with(stimulus);
    let mut mean = |cycles| {
        hold(&mut bench, held_m, cycles);
        let mut sum = nalgebra::Vector6::zeros();
        for _ in 0..50 {
            hold(&mut bench, held_m, 1);
            sum += wrench(&bench) / 50.0;
        }
        sum
    };
    let before = mean(0);
    let during = mean(140);
    let after = mean(250);
    [during - before, after - before]
}

#[test]
fn the_axes_balance_a_push_on_the_jaw_with_its_moment() {
    let push = [3.0, -4.0, -10.0];
    let point = [0.0, 0.02, 0.0];
    let [during, after] =
        wrench_changes(StimulusConfig { push_n: Some(push), point_m: Some(point), ..stimulus() });
    let moment = Vec3::from(point).cross(&Vec3::from(push));
    let expected = -nalgebra::Vector6::new(push[0], push[1], push[2], moment.x, moment.y, moment.z);
    assert!((during - expected).fixed_rows::<3>(0).amax() < 0.3, "{during} for {expected}");
    assert!((during - expected).fixed_rows::<3>(3).amax() < 0.01, "{during} for {expected}");
    assert!(after.amax() < 0.3, "{after}");
}

#[test]
fn the_axes_balance_a_torque_on_the_jaw() {
    let torque = [0.3, -0.2, 0.4];
    let [during, after] = wrench_changes(StimulusConfig { torque_n_m: Some(torque), ..stimulus() });
    let expected = -nalgebra::Vector6::new(0.0, 0.0, 0.0, torque[0], torque[1], torque[2]);
    assert!((during - expected).fixed_rows::<3>(0).amax() < 0.3, "{during} for {expected}");
    assert!((during - expected).fixed_rows::<3>(3).amax() < 0.05, "{during} for {expected}");
    assert!(after.amax() < 0.3, "{after}");
}

#[test]
fn a_push_by_a_table_ends_with_the_table() {
    let table = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/suite/push.csv");
    let (mut bench, held_m) =
        bench_with(StimulusConfig { push_table: Some(table), ..StimulusConfig::at(AT_S) });
    hold(&mut bench, held_m, 50);
    let quiet_n = wrench(&bench)[2];
    let mut most_n: f64 = 0.0;
    for _ in 0..500 {
        hold(&mut bench, held_m, 1);
        most_n = most_n.max(wrench(&bench)[2] - quiet_n);
    }
    assert!((20.0..33.0).contains(&most_n), "{most_n} N against 26 N");
    let told = bench.events.iter().filter(|event| event.source == Source::Scenario.code());
    let times_ns: Vec<_> = told.map(|event| event.time_ns).collect();
    let [began_ns, ended_ns] = times_ns[..] else { panic!("{times_ns:?}") };
    assert!((399_500_000..400_500_000).contains(&(ended_ns - began_ns)), "{times_ns:?}");
}

#[test]
fn the_axes_carry_a_payload_at_the_incisal_point() {
    let payload = Some("0.5 kg".parse().unwrap());
    let [during, after] = wrench_changes(StimulusConfig { payload, ..stimulus() });
    let (weight_n, arm_m) = (0.5 * 9.81, Scenario::default().jaw.reference_point_m[0]);
    assert!((during[2] - weight_n).abs() < 0.3, "{during}");
    assert!((during[4] + weight_n * arm_m).abs() < 0.01, "{during}");
    assert!(after.amax() < 0.3, "{after}");
}

#[test]
fn another_food_bites_otherwise_for_its_time() {
    // Between jaws that are 7.4 mm open, and that legs longer by 1 mm close to 6.4 mm.
    let food = FoodConfig {
        thickness_m: 0.007,
        stiffness_n_per_m: 20_000.0,
        strength_n: 500.0,
        ..FoodConfig::default()
    };
    let (mut bench, held_m) = bench_with(StimulusConfig { food: Some(food), ..stimulus() });
    hold(&mut bench, held_m, 60);
    assert!(bench.truth.bite_force_n < 1e-9, "the food does not fill the mouth");
    for step in 1..=100 {
        let closing_m = held_m.map(|held_m| held_m + if held_m > 0.1 { 1e-5 * f64::from(step) } else { 0.0 });
        hold(&mut bench, closing_m, 1);
    }
    let closed_m = bench.reading.position_m;
    assert!((9.0..14.0).contains(&bench.truth.bite_force_n), "{}", bench.truth.bite_force_n);
    let contact = bench.plant.contact().unwrap();
    let of_36 = contact.teeth().find(|tooth| tooth.number == 36).unwrap();
    assert!((of_36.load_n() - bench.truth.bite_force_n).abs() < 1.0, "{of_36:?}");
    hold(&mut bench, closed_m, 150);
    assert!(bench.truth.bite_force_n < 1e-9, "the stimulus is over");
}

#[test]
fn a_sine_pushes_up_and_down() {
    let push = StimulusConfig {
        push_n: Some([0.0, 0.0, 20.0]),
        shape: Shape::Sine,
        frequency_hz: Some(10.0),
        ..stimulus()
    };
    let (mut bench, held_m) = bench_with(push);
    hold(&mut bench, held_m, 50);
    let quiet_n = wrench(&bench)[2];
    let mut courses_n = Vec::new();
    for _ in 0..200 {
        hold(&mut bench, held_m, 1);
        courses_n.push(wrench(&bench)[2] - quiet_n);
    }
    let [low_n, high_n] = [f64::min, f64::max].map(|pick| courses_n.iter().copied().fold(0.0, pick));
    assert!((-25.0..-12.0).contains(&low_n) && (12.0..25.0).contains(&high_n), "{low_n} to {high_n} N");
}

#[test]
fn a_stimulus_reports_its_beginning_and_its_end_in_the_time_of_the_motion() {
    let (mut bench, held_m) = bench_with(StimulusConfig { push_n: Some([0.0, 0.0, 1.0]), ..stimulus() });
    hold(&mut bench, held_m, 1);
    let began_ns = bench.reading.sampled_ns;
    hold(&mut bench, held_m, 300);
    let told = bench.events.iter().filter(|event| event.source == Source::Scenario.code());
    let told: Vec<_> = told.map(|event| (event.cause, event.value, event.axis, event.time_ns)).collect();
    let [(began, 1.0, NO_AXIS, begin_ns), (ended, 1.0, NO_AXIS, end_ns)] = told[..] else {
        panic!("{told:?}")
    };
    assert_eq!([began, ended], [Cause::StimulusBegan, Cause::StimulusEnded].map(Cause::code));
    assert!((50_000_000..50_200_000).contains(&(begin_ns - began_ns)), "{told:?}");
    assert!((250_000_000..250_200_000).contains(&(end_ns - began_ns)), "{told:?}");
}
