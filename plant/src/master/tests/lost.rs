//! Drives that are lost, or restart, before they are started.

use masseter_can::FULL_QUEUE;
use masseter_can::canopen::sync;

use super::*;

#[test]
fn a_drive_that_falls_silent_after_its_configuration_is_lost_before_any_is_started() {
    let mut bench = Bench::new();
    // The one that is missing keeps the others from being started.
    bench.drive(0).is_dead = true;
    bench.cycles_until(5, BootPhase::Configured);
    bench.drive(5).is_dead = true;
    bench.cycles(145, DriveRequest::Off);
    assert_eq!(bench.causes(EventKind::Fault), []);
    bench.cycles(10, DriveRequest::Off);
    let fault = *bench.events_of(EventKind::Fault).next().unwrap();
    assert_eq!((fault.cause, fault.axis, fault.limit), (Cause::HeartbeatLost.code(), 5, 150.0));
    assert!((150.0..152.0).contains(&fault.value), "{} ms", fault.value);
    assert_eq!(bench.master.drives[5].boot.phase, BootPhase::Waiting);
    bench.cycles(400, DriveRequest::Off);
    assert_eq!(bench.causes(EventKind::Fault), [Cause::HeartbeatLost], "once");
    (bench.drive(0).is_dead, bench.drive(5).is_dead) = (false, false);
    bench.cycles(1500, DriveRequest::Off);
    bench.cycles(30, DriveRequest::Enable);
    assert!(bench.all_are(DriveState::OperationEnabled), "{:?}", bench.events);
}

impl Bench {
    /// Restarts a drive this many times in the midst of its boot.
    fn interrupt_boot(&mut self, axis: usize, times: usize) {
        for _ in 0..times {
            self.cycles_until(axis, BootPhase::Configuring);
            self.cycles(5, DriveRequest::Off);
            self.drive(axis).cycle_power();
            self.cycles(2, DriveRequest::Off);
        }
    }
}

#[test]
fn a_drive_may_restart_three_times_while_it_boots_and_is_given_up_at_the_fourth() {
    let mut bench = Bench::new();
    bench.interrupt_boot(3, 3);
    bench.cycles(600, DriveRequest::Enable);
    assert!(bench.all_are(DriveState::OperationEnabled), "{:?}", bench.events);
    assert_eq!(bench.causes(EventKind::Fault), []);

    let mut bench = Bench::new();
    bench.interrupt_boot(3, 4);
    let fault = *bench.events_of(EventKind::Fault).next().unwrap();
    assert_eq!((fault.cause, fault.axis), (Cause::NodeRestarted.code(), 3));
    assert_eq!(bench.master.drives[3].boot.phase, BootPhase::Failed);
    bench.cycles(600, DriveRequest::Enable);
    assert!(bench.nobody_is_enabled());
    assert_eq!(bench.causes(EventKind::Fault), [Cause::NodeRestarted]);
}

/// With the fourth cycle without process data, and before its heartbeat is overdue.
#[test]
fn a_running_drive_may_owe_its_process_data_for_three_cycles() {
    let mut bench = Bench::enabled();
    bench.drive(1).is_dead = true;
    bench.cycles(3, DriveRequest::Enable);
    assert_eq!(bench.reading.fresh_axes, 0b11_1101);
    bench.drive(1).is_dead = false;
    bench.cycles(3, DriveRequest::Enable);
    assert_eq!(bench.reading.fresh_axes, 0b11_1111);
    assert_eq!(bench.causes(EventKind::Fault), []);
    bench.drive(1).is_dead = true;
    bench.cycles(4, DriveRequest::Enable);
    let fault = *bench.events_of(EventKind::Fault).next().unwrap();
    assert_eq!((fault.cause, fault.axis), (Cause::ProcessDataLost.code(), 1));
    assert_eq!((fault.value, fault.limit), (4.0, 3.0));
}

#[test]
fn an_adapter_that_hangs_gets_the_frames_of_three_cycles_and_then_none_until_they_are_sent() {
    let mut bench = Bench::enabled();
    bench.wires.wire(0).hangs = true;
    bench.cycles(20, DriveRequest::Enable);
    let kept = bench.wires.wire(0).kept.clone();
    let syncs = kept.iter().filter(|frame| frame.id() == sync::frame().id()).count();
    assert_eq!(syncs, 3, "{kept:?}");
    let notice = bench.events_of(EventKind::Notice).find(|event| event.cause == Cause::BusRefused.code());
    let notice = *notice.expect("the hang is reported");
    assert_eq!((notice.bus, notice.value), (0, f64::from(FULL_QUEUE)));
    assert_eq!(bench.causes(EventKind::Fault)[0], Cause::ProcessDataLost);
    bench.wires.wire(0).hangs = false;
    bench.wires.wire(0).kept.clear();
    bench.cycles(600, DriveRequest::Off);
    bench.cycles(30, DriveRequest::Enable);
    assert!(bench.all_are(DriveState::OperationEnabled), "{:?}", bench.events);
}

#[test]
fn an_adapter_that_is_unplugged_stops_the_drives_with_the_number_of_the_error() {
    let mut bench = Bench::enabled();
    bench.wires.wire(1).errno = Some(6);
    bench.cycle(Some(DriveRequest::Enable));
    let fault = *bench.events_of(EventKind::Fault).next().unwrap();
    assert_eq!((fault.cause, fault.bus, fault.value), (Cause::BusRefused.code(), 1, 6.0));
    bench.cycles(10, DriveRequest::Enable);
    assert_eq!(bench.causes(EventKind::Fault)[0], Cause::BusRefused);
}

/// From its boot-up message on: nothing earlier counts for the drive.
#[test]
fn a_drive_that_has_restarted_is_unknown_at_once() {
    let mut bench = Bench::enabled();
    bench.drive(4).cycle_power();
    bench.drive(4).targets.clear();
    bench.cycle(Some(DriveRequest::Enable));
    assert_eq!(bench.reading.drive_state[4], NO_DRIVE_STATE);
    assert_eq!(bench.reading.fresh_axes, 0b10_1111);
    assert_eq!(bench.master.drives[4].boot.phase, BootPhase::Waiting);
    assert_eq!(bench.drive(4).targets, []);
}
