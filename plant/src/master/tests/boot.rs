//! From power-on to enabled drives, and the reasons that prevent it.

use std::collections::BTreeSet;

use masseter_can::canopen::{AbortCode, NmtState, SdoRequest};
use masseter_can::cia402::Statusword;

use super::peer::POSITION;
use super::*;

const PHASES: [BootPhase; 6] = [
    BootPhase::Identifying,
    BootPhase::CheckingPdos,
    BootPhase::Configuring,
    BootPhase::Configured,
    BootPhase::Starting,
    BootPhase::Ready,
];

#[test]
fn every_drive_is_identified_checked_configured_and_started_in_that_order() {
    let bench = Bench::enabled();
    assert_eq!(bench.causes(EventKind::Fault), []);
    for axis in 0..AXES {
        let phases: Vec<_> = bench
            .events_of(EventKind::Transition)
            .filter(|event| event.source == Source::Master.code() && event.axis == axis as u32)
            .map(|event| BootPhase::try_from(event.to).unwrap())
            .collect();
        assert_eq!(phases, PHASES, "axis {axis}");
    }
}

#[test]
fn a_drive_is_configured_as_the_scenario_declares() {
    let mut bench = Bench::enabled();
    let drive = bench.drive(4);
    let table = [
        ((0x1017, 0), 50),
        ((0x1016, 1), 0x007F_0096),
        ((0x1400, 5), 150),
        ((0x6007, 0), 3),
        ((0x605A, 0), 2),
        ((0x6085, 0), 10_000_000),
        ((0x6065, 0), 2000),
        ((0x6066, 0), 20),
        ((0x6072, 0), 2000),
        ((0x60C2, 1), 1),
        ((0x60C2, 2), 0xFD),
        ((0x6060, 0), 8),
        ((0x607A, 0), POSITION as u32),
    ];
    for ((index, subindex), value) in table {
        assert_eq!(drive.written(index, subindex), value, "{index:04X}:{subindex}");
    }
    let [low, high] = [1, 2].map(|end| drive.written(0x607D, end) as i32);
    assert!(low < high, "{low} {high}");
}

#[test]
fn one_request_a_bus_and_cycle_and_none_beside_process_data() {
    let mut bench = Bench::enabled();
    let before = bench.wires.peer(0).requests.len();
    bench.cycles(100, DriveRequest::Enable);
    assert_eq!(bench.wires.peer(0).requests.len(), before);
    for axes in [[0, 1, 2], [3, 4, 5]] {
        let mut times: Vec<_> = axes
            .into_iter()
            .flat_map(|axis| {
                bench.wires.peer(axis).requests.iter().map(|(time_ns, _)| *time_ns).collect::<Vec<_>>()
            })
            .collect();
        times.sort_unstable();
        assert!(times.windows(2).all(|pair| pair[1] - pair[0] >= PERIOD_NS));
    }
}

#[test]
fn a_drive_that_is_not_as_expected_is_named_and_no_drive_is_enabled() {
    type Change = fn(&mut Peer);
    let table: [(Change, Cause, u32); 14] = [
        (|drive| drop(drive.objects.insert((0x6064, 0), vec![0; 5])), Cause::SdoAborted, 0x60_6400),
        (|drive| drop(drive.objects.insert((0x1000, 0), vec![0; 4])), Cause::WrongIdentity, 0x10_0000),
        (|drive| drop(drive.objects.insert((0x1018, 2), vec![9, 9, 0, 0])), Cause::WrongIdentity, 0x10_1802),
        (
            |drive| drop(drive.objects.insert((0x1600, 1), vec![0x10, 0, 0x41, 0x60])),
            Cause::WrongPdo,
            0x16_0001,
        ),
        (|drive| drop(drive.objects.insert((0x1A00, 0), vec![2])), Cause::WrongPdo, 0x1A_0000),
        (|drive| drop(drive.objects.insert((0x1400, 2), vec![255])), Cause::WrongPdo, 0x14_0002),
        (|drive| drop(drive.objects.remove(&(0x6064, 0))), Cause::SdoAborted, 0x60_6400),
        (|drive| drive.refuses = Some(((0x6007, 0), AbortCode::READ_ONLY)), Cause::SdoAborted, 0x60_0700),
        // The boot goes on without such an object only if the drive lacks it: any other refusal is a failure.
        (|drive| drive.refuses = Some(((0x607C, 0), AbortCode::GENERAL)), Cause::SdoAborted, 0x60_7C00),
        (|drive| drive.refuses = Some(((0x1801, 1), AbortCode::GENERAL)), Cause::SdoAborted, 0x18_0101),
        (|drive| drive.get_stuck_in(DriveState::QuickStopActive), Cause::StillPowered, 0x60_4100),
        (
            |drive| drop(drive.objects.insert((0x607C, 0), vec![0x10, 0x27, 0, 0])),
            Cause::HomeOffset,
            0x60_7C00,
        ),
        (|drive| drive.servers = 2, Cause::DuplicateNode, 0),
        (|drive| drive.get_stuck_in(DriveState::Fault), Cause::FaultFound, 0x60_3F00),
    ];
    for (change, cause, object) in table {
        let mut bench = Bench::new();
        change(bench.drive(3));
        for _ in 0..800 {
            bench.cycle(Some(DriveRequest::Enable));
            assert!(bench.nobody_is_enabled());
        }
        let faults: Vec<_> = bench.events_of(EventKind::Fault).collect();
        assert_eq!(faults.len(), 1, "{faults:?}");
        let Event { axis, node, bus, .. } = *faults[0];
        assert_eq!((faults[0].cause, faults[0].object), (cause.code(), object), "{cause}");
        assert_eq!((axis, node, bus), (3, 4, 1));
        assert_eq!(bench.reading.master_fault, 1);
    }
}

/// A constant object with the value is right. An offset that stays would act in the motion.
#[test]
fn a_constant_object_passes_with_the_value_of_the_rig_alone() {
    for (object, value, enabled) in [
        ((0x60C2, 2), vec![0xFD], true),
        ((0x60C2, 2), vec![0xFE], false),
        ((0x60B2, 0), vec![0, 0], true),
        ((0x60B2, 0), vec![55, 0], false),
    ] {
        let mut bench = Bench::new();
        let drive = bench.drive(3);
        drive.constants.push(object);
        drive.objects.insert(object, value.clone());
        bench.cycles(800, DriveRequest::Enable);
        let faults: Vec<_> =
            bench.events_of(EventKind::Fault).map(|fault| (fault.cause, fault.object)).collect();
        let refused = (Cause::SdoAborted.code(), u32::from(object.0) << 8 | u32::from(object.1));
        assert_eq!(faults, if enabled { vec![] } else { vec![refused] }, "{object:X?} is {value:?}");
        assert_eq!(bench.nobody_is_enabled(), !enabled, "{object:X?} is {value:?}");
    }
}

/// Every object that a boot writes, in turn. The drive acts on controlwords, and shows its mode in another object.
#[test]
fn a_drive_that_acknowledges_a_value_and_does_not_keep_it_is_never_enabled() {
    let another_pdo = |drive: &mut Peer| drive.objects.insert((0x1801, 1), vec![0x82, 2, 0, 0x40]);
    let mut sound = Bench::new();
    another_pdo(sound.drive(3));
    sound.cycles(400, DriveRequest::Enable);
    let written = sound.drive(3).requests.iter().filter_map(|(_, request)| match request {
        SdoRequest::Download { object, .. } => Some((object.index, object.subindex)),
        _ => None,
    });
    let written: BTreeSet<_> = written.filter(|object| *object != (0x6040, 0)).collect();
    assert!(written.len() > 17, "{written:X?}");
    for object in written {
        let mut bench = Bench::new();
        let drive = bench.drive(3);
        another_pdo(drive);
        drive.forgets = Some(object);
        // The mode is read again and again.
        bench.cycles(800, DriveRequest::Enable);
        assert!(bench.nobody_is_enabled(), "{object:X?}");
        let faults: Vec<_> =
            bench.events_of(EventKind::Fault).map(|fault| (fault.cause, fault.object)).collect();
        let at = |(index, subindex): (u16, u8)| u32::from(index) << 8 | u32::from(subindex);
        let named = match object {
            (0x6060, 0) => (Cause::NotAccepted.code(), at((0x6061, 0))),
            _ => (Cause::NotKept.code(), at(object)),
        };
        assert_eq!(faults, [named], "{object:X?}");
    }
}

/// The table above has a drive that answers every request twice.
#[test]
fn answers_that_come_twice_now_and_then_are_no_second_drive() {
    let mut bench = Bench::new();
    for _ in 0..400 {
        let is_repeated = bench.drive(3).requests.len() % 10 == 9;
        bench.drive(3).servers = if is_repeated { 2 } else { 1 };
        bench.cycle(Some(DriveRequest::Enable));
    }
    assert!(bench.all_are(DriveState::OperationEnabled), "{:?}", bench.events);
    assert_eq!(bench.causes(EventKind::Fault), []);
}

#[test]
fn pdos_that_the_rig_does_not_exchange_are_switched_off_where_a_drive_has_them() {
    let mut bench = Bench::new();
    let drive = bench.drive(1);
    drive.objects.insert((0x1801, 1), 0x4000_0282_u32.to_le_bytes().to_vec());
    drive.objects.insert((0x1802, 1), 0xC000_0382_u32.to_le_bytes().to_vec());
    bench.cycles(400, DriveRequest::Enable);
    assert!(bench.all_are(DriveState::OperationEnabled), "{:?}", bench.events);
    assert_eq!(bench.drive(1).written(0x1801, 1), 0xC000_0282);
    let wrote_1802 = |(_, request): &(u64, SdoRequest)| matches!(request, SdoRequest::Download { object, .. } if object.index == 0x1802);
    assert!(!bench.drive(1).requests.iter().any(wrote_1802));
}

#[test]
fn nothing_is_written_to_a_device_that_is_another() {
    let mut bench = Bench::new();
    bench.drive(0).objects.insert((0x1018, 1), vec![1, 2, 3, 4]);
    bench.cycles(300, DriveRequest::Enable);
    let wrote = |(_, request): &(u64, SdoRequest)| !matches!(request, SdoRequest::InitiateUpload { .. });
    assert!(!bench.drive(0).requests.iter().any(wrote));
}

fn resetting_faults() -> Bench {
    let mut scenario = Scenario::default();
    scenario.can.reset_faults = true;
    Bench::of(scenario)
}

#[test]
fn a_fault_found_at_the_start_is_named_and_neither_reset_nor_followed_by_power() {
    let mut bench = Bench::new();
    bench.drive(2).power = DriveState::Fault;
    bench.cycles(400, DriveRequest::Enable);
    assert_eq!(bench.drive(2).power, DriveState::Fault);
    assert!((0..AXES).all(|axis| !bench.drive(axis).power.is_powered()));
    let fault = *bench.events_of(EventKind::Fault).next().unwrap();
    assert_eq!((fault.cause, fault.axis, fault.value as u16), (Cause::FaultFound.code(), 2, 0x7320));
    assert_eq!(fault.limit as u16, Statusword::for_state(DriveState::Fault).0);
    assert_eq!(bench.causes(EventKind::Fault).len(), 1);
}

#[test]
fn a_fault_that_is_only_remembered_is_reset_by_an_edge_on_request_and_reported() {
    let mut bench = resetting_faults();
    bench.drive(2).power = DriveState::Fault;
    bench.cycles(400, DriveRequest::Enable);
    assert!(bench.all_are(DriveState::OperationEnabled));
    assert_eq!(bench.causes(EventKind::Fault), []);
    let notice = *bench.events_of(EventKind::Notice).next().unwrap();
    assert_eq!((notice.cause, notice.axis, notice.value as u16), (Cause::FaultReset.code(), 2, 0x7320));
}

#[test]
fn a_fault_that_persists_is_named_although_a_reset_was_requested() {
    let mut bench = resetting_faults();
    bench.drive(3).get_stuck_in(DriveState::Fault);
    bench.cycles(800, DriveRequest::Enable);
    assert!(bench.nobody_is_enabled());
    assert_eq!(bench.causes(EventKind::Fault), [Cause::FaultAtStart]);
    assert_eq!(bench.causes(EventKind::Notice), []);
}

#[test]
fn a_dry_run_lowers_the_limit_of_force_and_needs_a_drive_that_has_one() {
    for is_on in [false, true] {
        let mut scenario = Scenario::default();
        scenario.dry.is_on = is_on;
        let mut bench = Bench::of(scenario.clone());
        bench.cycles(400, DriveRequest::Enable);
        assert_eq!(bench.drive(0).written(0x6072, 0), if is_on { 600 } else { 2000 });
        let mut bench = Bench::of(scenario);
        bench.drive(0).refuses = Some(((0x6072, 0), AbortCode::NO_OBJECT));
        bench.cycles(400, DriveRequest::Enable);
        assert_eq!(bench.all_are(DriveState::OperationEnabled), !is_on);
        assert_eq!(bench.causes(EventKind::Fault).first(), is_on.then_some(&Cause::SdoAborted));
    }
}

#[test]
fn a_drive_that_is_already_alive_is_reset_before_it_is_believed() {
    let mut bench = Bench::new();
    bench.drive(1).nmt = Some(NmtState::Operational);
    bench.cycles(400, DriveRequest::Enable);
    assert!(bench.all_are(DriveState::OperationEnabled));
    assert_eq!(bench.causes(EventKind::Fault), []);
}

#[test]
fn a_drive_may_have_a_home_offset_that_is_zero() {
    let mut bench = Bench::new();
    bench.drive(3).objects.insert((0x607C, 0), vec![0; 4]);
    bench.cycles(400, DriveRequest::Enable);
    assert!(bench.all_are(DriveState::OperationEnabled), "{:?}", bench.events);
}

/// A tool has set 6007 to 0 on an enabled drive. The scripted drive refuses other writes until it is off.
#[test]
fn a_drive_that_was_left_enabled_is_stopped_before_it_is_configured() {
    let mut bench = Bench::new();
    let drive = bench.drive(1);
    (drive.nmt, drive.power) = (Some(NmtState::Operational), DriveState::OperationEnabled);
    bench.cycles(400, DriveRequest::Off);
    assert_eq!(bench.causes(EventKind::Fault), []);
    assert!(bench.all_are(DriveState::SwitchOnDisabled));
    bench.cycles(20, DriveRequest::Enable);
    assert!(bench.all_are(DriveState::OperationEnabled));
}

#[test]
fn a_drive_that_is_refused_for_its_quick_stop_is_stopped_all_the_same() {
    let mut bench = Bench::new();
    let drive = bench.drive(1);
    drive.power = DriveState::OperationEnabled;
    drive.refuses = Some(((0x605A, 0), AbortCode::NO_OBJECT));
    bench.cycles(400, DriveRequest::Off);
    assert_eq!(bench.causes(EventKind::Fault), [Cause::SdoAborted]);
    assert_eq!(bench.drive(1).power, DriveState::SwitchOnDisabled);
}

#[test]
fn the_position_is_held_before_the_mode_is_chosen_and_again_at_the_end() {
    let mut bench = Bench::enabled();
    let written = bench.drive(0).requests.iter().filter_map(|(_, request)| match request {
        SdoRequest::Download { object, .. } => Some(object.index),
        _ => None,
    });
    let order: Vec<_> = written.filter(|index| matches!(index, 0x6060 | 0x607A)).collect();
    assert_eq!(order, [0x607A, 0x6060, 0x607A]);
}

#[test]
fn a_missing_drive_is_named_and_the_others_wait_for_it() {
    let mut bench = Bench::new();
    bench.drive(5).is_dead = true;
    bench.cycles(2100, DriveRequest::Off);
    assert!(bench.nobody_is_enabled());
    assert_eq!(bench.causes(EventKind::Fault), [Cause::BootTimeout]);
    bench.drive(5).is_dead = false;
    bench.cycles(300, DriveRequest::Off);
    assert_eq!(bench.causes(EventKind::Notice), [Cause::Recovered]);
    bench.cycles(20, DriveRequest::Enable);
    assert!(bench.all_are(DriveState::OperationEnabled));
}

#[test]
fn a_drive_that_stops_answering_gets_new_requests_and_is_then_named() {
    let mut bench = Bench::new();
    bench.cycles(10, DriveRequest::Enable);
    bench.drive(3).is_dead = true;
    bench.cycles(3500, DriveRequest::Enable);
    assert_eq!(bench.causes(EventKind::Fault), [Cause::SdoTimeout]);
    assert!(bench.nobody_is_enabled());
}
