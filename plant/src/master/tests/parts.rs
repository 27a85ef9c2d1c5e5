//! The parts of the master alone, at the edges of what they decide.

use masseter_can::canopen::ObjectAddress;
use masseter_can::{ErrorState, SendError};

use super::super::bus_monitor::BusMonitor;
use super::super::drive::{Finding, RemoteDrive};
use super::super::exchange::Exchange;
use super::super::interlock::{Failure, Interlock};
use super::super::presence::Presence;
use super::super::supervision::Supervision;
use super::*;

#[test]
fn only_some_causes_lock_for_good_and_the_first_one_counts() {
    let for_good = [Cause::CommandLost, Cause::BadMessage, Cause::DriveFault];
    let restorable = [
        Cause::BusOff,
        Cause::BusRefused,
        Cause::NodeRestarted,
        Cause::NodeStopped,
        Cause::HeartbeatLost,
        Cause::ProcessDataLost,
        Cause::DuplicateNode,
        Cause::SdoAborted,
        Cause::BootTimeout,
    ];
    for (causes, is_for_good) in [(&for_good[..], true), (&restorable[..], false)] {
        for &cause in causes {
            let mut interlock = Interlock::default();
            assert!(!interlock.is_locked() && !interlock.awaits_restoration() && interlock.may_boot(false));
            assert!(interlock.lock(cause));
            for later in for_good.iter().chain(&restorable) {
                assert!(!interlock.lock(*later), "{later} is no first cause after {cause}");
            }
            assert!(interlock.is_locked() && !interlock.may_boot(false), "{cause}");
            assert_eq!(interlock.awaits_restoration(), !is_for_good, "{cause}");
            assert_eq!(interlock.may_boot(true), !is_for_good, "{cause}");
            assert_eq!(interlock.lock_permanently(), !is_for_good, "{cause}");
            assert!(!interlock.lock_permanently() && !interlock.awaits_restoration(), "{cause}");
        }
    }
    let mut interlock = Interlock::default();
    interlock.lock(Cause::BusOff);
    interlock.release();
    assert!(!interlock.is_locked() && interlock.may_boot(false));
}

#[test]
fn a_failure_is_reported_with_its_object_value_and_limit() {
    let object = Some(ObjectAddress::new(0x1018, 0x02));
    let event = Failure { object, ..Failure::with(Cause::WrongIdentity, [7.0, 8.0]) }.event();
    assert_eq!((event.cause, event.object), (Cause::WrongIdentity.code(), 0x10_1802));
    assert_eq!((event.value, event.limit), (7.0, 8.0));
    assert_eq!((event.kind, event.source), (EventKind::Fault.code(), Source::Master.code()));
    assert_eq!(Failure::new(Cause::BusOff).event().object, 0);
}

#[test]
fn a_drive_is_lost_beyond_each_limit_and_not_at_it() {
    let cause = |presence: &Presence, now_ns| presence.judge(now_ns, 1000).map(|failure| failure.cause);
    let mut presence = Presence::new(500);
    assert_eq!(cause(&presence, 1500), None);
    assert_eq!(cause(&presence, 1501), Some(Cause::HeartbeatLost));
    assert_eq!(cause(&presence, 0), None, "a clock that lags is no silence");
    presence.hear(2500);
    assert_eq!(cause(&presence, 3500), None);
    let silent = presence.judge(4_002_500, 1_000_000).unwrap();
    assert_eq!((silent.value, silent.limit), (4.0, 1.0), "ms");

    for (missing, expected) in
        [(1, None), (3, None), (4, Some(Cause::ProcessDataLost)), (5, Some(Cause::ProcessDataLost))]
    {
        presence.end_missing();
        (0..missing).for_each(|_| presence.miss_cycle());
        assert_eq!(cause(&presence, 2500), expected, "{missing} missing");
    }
    presence.end_missing();
    for (answers, expected) in
        [(1, None), (6, None), (7, Some(Cause::DuplicateNode)), (9, Some(Cause::DuplicateNode))]
    {
        presence.restart();
        presence.begin_cycle();
        (0..answers).for_each(|_| presence.answer(2500, true));
        presence.begin_cycle();
        assert_eq!(cause(&presence, 2500), expected, "{answers} answers");
    }
    presence.restart();
    assert_eq!(cause(&presence, 2500), None);
}

#[test]
fn an_answer_is_one_after_the_time_that_is_asked_for() {
    let mut presence = Presence::new(0);
    presence.answer(100, true);
    assert!(presence.has_answered_since(99) && !presence.has_answered_since(100));
    presence.forget_answer();
    assert!(!presence.has_answered_since(0));
}

#[test]
fn a_drive_may_leave_operation_only_before_all_were_enabled_or_when_it_is_told_to() {
    let mut supervision = Supervision::default();
    let enabled = Some(DriveState::OperationEnabled);
    let left = [None, Some(DriveState::SwitchedOn), Some(DriveState::Fault)];
    let is_fault = |supervision: Supervision, state| supervision.judge(state, true).is_some();
    supervision.end_cycle(true, false);
    assert!(left.iter().all(|&state| !is_fault(supervision, state)), "while they are switched on");
    supervision.end_cycle(true, true);
    for all_are_enabled in [true, false] {
        assert!(!is_fault(supervision, enabled));
        assert!(left.iter().all(|&state| is_fault(supervision, state)));
        assert!(left.iter().all(|&state| supervision.judge(state, false).is_none()));
        supervision.end_cycle(true, all_are_enabled);
    }
    supervision.end_cycle(false, true);
    assert!(left.iter().all(|&state| !is_fault(supervision, state)), "after they were switched off");
    supervision.end_cycle(true, true);
    let fault = supervision.judge(Some(DriveState::Fault), true).unwrap();
    assert_eq!((fault.cause, fault.value), (Cause::DriveFault, f64::from(DriveState::Fault.code())));
}

#[test]
fn a_bus_reports_each_change_once_and_each_stranger_once() {
    let mut bus = BusMonitor::default();
    let states = [
        (ErrorState::Active, None, false),
        (ErrorState::Passive, None, false),
        (ErrorState::BusOff, Some(true), true),
        (ErrorState::BusOff, None, true),
        (ErrorState::Passive, Some(false), false),
        (ErrorState::Active, None, false),
    ];
    for (state, change, is_off) in states {
        assert_eq!(bus.set_error_state(state), change, "{state:?}");
        assert_eq!(bus.is_off(), is_off);
    }
    let strangers = [1, 2, 127, 1, 127, 1, 3, 2].map(|id| bus.is_new_unknown(NodeId::new(id).unwrap()));
    assert_eq!(strangers, [true, true, true, false, false, false, true, false]);
}

#[test]
fn a_refusal_to_send_is_explained_by_bus_off_or_by_drives_that_are_not_there_yet() {
    let mut bus = BusMonitor::default();
    let [off, full, down] = [
        SendError::BusOff { tec: 256 },
        SendError::QueueFull { capacity: 9 },
        SendError::InterfaceDown { errno: 100 },
    ];
    assert_eq!([&off, &full, &down].map(|refusal| bus.is_unexplained(refusal)), [false, false, true]);
    bus.note_drive();
    assert_eq!([&off, &full, &down].map(|refusal| bus.is_unexplained(refusal)), [false, true, true]);
}

#[test]
fn process_data_answer_the_first_sync_that_is_seen_in_a_cycle() {
    let can = Scenario::default().can;
    let mut exchange = Exchange::new(&can, 1000).unwrap();
    assert!(!exchange.begin_cycle(Wake::on_time(1, 999)), "the first heartbeat is due at 1000");
    assert!(exchange.begin_cycle(Wake::on_time(2, 1000)));
    assert_eq!([0, 1].map(|bus| exchange.answered_after_ns(bus)), [1000, 1000]);
    exchange.note_sync(1, 1200);
    exchange.note_sync(1, 1700);
    assert_eq!([0, 1].map(|bus| exchange.answered_after_ns(bus)), [1000, 1200]);
    let heartbeat_ns = u64::from(can.heartbeat_producer_ms) * 1_000_000;
    assert!(!exchange.begin_cycle(Wake::on_time(3, 1000 + heartbeat_ns - 1)));
    let next_ns = 1000 + heartbeat_ns;
    assert!(exchange.begin_cycle(Wake::on_time(4, next_ns)));
    assert_eq!(exchange.begun_ns(), next_ns);
    // A SYNC seen at the very time it was sent is this cycle's.
    exchange.note_sync(0, next_ns);
    exchange.note_sync(0, next_ns + 5);
    assert_eq!(exchange.answered_after_ns(0), next_ns);
}

#[test]
fn a_reading_has_the_times_of_its_cycle() {
    let can = Scenario::default().can;
    let mut exchange = Exchange::new(&can, 0).unwrap();
    let mut wake = Wake::on_time(7, 5000);
    (wake.due_ns, wake.skipped) = (4000, 3);
    exchange.begin_cycle(wake);
    exchange.note_answer(9000);
    exchange.note_answer(8000);
    let mut reading = Reading::default();
    exchange.fill_reading(&mut reading);
    let times = (reading.cycle, reading.due_ns, reading.woke_ns, reading.skipped_cycles, reading.complete_ns);
    assert_eq!(times, (7, 4000, 5000, 3, 9000));
    // SYNC without data at 1 Mbit/s: 44 bits and 4 stuff bits, at whose last the drives sample.
    assert_eq!(reading.sampled_ns - 5000, 48_000);
    exchange.begin_cycle(Wake::on_time(8, 6000));
    exchange.fill_reading(&mut reading);
    assert_eq!(reading.complete_ns, 0);
}

#[test]
fn a_drive_is_absent_once_beyond_its_time() {
    let scenario = Scenario::default();
    let mut drive = RemoteDrive::new(&scenario, 0, NodeId::new(1).unwrap(), 0, 500);
    let limit_ns = 500 + u64::from(scenario.can.boot_timeout_ms) * 1_000_000;
    assert_eq!(drive.judge(limit_ns, false), None);
    assert!(matches!(drive.judge(limit_ns + 1, false), Some(Finding::Absent(_))));
    assert_eq!(drive.judge(limit_ns + 2, false), None);
}

#[test]
fn an_event_has_the_cycle_in_which_it_happened() {
    let mut bench = Bench::enabled();
    bench.drive(2).power = DriveState::Fault;
    bench.cycle(Some(DriveRequest::Enable));
    let fault = *bench.events_of(EventKind::Fault).next().unwrap();
    assert_eq!((fault.cycle, fault.axis, fault.node, fault.bus), (bench.cycle, 2, 3, 0));
}
