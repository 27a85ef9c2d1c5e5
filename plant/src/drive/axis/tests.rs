//! The parts of an axis alone, at the edges of what they decide. Scenarios of a whole drive are in `drive::tests`.

use masseter_can::canopen::NodeId;
use masseter_shared::config::DrivesConfig;

use super::*;

const MS: u64 = 1_000_000;

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs()
}

/// A drive whose dictionary differs from its abilities in every limit.
fn objects() -> (Objects, DriveConfig) {
    let drive = DriveConfig { encoder_resolution_m: 2e-6, ..DrivesConfig::default().leg };
    let mut objects = Objects::new(NodeId::new(1).unwrap());
    configure(&mut objects, &drive, MS, [-5, 7]);
    objects.set(names::MAX_VELOCITY, 150_000);
    objects.set(names::PROFILE_VELOCITY, 20_000);
    objects.set(names::PROFILE_ACCELERATION, 3_000_000);
    objects.set(names::PROFILE_DECELERATION, 4_000_000);
    objects.set(names::QUICK_STOP_DECELERATION, 6_000_000);
    objects.set(names::MAX_TORQUE, 1500);
    objects.set(names::FOLLOWING_WINDOW, 700);
    objects.set(names::FOLLOWING_TIMEOUT_MS, 30);
    objects.set(names::POSITION_WINDOW, 40);
    objects.set(names::HOME_OFFSET, 100);
    objects.set(names::HOMING_METHOD, 34);
    objects.set(names::HOMING_SPEED_ZERO, 5000);
    objects.set(names::HOMING_ACCELERATION, 1_000_000);
    objects.set(names::PERIOD_VALUE, 25);
    objects.set(names::PERIOD_INDEX, -4);
    (objects, drive)
}

#[test]
fn every_parameter_is_read_in_si() {
    let (objects, drive) = objects();
    let parameters = Parameters::from_objects(&objects, &drive);
    assert!(near(parameters.period_s, 2.5e-3));
    assert!(near(parameters.velocity_limit_m_s, 0.3));
    assert!(near(parameters.force_limit_n, 750.0));
    assert_eq!(parameters.position_limits, [-105, -93]);
    assert!(near(parameters.following_window_m.unwrap(), 1.4e-3));
    assert_eq!(parameters.following_timeout_ns, 30 * MS);
    assert!(near(parameters.position_window_m, 80e-6));
    let limits =
        |limits: MotionLimits| [limits.velocity_m_s, limits.acceleration_m_s2, limits.deceleration_m_s2];
    let found = [limits(parameters.profile), limits(parameters.homing.search)];
    let expected = [[0.04, 6.0, 8.0], [0.01, 2.0, 2.0]];
    assert!(found.iter().flatten().zip(expected.iter().flatten()).all(|(a, b)| near(*a, *b)), "{found:?}");
    assert_eq!((parameters.homing.method, parameters.homing.offset_increments), (34, 100));
}

/// However high the dictionary's limits are.
#[test]
fn no_parameter_exceeds_the_abilities_of_the_drive() {
    let (mut objects, drive) = objects();
    for velocity in [names::MAX_VELOCITY, names::PROFILE_VELOCITY, names::HOMING_SPEED_ZERO] {
        objects.set(velocity, 10_000_000);
    }
    objects.set(names::MAX_TORQUE, u16::MAX);
    let parameters = Parameters::from_objects(&objects, &drive);
    let velocities = [
        parameters.velocity_limit_m_s,
        parameters.profile.velocity_m_s,
        parameters.homing.search.velocity_m_s,
    ];
    assert!(velocities.iter().all(|velocity_m_s| near(*velocity_m_s, 0.4)), "{velocities:?}");
    assert!(near(parameters.force_limit_n, 1000.0));
}

#[test]
fn stops_brake_or_slow_down_as_their_options_say() {
    let (mut objects, drive) = objects();
    let table = [
        (0, None, false),
        (1, Some(8.0), false),
        (2, Some(12.0), false),
        (5, Some(8.0), true),
        (6, Some(12.0), true),
    ];
    for (option, ramp_m_s2, holds) in table {
        objects.set(names::QUICK_STOP_OPTION, option);
        objects.set(names::FAULT_OPTION, 2);
        let parameters = Parameters::from_objects(&objects, &drive);
        assert_eq!((parameters.quick_stop_m_s2, parameters.holds_quick_stop), (ramp_m_s2, holds), "{option}");
        assert_eq!(parameters.fault_stop_m_s2, Some(12.0));
        objects.set(names::FAULT_OPTION, option);
        assert_eq!(Parameters::from_objects(&objects, &drive).fault_stop_m_s2, ramp_m_s2, "{option}");
    }
    objects.set(names::FOLLOWING_WINDOW, u32::MAX);
    assert_eq!(Parameters::from_objects(&objects, &drive).following_window_m, None);
}

#[test]
fn a_new_drive_has_its_abilities_in_its_dictionary() {
    let read = |drive: &DriveConfig| {
        let mut objects = Objects::new(NodeId::new(1).unwrap());
        configure(&mut objects, drive, 2 * MS, [-5, 7]);
        let window = objects.get(names::POSITION_WINDOW);
        assert_eq!((objects.get(names::MIN_POSITION_LIMIT), objects.get(names::MAX_POSITION_LIMIT)), (-5, 7));
        assert_eq!((objects.get(names::FOLLOWING_TIMEOUT_MS), objects.get(names::PERIOD_VALUE)), (20, 2));
        let numbers = [
            names::FOLLOWING_WINDOW,
            names::MAX_VELOCITY,
            names::PROFILE_VELOCITY,
            names::PROFILE_ACCELERATION,
            names::PROFILE_DECELERATION,
            names::QUICK_STOP_DECELERATION,
            names::HOMING_SPEED_SWITCH,
            names::HOMING_SPEED_ZERO,
            names::HOMING_ACCELERATION,
        ];
        (numbers.map(|number| objects.get(number)), objects.get(names::MAX_TORQUE), window)
    };
    let drive = DriveConfig { max_force_n: 600.0, encoder_noise_m: 5e-6, ..DrivesConfig::default().leg };
    let (numbers, torque, window) = read(&drive);
    let ramp = 10_000_000;
    let expected = [2000, 400_000, 100_000, ramp / 4, ramp / 4, ramp, 20_000, 4000, ramp / 4];
    assert_eq!((numbers, torque, window), (expected, 1200, 50));
    // A drive slower than an increment a second can still be moved.
    let slow = DriveConfig {
        max_velocity_m_s: 1e-9,
        quick_stop_deceleration_m_s2: 1e-9,
        encoder_noise_m: 0.0,
        ..drive
    };
    let (numbers, _, window) = read(&slow);
    assert_eq!((numbers, window), ([2000, 1, 1, 1, 1, 1, 1, 1, 1], 10));
}

#[test]
fn a_following_error_counts_beyond_window_and_time_out() {
    for error_m in [0.011, -0.011] {
        let mut monitor = FollowingErrorMonitor::default();
        let mut exceeds = |now_ns, error_m| monitor.exceeds(now_ns, error_m, 0.01, 20);
        assert!(!exceeds(1000, 0.01) && !exceeds(2000, -0.01), "at the edge of the window");
        assert!(!exceeds(3000, error_m) && !exceeds(3020, error_m));
        assert!(exceeds(3021, error_m) && exceeds(3022, error_m));
        assert!(!exceeds(3023, 0.0));
        assert!(!exceeds(3024, error_m) && !exceeds(3044, error_m) && exceeds(3045, error_m), "anew");
        monitor.restart(false);
        assert!(!monitor.exceeds(3046, error_m, 0.01, 20), "anew");
    }
}

#[test]
fn a_following_error_that_is_a_fault_is_one_as_long_as_the_drive_is_in_fault() {
    let mut monitor = FollowingErrorMonitor::default();
    monitor.restart(true);
    assert!(!monitor.is_fault(), "another fault");
    monitor.set_fault();
    assert!(monitor.is_fault());
    monitor.restart(true);
    assert!(monitor.is_fault());
    monitor.restart(false);
    assert!(!monitor.is_fault());
}

#[test]
fn a_line_to_a_target_is_straight_and_ends_there() {
    let mut demand = Demand::new();
    assert!(demand.is_at_rest(0) && !demand.is_interpolated());
    let towards = |target_m| Approach { target_m, period_s: 2e-3, limit_m_s: 0.4 };
    assert!(!demand.interpolate(5 * MS, 0.27, towards(0.2704)));
    assert!(demand.is_interpolated() && !demand.is_at_rest(5 * MS));
    for (at_ms, position_m, velocity_m_s) in
        [(4, 0.27, 0.2), (5, 0.27, 0.2), (6, 0.2702, 0.2), (7, 0.2704, 0.0), (8, 0.2704, 0.0)]
    {
        let motion = demand.at(at_ms * MS).unwrap();
        assert!(near(motion.position_m, position_m), "{at_ms} ms: {motion:?}");
        assert!((motion.velocity_m_s - velocity_m_s).abs() < 1e-9, "{at_ms} ms: {motion:?}");
        assert_eq!(demand.servo_command(at_ms * MS), ServoCommand::Follow(motion));
    }
    assert!(demand.interpolate(7 * MS, 0.5, towards(0.26)), "backwards, too far");
    let end = demand.at(9 * MS).unwrap();
    assert!(near(end.position_m, 0.2696), "{end:?}");
    demand.push(1.0);
    assert!(!demand.is_at_rest(20 * MS) && !demand.is_interpolated());
    demand.release();
    assert_eq!(demand.servo_command(20 * MS), ServoCommand::Brake);
    demand.slow_down(20 * MS, Motion { position_m: 0.27, velocity_m_s: 0.1 }, 10.0);
    assert_eq!(demand.servo_command(21 * MS), ServoCommand::Brake, "a closed brake stays closed");
}

#[test]
fn a_target_is_moved_to_the_nearest_end_of_what_is_allowed() {
    let view = PositionView { actual: 0, allowed: [-20, 30] };
    assert_eq!([-50, -20, 5, 30, 50].map(|target| view.clamp(target)), [-20, -20, 5, 30, 30]);
}

#[test]
fn a_mode_has_the_number_of_cia_402() {
    let numbers: Vec<_> = (i8::MIN..=i8::MAX).filter(|&number| Mode::from_number(number).is_some()).collect();
    assert_eq!(numbers, [1, 6, 8, 10]);
    for number in numbers {
        assert_eq!(Mode::from_number(number).map(Mode::number), Some(number));
    }
    let methods: Vec<_> = (i8::MIN..=i8::MAX).filter(|&method| Homing::is_method(method)).collect();
    assert_eq!(methods, [33, 34, 35, 37]);
}
