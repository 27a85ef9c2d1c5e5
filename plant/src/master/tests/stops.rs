//! Stops for good: neither switching off nor a new demand for motion ends them.

use masseter_can::canopen::{Heartbeat, NmtState, sync};

use super::*;

type Trigger = fn(&mut Bench);

/// What stops the drives for good, and the cause that is reported.
const FOR_GOOD: [(Cause, Trigger); 10] = [
    (Cause::CommandLost, |bench| (0..=TIMEOUT_CYCLES).for_each(|_| bench.cycle(None))),
    (Cause::BadMessage, |bench| bench.spoil(|command| command.target_m[0] = f64::NAN)),
    (Cause::BadMessage, |bench| bench.spoil(|command| command.target_m[5] = f64::NEG_INFINITY)),
    (Cause::BadMessage, |bench| bench.spoil(|command| command.target_m[2] = 2200.0)),
    (Cause::BadMessage, |bench| bench.spoil(|command| command.request = 99)),
    (Cause::DriveFault, |bench| bench.drive(2).power = DriveState::SwitchOnDisabled),
    (Cause::DriveFault, |bench| bench.drive(5).power = DriveState::Fault),
    (Cause::DriveFault, |bench| bench.drive(0).power = DriveState::QuickStopActive),
    (Cause::SecondMaster, |bench| {
        let now_ns = bench.now_ns();
        bench.wires.wire(1).arrive(now_ns, sync::frame());
        bench.cycle(Some(DriveRequest::Enable));
    }),
    (Cause::SecondMaster, |bench| {
        let (now_ns, id) = (bench.now_ns(), bench.master.id);
        bench.wires.wire(0).arrive(now_ns, Heartbeat { state: NmtState::Operational }.frame(id));
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
fn a_stop_for_good_ends_with_no_request() {
    for (case, (cause, trigger)) in FOR_GOOD.into_iter().enumerate() {
        let mut bench = Bench::enabled();
        trigger(&mut bench);
        bench.cycles(3, DriveRequest::Enable);
        for request in [DriveRequest::Enable, DriveRequest::Off, DriveRequest::Enable, DriveRequest::Off] {
            for _ in 0..100 {
                assert_eq!(bench.reading.master_fault, 1, "case {case}");
                assert!(bench.nobody_is_enabled(), "case {case}");
                bench.cycle(Some(request));
            }
        }
        assert_eq!(bench.causes(EventKind::Fault), [cause], "case {case}");
        assert_eq!(bench.causes(EventKind::Notice), [], "case {case}");
    }
}

/// Each drive was reset, and is off: only the memory of the stop keeps the drives from moving.
#[test]
fn a_stop_for_good_outlasts_a_restart_of_every_drive() {
    for (case, (cause, trigger)) in FOR_GOOD.into_iter().enumerate() {
        let mut bench = Bench::enabled();
        trigger(&mut bench);
        bench.cycles(3, DriveRequest::Enable);
        (0..AXES).for_each(|axis| bench.drive(axis).cycle_power());
        bench.cycles(600, DriveRequest::Off);
        bench.cycles(50, DriveRequest::Enable);
        assert!(bench.nobody_is_enabled(), "case {case}");
        assert_eq!(bench.causes(EventKind::Fault), [cause], "case {case}");
        assert!(!bench.causes(EventKind::Notice).contains(&Cause::Recovered), "case {case}");
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
fn a_bad_command_is_reported_with_its_axis_and_value() {
    type Spoil = fn(&mut Command);
    let cases: [(Spoil, u32, f64); 3] = [
        (|command| command.target_m[4] = f64::INFINITY, 4, f64::INFINITY),
        (|command| command.target_m[1] = -2200.0, 1, -2200.0),
        (|command| command.request = 77, NO_AXIS, 77.0),
    ];
    for (spoil, axis, value) in cases {
        let mut bench = Bench::enabled();
        bench.spoil(spoil);
        let fault = *bench.events_of(EventKind::Fault).next().unwrap();
        assert_eq!((fault.cause, fault.axis), (Cause::BadMessage.code(), axis));
        assert_eq!((fault.value, fault.limit), (value, 0.0));
    }
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
