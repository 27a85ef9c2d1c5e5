//! Injected faults of encoders, drives, mechanism and commands: each strikes, does what its name says, and ends.

mod injected_times;
mod mechanism;

use masseter_can::canopen::EmergencyCode;
use masseter_model::geometry::AXIS_NAMES;
use masseter_scenario::{
    AxisFault, CommandFault, DriveFault, EncoderFault, FaultConfig, FaultKindConfig as Kind, PlatformFault,
};

use super::*;

/// The drives are enabled by then, s.
const FROM_S: f64 = 0.5;
/// The axis l2.
const L2: usize = 4;

fn fault(kind: impl Into<Kind>, size: Option<&str>, axis: usize) -> FaultConfig {
    let kind = kind.into();
    FaultConfig {
        from_s: Some(FROM_S),
        axis: kind.takes("axis").then(|| AXIS_NAMES[axis].to_owned()),
        size: size.map(|size| size.parse().unwrap()),
        ..FaultConfig::new(kind)
    }
}

fn on_l2(kind: impl Into<Kind>, size: Option<&str>) -> FaultConfig {
    fault(kind, size, L2)
}

fn bench_with(fault: FaultConfig) -> Bench {
    let scenario = Scenario { faults: vec![fault], ..Scenario::default() };
    scenario.validate().unwrap();
    Bench::new(&scenario)
}

/// Enables the drives and holds them where they are, until that time.
fn hold_until(bench: &mut Bench, until_s: f64) {
    if bench.reading.drive_state != ENABLED && bench.cycle == 0 {
        bench.enable();
    }
    let held_m = bench.reading.position_m;
    hold_at(bench, held_m, until_s);
}

fn hold_at(bench: &mut Bench, held_m: [f64; AXES], until_s: f64) {
    while (bench.cycle as f64) < until_s * 1e3 {
        bench.cycle(Some(&|_| (held_m, DriveRequest::Enable)));
    }
}

fn play_until(bench: &mut Bench, until_s: f64) {
    bench.enable();
    play(bench, (until_s * 1e3) as u64 - bench.cycle);
}

fn told(bench: &Bench, cause: Cause) -> Vec<Event> {
    bench.events.iter().filter(|event| event.cause == cause.code()).copied().collect()
}

fn first_failure(bench: &Bench) -> Option<(Cause, u32)> {
    let failure = bench.events.iter().find(|event| event.kind == EventKind::Fault.code())?;
    Some((Cause::try_from(failure.cause).unwrap(), failure.axis))
}

fn since_switch_on_s(event: &Event) -> f64 {
    (event.time_ns - EPOCH_NS) as f64 * 1e-9
}

/// A size with which a kind shows in the motion of the tests.
fn size_of(kind: Kind) -> Option<&'static str> {
    kind.declared().size?;
    Some(match kind {
        Kind::Encoder(EncoderFault::Offset) | Kind::Command(CommandFault::Jump) => "2 mm",
        Kind::Encoder(EncoderFault::Drift) => "20 mm/s",
        Kind::Encoder(EncoderFault::Noise) => "0.1 mm",
        Kind::Encoder(EncoderFault::Steps) | Kind::Axis(AxisFault::EndStop) => "0.05 mm",
        Kind::Encoder(EncoderFault::Delay) => "5 ms",
        Kind::Drive(DriveFault::SlowEnable | DriveFault::Reboot)
        | Kind::Command(CommandFault::ControllerStall) => "30 ms",
        Kind::Drive(DriveFault::EmcyStorm) => "1 ms",
        Kind::Platform(PlatformFault::Payload) => "0.5 kg",
        Kind::Axis(AxisFault::Play) => "0.5 mm",
        Kind::Axis(AxisFault::Friction) => "5",
        _ => "0.5",
    })
}

/// Every kind on every axis: the event names it, comes when the fault acts, and another one ends it.
#[test]
fn every_kind_strikes_on_every_axis_in_its_time_and_ends() {
    let of_others = |kind: &Kind| matches!(kind, Kind::Bus(_) | Kind::Process(_));
    for &kind in Kind::ALL.iter().filter(|kind| !of_others(kind)) {
        for (axis, name) in AXIS_NAMES.into_iter().enumerate() {
            let is_of_start = kind == Kind::Drive(DriveFault::SlowEnable);
            // A brake that does not close shows only once the drives are switched off.
            let for_s = if kind == Kind::Drive(DriveFault::BrakeOpen) { 0.3 } else { 0.1 };
            let from_s = if is_of_start { 0.0 } else { FROM_S };
            let for_s = if is_of_start { 0.6 } else { for_s };
            let given = fault(kind, size_of(kind), axis);
            let mut bench =
                bench_with(FaultConfig { from_s: Some(from_s), for_s: Some(for_s), ..given.clone() });
            play_until(&mut bench, 0.7);
            for _ in 0..150 {
                bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Off)));
            }
            let place = format!("{kind} on {name}");
            let injected = told(&bench, Cause::FaultInjected);
            let expected_axis = given.axis().map_or(NO_AXIS, |axis| axis as u32);
            assert_eq!(injected.len(), 1, "{place}");
            let Event { source, axis: told_axis, value, limit, .. } = injected[0];
            assert_eq!((source, told_axis, value, limit), (Source::Scenario.code(), expected_axis, 1.0, 1.0));
            let window_s = from_s..from_s + for_s + 0.001;
            assert!(window_s.contains(&since_switch_on_s(&injected[0])), "{place}: {injected:?}");
            let ended = told(&bench, Cause::FaultEnded);
            assert_eq!((ended.len(), ended.first().map(|event| event.value)), (1, Some(1.0)), "{place}");
            let lasts_its_size = matches!(
                kind,
                Kind::Drive(DriveFault::Reboot) | Kind::Command(CommandFault::ControllerStall)
            );
            let end_s = from_s + if lasts_its_size { 0.03 } else { for_s };
            assert!((since_switch_on_s(&ended[0]) - end_s).abs() < 0.0016, "{place}: {ended:?}");
            assert!(bench.truth.joint_m.iter().all(|joint_m| joint_m.is_finite()), "{place}");
        }
    }
}

#[test]
fn a_fault_that_changes_nothing_reports_nothing() {
    for (kind, size) in [
        (Kind::Encoder(EncoderFault::Offset), Some("0 mm")),
        (Kind::Axis(AxisFault::EndStop), Some("50 mm")),
        (Kind::Drive(DriveFault::TorqueLoss), Some("0")),
        (Kind::Drive(DriveFault::SlowEnable), Some("1 s")),
        (Kind::Drive(DriveFault::BrakeOpen), None),
        (Kind::Axis(AxisFault::Friction), Some("1")),
        (Kind::Platform(PlatformFault::Payload), Some("0 kg")),
    ] {
        let mut bench = bench_with(FaultConfig { for_s: Some(0.05), ..on_l2(kind, size) });
        play_until(&mut bench, 0.6);
        assert_eq!(bench.causes(EventKind::Fault), [], "{kind}");
        let of_scenario = bench.events.iter().filter(|event| event.source == Source::Scenario.code());
        assert_eq!(of_scenario.count(), 0, "{kind}");
    }
}

#[test]
fn the_same_seed_gives_the_same_faults() {
    let run = |seed| {
        let faults = vec![on_l2(EncoderFault::Noise, Some("5 um"))];
        let mut bench = Bench::new(&Scenario { seed, faults, ..Scenario::default() });
        play_until(&mut bench, 0.6);
        (bench.reading, bench.truth)
    };
    assert_eq!(run(5), run(5));
    assert_ne!(run(5), run(6));
}

#[test]
fn an_encoder_with_an_offset_leads_the_axis_away_and_back() {
    let mut bench =
        bench_with(FaultConfig { for_s: Some(0.1), ..on_l2(EncoderFault::Offset, Some("50 um")) });
    hold_until(&mut bench, 0.49);
    let (seen_m, is_m) = (bench.reading.position_m[L2], bench.truth.joint_m[L2]);
    let held_m = bench.reading.position_m;
    hold_at(&mut bench, held_m, 0.59);
    assert!((bench.reading.position_m[L2] - seen_m).abs() < 1e-5, "the drive corrects what it sees");
    assert!((bench.truth.joint_m[L2] - is_m + 5e-5).abs() < 1e-5, "{}", bench.truth.joint_m[L2] - is_m);
    hold_at(&mut bench, held_m, 0.75);
    assert!((bench.truth.joint_m[L2] - is_m).abs() < 1e-5);
}

#[test]
fn the_brake_holds_the_axis_though_its_encoder_drifts() {
    let mut bench = bench_with(on_l2(EncoderFault::Drift, Some("50 mm/s")));
    hold_until(&mut bench, 0.55);
    let mut switch_off = || {
        (0..100).for_each(|_| bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Off))));
        bench.truth.joint_m[L2]
    };
    let stopped_m = switch_off();
    switch_off();
    assert!(bench.plant.master.drives_are_off());
    assert!((bench.truth.joint_m[L2] - stopped_m).abs() < 1e-5);
    assert!((bench.reading.position_m[L2] - stopped_m).abs() > 0.01, "the encoder drifts on");
}

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
    assert_eq!(first_failure(&bench), Some((Cause::FollowingError, 4)));
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
/// The master judges a bad command as it judges that of any controller.
#[test]
fn a_bad_command_stops_the_rig_by_the_path_that_refuses_it() {
    for (kind, size, cause, axis) in [
        (Kind::Command(CommandFault::Nan), None, Cause::BadMessage, 0),
        (Kind::Command(CommandFault::Version), None, Cause::BadMessage, NO_AXIS),
        (Kind::Command(CommandFault::Jump), Some("2 mm"), Cause::VelocityLimit, 4),
        (Kind::Command(CommandFault::ControllerStall), Some("100 ms"), Cause::CommandLost, NO_AXIS),
    ] {
        let mut bench = bench_with(on_l2(kind, size));
        hold_until(&mut bench, 0.7);
        assert_eq!(first_failure(&bench), Some((cause, axis)), "{kind}");
        assert!(bench.plant.master.drives_are_off());
    }
}

/// The controller detects this one: a reading answers a cycle that it has not reached.
#[test]
fn a_foreign_command_shows_in_the_readings() {
    let mut bench = bench_with(on_l2(CommandFault::Foreign, None));
    hold_until(&mut bench, 0.55);
    assert!(bench.reading.answers_cycle > bench.cycle);
}
