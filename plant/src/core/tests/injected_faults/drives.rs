//! Faults of drives.

use super::*;

#[test]
fn a_drive_with_a_low_supply_is_in_fault_and_says_so() {
    let mut bench = bench_with(on_l2(DriveFault::Fault, None));
    play_until(&mut bench, 0.6);
    let emergency = told(&bench, Cause::Emergency)[0];
    assert_eq!((EmergencyCode(emergency.value as u16), emergency.axis), (EmergencyCode::LOGIC_SUPPLY, 4));
    assert_eq!(emergency.limit as u8, 0x05, "error register: generic, voltage");
    assert_eq!(bench.reading.drive_state[L2], DriveState::Fault.code());
    assert!(bench.plant.master.drives_are_off());
}

#[test]
fn a_drive_that_ignores_its_targets_stands_and_is_found_by_its_distance() {
    let mut bench = bench_with(on_l2(DriveFault::IgnoresTargets, None));
    play_until(&mut bench, 0.6);
    assert_eq!(first_failure(&bench), Some((Cause::FollowingError, 4)));
}

#[test]
fn without_force_a_leg_sinks_under_the_weight_of_the_platform() {
    let mut bench = bench_with(FaultConfig { for_s: Some(0.01), ..on_l2(DriveFault::TorqueLoss, Some("1")) });
    hold_until(&mut bench, 0.5);
    let before_m = bench.truth.joint_m[L2];
    hold_until(&mut bench, 0.51);
    assert!(bench.truth.joint_m[L2] < before_m - 5e-5, "{}", bench.truth.joint_m[L2] - before_m);
}

#[test]
fn a_drive_that_runs_away_pushes_with_full_force_until_the_window_ends_whatever_it_is_told() {
    let mut bench = bench_with(FaultConfig { for_s: Some(0.3), ..on_l2(DriveFault::Runaway, None) });
    hold_until(&mut bench, 0.5);
    let before_m = bench.truth.joint_m[L2];
    hold_until(&mut bench, 0.52);
    assert_eq!(first_failure(&bench), Some((Cause::Emergency, 4)));
    assert!(bench.truth.joint_m[L2] > before_m + 1e-3);
    hold_until(&mut bench, 0.9);
    let [_, high_m] = Scenario::default().mechanism.strokes.of_axis(L2);
    assert!(
        bench.truth.joint_m[L2] < high_m + 0.003,
        "the mechanism's own stop: {}",
        bench.truth.joint_m[L2]
    );
    assert!(bench.plant.master.drives_are_off() && bench.fastest_axis_m_s() < 1e-3);
}

#[test]
fn safe_torque_off_takes_the_drive_to_switch_on_disabled_and_keeps_it_there() {
    let mut bench = bench_with(on_l2(DriveFault::Sto, None));
    play_until(&mut bench, 0.6);
    assert_eq!(first_failure(&bench), Some((Cause::DriveFault, 4)));
    assert_eq!(bench.reading.drive_state[L2], DriveState::SwitchOnDisabled.code());
    assert_eq!(told(&bench, Cause::Emergency), []);
}

#[test]
fn a_drive_enables_later_by_as_much_as_the_fault_says() {
    let enabled_after = |size: &str| {
        let mut bench =
            bench_with(FaultConfig { from_s: Some(0.0), ..on_l2(DriveFault::SlowEnable, Some(size)) });
        bench.enable();
        bench.cycle
    };
    assert_eq!(enabled_after("40 ms") - enabled_after("0 ms"), 40);
}

#[test]
fn a_brake_that_never_closes_lets_a_switched_off_leg_sink_to_its_end() {
    let mut bench = bench_with(on_l2(DriveFault::BrakeOpen, None));
    hold_until(&mut bench, 0.51);
    let before_m = bench.truth.joint_m;
    for _ in 0..600 {
        bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Off)));
    }
    let sunk_m: Vec<_> = before_m.iter().zip(bench.truth.joint_m).map(|(was, is)| was - is).collect();
    assert!(sunk_m[L2] > 0.01, "{sunk_m:?}");
    assert!(sunk_m[3].abs() < 1e-3 && sunk_m[5].abs() < 1e-3, "the other brakes hold: {sunk_m:?}");
    let [low_m, _] = Scenario::default().mechanism.strokes.of_axis(L2);
    assert!(bench.truth.joint_m[L2] > low_m - 0.003, "the mechanism's own stop");
}

#[test]
fn a_brake_that_does_not_open_holds_the_axis_against_its_motor() {
    let mut bench = bench_with(on_l2(DriveFault::BrakeClosed, None));
    play_until(&mut bench, 0.6);
    assert_eq!(first_failure(&bench), Some((Cause::FollowingError, 4)));
}

#[test]
fn a_dip_of_the_supply_silences_the_drive_which_boots_anew() {
    let mut bench = bench_with(on_l2(DriveFault::Reboot, Some("50 ms")));
    hold_until(&mut bench, 0.54);
    assert_eq!(first_failure(&bench), Some((Cause::ProcessDataLost, 4)));
    let silent = bench.frames.iter().filter(|frame| {
        let tapped = tap::decode(frame).unwrap();
        let from_node = tapped.frame().is_some_and(|received| {
            matches!(Cob::try_from(received.frame.id()), Ok(Cob::Tpdo1(node) | Cob::Heartbeat(node)) if node.get() == 5)
        });
        from_node && tapped.frame().is_some_and(|received| received.time_ns > EPOCH_NS + 501_000_000)
    });
    assert_eq!(silent.count(), 0);
    for _ in 0..1000 {
        bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Off)));
    }
    assert_eq!(bench.reading.drive_state[L2], DriveState::SwitchOnDisabled.code(), "it is back");
    assert!(bench.causes(EventKind::Notice).contains(&Cause::Recovered));
}

#[test]
fn with_a_wrong_scale_the_axis_moves_by_a_multiple_and_the_drive_does_not_see_it() {
    let mut bench = bench_with(on_l2(DriveFault::Scale, Some("0.5")));
    bench.enable();
    let held_m = bench.reading.position_m;
    hold_at(&mut bench, held_m, 0.55);
    let is_m = bench.truth.joint_m[L2];
    // 1 mm in 200 ms.
    for step in 1..=300 {
        let mut targets_m = held_m;
        targets_m[L2] += 1e-3 * f64::from(step.min(200)) / 200.0;
        bench.cycle(Some(&|_| (targets_m, DriveRequest::Enable)));
    }
    assert_eq!(first_failure(&bench), None);
    assert!((bench.reading.position_m[L2] - held_m[L2] - 1e-3).abs() < 1e-5);
    assert!((bench.truth.joint_m[L2] - is_m - 0.5e-3).abs() < 1e-5, "{}", bench.truth.joint_m[L2] - is_m);
}

#[test]
fn a_storm_sends_an_emergency_every_so_often() {
    let mut bench =
        bench_with(FaultConfig { for_s: Some(0.05), ..on_l2(DriveFault::EmcyStorm, Some("2 ms")) });
    hold_until(&mut bench, 0.6);
    let sent = bench.frames.iter().filter(|frame| {
        let tapped = tap::decode(frame).unwrap();
        tapped.frame().is_some_and(|received| {
            matches!(Cob::try_from(received.frame.id()), Ok(Cob::Emergency(node)) if node.get() == 5)
        })
    });
    assert_eq!(sent.count(), 25);
}

#[test]
fn a_storm_in_a_storm_sends_by_its_own_time() {
    let storm = |size: &str, [from_s, for_s]: [f64; 2]| FaultConfig {
        from_s: Some(from_s),
        for_s: Some(for_s),
        ..on_l2(DriveFault::EmcyStorm, Some(size))
    };
    let faults = vec![storm("1 s", [0.5, 0.2]), storm("2 ms", [0.55, 0.05])];
    let mut bench = Bench::new(&Scenario { faults, ..Scenario::default() });
    hold_until(&mut bench, 0.75);
    let frames = bench.frames.iter().filter_map(|frame| tap::decode(frame).unwrap().frame().copied());
    let emergencies = frames.filter(
        |received| matches!(Cob::try_from(received.frame.id()), Ok(Cob::Emergency(node)) if node.get() == 5),
    );
    let times_s: Vec<_> = emergencies.map(|received| (received.time_ns - EPOCH_NS) as f64 * 1e-9).collect();
    let inner = times_s.iter().filter(|time_s| (0.55..0.6).contains(*time_s)).count();
    // The outer one begins anew when it acts alone again.
    assert_eq!((inner, times_s.len()), (25, 27), "{times_s:?}");
}
