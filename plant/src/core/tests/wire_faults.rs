//! Faults of the wires: those that the rig tolerates, those that stop the rig, and the reports.

use masseter_can::canopen::EmergencyCode;
use masseter_can::{ErrorKind, Tapped};
use masseter_runtime::messages::codes::NO_AXIS;
use masseter_scenario::{BusFault, FaultConfig};

use super::*;

fn base() -> FaultConfig {
    FaultConfig { bus: Some(0), from_s: Some(0.5), ..FaultConfig::new(BusFault::Corrupt) }
}

fn bench_with(fault: FaultConfig) -> Bench {
    Bench::new(&Scenario { faults: vec![fault], ..Scenario::default() })
}

/// Enables the drives and plays until `until_s`; the largest distance of an axis from its target.
fn play_until(bench: &mut Bench, until_s: f64) -> f64 {
    bench.enable();
    play(bench, (until_s * 1e3) as u64 - bench.cycle)
}

fn error_frames(bench: &Bench) -> usize {
    let tapped = bench.frames.iter().map(|frame| tap::decode(frame).unwrap());
    tapped.filter(|tapped| matches!(tapped, Tapped::Error(report) if report.kind == ErrorKind::Bit)).count()
}

#[test]
fn with_one_frame_in_a_hundred_corrupted_the_motion_goes_on_and_errors_are_counted() {
    let mut bench = bench_with(FaultConfig { probability: 0.01, ..base() });
    let worst_m = play_until(&mut bench, 2.5);
    assert!(worst_m < 1e-3, "{worst_m}");
    assert_eq!(bench.causes(EventKind::Fault), []);
    assert_eq!(bench.reading.master_fault, 0);
    let errors = error_frames(&bench);
    assert!((80..250).contains(&errors), "{errors} of about 14000 frames");
    assert!(bench.causes(EventKind::Notice).contains(&Cause::FaultInjected));
}

#[test]
fn the_same_seed_corrupts_the_same_frames_and_another_one_others() {
    let frames = |seed| {
        let faults = vec![FaultConfig { probability: 0.05, from_s: Some(0.0), ..base() }];
        let mut bench = Bench::new(&Scenario { seed, faults, ..Scenario::default() });
        (0..300).for_each(|_| bench.cycle(None));
        bench.frames
    };
    let first = frames(1);
    assert!(first == frames(1));
    assert!(first != frames(2));
}

#[test]
fn a_babbling_node_makes_a_safe_stop() {
    let mut bench = bench_with(FaultConfig { kind: BusFault::Babble.into(), node: Some(2), ..base() });
    play_until(&mut bench, 1.0);
    assert_eq!(bench.reading.master_fault, 1);
    assert_eq!(bench.causes(EventKind::Fault)[0], Cause::ProcessDataLost);
    for drive in &bench.plant.link.emulation.drives {
        assert_eq!(
            drive.state(),
            DriveState::SwitchOnDisabled,
            "those behind the babble by loss of the link"
        );
    }
}

#[test]
fn a_disconnected_node_is_detected_and_all_drives_stop() {
    let fault = FaultConfig { kind: BusFault::Disconnect.into(), bus: Some(1), node: Some(5), ..base() };
    let mut bench = bench_with(fault);
    play_until(&mut bench, 1.0);
    let fault = bench.events.iter().find(|event| event.kind == EventKind::Fault.code()).unwrap();
    assert_eq!((fault.cause, fault.axis), (Cause::ProcessDataLost.code(), 4));
    assert!(fault.time_ns < EPOCH_NS + 510_000_000, "{} ms after", (fault.time_ns - EPOCH_NS) / 1_000_000);
    assert!(bench.fastest_axis_m_s() < 1e-3, "{}", bench.fastest_axis_m_s());
}

/// 0x204 for drive 4, which stands still: no position shows the loss.
fn deaf(until_s: Option<f64>) -> FaultConfig {
    FaultConfig {
        kind: BusFault::Lose.into(),
        bus: Some(1),
        node: Some(4),
        id: Some(0x204),
        until_s,
        ..base()
    }
}

#[test]
fn a_standing_drive_without_process_data_stops_by_itself_and_with_it_all() {
    let mut bench = bench_with(deaf(None));
    bench.enable();
    let held_m = bench.reading.position_m;
    while bench.cycle < 630 {
        bench.cycle(Some(&|_| (held_m, DriveRequest::Enable)));
    }
    assert_eq!(bench.causes(EventKind::Fault), []);
    for _ in 0..100 {
        bench.cycle(Some(&|_| (held_m, DriveRequest::Enable)));
    }
    let faults: Vec<_> = bench.events.iter().filter(|event| event.kind == EventKind::Fault.code()).collect();
    assert_eq!((faults[0].cause, faults[0].axis), (Cause::Emergency.code(), 3));
    assert_eq!(EmergencyCode(faults[0].value as u16), EmergencyCode::RPDO_TIMEOUT);
    assert_eq!((faults[1].cause, faults[1].axis), (Cause::DriveFault.code(), 3));
    assert!(bench.plant.master.drives_are_off());
}

/// The machine stalls for as long as the heartbeat may.
#[test]
fn process_data_that_come_back_within_the_time_of_a_heartbeat_trip_no_drive() {
    let mut bench = bench_with(deaf(Some(0.64)));
    bench.enable();
    let held_m = bench.reading.position_m;
    while bench.cycle < 800 {
        bench.cycle(Some(&|_| (held_m, DriveRequest::Enable)));
    }
    assert_eq!(bench.causes(EventKind::Fault), []);
}

#[test]
fn a_moving_drive_that_misses_its_targets_stops_all_within_three_cycles_of_the_second() {
    let mut bench = bench_with(deaf(None));
    play_until(&mut bench, 0.6);
    let fault = bench.events.iter().find(|event| event.kind == EventKind::Fault.code()).unwrap();
    assert_eq!((fault.cause, fault.axis, fault.limit), (Cause::FollowingError.code(), 3, 7.5e-5));
    assert!(fault.value > 7.5e-5 && fault.value < 3e-4, "{}", fault.value);
    assert_eq!(bench.reading.master_fault, 1);
}

#[test]
fn a_drive_in_bus_off_is_reported_and_stops_the_rig() {
    let fault = FaultConfig { kind: BusFault::BusOff.into(), node: Some(3), ..base() };
    let mut bench = bench_with(fault);
    play_until(&mut bench, 1.0);
    let told = bench.events.iter().find(|event| event.cause == Cause::BusOff.code()).unwrap();
    assert_eq!((told.source, told.axis), (Source::Wire.code(), 2));
    assert!(bench.causes(EventKind::Notice).contains(&Cause::ErrorActive), "restarted after 100 ms");
    let emergencies = bench.events.iter().filter(|event| event.cause == Cause::Emergency.code());
    let mut codes = emergencies.map(|event| EmergencyCode(event.value as u16));
    assert!(codes.any(|code| code == EmergencyCode::WAS_BUS_OFF));
    assert_eq!(bench.reading.master_fault, 1);
}

#[test]
fn the_masters_own_controller_in_bus_off_is_reported_with_the_bus() {
    let mut bench =
        bench_with(FaultConfig { kind: BusFault::BusOff.into(), bus: Some(1), node: Some(127), ..base() });
    play_until(&mut bench, 0.6);
    let told = bench.events.iter().find(|event| event.cause == Cause::BusOff.code()).unwrap();
    assert_eq!((told.source, told.bus, told.axis), (Source::Wire.code(), 1, NO_AXIS));
}

#[test]
fn drives_boot_though_one_frame_in_a_hundred_comes_twice() {
    for seed in 0..20 {
        let fault = |bus| FaultConfig {
            kind: BusFault::Duplicate.into(),
            bus: Some(bus),
            from_s: Some(0.0),
            probability: 0.01,
            ..base()
        };
        let mut bench =
            Bench::new(&Scenario { seed, faults: [0, 1].map(fault).into(), ..Scenario::default() });
        bench.enable();
        assert_eq!(bench.causes(EventKind::Fault), [], "seed {seed}");
    }
}

#[test]
fn a_lost_synchronisation_costs_one_drive_one_cycle() {
    let fault =
        FaultConfig { kind: BusFault::Lose.into(), node: Some(1), id: Some(0x080), count: Some(1), ..base() };
    let mut bench = bench_with(fault);
    play_until(&mut bench, 1.0);
    assert_eq!(bench.causes(EventKind::Fault), []);
    assert_eq!(error_frames(&bench), 0);
    let ended = bench.events.iter().find(|event| event.cause == Cause::FaultEnded.code()).unwrap();
    assert_eq!((ended.value, ended.limit, ended.axis), (1.0, 1.0, 0));
}

/// Those of 855 µs even come between the moment the next SYNC is queued and that in which it is on the wire.
#[test]
fn process_data_of_the_cycle_before_are_no_answer_however_late_they_come() {
    for delay_us in [600, 700, 855] {
        let fault = FaultConfig {
            kind: BusFault::Delay.into(),
            id: Some(0x181),
            node: Some(1),
            size: Some(format!("{delay_us} us").parse().unwrap()),
            ..base()
        };
        let mut bench = bench_with(fault);
        play_until(&mut bench, 0.6);
        assert_eq!(bench.reading.fresh_axes & 1, 0, "late by {delay_us} µs");
    }
}

/// The frames of the master are held for 10 ms, as by an adapter that hangs. The frames of three cycles may come late.
#[test]
fn drives_get_no_burst_of_old_syncs_after_a_hang() {
    let mut bench = bench_with(FaultConfig {
        kind: BusFault::Delay.into(),
        node: Some(127),
        size: Some("10 ms".parse().unwrap()),
        until_s: Some(0.51),
        ..base()
    });
    play_until(&mut bench, 0.6);
    let frames = bench.frames.iter().filter(|frame| frame.bus == 0);
    let frames = frames.map(|frame| *tap::decode(frame).unwrap().frame().unwrap());
    let syncs = frames.filter(|frame| Cob::try_from(frame.frame.id()) == Ok(Cob::Sync));
    let times_ns: Vec<_> = syncs.map(|frame| frame.time_ns).collect();
    let gaps_ns = times_ns.windows(2).map(|pair| pair[1] - pair[0]);
    let (longest_ns, close) =
        (gaps_ns.clone().max().unwrap(), gaps_ns.filter(|&gap_ns| gap_ns < PERIOD_NS / 2).count());
    assert!(longest_ns > 9 * PERIOD_NS, "the hang shows: {longest_ns} ns");
    assert!(close <= 3, "{close} SYNCs close behind another");
}

#[test]
fn drives_that_are_switched_on_after_the_master_are_waited_for() {
    let faults = [1, 2, 3].map(|node| FaultConfig {
        kind: BusFault::Disconnect.into(),
        node: Some(node),
        from_s: Some(0.0),
        until_s: Some(0.5),
        ..base()
    });
    let mut bench = Bench::new(&Scenario { faults: faults.into(), ..Scenario::default() });
    (0..600).for_each(|_| bench.cycle(None));
    bench.enable();
    assert_eq!(bench.causes(EventKind::Fault), []);
}

#[test]
fn a_fault_of_an_absent_node_is_refused() {
    let fault = FaultConfig { kind: BusFault::Disconnect.into(), node: Some(5), ..base() };
    let scenario = Scenario { faults: vec![fault], ..Scenario::default() };
    let error = PlantCore::new(&scenario, 0).unwrap_err().to_string();
    assert_eq!(error, "faults.node = 5: bus 0 has the nodes 127, 1, 2, 3");
}
