//! Injected faults of encoders, drives, mechanism and commands: each strikes, has the effect of its name, and ends.

mod commands;
mod drives;
mod encoders;
mod mechanism;
mod times;

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

/// A size with a visible effect in the motion of the tests.
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
