//! The wire's laws, each in a scene of a few frames, and the conformance suite.

use proptest::prelude::*;

use super::*;
use crate::canopen::sync;
use crate::laws::{self, End, Pair};
use crate::wire::{INTERFRAME_BITS, frame_bits};
use crate::{Bitrate, CanId, ErrorKind, ErrorReport};

mod errors;
mod injected;

const PORTS: usize = 3;
const BIT_NS: u64 = 1000;
const FOREVER: u64 = u64::MAX;

const CONFIG: WireConfig = WireConfig {
    bitrate: Bitrate::MAX,
    ports: PORTS,
    transmit_capacity: 8,
    receive_capacity: 16,
    restart_after_ns: None,
};

fn wire() -> VirtualWire {
    VirtualWire::new(&CONFIG)
}

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::new(CanId::standard(id).unwrap(), data).unwrap()
}

fn duration_ns(frame: &Frame) -> u64 {
    u64::from(frame_bits(frame) - INTERFRAME_BITS) * BIT_NS
}

fn fetch(wire: &mut VirtualWire, port: usize) -> Vec<Received> {
    std::iter::from_fn(|| wire.port(port).receive(FOREVER).unwrap()).collect()
}

fn tapped(wire: &mut VirtualWire) -> Vec<Tapped> {
    std::iter::from_fn(|| wire.tap(FOREVER).unwrap()).collect()
}

fn arrivals(wire: &mut VirtualWire) -> Vec<(u32, u64)> {
    let frames: Vec<_> = tapped(wire).iter().filter_map(|tapped| tapped.frame().copied()).collect();
    frames.iter().map(|received| (received.frame.id().number(), received.time_ns)).collect()
}

fn status(wire: &mut VirtualWire, port: usize) -> BusStatus {
    wire.port(port).status()
}

/// The error frames among these.
fn error_frames(tapped: &[Tapped]) -> usize {
    let is_error_frame = |tapped: &&Tapped| matches!(tapped, Tapped::Error(report) if !matches!(report.kind, ErrorKind::State(_)));
    tapped.iter().filter(is_error_frame).count()
}

/// The errors at the tap.
fn errors(wire: &mut VirtualWire) -> Vec<ErrorReport> {
    let tapped = tapped(wire).into_iter();
    tapped.filter_map(|tapped| if let Tapped::Error(report) = tapped { Some(report) } else { None }).collect()
}

#[test]
fn sync_takes_48_bits_to_arrive_and_51_until_the_next_may_start() {
    let mut wire = wire();
    wire.port(0).send(5000, sync::frame()).unwrap();
    wire.port(0).send(5000, sync::frame()).unwrap();
    wire.advance(1_000_000);
    assert_eq!(arrivals(&mut wire), [(0x080, 5000 + 48_000), (0x080, 5000 + 51_000 + 48_000)]);
}

#[test]
fn everyone_but_the_sender_receives_a_frame_once_at_its_end() {
    let mut wire = wire();
    let frame = frame(0x181, &[1, 2, 3]);
    wire.port(1).send(0, frame).unwrap();
    wire.advance(duration_ns(&frame) - 1);
    assert_eq!(wire.port(0).receive(FOREVER), Ok(None), "not before the end of the frame");
    wire.advance(duration_ns(&frame));
    assert_eq!(
        wire.port(0).receive(duration_ns(&frame) - 1),
        Ok(None),
        "nor to who asks for an earlier time"
    );
    let expected = [Received { frame, time_ns: duration_ns(&frame) }];
    assert_eq!(fetch(&mut wire, 0), expected);
    assert_eq!(fetch(&mut wire, 1), []);
    assert_eq!(fetch(&mut wire, 2), expected);
}

#[test]
fn the_lowest_identifier_wins_in_any_order_of_queuing() {
    let mut wire = wire();
    for (port, id) in [(2, 0x183), (1, 0x182), (0, 0x201), (0, 0x080), (1, 0x081)] {
        wire.port(port).send(0, frame(id, &[])).unwrap();
    }
    wire.advance(FOREVER / 2);
    let order: Vec<_> = arrivals(&mut wire).into_iter().map(|(id, _)| id).collect();
    assert_eq!(order, [0x080, 0x081, 0x182, 0x183, 0x201]);
}

#[test]
fn a_frame_on_the_wire_is_not_interrupted() {
    let mut wire = wire();
    wire.port(0).send(0, frame(0x700, &[])).unwrap();
    wire.port(1).send(1, frame(0x080, &[])).unwrap();
    wire.advance(FOREVER / 2);
    assert_eq!(arrivals(&mut wire)[0].0, 0x700, "nothing else was queued when it started");
}

#[test]
fn frames_of_one_instant_arbitrate_even_if_time_was_advanced_to_it_between() {
    let mut wire = wire();
    wire.port(0).send(1000, frame(0x700, &[])).unwrap();
    wire.advance(1000);
    wire.port(1).send(1000, frame(0x080, &[])).unwrap();
    wire.advance(FOREVER / 2);
    assert_eq!(arrivals(&mut wire)[0].0, 0x080);
}

#[test]
fn a_frame_queued_for_the_past_is_queued_now() {
    let mut wire = wire();
    wire.advance(1_000_000);
    wire.port(0).send(10, sync::frame()).unwrap();
    assert_eq!(wire.next_event_ns(), Some(1_048_000));
}

#[test]
fn equal_identifiers_of_a_port_stay_in_order() {
    let mut wire = wire();
    for byte in 0..4 {
        wire.port(0).send(0, frame(0x123, &[byte])).unwrap();
    }
    wire.advance(FOREVER / 2);
    let bytes: Vec<_> = fetch(&mut wire, 1).iter().map(|received| received.frame.data()[0]).collect();
    assert_eq!(bytes, [0, 1, 2, 3]);
    assert_eq!(errors(&mut wire), []);
}

#[test]
fn a_full_transmit_queue_refuses_and_a_full_receive_queue_counts() {
    let mut wire = wire();
    for round in 0..3 {
        for _ in 0..8 {
            wire.port(0).send(round * 1_000_000, sync::frame()).unwrap();
        }
        let refused = wire.port(0).send(round * 1_000_000, sync::frame());
        assert_eq!(refused, Err(SendError::QueueFull { capacity: 8 }));
        wire.advance((round + 1) * 1_000_000);
    }
    assert_eq!(wire.port(1).receive(FOREVER), Err(ReceiveError::Overrun { lost: 8 }));
    assert_eq!(fetch(&mut wire, 1).len(), 16);
    assert_eq!(arrivals(&mut wire).len(), 24, "the tap has room for the traffic of all ports");
}

#[test]
fn events_lead_from_arrival_to_arrival() {
    let mut wire = wire();
    assert_eq!(wire.next_event_ns(), None);
    wire.port(0).send(100, sync::frame()).unwrap();
    wire.port(1).send(200, frame(0x181, &[])).unwrap();
    let mut events = Vec::new();
    while let Some(event_ns) = wire.next_event_ns() {
        wire.advance(event_ns);
        events.push(event_ns);
    }
    let arrivals: Vec<_> = arrivals(&mut wire).into_iter().map(|(_, time_ns)| time_ns).collect();
    assert_eq!(events, arrivals);
    assert_eq!(events.len(), 2);
}

#[test]
fn the_tap_knows_when_a_frame_was_queued() {
    let mut wire = wire();
    wire.port(0).send(1000, sync::frame()).unwrap();
    wire.port(0).send(2000, sync::frame()).unwrap();
    wire.advance(FOREVER / 2);
    let queued: Vec<_> = tapped(&mut wire).iter().map(|tapped| tapped.frame().unwrap().queued_ns).collect();
    assert_eq!(queued, [Some(1000), Some(2000)]);
}

struct TwoPorts {
    wire: VirtualWire,
    now_ns: u64,
}

impl Pair for TwoPorts {
    fn end(&mut self, end: End) -> impl Bus {
        self.wire.port(end as usize)
    }

    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn wait_for_arrivals(&mut self) {
        while let Some(event_ns) = self.wire.next_event_ns() {
            self.wire.advance(event_ns);
            self.now_ns = event_ns;
        }
    }
}

#[test]
fn the_wire_conforms() {
    let new = || TwoPorts { wire: wire(), now_ns: 0 };
    assert_eq!(laws::check_every_law(new), Ok(()));
    assert_eq!(laws::check_arbitration(new), Ok(()));
}

proptest! {
    #[test]
    fn frames_never_overlap_and_none_is_lost_however_time_is_cut(
        sends in prop::collection::vec((0..PORTS, 0_u64..2_000_000, 0_u16..=0x7FF, 0_usize..=8), 0..8),
        cuts in prop::collection::vec(0_u64..3_000_000, 0..8),
    ) {
        let run = |cuts: &[u64]| {
            let mut wire = wire();
            for &(port, at_ns, id, length) in &sends {
                wire.port(port).send(at_ns, frame(id, &[0x55; 8][..length])).unwrap();
            }
            for &cut_ns in cuts {
                wire.advance(cut_ns);
            }
            wire.advance(FOREVER / 2);
            tapped(&mut wire)
        };
        let all = run(&[]);
        let received: Vec<_> = all.iter().filter_map(Tapped::frame).collect();
        prop_assert!(received.len() <= sends.len());
        for pair in received.windows(2) {
            let gap_ns = pair[1].time_ns - pair[0].time_ns;
            prop_assert!(gap_ns >= duration_ns(&pair[1].frame) + u64::from(INTERFRAME_BITS) * BIT_NS);
        }
        prop_assert_eq!(run(&cuts), all);
    }
}
