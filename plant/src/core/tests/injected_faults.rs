//! Injected faults of encoders, drives, mechanism and commands: each strikes, does what its name says, and ends.

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

#[test]
fn a_jam_stops_the_axis_at_once_and_holds_it() {
    let mut bench = bench_with(FaultConfig { for_s: Some(0.2), ..on_l2(AxisFault::Jam, None) });
    play_until(&mut bench, 0.505);
    let stuck_m = bench.truth.joint_m[L2];
    assert!(bench.truth.joint_m_s[L2].abs() < 1e-3, "{}", bench.truth.joint_m_s[L2]);
    for _ in 0..100 {
        bench.cycle(Some(&|_| ([0.0; AXES], DriveRequest::Off)));
        assert!((bench.truth.joint_m[L2] - stuck_m).abs() < 2e-4);
    }
}

#[test]
fn dry_guides_take_more_force_for_the_same_motion() {
    let force_n = |factor: &str| {
        let mut bench = bench_with(fault(AxisFault::Friction, Some(factor), 0));
        // About where the slide moves fastest.
        play_until(&mut bench, 0.69);
        assert_eq!(first_failure(&bench), None);
        bench.truth.force_n[0].abs()
    };
    let (usual_n, more_n) = (force_n("1"), force_n("3"));
    // Twice 5 N more, the screw, and some viscous friction.
    assert!((12.0..25.0).contains(&(more_n - usual_n)), "{usual_n} N became {more_n} N");
}

#[test]
fn with_play_the_platform_drops_by_half_of_it_and_the_encoder_does_not_see_that() {
    let mut bench = bench_with(on_l2(AxisFault::Play, Some("0.4 mm")));
    hold_until(&mut bench, 0.49);
    let (seen_m, is_m) = (bench.reading.position_m[L2], bench.truth.joint_m[L2]);
    hold_until(&mut bench, 0.8);
    assert_eq!(first_failure(&bench), None);
    assert!((bench.reading.position_m[L2] - seen_m).abs() < 2e-5);
    assert!((is_m - bench.truth.joint_m[L2] - 2e-4).abs() < 2e-5, "{}", is_m - bench.truth.joint_m[L2]);
}

#[test]
fn a_broken_rod_drops_the_leg_while_its_drive_stands() {
    let mut bench = bench_with(on_l2(AxisFault::BrokenRod, None));
    hold_until(&mut bench, 0.49);
    let (seen_m, is_m) = (bench.reading.position_m[L2], bench.truth.joint_m[L2]);
    hold_until(&mut bench, 1.0);
    assert!((bench.reading.position_m[L2] - seen_m).abs() < 1e-4);
    assert!(is_m - bench.truth.joint_m[L2] > 0.005, "{}", is_m - bench.truth.joint_m[L2]);
}

#[test]
fn an_axis_that_falls_on_its_end_stop_is_an_event() {
    let mut scenario = Scenario { faults: vec![on_l2(AxisFault::BrokenRod, None)], ..Scenario::default() };
    scenario.mechanism.strokes.leg_m = [0.288, 0.3];
    scenario.dynamics.axes.stop_beyond_m = 0.0;
    let mut bench = Bench::new(&scenario);
    bench.enable();
    bench.controller_state = ControllerState::Running;
    hold_until(&mut bench, 1.5);
    let hits = bench.events.iter().filter(|event| event.cause == Cause::EndStopHit.code());
    let hit = hits.clone().next().expect("the leg falls on its stop");
    assert_eq!((hit.axis, hit.source), (L2 as u32, Source::Scenario.code()));
    let speeds: Vec<_> = hits.map(|hit| hit.value).collect();
    assert!(hit.value < 0.0 && speeds.len() <= 3, "the leg rests after a bounce: {speeds:?}");
    assert!((bench.truth.joint_m[L2] - 0.288).abs() < 1e-4, "{}", bench.truth.joint_m[L2]);
}

#[test]
fn a_hard_stop_ends_the_axis_way() {
    let mut sound = Bench::new(&Scenario::default());
    play_until(&mut sound, 0.501);
    let from_m = sound.truth.joint_m[L2];
    let mut bench = bench_with(on_l2(AxisFault::EndStop, Some("0.5 mm")));
    play_until(&mut bench, 0.8);
    assert_eq!(first_failure(&bench), Some((Cause::FollowingError, 4)));
    let way_m = (bench.truth.joint_m[L2] - from_m).abs();
    assert!((0.3e-3..0.75e-3).contains(&way_m), "{way_m}");
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

mod injected_times {
    //! When injected faults act: since switch-on, since the motion began, and since each other.

    use masseter_scenario::{
        AxisFault, BusFault, CommandFault, DriveFault, EncoderFault, FaultConfig, FaultKindConfig as Kind,
    };

    use crate::core::tests::*;

    fn named(name: &str, fault: FaultConfig) -> FaultConfig {
        FaultConfig { name: Some(name.to_owned()), ..fault }
    }

    fn on_l1(kind: impl Into<Kind>) -> FaultConfig {
        FaultConfig { axis: Some("l1".to_owned()), ..FaultConfig::new(kind) }
    }

    fn bench_with(faults: Vec<FaultConfig>) -> Bench {
        let scenario = Scenario { faults, ..Scenario::default() };
        scenario.validate().unwrap();
        Bench::new(&scenario)
    }

    /// Enables the drives, begins the motion and holds for so many cycles; returns when the motion began, ns.
    fn run(bench: &mut Bench, cycles: u64) -> u64 {
        bench.enable();
        bench.controller_state = ControllerState::Running;
        let held_m = bench.reading.position_m;
        bench.cycle(Some(&|_| (held_m, DriveRequest::Enable)));
        let began_ns = bench.reading.sampled_ns;
        (1..cycles).for_each(|_| bench.cycle(Some(&|_| (held_m, DriveRequest::Enable))));
        began_ns
    }

    fn times_ns(bench: &Bench, cause: Cause) -> Vec<(f64, u64)> {
        let told = bench.events.iter().filter(|event| event.cause == cause.code());
        told.map(|event| (event.value, event.time_ns)).collect()
    }

    #[test]
    fn a_fault_of_a_bus_acts_in_the_time_of_the_motion() {
        let lose = FaultConfig {
            bus: Some(1),
            node: Some(4),
            id: Some(0x204),
            at_s: Some(0.05),
            for_s: Some(0.003),
            ..FaultConfig::new(BusFault::Lose)
        };
        let mut bench = bench_with(vec![lose]);
        let began_ns = run(&mut bench, 100);
        let [(1.0, struck_ns)] = times_ns(&bench, Cause::FaultInjected)[..] else { panic!() };
        assert!((50_000_000..51_500_000).contains(&(struck_ns - began_ns)), "{}", struck_ns - began_ns);
        let ended = bench.events.iter().find(|event| event.cause == Cause::FaultEnded.code()).unwrap();
        assert_eq!((ended.source, ended.limit), (Source::Wire.code(), 3.0), "three process data were lost");
    }

    #[test]
    fn faults_follow_each_other_over_every_layer() {
        let after = |name: &str, at_s: f64, fault: FaultConfig| FaultConfig {
            after: Some(name.to_owned()),
            at_s: Some(at_s),
            ..fault
        };
        let lose =
            FaultConfig { bus: Some(1), node: Some(4), count: Some(1), ..FaultConfig::new(BusFault::Lose) };
        let size = Some("1 um".parse().unwrap());
        let mut bench = bench_with(vec![
            named("third", after("fault.second", 0.02, FaultConfig { size, ..on_l1(EncoderFault::Offset) })),
            named("first", FaultConfig { at_s: Some(0.03), ..on_l1(EncoderFault::Stuck) }),
            named("second", after("fault.first", 0.01, lose)),
            named("fourth", after("fault.third", 0.005, FaultConfig::new(CommandFault::Foreign))),
        ]);
        let began_ns = run(&mut bench, 100);
        let struck = times_ns(&bench, Cause::FaultInjected);
        let order: Vec<_> = struck.iter().map(|(number, _)| *number).collect();
        assert_eq!(order, [2.0, 3.0, 1.0, 4.0]);
        let after_ms = |index: usize, from_ns: u64| (struck[index].1 - from_ns) as f64 * 1e-6;
        assert!((30.0..30.2).contains(&after_ms(0, began_ns)), "{struck:?}");
        assert!((10.0..11.1).contains(&after_ms(1, struck[0].1)), "the next frame to that node: {struck:?}");
        assert!((20.0..20.2).contains(&after_ms(2, struck[1].1)), "{struck:?}");
        assert!((5.0..6.6).contains(&after_ms(3, struck[2].1)), "the next command: {struck:?}");
    }

    #[test]
    fn a_fault_of_a_state_that_never_comes_never_acts() {
        let mut bench = bench_with(vec![
            FaultConfig { at_s: Some(0.0), ..on_l1(DriveFault::Fault) },
            FaultConfig { at_s: Some(0.5), ..on_l1(AxisFault::Jam) },
        ]);
        bench.enable();
        (0..100).for_each(|_| bench.cycle(Some(&|reading| (reading.position_m, DriveRequest::Enable))));
        assert!(times_ns(&bench, Cause::FaultInjected).is_empty());
        run(&mut bench, 100);
        let struck = times_ns(&bench, Cause::FaultInjected);
        assert_eq!(struck.iter().map(|(number, _)| *number).collect::<Vec<_>>(), [1.0]);
    }
}
