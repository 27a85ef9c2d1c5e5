//! Failure and return of a running drive or bus.

use masseter_can::Frame;
use masseter_can::canopen::{Cob, Emergency, EmergencyCode, Heartbeat, NmtState, sync};
use masseter_scenario::MASTER_NODE;

use super::peer::POSITION;
use super::*;

/// Keeps requesting motion, which must not happen, then switches off, after which motion is allowed again.
fn restore(bench: &mut Bench, cause: Cause) {
    for _ in 0..600 {
        bench.cycle(Some(DriveRequest::Enable));
        assert_eq!(bench.reading.master_fault, 1);
    }
    assert!(bench.nobody_is_enabled());
    assert_eq!(bench.causes(EventKind::Fault), [cause]);
    bench.cycles(20, DriveRequest::Off);
    assert_eq!(bench.causes(EventKind::Notice).last(), Some(&Cause::Recovered));
    bench.cycles(30, DriveRequest::Enable);
    assert!(bench.all_are(DriveState::OperationEnabled));
    assert_eq!(bench.reading.master_fault, 0);
}

#[test]
fn a_drive_that_lost_its_power_is_booted_again_without_a_restart_of_the_master() {
    let mut bench = Bench::enabled();
    bench.drive(4).cycle_power();
    bench.drive(4).objects.insert((0x6060, 0), vec![0]);
    bench.cycles(5, DriveRequest::Enable);
    let fault = *bench.events_of(EventKind::Fault).next().unwrap();
    assert_eq!((fault.cause, fault.axis, fault.node), (Cause::NodeRestarted.code(), 4, 5));
    restore(&mut bench, Cause::NodeRestarted);
    assert_eq!(bench.drive(4).written(0x6060, 0), 8);
}

#[test]
fn a_drive_that_falls_silent_is_booted_again_when_it_comes_back() {
    let mut bench = Bench::enabled();
    bench.drive(0).is_dead = true;
    bench.cycles(300, DriveRequest::Enable);
    assert_eq!(bench.causes(EventKind::Fault), [Cause::ProcessDataLost]);
    let others_are_off = (1..AXES).all(|axis| bench.drive(axis).power == DriveState::SwitchOnDisabled);
    assert!(others_are_off);
    bench.drive(0).is_dead = false;
    restore(&mut bench, Cause::ProcessDataLost);
}

#[test]
fn a_drive_that_reports_to_have_left_operational_stops_all_and_is_booted_again() {
    let mut bench = Bench::enabled();
    let drive = bench.drive(2);
    (drive.nmt, drive.next_beat_ns) = (Some(NmtState::PreOperational), 0);
    bench.cycles(5, DriveRequest::Enable);
    let fault = *bench.events_of(EventKind::Fault).next().unwrap();
    assert_eq!((fault.cause, fault.axis, fault.value), (Cause::NodeStopped.code(), 2, 127.0));
    restore(&mut bench, Cause::NodeStopped);
}

#[test]
fn a_drive_that_boots_again_during_a_stop_is_configured_from_the_first_object_on() {
    for phase in [BootPhase::Configuring, BootPhase::Configured] {
        let mut bench = Bench::enabled();
        // The one that is missing keeps the other from being started.
        bench.drive(0).is_dead = phase == BootPhase::Configured;
        bench.drive(5).cycle_power();
        bench.cycles_until(5, phase);
        bench.cycles(10, DriveRequest::Off);
        bench.drive(2).is_reacting = true;
        bench.cycles(5, DriveRequest::Off);
        bench.drive(5).cycle_power();
        bench.drive(5).objects.remove(&(0x1016, 1));
        bench.cycles(5, DriveRequest::Off);
        assert_eq!(bench.master.drives[5].boot.phase, BootPhase::Waiting);
        (bench.drive(0).is_dead, bench.drive(2).is_reacting) = (false, false);
        bench.cycles(1500, DriveRequest::Off);
        assert_eq!(bench.drive(5).written(0x1016, 1), 0x007F_0096);
        assert_eq!(bench.master.drives[5].boot.phase, BootPhase::Ready);
    }
}

#[test]
fn a_drive_that_became_operational_is_not_given_up_for_another_that_is_lost() {
    let mut bench = Bench::new();
    bench.cycles_until(3, BootPhase::Starting);
    bench.drive(3).nmt = Some(NmtState::PreOperational);
    bench.cycles(20, DriveRequest::Off);
    bench.drive(0).is_dead = true;
    bench.cycles(60, DriveRequest::Off);
    bench.drive(3).nmt = Some(NmtState::Operational);
    bench.cycles(1500, DriveRequest::Off);
    assert_eq!(bench.causes(EventKind::Fault), [Cause::ProcessDataLost]);
    bench.drive(0).is_dead = false;
    restore(&mut bench, Cause::ProcessDataLost);
}

#[test]
fn two_drives_of_one_id_differ_from_a_frame_sent_twice() {
    let mut bench = Bench::enabled();
    bench.drive(3).twin_position = Some(POSITION);
    bench.cycles(100, DriveRequest::Enable);
    assert_eq!(bench.causes(EventKind::Fault), []);
    bench.drive(3).twin_position = Some(POSITION + 1);
    bench.cycles(10, DriveRequest::Enable);
    let fault = *bench.events_of(EventKind::Fault).next().unwrap();
    assert_eq!((fault.cause, fault.axis, fault.node), (Cause::DuplicateNode.code(), 3, 4));
    assert!(bench.nobody_is_enabled());
    bench.drive(3).twin_position = None;
    restore(&mut bench, Cause::DuplicateNode);
}

#[test]
fn another_drive_in_the_place_of_the_old_one_is_not_started() {
    let mut bench = Bench::enabled();
    bench.drive(2).cycle_power();
    bench.drive(2).objects.insert((0x1018, 3), vec![7, 0, 0, 0]);
    bench.cycles(600, DriveRequest::Off);
    assert_eq!(bench.causes(EventKind::Fault), [Cause::NodeRestarted, Cause::WrongIdentity]);
    bench.cycles(50, DriveRequest::Enable);
    assert!(bench.nobody_is_enabled());
}

#[test]
fn a_bus_that_went_off_stops_the_rig_and_works_again_when_it_returns() {
    let mut bench = Bench::enabled();
    bench.wires.wire(1).is_off = true;
    bench.cycles(300, DriveRequest::Enable);
    assert_eq!(bench.causes(EventKind::Fault), [Cause::BusOff]);
    assert_eq!(bench.events_of(EventKind::Fault).next().unwrap().bus, 1);
    // Real drives stop by themselves when the master falls silent; these scripted ones get a command.
    (3..AXES).for_each(|axis| bench.drive(axis).power = DriveState::SwitchOnDisabled);
    bench.wires.wire(1).is_off = false;
    restore(&mut bench, Cause::BusOff);
}

#[test]
fn emergencies_come_with_code_and_register_and_go() {
    let mut bench = Bench::enabled();
    let id = bench.drive(3).id;
    let now_ns = bench.now_ns();
    let hot = Emergency { code: EmergencyCode(0x4310), register: 0x09, vendor: [0; 5] };
    bench.wires.wire(1).arrive(now_ns, hot.frame(id));
    bench.wires.wire(1).arrive(now_ns, Emergency::RESET.frame(id));
    bench.cycle(Some(DriveRequest::Enable));
    let told: Vec<_> = bench.events.iter().filter(|event| event.cause == Cause::Emergency.code()).collect();
    assert_eq!((told[0].kind, told[0].value, told[0].limit), (EventKind::Fault.code(), 17168.0, 9.0));
    assert_eq!((told[1].kind, told[1].value, told[1].axis), (EventKind::Notice.code(), 0.0, 3));
}

/// Its process data would be missing only some cycles later, in which the others move on.
#[test]
fn a_drive_that_has_lost_the_master_stops_the_others_by_its_emergency() {
    let mut bench = Bench::enabled();
    let (now_ns, id) = (bench.now_ns(), bench.drive(3).id);
    let silent = Emergency { code: EmergencyCode::HEARTBEAT, register: 0x11, vendor: [0; 5] };
    bench.wires.wire(1).arrive(now_ns, silent.frame(id));
    bench.cycle(Some(DriveRequest::Enable));
    assert_eq!(bench.reading.master_fault, 1);
    let stop = bench.events_of(EventKind::Fault).last().unwrap();
    assert_eq!((stop.source, stop.cause), (Source::Master.code(), Cause::Emergency.code()));
    assert_eq!((stop.axis, stop.value, stop.limit), (3, f64::from(0x8130), 17.0));
}

/// Such a drive is off, or is about to be, and moves nothing.
#[test]
fn a_lost_master_is_no_fault_of_drives_that_are_off_or_go_off() {
    for off_cycles in [1, 300] {
        let mut bench = Bench::enabled();
        bench.cycles(off_cycles, DriveRequest::Off);
        let is_enabled = bench.all_are(DriveState::OperationEnabled);
        assert_eq!(is_enabled, off_cycles == 1, "the drives take a moment");
        let (now_ns, id) = (bench.now_ns(), bench.drive(3).id);
        let silent = Emergency { code: EmergencyCode::HEARTBEAT, register: 0x11, vendor: [0; 5] };
        bench.wires.wire(1).arrive(now_ns, silent.frame(id));
        bench.cycle(Some(DriveRequest::Off));
        assert_eq!(bench.reading.master_fault, 0, "after {off_cycles} cycles");
    }
}

#[test]
fn a_lost_master_is_no_fault_of_drives_that_are_not_enabled_yet() {
    let mut bench = Bench::enabled();
    bench.cycles(300, DriveRequest::Off);
    bench.cycle(Some(DriveRequest::Enable));
    assert!(!bench.all_are(DriveState::OperationEnabled));
    let (now_ns, id) = (bench.now_ns(), bench.drive(3).id);
    let silent = Emergency { code: EmergencyCode::HEARTBEAT, register: 0x11, vendor: [0; 5] };
    bench.wires.wire(1).arrive(now_ns, silent.frame(id));
    bench.cycle(Some(DriveRequest::Enable));
    assert_eq!(bench.reading.master_fault, 0);
}

/// A drive that missed the heartbeat of an earlier rig may report the loss only now.
#[test]
fn an_emergency_before_the_boot_up_is_no_fault_of_this_rig() {
    let mut bench = Bench::new();
    let id = bench.drive(0).id;
    let silent = Emergency { code: EmergencyCode::HEARTBEAT, register: 0x11, vendor: [0; 5] };
    let now_ns = bench.now_ns();
    bench.wires.wire(0).arrive(now_ns, silent.frame(id));
    bench.cycles(400, DriveRequest::Enable);
    assert_eq!(bench.causes(EventKind::Fault), []);
    assert!(bench.causes(EventKind::Notice).contains(&Cause::Emergency));
    assert!(bench.all_are(DriveState::OperationEnabled));
}

#[test]
fn frames_of_wrong_length_are_reported_once_and_so_are_unknown_nodes() {
    let mut bench = Bench::enabled();
    let id = bench.drive(0).id;
    let stranger = NodeId::new(9).unwrap();
    for _ in 0..5 {
        let now_ns = bench.now_ns();
        let wire = bench.wires.wire(0);
        wire.arrive(now_ns, Frame::new(Cob::Emergency(id).into(), &[1, 2, 3]).unwrap());
        wire.arrive(now_ns, Heartbeat { state: NmtState::Operational }.frame(stranger));
        bench.cycle(Some(DriveRequest::Enable));
    }
    assert_eq!(bench.causes(EventKind::Notice), [Cause::WrongLength, Cause::UnknownNode]);
    let wrong = bench.events_of(EventKind::Notice).next().unwrap();
    assert_eq!((wrong.object, wrong.value, wrong.limit), (0x81, 3.0, 8.0));
    assert!(bench.all_are(DriveState::OperationEnabled));
}

#[test]
fn a_second_master_stops_the_drives() {
    let mut bench = Bench::enabled();
    let (now_ns, id) = (bench.now_ns(), MASTER_NODE);
    bench.wires.wire(1).arrive(now_ns, Heartbeat { state: NmtState::Operational }.frame(id));
    bench.cycles(3, DriveRequest::Enable);
    assert_eq!(bench.causes(EventKind::Fault), [Cause::SecondMaster]);
    assert!(bench.nobody_is_enabled());
    bench.cycles(50, DriveRequest::Off);
    assert_eq!(bench.causes(EventKind::Notice), [], "for good");
}

#[test]
fn a_stop_that_could_be_restored_is_for_good_once_there_is_a_second_master() {
    let mut bench = Bench::enabled();
    bench.drive(4).cycle_power();
    bench.cycles(5, DriveRequest::Enable);
    let (now_ns, id) = (bench.now_ns(), MASTER_NODE);
    bench.wires.wire(0).arrive(now_ns, Heartbeat { state: NmtState::Operational }.frame(id));
    bench.cycles(600, DriveRequest::Off);
    assert_eq!(bench.causes(EventKind::Fault), [Cause::NodeRestarted, Cause::SecondMaster]);
    assert_eq!(bench.causes(EventKind::Notice), []);
}

/// The other master controls the drives, and this one's SYNC has stopped it already.
#[test]
fn drives_of_another_master_are_neither_reset_nor_configured() {
    let mut bench = Bench::new();
    (0..AXES).for_each(|axis| bench.drive(axis).nmt = Some(NmtState::Operational));
    for bus in 0..2 {
        let now_ns = bench.now_ns();
        bench.wires.wire(bus).arrive(now_ns, sync::frame());
    }
    bench.cycles(3000, DriveRequest::Off);
    assert_eq!(bench.causes(EventKind::Fault)[0], Cause::SecondMaster);
    for axis in 0..AXES {
        assert_eq!(
            (bench.drive(axis).nmt, bench.drive(axis).requests.len()),
            (Some(NmtState::Operational), 0)
        );
    }
}

#[test]
fn an_overrun_withholds_no_frame_that_is_still_there() {
    let mut bench = Bench::enabled();
    for _ in 0..20 {
        bench.wires.wire(0).lost = 1;
        bench.cycle(Some(DriveRequest::Enable));
        assert_eq!(bench.reading.fresh_axes, 0b11_1111);
    }
}
