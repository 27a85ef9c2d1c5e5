//! The way of all drives to "operation enabled": together, within a time, or not at all.

use masseter_can::canopen::{Emergency, EmergencyCode};
use masseter_can::cia402::Statusword;

use super::*;

/// The axis l2.
const L2: usize = 4;

/// The bench with a drive that, once ready, goes into this state and does not leave it.
fn stuck(state: DriveState) -> Bench {
    let mut bench = Bench::new();
    bench.cycles(400, DriveRequest::Off);
    bench.drive(L2).get_stuck_in(state);
    bench
}

/// Every state that a drive had from now on, during these cycles.
fn states(bench: &mut Bench, axis: usize, cycles: u64) -> Vec<DriveState> {
    let mut states = Vec::new();
    for _ in 0..cycles {
        bench.cycle(Some(DriveRequest::Enable));
        states.push(bench.drive(axis).power);
    }
    states.dedup();
    states
}

#[test]
fn nobody_is_switched_on_while_one_has_safe_torque_off_and_all_are_once_it_is_back() {
    use DriveState::{OperationEnabled, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn};
    let mut bench = stuck(SwitchOnDisabled);
    assert_eq!(states(&mut bench, 0, 4000), [SwitchOnDisabled, ReadyToSwitchOn]);
    assert_eq!(bench.causes(EventKind::Fault), []);
    let told = *bench.events_of(EventKind::Notice).next().unwrap();
    assert_eq!((told.cause, told.axis), (Cause::WaitsForDrive.code(), L2 as u32));
    assert_eq!(told.value as u16, Statusword::for_state(SwitchOnDisabled).0);
    bench.drive(L2).be_free();
    assert_eq!(states(&mut bench, 0, 10), [ReadyToSwitchOn, SwitchedOn, OperationEnabled]);
    bench.cycles(5000, DriveRequest::Enable);
    assert!(bench.all_are(OperationEnabled));
    assert_eq!(bench.causes(EventKind::Notice).len(), 1, "the drive is named once");
}

#[test]
fn a_drive_that_does_not_become_ready_in_time_ends_the_start() {
    let mut bench = stuck(DriveState::SwitchOnDisabled);
    bench.cycles(5100, DriveRequest::Enable);
    assert_eq!(bench.causes(EventKind::Fault), [Cause::NotReady]);
    assert!((0..AXES).all(|axis| !bench.drive(axis).power.is_powered()));
    bench.cycles(10, DriveRequest::Off);
    bench.drive(L2).be_free();
    bench.cycles(100, DriveRequest::Enable);
    assert!(bench.nobody_is_enabled(), "for good");
}

#[test]
fn all_are_off_and_each_late_drive_is_named_with_its_state_and_emergency() {
    let mut bench = stuck(DriveState::SwitchedOn);
    bench.drive(L2).power = DriveState::SwitchOnDisabled;
    bench.drive(1).get_stuck_in(DriveState::SwitchedOn);
    bench.drive(1).power = DriveState::SwitchOnDisabled;
    bench.cycles(1000, DriveRequest::Enable);
    assert_eq!(bench.drive(0).power, DriveState::OperationEnabled);
    let (id, now_ns) = (bench.drive(L2).id, bench.now_ns());
    let low = Emergency { code: EmergencyCode::LOGIC_SUPPLY, register: 0x05, vendor: [0; 5] };
    bench.wires.wire(1).arrive(now_ns, low.frame(id));
    bench.cycles(502, DriveRequest::Enable);
    let late: Vec<_> = bench
        .events_of(EventKind::Fault)
        .filter(|event| event.cause == Cause::NotEnabled.code())
        .map(|event| (event.axis, event.value as u16, event.limit as u16))
        .collect();
    let on = Statusword::for_state(DriveState::SwitchedOn).0;
    assert_eq!(late, [(1, on, 0), (4, on, 0x5112)]);
    (0..AXES).for_each(|axis| bench.drive(axis).be_free());
    bench.cycles(10, DriveRequest::Enable);
    assert!(bench.all_are(DriveState::SwitchOnDisabled));
    assert_eq!(bench.reading.master_fault, 1);
}

#[test]
fn a_fault_on_the_way_to_operation_is_not_reset() {
    let mut bench = stuck(DriveState::SwitchOnDisabled);
    bench.cycles(10, DriveRequest::Enable);
    bench.drive(L2).power = DriveState::Fault;
    bench.cycles(100, DriveRequest::Enable);
    assert_eq!(bench.causes(EventKind::Fault), [Cause::DriveFault]);
    assert_eq!(bench.drive(L2).power, DriveState::Fault);
    assert!(bench.nobody_is_enabled());
}
