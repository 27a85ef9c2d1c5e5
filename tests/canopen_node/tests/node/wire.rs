//! A node on the simulated wire, through the trait that the product's own nodes use.

use crate::client::{EPOS4, settings};
use canopen_node::{Dcf, Frame, Node};
use masseter_can::{Bitrate, Bus as _, CanId, VirtualWire, WireConfig};

#[test]
fn a_node_answers_on_the_simulated_wire() {
    let mut wire = VirtualWire::new(&WireConfig {
        bitrate: Bitrate::MAX,
        ports: 2,
        transmit_capacity: 8,
        receive_capacity: 8,
        restart_after_ns: None,
    });
    let mut node = Node::new(&Dcf::parse(EPOS4).unwrap(), settings(), "", 0).unwrap();
    let request = Frame::fixed(CanId::standard(0x605).unwrap(), [0x40, 0, 0x10, 0, 0, 0, 0, 0]);
    wire.port(0).send(0, request).unwrap();
    let mut heard = Vec::new();
    for now_ns in (0..5_000_000).step_by(100_000) {
        wire.advance(now_ns);
        while let Some(received) = wire.port(1).receive(now_ns).unwrap() {
            node.receive(received.frame, now_ns);
        }
        node.step(now_ns);
        while let Some(frame) = node.outgoing() {
            wire.port(1).send(now_ns, frame).unwrap();
        }
        while let Some(received) = wire.port(0).receive(now_ns).unwrap() {
            heard.push(received.frame.to_string());
        }
    }
    assert_eq!(heard, ["705#00", "585#4300100092010200"]);
}
