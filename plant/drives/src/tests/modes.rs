//! CiA 402: power states, stops and modes of operation with an axis that moves.

use super::*;

const MAX_TORQUE: (u16, u8) = (0x6072, 0);

#[test]
fn cyclic_targets_are_followed_from_sync_to_sync() {
    let (mut bench, target) = Bench::cycling();
    // The last target is reached a period after its SYNC, give or take the loop.
    bench.run_ms(50);
    assert!(bench.is_near(target));
    assert!(bench.has(StatusBit::TargetFollowed) && !bench.has(StatusBit::InternalLimit));
}

#[test]
fn a_single_controlword_switches_on_and_enables() {
    let mut bench = Bench::enabled(PROFILE_POSITION);
    bench.control(0x06);
    assert_eq!(bench.drive.state(), DriveState::ReadyToSwitchOn);
    bench.control(0x0F);
    assert_eq!(bench.drive.state(), DriveState::OperationEnabled);
}

#[test]
fn a_target_written_long_before_moves_nothing_when_the_drive_is_enabled() {
    let mut bench = Bench::operational();
    bench.cycle(0x06, START + 5000);
    bench.cycle(0x07, START + 5000);
    bench.write((0x1400, 1), &0x8000_0204_u32.to_le_bytes()).unwrap();
    bench.control(0x0F);
    for _ in 0..20 {
        bench.sync();
        bench.run_ms(1);
    }
    assert_eq!(bench.drive.state(), DriveState::OperationEnabled);
    assert!((bench.position() - START).abs() < 100);
}

#[test]
fn targets_beyond_the_software_limits_end_there_and_are_reported() {
    let mut bench = Bench::operational();
    bench.write((0x607D, 2), &(START + 1000).to_le_bytes()).unwrap();
    for word in [0x06, 0x07, 0x0F] {
        bench.cycle(word, START);
    }
    for step in 0..100 {
        bench.cycle(0x0F, START + step * 50);
    }
    assert!(bench.has(StatusBit::InternalLimit));
    assert!(bench.is_near(START + 1000));
}

/// After late or lost process data of the master, a target may be further off than a period allows.
#[test]
fn a_target_too_far_for_one_period_is_reached_over_the_next_syncs() {
    let mut bench = Bench::operational();
    for word in [0x06, 0x07, 0x0F] {
        bench.cycle(word, START);
    }
    bench.cycle(0x0F, START + 5000);
    assert!(bench.has(StatusBit::InternalLimit));
    for _ in 0..100 {
        bench.sync();
        bench.run_ms(1);
    }
    assert!(bench.is_near(START + 5000), "{}", bench.position() - START);
    assert!(!bench.has(StatusBit::InternalLimit));
}

/// Object 605A, the state at the end, and the deceleration in m/s² on the way there.
#[test]
fn a_quick_stop_goes_as_object_605a_says() {
    let table = [
        (0_u16, DriveState::SwitchOnDisabled, None),
        (1, DriveState::SwitchOnDisabled, Some(2.5)),
        (2, DriveState::SwitchOnDisabled, Some(10.0)),
        (5, DriveState::QuickStopActive, Some(2.5)),
        (6, DriveState::QuickStopActive, Some(10.0)),
    ];
    for (option, state, ramp_m_s2) in table {
        let (mut bench, target) = Bench::cycling();
        bench.write((0x605A, 0), &option.to_le_bytes()).unwrap();
        bench.cycle(0x02, target);
        if let Some(ramp_m_s2) = ramp_m_s2 {
            let before = bench.velocity_m_s;
            bench.run_ms(5);
            let slowed = (before - bench.velocity_m_s) / 5e-3;
            assert!((slowed - ramp_m_s2).abs() < 0.2 * ramp_m_s2, "605A = {option}: {slowed} m/s²");
        }
        bench.run_ms(100);
        assert_eq!(bench.drive.state(), state, "605A = {option}");
        assert!(bench.velocity_m_s.abs() < 1e-3);
    }
}

#[test]
fn a_held_quick_stop_can_be_left_for_operation() {
    let (mut bench, target) = Bench::cycling();
    bench.write((0x605A, 0), &6_u16.to_le_bytes()).unwrap();
    bench.cycle(0x02, target);
    bench.run_ms(50);
    let here = bench.position();
    bench.cycle(0x0F, here);
    assert_eq!(bench.drive.state(), DriveState::OperationEnabled);
    bench.run_ms(20);
    assert!(bench.is_near(here));
}

#[test]
fn a_following_error_is_a_fault_that_only_an_edge_resets() {
    let (mut bench, target) = Bench::cycling();
    bench.write((0x6065, 0), &200_u32.to_le_bytes()).unwrap();
    bench.write((0x6066, 0), &2_u16.to_le_bytes()).unwrap();
    bench.write(MAX_TORQUE, &0_u16.to_le_bytes()).unwrap();
    bench.run_ms(20);
    bench.write(MAX_TORQUE, &2000_u16.to_le_bytes()).unwrap();
    bench.run_ms(200);
    assert_eq!(bench.emergencies(), [EmergencyCode::FOLLOWING_ERROR]);
    assert_eq!(bench.drive.state(), DriveState::Fault);
    assert!(bench.has(StatusBit::FollowingError), "as long as the fault stands");
    assert_eq!(bench.read((0x603F, 0)), Ok(0x8611));
    assert_eq!(bench.read((0x1001, 0)), Ok(0x21));
    bench.cycle(0x0F, target);
    assert_eq!(bench.drive.state(), DriveState::Fault);
    bench.cycle(0x80, target);
    assert_eq!(bench.drive.state(), DriveState::SwitchOnDisabled);
    assert_eq!(bench.emergencies().last(), Some(&EmergencyCode::RESET));
    assert_eq!((bench.read((0x603F, 0)), bench.read((0x1001, 0))), (Ok(0), Ok(0)));
    assert!(!bench.has(StatusBit::FollowingError));
}

#[test]
fn a_window_left_for_less_than_its_time_out_is_no_following_error() {
    let (mut bench, target) = Bench::cycling();
    bench.write((0x6065, 0), &50_u32.to_le_bytes()).unwrap();
    bench.write((0x6066, 0), &1000_u16.to_le_bytes()).unwrap();
    bench.write(MAX_TORQUE, &0_u16.to_le_bytes()).unwrap();
    bench.run_ms(20);
    assert!((bench.read((0x60F4, 0)).unwrap() as i32).abs() > 50);
    assert!(!bench.has(StatusBit::FollowingError));
    bench.write(MAX_TORQUE, &2000_u16.to_le_bytes()).unwrap();
    bench.cycle(0x0F, target);
    assert_eq!(bench.drive.state(), DriveState::OperationEnabled);
}

#[test]
fn without_a_window_no_following_error_is_seen() {
    let (mut bench, _) = Bench::cycling();
    bench.write((0x6065, 0), &u32::MAX.to_le_bytes()).unwrap();
    bench.write(MAX_TORQUE, &0_u16.to_le_bytes()).unwrap();
    bench.run_ms(20);
    let error = bench.read((0x60F4, 0)).unwrap() as i32;
    assert!(error.abs() > 50, "{error}");
    assert_eq!(bench.drive.state(), DriveState::OperationEnabled);
}

/// Object 605E: with 0 the brake closes at once, else the drive brakes before it is in fault.
#[test]
fn a_fault_is_reacted_to_as_object_605e_says() {
    for (option, state) in [
        (0_u16, DriveState::Fault),
        (1, DriveState::FaultReactionActive),
        (2, DriveState::FaultReactionActive),
    ] {
        let (mut bench, _) = Bench::cycling();
        bench.write((0x605E, 0), &option.to_le_bytes()).unwrap();
        bench.write((0x6007, 0), &1_u16.to_le_bytes()).unwrap();
        bench.nmt(NmtCommand::EnterPreOperational);
        bench.run_ms(1);
        assert_eq!(bench.drive.state(), state, "605E = {option}");
        bench.run_ms(100);
        assert_eq!(bench.drive.state(), DriveState::Fault);
    }
}

#[test]
fn a_set_point_is_acknowledged_reached_and_held() {
    let mut bench = Bench::enabled(PROFILE_POSITION);
    bench.set_point(START + 10_000, 0);
    assert!(bench.has(StatusBit::SETPOINT_ACKNOWLEDGED) && !bench.has(StatusBit::TargetReached));
    bench.control(0x0F);
    assert!(!bench.has(StatusBit::SETPOINT_ACKNOWLEDGED));
    // 10 mm at 0.1 m/s and 2.5 m/s²: 140 ms.
    bench.run_ms(130);
    assert!(!bench.has(StatusBit::TargetReached));
    bench.run_ms(60);
    assert!(bench.has(StatusBit::TargetReached) && bench.is_near(START + 10_000));
}

#[test]
fn one_set_point_waits_and_the_next_finds_no_room() {
    let mut bench = Bench::enabled(PROFILE_POSITION);
    bench.set_point(START + 5000, 0);
    bench.set_point(START + 8000, 0);
    assert!(bench.has(StatusBit::SETPOINT_ACKNOWLEDGED));
    bench.control(0x0F);
    assert!(bench.has(StatusBit::SETPOINT_ACKNOWLEDGED), "no room before the first is reached");
    bench.set_point(START + 1000, 0);
    bench.control(0x0F);
    bench.run_ms(400);
    assert!(bench.is_near(START + 8000), "the third was not taken");
    assert!(!bench.has(StatusBit::SETPOINT_ACKNOWLEDGED) && bench.has(StatusBit::TargetReached));
}

#[test]
fn a_set_point_may_replace_the_running_one_and_may_be_relative() {
    let mut bench = Bench::enabled(PROFILE_POSITION);
    bench.set_point(START + 20_000, 0);
    bench.run_ms(60);
    bench.set_point(START - 3000, 1 << 5);
    bench.run_ms(500);
    assert!(bench.is_near(START - 3000));
    bench.set_point(1000, 1 << 6);
    bench.run_ms(200);
    assert!(bench.is_near(START - 2000));
}

#[test]
fn halt_interrupts_a_motion_and_its_end_resumes_it() {
    let mut bench = Bench::enabled(PROFILE_POSITION);
    bench.set_point(START + 20_000, 0);
    bench.run_ms(100);
    bench.control(0x11F);
    bench.run_ms(100);
    assert!(bench.has(StatusBit::TargetReached) && !bench.is_near(START + 20_000));
    bench.control(0x1F);
    bench.run_ms(300);
    assert!(bench.is_near(START + 20_000));
}

/// Without "change immediately" (bit 5), the one that was interrupted is completed first.
#[test]
fn a_set_point_given_during_a_halt_waits_for_the_one_that_was_interrupted() {
    // The halt ends before the new set-point, or with the same controlword.
    for words in [[0x10F, 0x11F, 0x00F], [0x10F, 0x10F, 0x01F]] {
        let mut bench = Bench::enabled(PROFILE_POSITION);
        bench.set_point(START + 20_000, 0);
        bench.run_ms(100);
        bench.control(0x11F);
        bench.run_ms(100);
        bench.write(TARGET_POSITION, &(START + 5_000).to_le_bytes()).unwrap();
        for word in words {
            bench.control(word);
        }
        let mut furthest = 0;
        for _ in 0..1000 {
            bench.run_ms(1);
            furthest = furthest.max(bench.position());
        }
        assert!((furthest - (START + 20_000)).abs() <= 50, "{words:X?}: {furthest}");
        assert!(bench.is_near(START + 5_000), "{words:X?}: {}", bench.position());
    }
}

#[test]
fn a_set_point_beyond_the_software_limit_ends_at_it() {
    let mut bench = Bench::enabled(PROFILE_POSITION);
    bench.set_point(LIMITS[1] + 50_000, 0);
    assert!(bench.has(StatusBit::InternalLimit));
    bench.run_ms(1500);
    assert!(bench.is_near(LIMITS[1]));
}

impl Bench {
    /// Enabled in cyclic synchronous torque, giving a target every millisecond.
    fn push(&mut self, permille: i16, ms: u64) {
        for _ in 0..ms {
            self.write((0x6071, 0), &permille.to_le_bytes()).unwrap();
            self.sync();
            self.run_ms(1);
        }
    }
}

#[test]
fn a_torque_is_given_within_its_limit() {
    let mut bench = Bench::enabled(CYCLIC_TORQUE);
    // 10 ‰ of 500 N carry the load.
    bench.push(10, 50);
    assert!((bench.force_n - 5.0).abs() < 1e-9);
    assert_eq!(bench.read((0x6077, 0)).unwrap() as i16, 10);
    assert!(bench.has(StatusBit::TargetFollowed) && !bench.has(StatusBit::InternalLimit));
    bench.write((0x6072, 0), &5_u16.to_le_bytes()).unwrap();
    bench.push(10, 1);
    assert!((bench.force_n - 2.5).abs() < 1e-9);
    assert!(bench.has(StatusBit::InternalLimit));
}

#[test]
fn while_the_brake_holds_the_motor_gives_no_torque() {
    let mut bench = Bench::new();
    bench.load_n = 50.0;
    bench.run_ms(100);
    assert!((bench.force_n - 50.0).abs() < 1.0, "the brake carries the load: {} N", bench.force_n);
    assert_eq!(bench.read((0x6077, 0)), Ok(0));
}

/// At the deceleration of the profile, 2.5 m/s². Without a load: the velocity loop under a torque has no integral.
#[test]
fn under_a_torque_the_axis_can_always_stop_before_either_software_limit() {
    for (permille, limit) in [(200, LIMITS[1]), (-200, LIMITS[0])] {
        let mut bench = Bench::enabled(CYCLIC_TORQUE);
        bench.load_n = 0.0;
        let mut nearest_to_limit = 0.0_f64;
        for _ in 0..1000 {
            bench.push(permille, 1);
            let way_m = (f64::from(limit) * 1e-6 - bench.position_m).abs();
            let braking_m_s = (2.0 * 2.5 * way_m).sqrt().min(0.4);
            let speed_m_s = bench.velocity_m_s.abs();
            assert!(speed_m_s < 1.1 * braking_m_s + 0.02, "{speed_m_s} at {way_m} m");
            nearest_to_limit = nearest_to_limit.max(speed_m_s / (braking_m_s + 0.02));
        }
        assert!(nearest_to_limit > 0.8, "slower than it needs to be: {nearest_to_limit}");
        assert!((bench.position() - limit).abs() < 2000, "{}", bench.position());
        assert!(bench.has(StatusBit::InternalLimit));
    }
}

#[test]
fn a_quick_stop_out_of_torque_brakes_and_holds() {
    let mut bench = Bench::enabled(CYCLIC_TORQUE);
    bench.push(100, 20);
    assert!(bench.velocity_m_s > 0.1);
    bench.control(0x02);
    bench.run_ms(150);
    assert_eq!(bench.drive.state(), DriveState::SwitchOnDisabled);
    assert!(bench.velocity_m_s.abs() < 1e-3);
}

#[test]
fn a_mode_that_changes_in_motion_brings_the_axis_to_rest() {
    let (mut bench, _) = Bench::cycling();
    bench.write(MODE, &[PROFILE_POSITION as u8]).unwrap();
    assert_eq!(bench.read((0x6061, 0)), Ok(1));
    bench.run_ms(100);
    assert!(bench.velocity_m_s.abs() < 1e-3);
    assert_eq!(bench.drive.state(), DriveState::OperationEnabled);
    bench.write(MODE, &[CYCLIC_POSITION as u8]).unwrap();
    let here = bench.position();
    bench.cycle(0x0F, here);
    bench.run_ms(20);
    assert!(bench.is_near(here));
}
