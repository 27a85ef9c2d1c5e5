//! Errors without injected faults: missing acknowledgement, one identifier sent twice, bus-off.

use super::*;

fn with(change: impl FnOnce(&mut WireConfig)) -> VirtualWire {
    let mut config = CONFIG;
    change(&mut config);
    VirtualWire::new(&config)
}

fn alone() -> VirtualWire {
    with(|config| (config.ports, config.receive_capacity) = (1, 16_384))
}

#[test]
fn a_lone_node_repeats_until_it_is_passive_and_stays_on_the_bus() {
    let mut wire = alone();
    wire.port(0).send(0, sync::frame()).unwrap();
    wire.advance(1_000_000_000);
    assert_eq!(status(&mut wire, 0), BusStatus { state: ErrorState::Passive, tec: 128, rec: 0 });
    let seen = tapped(&mut wire);
    let is_expected = |tapped: &Tapped| {
        let Tapped::Error(report) = tapped else { return false };
        matches!(report.kind, ErrorKind::Acknowledge | ErrorKind::State(ErrorState::Passive))
    };
    assert!(seen.iter().all(is_expected));
    assert!(error_frames(&seen) > 10_000);
}

#[test]
fn an_unacknowledged_frame_takes_its_bits_to_the_slot_an_error_frame_and_a_passive_pause() {
    let mut wire = alone();
    wire.port(0).send(0, sync::frame()).unwrap();
    wire.advance(3_000_000);
    // 51 bits less intermission, end of frame and acknowledge delimiter; flag and delimiter.
    let attempt_bits = 51 - 3 - 7 - 1 + 6 + 8;
    let seen = errors(&mut wire);
    let times: Vec<_> = seen
        .iter()
        .filter(|report| report.kind == ErrorKind::Acknowledge)
        .map(|report| report.time_ns)
        .collect();
    assert_eq!(times[0], attempt_bits * BIT_NS);
    assert_eq!(
        times[1] - times[0],
        (3 + attempt_bits) * BIT_NS,
        "error active: next behind the intermission"
    );
    assert_eq!(times[20] - times[19], (3 + 8 + attempt_bits) * BIT_NS, "error passive: 8 bits later");
    assert_eq!(times[16] - times[15], times[20] - times[19], "passive from the sixteenth error on");
    assert_eq!(times[15] - times[14], times[1] - times[0]);
}

#[test]
fn an_error_is_reported_with_the_counter_after_it_and_before_the_change_of_state() {
    let mut wire = alone();
    wire.port(0).send(0, sync::frame()).unwrap();
    wire.advance(3_000_000);
    let seen: Vec<_> = errors(&mut wire).iter().map(|report| (report.kind, report.tec)).collect();
    assert_eq!(seen[..2], [(ErrorKind::Acknowledge, 8), (ErrorKind::Acknowledge, 16)]);
    let passive = ErrorKind::State(ErrorState::Passive);
    assert_eq!(seen[15..17], [(ErrorKind::Acknowledge, 128), (passive, 128)]);
}

#[test]
fn a_node_that_joins_a_lone_node_receives_its_frame_at_once() {
    let mut wire = with(|config| (config.ports, config.receive_capacity) = (2, 1024));
    wire.nodes.stations[1].confinement.leave_bus(0, Some(5_000_000));
    wire.port(0).send(0, sync::frame()).unwrap();
    wire.advance(100_000_000);
    assert_eq!(fetch(&mut wire, 1).len(), 1);
    assert_eq!(status(&mut wire, 0), BusStatus { state: ErrorState::Active, tec: 127, rec: 0 });
    assert_eq!(arrivals(&mut wire).len(), 1);
}

#[test]
fn equal_frames_of_two_ports_pass_as_one() {
    let mut wire = wire();
    wire.port(1).send(0, frame(0x123, &[1])).unwrap();
    wire.port(2).send(0, frame(0x123, &[1])).unwrap();
    wire.advance(FOREVER / 2);
    assert_eq!(fetch(&mut wire, 0).len(), 1);
    let seen = tapped(&mut wire);
    assert_eq!((seen.len(), error_frames(&seen)), (1, 0));
}

#[test]
fn two_frames_of_one_identifier_destroy_each_other_until_their_senders_are_passive() {
    let mut wire = wire();
    wire.port(1).send(0, frame(0x123, &[1])).unwrap();
    wire.port(2).send(0, frame(0x123, &[2])).unwrap();
    wire.advance(FOREVER / 2);
    let bytes: Vec<_> = fetch(&mut wire, 0).iter().map(|received| received.frame.data()[0]).collect();
    assert_eq!(bytes, [1, 2], "the dominant one first: a passive error flag does not disturb it");
    assert_eq!(fetch(&mut wire, 2), [], "who signalled an error heard no more of the frame");
    assert_eq!(error_frames(&tapped(&mut wire)), 16);
    assert_eq!(status(&mut wire, 1), BusStatus { state: ErrorState::Active, tec: 127, rec: 0 });
    assert_eq!(status(&mut wire, 2), BusStatus { state: ErrorState::Passive, tec: 135, rec: 0 });
    assert_eq!(status(&mut wire, 0), BusStatus { state: ErrorState::Active, tec: 0, rec: 14 });
}

#[test]
fn a_node_in_bus_off_sends_and_receives_nothing_until_its_restart_and_the_wait_after_it() {
    let mut wire = wire();
    wire.port(0).send(0, frame(0x700, &[])).unwrap();
    wire.nodes.stations[0]
        .transmit
        .push(Queued { frame: sync::frame(), duration_ns: 51_000, since_ns: 9_000_000 })
        .unwrap();
    wire.nodes.confine(0, 0, |node| node.leave_bus(0, Some(10_000_000)));
    assert!(wire.nodes.stations[0].transmit.frames.is_empty(), "both frames are discarded");
    assert_eq!(wire.port(0).send(0, sync::frame()), Err(SendError::BusOff { tec: 256 }));
    wire.port(1).send(0, frame(0x181, &[])).unwrap();
    wire.advance(10_000_000);
    assert_eq!(fetch(&mut wire, 0), []);
    assert_eq!(fetch(&mut wire, 2).len(), 1);
    assert_eq!(status(&mut wire, 0).state, ErrorState::BusOff, "before its restart");
    wire.advance(10_000_000 + 128 * 11 * BIT_NS - 1);
    assert_eq!(status(&mut wire, 0).state, ErrorState::BusOff);
    wire.advance(10_000_000 + 128 * 11 * BIT_NS);
    assert_eq!(status(&mut wire, 0), BusStatus { state: ErrorState::Active, tec: 0, rec: 0 });
    wire.port(0).send(12_000_000, sync::frame()).unwrap();
    wire.advance(FOREVER / 2);
    assert_eq!(fetch(&mut wire, 1).len(), 1);
    let states: Vec<_> = errors(&mut wire).iter().map(|report| (report.port, report.kind)).collect();
    assert_eq!(
        states,
        [(0, ErrorKind::State(ErrorState::BusOff)), (0, ErrorKind::State(ErrorState::Active))]
    );
}

#[test]
fn every_frame_that_passes_counts_as_a_recessive_sequence() {
    let mut wire = wire();
    wire.nodes.confine(0, 0, |node| node.leave_bus(0, Some(0)));
    let (mut sent, mut now_ns) = (0, 0);
    while status(&mut wire, 0).state == ErrorState::BusOff {
        wire.port(1).send(now_ns, sync::frame()).unwrap();
        now_ns = wire.next_event_ns().unwrap() + 3 * BIT_NS;
        wire.advance(now_ns);
        sent += 1;
        assert!(sent <= 128);
    }
    assert_eq!(sent, 128);
}
