//! The conformance suite through injected faults, and each kind of fault.

use super::*;
use crate::faults::{Fault, FaultKind};
use crate::laws::{self, End, Pair};
use crate::{Bitrate, Bus, CanId, ErrorState, Frame, SendError, VirtualWire, WireConfig};

const FAULT: Fault = Fault {
    number: 0,
    kind: FaultKind::Lose,
    from_ns: 0,
    until_ns: u64::MAX,
    id: None,
    port: None,
    probability: 1.0,
    count: u64::MAX,
};

fn wire() -> VirtualWire {
    VirtualWire::new(&WireConfig {
        bitrate: Bitrate::MAX,
        ports: 2,
        transmit_capacity: 8,
        receive_capacity: 4,
        restart_after_ns: None,
    })
}

/// Two ports of a simulated wire, each with faults of its own.
struct Faulted {
    wire: VirtualWire,
    now_ns: u64,
    faults: [PortFaults; 2],
}

impl Faulted {
    fn new(of_a: Vec<Fault>, of_b: Vec<Fault>) -> Self {
        Self {
            wire: wire(),
            now_ns: 0,
            faults: [(of_a, 0), (of_b, 1)]
                .map(|(faults, port)| PortFaults::new(faults, port, 1, None).unwrap()),
        }
    }

    fn send(&mut self, byte: u8) -> Result<(), SendError> {
        let now_ns = self.now_ns;
        self.end(End::A).send(now_ns, frame(byte))
    }

    /// First bytes of the frames at the other end.
    fn received(&mut self) -> Vec<u8> {
        self.wait_for_arrivals();
        let now_ns = self.now_ns;
        let mut port = self.end(End::B);
        std::iter::from_fn(|| port.receive(now_ns).unwrap())
            .map(|received| received.frame.data()[0])
            .collect()
    }
}

impl Pair for Faulted {
    fn end(&mut self, end: End) -> impl Bus {
        let index = end as usize;
        self.faults[index].over(self.wire.port(index))
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

fn frame(byte: u8) -> Frame {
    Frame::fixed(CanId::standard(0x181).unwrap(), [byte])
}

#[test]
fn ports_under_faults_conform() {
    let new = || Faulted::new(Vec::new(), Vec::new());
    assert_eq!(laws::check_every_law(new), Ok(()));
    assert_eq!(laws::check_arbitration(new), Ok(()));
}

#[test]
fn a_lost_frame_does_not_arrive_and_a_duplicated_one_arrives_twice() {
    let mut pair = Faulted::new(Vec::new(), vec![Fault { count: 1, ..FAULT }]);
    (1..=2).for_each(|byte| pair.send(byte).unwrap());
    assert_eq!(pair.received(), [2]);
    let mut pair = Faulted::new(vec![Fault { kind: FaultKind::Duplicate, count: 1, ..FAULT }], Vec::new());
    (1..=2).for_each(|byte| pair.send(byte).unwrap());
    assert_eq!(pair.received(), [1, 1, 2]);
}

#[test]
fn a_delayed_frame_leaves_when_it_is_due() {
    let kind = FaultKind::Delay { by_ns: 1_000_000 };
    let mut pair = Faulted::new(vec![Fault { kind, count: 1, ..FAULT }], Vec::new());
    (1..=2).for_each(|byte| pair.send(byte).unwrap());
    assert_eq!(pair.received(), [2]);
    pair.now_ns = 1_000_000;
    assert_eq!(pair.end(End::A).receive(1_000_000), Ok(None));
    assert_eq!(pair.received(), [1]);
}

#[test]
fn a_babbling_node_sends_whenever_its_port_is_used() {
    let kind = FaultKind::Babble { frame: frame(0xBB) };
    let mut pair = Faulted::new(vec![Fault { kind, count: 2, ..FAULT }], Vec::new());
    pair.send(1).unwrap();
    let now_ns = pair.now_ns;
    assert_eq!(pair.end(End::A).receive(now_ns), Ok(None));
    pair.send(2).unwrap();
    assert_eq!(pair.received(), [0xBB, 1, 0xBB, 2]);
}

#[test]
fn a_disconnected_node_neither_sends_nor_receives_until_the_fault_ends() {
    let fault = Fault { kind: FaultKind::Disconnect, until_ns: 1_000_000, ..FAULT };
    let mut pair = Faulted::new(Vec::new(), vec![fault]);
    pair.send(1).unwrap();
    assert!(pair.received().is_empty());
    assert!(pair.end(End::B).send(500_000, frame(9)).is_err());
    pair.now_ns = 1_000_000;
    pair.send(2).unwrap();
    assert_eq!(pair.received(), [2]);
}

#[test]
fn a_node_in_bus_off_reports_bus_off_until_it_restarts() {
    let off = Fault { kind: FaultKind::BusOff, count: 1, ..FAULT };
    let mut pair = Faulted::new(vec![off], Vec::new());
    assert_eq!(pair.send(1), Err(SendError::BusOff { tec: 256 }));
    assert_eq!(pair.end(End::A).status().state, ErrorState::BusOff);
    pair.now_ns = 10_000_000_000;
    assert_eq!(pair.send(2), Err(SendError::BusOff { tec: 256 }), "it was not told to restart");
    let restarting = PortFaults::new(vec![off], 0, 1, Some(1_000_000)).unwrap();
    let mut pair = Faulted { faults: [restarting, PortFaults::new(Vec::new(), 1, 1, None).unwrap()], ..pair };
    assert_eq!(pair.send(3), Err(SendError::BusOff { tec: 256 }));
    pair.now_ns += 999_999;
    assert_eq!(pair.send(4), Err(SendError::BusOff { tec: 256 }));
    pair.now_ns += 1;
    pair.send(5).unwrap();
    assert_eq!(pair.received(), [5]);
    assert_eq!(pair.end(End::A).status().state, ErrorState::Active);
}

#[test]
fn a_node_is_put_off_the_bus_as_often_as_asked_for() {
    let off = Fault { kind: FaultKind::BusOff, count: 2, ..FAULT };
    let mut pair = Faulted::new(Vec::new(), Vec::new());
    pair.faults[0] = PortFaults::new(vec![off], 0, 1, Some(1_000_000)).unwrap();
    for _ in 0..2 {
        for byte in 0..5 {
            assert_eq!(pair.send(byte), Err(SendError::BusOff { tec: 256 }));
        }
        pair.now_ns += 1_000_000;
    }
    pair.send(1).unwrap();
}

#[test]
fn a_copy_without_room_does_not_fail_the_frame() {
    let duplicate = Fault { kind: FaultKind::Duplicate, ..FAULT };
    let mut pair = Faulted::new(vec![duplicate], Vec::new());
    // The queue holds eight: four frames with their copies.
    (0..4).for_each(|byte| pair.send(byte).unwrap());
    assert_eq!(pair.send(4), Err(SendError::QueueFull { capacity: 8 }));
    let mut pair = Faulted::new(vec![Fault { count: 1, from_ns: 1, ..duplicate }], Vec::new());
    (0..7).for_each(|byte| pair.send(byte).unwrap());
    pair.now_ns = 1;
    assert_eq!(pair.send(7), Ok(()), "its copy would be the ninth");
}

#[test]
fn corruption_needs_a_wire() {
    let corrupt = Fault { kind: FaultKind::Corrupt, number: 5, ..FAULT };
    assert_eq!(PortFaults::new(vec![FAULT, corrupt], 0, 1, None).unwrap_err(), NotByPort(5));
}

#[test]
fn a_fault_whose_time_becomes_known_later_acts_from_then_on() {
    let mut faults = PortFaults::new(vec![Fault { from_ns: u64::MAX, ..FAULT }], 1, 1, None).unwrap();
    let mut wire = wire();
    let mut arrives = |at_ns: u64, faults: &mut PortFaults| {
        wire.port(0).send(at_ns, frame(1)).unwrap();
        wire.advance(at_ns + 500_000);
        faults.over(wire.port(1)).receive(at_ns + 500_000).unwrap().is_some()
    };
    assert!(arrives(0, &mut faults));
    faults.set_fault_window(0, 1_000_000..2_000_000);
    assert!(!arrives(1_000_000, &mut faults));
    assert!(arrives(2_000_000, &mut faults));
}
