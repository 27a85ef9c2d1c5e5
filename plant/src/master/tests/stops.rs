//! Permanent stops: neither switching off nor a new demand for motion ends them.

use masseter_can::canopen::{Nmt, NmtCommand, NmtTarget, sync};

use super::*;

type Trigger = fn(&mut Bench);

/// Reasons for a permanent stop, with the reported cause.
const PERMANENT: [(Cause, Trigger); 14] = [
    (Cause::CommandLost, |bench| (0..=TIMEOUT_CYCLES).for_each(|_| bench.cycle(None))),
    (Cause::CommandLost, |bench| {
        let stale_cycle = bench.cycle;
        (0..=TIMEOUT_CYCLES).for_each(|_| bench.spoil(|command| command.cycle = stale_cycle));
    }),
    (Cause::BadMessage, |bench| bench.spoil(|command| command.target_m[0] = f64::NAN)),
    (Cause::BadMessage, |bench| bench.spoil(|command| command.request = 99)),
    (Cause::BadMessage, |bench| bench.spoil(|command| command.version += 1)),
    (Cause::StrokeLimit, |bench| bench.spoil(|command| command.target_m[2] = 0.031)),
    (Cause::VelocityLimit, |bench| bench.spoil(|command| command.target_m[4] += 5e-4)),
    (Cause::AccelerationLimit, |bench| bench.spoil(|command| command.target_m[5] -= 1e-4)),
    (Cause::FollowingError, |bench| {
        let drive = bench.drive(4);
        (drive.may_move, drive.position) = (true, drive.position + 100);
    }),
    (Cause::DriveFault, |bench| bench.drive(2).power = DriveState::SwitchOnDisabled),
    (Cause::DriveFault, |bench| bench.drive(5).power = DriveState::Fault),
    (Cause::DriveFault, |bench| bench.drive(0).power = DriveState::QuickStopActive),
    (Cause::SecondMaster, |bench| {
        let now_ns = bench.now_ns();
        bench.wires.wire(1).arrive(now_ns, sync::frame());
        bench.cycle(Some(DriveRequest::Enable));
    }),
    (Cause::SecondMaster, |bench| {
        let (now_ns, target) = (bench.now_ns(), NmtTarget::All);
        bench.wires.wire(0).arrive(now_ns, Nmt { command: NmtCommand::ResetNode, target }.frame());
        bench.cycle(Some(DriveRequest::Enable));
    }),
];

/// Default of `can.command_timeout_cycles`.
const TIMEOUT_CYCLES: u32 = 20;

impl Bench {
    /// A cycle with a demand for motion that something is wrong with.
    fn spoil(&mut self, spoil: impl FnOnce(&mut Command)) {
        self.cycle_with(|command| {
            let mut command = Command { request: DriveRequest::Enable.code(), ..command };
            spoil(&mut command);
            Some(command)
        });
    }
}

#[test]
fn a_permanent_stop_ends_with_no_request() {
    for (cause, trigger) in PERMANENT {
        let mut bench = Bench::enabled();
        trigger(&mut bench);
        bench.cycles(3, DriveRequest::Enable);
        for request in [DriveRequest::Enable, DriveRequest::Off, DriveRequest::Enable, DriveRequest::Off] {
            for _ in 0..100 {
                assert_eq!(bench.reading.master_fault, 1, "{cause}");
                assert!(bench.nobody_is_enabled(), "{cause}");
                bench.cycle(Some(request));
            }
        }
        assert_eq!(bench.causes(EventKind::Fault), [cause]);
        assert_eq!(bench.causes(EventKind::Notice), [], "{cause}");
    }
}

/// Each drive was reset, and is off: only the memory of the stop keeps the drives from moving.
#[test]
fn a_permanent_stop_outlasts_a_restart_of_every_drive() {
    for (cause, trigger) in PERMANENT {
        let mut bench = Bench::enabled();
        trigger(&mut bench);
        bench.cycles(3, DriveRequest::Enable);
        (0..AXES).for_each(|axis| bench.drive(axis).cycle_power());
        bench.cycles(600, DriveRequest::Off);
        bench.cycles(50, DriveRequest::Enable);
        assert!(bench.nobody_is_enabled(), "{cause}");
        assert_eq!(bench.causes(EventKind::Fault), [cause]);
        assert!(!bench.causes(EventKind::Notice).contains(&Cause::Recovered), "{cause}");
    }
}

#[test]
fn silence_is_borne_as_long_as_declared_and_only_while_motion_is_demanded() {
    assert_eq!(Scenario::default().can.command_timeout_cycles, TIMEOUT_CYCLES);
    let mut bench = Bench::enabled();
    (0..TIMEOUT_CYCLES).for_each(|_| bench.cycle(None));
    assert_eq!(bench.causes(EventKind::Fault), []);
    bench.cycle(None);
    let fault = *bench.events_of(EventKind::Fault).next().unwrap();
    assert_eq!((fault.cause, fault.value, fault.limit), (Cause::CommandLost.code(), 21.0, 20.0));
    assert_eq!(bench.master.silent_cycles(), 21);

    let mut bench = Bench::enabled();
    bench.cycles(5, DriveRequest::Off);
    (0..100).for_each(|_| bench.cycle(None));
    assert_eq!(bench.causes(EventKind::Fault), []);
    assert_eq!(bench.master.silent_cycles(), 100);
    bench.cycles(20, DriveRequest::Enable);
    assert!(bench.all_are(DriveState::OperationEnabled));
    assert_eq!(bench.master.silent_cycles(), 0);
}

#[test]
fn a_repeated_cycle_is_silence_unless_it_asks_to_stop() {
    for (request, silent_cycles) in
        [(DriveRequest::Enable, 1), (DriveRequest::QuickStop, 0), (DriveRequest::Off, 0)]
    {
        let mut bench = Bench::enabled();
        let stale_cycle = bench.cycle;
        bench.spoil(|command| (command.cycle, command.request) = (stale_cycle, request.code()));
        assert_eq!(bench.master.silent_cycles(), silent_cycles, "{request}");
        bench.cycle(None);
        assert_eq!(bench.nobody_is_enabled(), request != DriveRequest::Enable, "{request}");
        assert_eq!(bench.causes(EventKind::Fault), [], "{request}");
    }
}

#[test]
fn a_command_in_time_begins_the_silence_anew() {
    let mut bench = Bench::enabled();
    for _ in 0..10 {
        (0..TIMEOUT_CYCLES).for_each(|_| bench.cycle(None));
        bench.cycle(Some(DriveRequest::Enable));
    }
    assert_eq!(bench.causes(EventKind::Fault), []);
    assert!(bench.all_are(DriveState::OperationEnabled));
}

#[test]
fn the_end_stops_the_drives_without_a_fault() {
    let mut bench = Bench::enabled();
    assert!(!bench.master.drives_are_off());
    bench.master.stop();
    bench.cycles(20, DriveRequest::Enable);
    assert!(bench.nobody_is_enabled() && bench.master.drives_are_off());
    assert_eq!(bench.causes(EventKind::Fault), []);
    assert_eq!(bench.reading.master_fault, 0);
}
