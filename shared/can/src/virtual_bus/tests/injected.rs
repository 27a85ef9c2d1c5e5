//! Injected faults: the effect of each kind on the frames and the counters.

use super::*;
use crate::faults::{Fault, FaultKind};

const ANY: Fault = Fault {
    number: 0,
    kind: FaultKind::Corrupt,
    from_ns: 0,
    until_ns: FOREVER,
    id: None,
    port: None,
    probability: 1.0,
    count: FOREVER,
};

fn wire_with(fault: Fault) -> VirtualWire {
    let config = WireConfig { restart_after_ns: Some(1_000_000), ..CONFIG };
    VirtualWire::with_faults(&config, Faults::new(vec![fault], 1))
}

fn state_change(tapped: &Tapped) -> Option<&ErrorReport> {
    let Tapped::Error(report) = tapped else { return None };
    matches!(report.kind, ErrorKind::State(_)).then_some(report)
}

fn of(wire: &mut VirtualWire) -> [(u16, u16); PORTS] {
    std::array::from_fn(|port| (status(wire, port).tec, status(wire, port).rec))
}

#[test]
fn a_corrupted_frame_is_repeated_and_counted_by_everybody() {
    let mut wire = wire_with(Fault { count: 1, ..ANY });
    let frame = frame(0x181, &[1, 2, 3]);
    wire.port(1).send(0, frame).unwrap();
    wire.advance(FOREVER / 2);
    let [Tapped::Error(report), Tapped::Frame(received)] = tapped(&mut wire)[..] else { panic!() };
    assert_eq!((report.port, report.kind), (1, ErrorKind::Bit));
    assert_eq!(
        received.time_ns,
        report.time_ns + 3 * BIT_NS + duration_ns(&frame),
        "at once after the error frame"
    );
    let shortest = 1 + 12 + 8;
    assert!((shortest * BIT_NS..=duration_ns(&frame) + 20 * BIT_NS).contains(&report.time_ns));
    assert_eq!(of(&mut wire), [(0, 0), (7, 0), (0, 0)], "8 up and 1 down; 1 up and 1 down");
}

#[test]
fn a_frame_that_is_always_corrupted_takes_its_sender_off_the_bus_alone() {
    let mut wire = wire_with(Fault { count: 32, ..ANY });
    wire.port(1).send(0, sync::frame()).unwrap();
    wire.advance(100_000_000);
    assert_eq!(of(&mut wire), [(0, 32), (0, 0), (0, 32)], "restarted after a millisecond, counters cleared");
    let seen = tapped(&mut wire);
    assert_eq!((error_frames(&seen), seen.len()), (32, 32 + 3), "the frame never arrives");
    let states: Vec<_> = seen.iter().filter_map(state_change).collect();
    let kinds: Vec<_> = states.iter().map(|report| (report.port, report.kind)).collect();
    let state = |state| (1, ErrorKind::State(state));
    assert_eq!(kinds, [state(ErrorState::Passive), state(ErrorState::BusOff), state(ErrorState::Active)]);
    assert!(states[2].time_ns - states[1].time_ns >= 1_000_000 + 128 * 11 * BIT_NS);
}

#[test]
fn one_receiver_loses_a_frame_without_an_error_on_the_wire() {
    let mut wire = wire_with(Fault { kind: FaultKind::Lose, port: Some(2), ..ANY });
    wire.port(1).send(0, sync::frame()).unwrap();
    wire.advance(FOREVER / 2);
    assert_eq!([0, 2].map(|port| fetch(&mut wire, port).len()), [1, 0]);
    assert_eq!(errors(&mut wire), []);
}

#[test]
fn a_delayed_frame_is_queued_later() {
    let mut wire = wire_with(Fault { kind: FaultKind::Delay { by_ns: 300_000 }, ..ANY });
    wire.port(1).send(1000, sync::frame()).unwrap();
    wire.advance(FOREVER / 2);
    assert_eq!(arrivals(&mut wire), [(0x080, 301_000 + 48_000)]);
}

#[test]
fn a_delay_of_nothing_never_acts() {
    let mut wire = wire_with(Fault { kind: FaultKind::Delay { by_ns: 0 }, ..ANY });
    wire.port(1).send(1000, sync::frame()).unwrap();
    wire.advance(FOREVER / 2);
    assert_eq!(arrivals(&mut wire), [(0x080, 1000 + 48_000)]);
    assert_eq!(wire.next_note(FOREVER).map(|note| note.activations), None);
}

#[test]
fn a_frame_that_finds_no_room_is_not_counted_as_delayed() {
    let mut wire =
        wire_with(Fault { kind: FaultKind::Delay { by_ns: 300_000 }, from_ns: 1000, count: 1, ..ANY });
    while wire.port(1).send(0, sync::frame()).is_ok() {}
    assert!(wire.port(1).send(1000, sync::frame()).is_err());
    wire.advance(FOREVER / 4);
    arrivals(&mut wire);
    wire.port(1).send(FOREVER / 2, sync::frame()).unwrap();
    wire.advance(FOREVER);
    assert_eq!(arrivals(&mut wire), [(0x080, FOREVER / 2 + 300_000 + 48_000)]);
}

#[test]
fn a_duplicated_frame_arrives_twice() {
    let mut wire = wire_with(Fault { kind: FaultKind::Duplicate, count: 1, ..ANY });
    wire.port(1).send(0, sync::frame()).unwrap();
    wire.advance(FOREVER / 2);
    assert_eq!(arrivals(&mut wire), [(0x080, 48_000), (0x080, (48 + 7 + 8 + 3 + 48) * BIT_NS)]);
    assert_eq!(fetch(&mut wire, 0).len(), 2);
    assert_eq!(of(&mut wire), [(0, 0), (7, 0), (0, 0)], "only the transmitter saw an error");
}

#[test]
fn a_babbling_node_leaves_no_gap_to_lower_priorities() {
    let babble = frame(0x001, &[0x55; 8]);
    let kind = FaultKind::Babble { frame: babble };
    let mut wire = wire_with(Fault { kind, port: Some(2), from_ns: 500_000, until_ns: 2_000_000, ..ANY });
    wire.port(1).send(600_000, sync::frame()).unwrap();
    wire.advance(FOREVER / 2);
    let arrivals = arrivals(&mut wire);
    let (last, babbled) = arrivals.split_last().unwrap();
    assert_eq!(last.0, 0x080, "SYNC comes when the babbling is over");
    assert!(last.1 > 2_000_000);
    let each_ns = u64::from(frame_bits(&babble)) * BIT_NS;
    assert_eq!(babbled.len() as u64, 1_500_000_u64.div_ceil(each_ns));
}

#[test]
fn a_disconnected_node_neither_hears_nor_sends_nor_acknowledges() {
    let mut wire =
        wire_with(Fault { kind: FaultKind::Disconnect, port: Some(0), until_ns: 1_000_000, ..ANY });
    wire.port(0).send(0, frame(0x080, &[])).unwrap();
    wire.port(1).send(0, frame(0x181, &[])).unwrap();
    wire.advance(900_000);
    assert_eq!(fetch(&mut wire, 0), []);
    assert_eq!(fetch(&mut wire, 2).len(), 1);
    wire.advance(2_000_000);
    assert_eq!(fetch(&mut wire, 1).len(), 1, "what it had queued goes out when it is back");
    let notes: Vec<_> = std::iter::from_fn(|| wire.next_note(2_000_000)).map(|note| note.has_ended).collect();
    assert_eq!(notes, [false, true]);
}

#[test]
fn bus_off_is_forced_once_between_frames() {
    let mut wire =
        wire_with(Fault { kind: FaultKind::BusOff, port: Some(1), from_ns: 20_000, count: 1, ..ANY });
    wire.port(1).send(0, sync::frame()).unwrap();
    wire.advance(60_000);
    assert_eq!(status(&mut wire, 1).state, ErrorState::BusOff);
    assert_eq!(fetch(&mut wire, 0).len(), 1, "the frame on the wire still arrives");
    let report = errors(&mut wire)[0];
    assert_eq!((report.time_ns, report.kind), (51_000, ErrorKind::State(ErrorState::BusOff)));
    wire.advance(10_000_000);
    assert_eq!(status(&mut wire, 1).state, ErrorState::Active);
}

fn any_fault() -> impl Strategy<Value = Fault> {
    let kind = prop_oneof![
        Just(FaultKind::Corrupt),
        Just(FaultKind::Lose),
        (0_u64..500_000).prop_map(|by_ns| FaultKind::Delay { by_ns }),
        Just(FaultKind::Duplicate),
        (0_u16..0x200).prop_map(|id| FaultKind::Babble { frame: frame(id, &[7]) }),
        Just(FaultKind::Disconnect),
        Just(FaultKind::BusOff),
    ];
    let time = 0_u64..3_000_000;
    (0_usize..8, kind, time.clone(), time, prop::option::of(0..PORTS), 0.0..1.0, 1_u64..50).prop_map(
        |(number, kind, from_ns, lasts_ns, port, probability, count)| Fault {
            number,
            kind,
            from_ns,
            until_ns: from_ns + lasts_ns,
            id: None,
            port,
            probability,
            count,
        },
    )
}

proptest! {
    #[test]
    fn whatever_befalls_the_wire_its_laws_hold_however_time_is_cut(
        faults in prop::collection::vec(any_fault(), 0..4),
        sends in prop::collection::vec((0..PORTS, 0_u64..2_000_000, 0_u16..=0x7FF, 0_usize..=8), 0..8),
        cuts in prop::collection::vec(0_u64..6_000_000, 0..8),
        seed: u64,
    ) {
        let config = WireConfig { receive_capacity: 4096, restart_after_ns: Some(100_000), ..CONFIG };
        let run = |cuts: &[u64]| {
            let mut wire = VirtualWire::with_faults(&config, Faults::new(faults.clone(), seed));
            for &(port, at_ns, id, length) in &sends {
                wire.port(port).send(at_ns, frame(id, &[0x55; 8][..length])).unwrap();
            }
            for &cut_ns in cuts {
                wire.advance(cut_ns);
            }
            wire.advance(20_000_000);
            (tapped(&mut wire), wire)
        };
        let (seen, mut wire) = run(&[]);
        prop_assert!(seen.is_sorted_by_key(Tapped::time_ns));
        for port in 0..PORTS {
            let status = status(&mut wire, port);
            prop_assert_eq!(status.state == ErrorState::BusOff, status.tec > 255);
        }
        prop_assert_eq!(run(&cuts).0, seen);
    }
}

#[test]
fn a_fault_whose_time_becomes_known_later_acts_from_then_on() {
    let mut wire = wire_with(Fault { kind: FaultKind::Lose, port: Some(2), from_ns: FOREVER, ..ANY });
    let frame = frame(0x181, &[1]);
    let arrives = |at_ns: u64, wire: &mut VirtualWire| {
        wire.port(1).send(at_ns, frame).unwrap();
        wire.advance(at_ns + 500_000);
        wire.port(2).receive(FOREVER).unwrap().is_some()
    };
    assert!(arrives(0, &mut wire));
    wire.set_fault_window(0, 1_000_000..2_000_000);
    wire.set_fault_window(7, 0..FOREVER);
    assert!(!arrives(1_000_000, &mut wire));
    assert!(arrives(2_000_000, &mut wire));
    assert_eq!(wire.next_note(2_500_000).map(|note| note.has_ended), Some(false));
    assert_eq!(wire.next_note(2_500_000).map(|note| note.activations), Some(1));
}

#[test]
fn a_node_begins_to_babble_no_earlier_than_when_its_time_becomes_known() {
    let babble = FaultKind::Babble { frame: frame(0x001, &[0x55; 8]) };
    let mut wire = wire_with(Fault { kind: babble, port: Some(2), from_ns: FOREVER, ..ANY });
    assert_eq!(wire.next_event_ns(), None);
    wire.advance(1_000_000);
    wire.set_fault_window(0, 500_000..2_000_000);
    assert!(wire.next_event_ns().is_some_and(|end_ns| end_ns > 1_000_000));
}
