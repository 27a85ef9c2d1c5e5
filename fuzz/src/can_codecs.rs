//! Any bytes as frames, CANopen messages, tap messages and requests: read or refused, and what was read
//! is written such that it reads the same.

use arbitrary::Unstructured;
use masseter_can::canopen::{
    BlockMessage, BlockSegment, Cob, Emergency, Heartbeat, Nmt, NodeId, SdoRequest, SdoResponse,
};
use masseter_can::socketcand::Requests;
use masseter_can::{CanId, ErrorReport, PdoMapping, Rpdo1, Tpdo1, candump};
use masseter_runtime::messages::tap;
use masseter_runtime::messages::{CanData, FrameTap, Message};

/// Feeds the target with these bytes.
///
/// # Panics
/// If what the head of this file says does not hold.
pub fn feed(data: &[u8]) {
    canopen(data);
    identifier(data);
    tapped(data);
    socketcand_stream(data);
}

fn canopen(data: &[u8]) {
    let node = NodeId::new(1).expect("a node id");
    if let Ok(request) = SdoRequest::decode(data) {
        assert_eq!(SdoRequest::decode(&request.encode()), Ok(request));
        assert_nothing_invented(data, &request.encode());
    }
    if let Ok(response) = SdoResponse::decode(data) {
        assert_eq!(SdoResponse::decode(&response.encode()), Ok(response));
        assert_nothing_invented(data, &response.encode());
    }
    if let Some(message) = BlockMessage::decode(data) {
        assert_eq!(BlockMessage::decode(&message.encode()), Some(message));
        assert_nothing_invented(data, &message.encode());
    }
    if let Some(segment) = BlockSegment::decode(data) {
        assert_eq!(segment.encode(), data);
    }
    if let Ok(emergency) = Emergency::decode(data) {
        assert_eq!(emergency.encode(), data);
    }
    if let Some(nmt) = Nmt::decode(data) {
        assert_eq!(nmt.frame().data(), data);
    }
    if let Ok(heartbeat) = Heartbeat::decode(data) {
        assert_eq!(heartbeat.frame(node).data(), data);
    }
    if let Ok(pdo) = Rpdo1::decode(data, &PdoMapping::RPDO1) {
        assert_eq!(pdo.frame(node, &PdoMapping::RPDO1).data(), data);
    }
    if let Ok(pdo) = Tpdo1::decode(data, &PdoMapping::TPDO1) {
        assert_eq!(pdo.frame(node, &PdoMapping::TPDO1).data(), data);
    }
}

/// Bits that a message does not use may be read as 1, and are written as 0.
fn assert_nothing_invented(read: &[u8], written: &[u8]) {
    assert_eq!(read.len(), written.len());
    for (read, written) in read.iter().zip(written) {
        assert_eq!(read & written, *written, "bits of {read:02X} became others of {written:02X}");
    }
}

fn identifier(data: &[u8]) {
    let Some((bytes, _)) = data.split_first_chunk::<4>() else { return };
    let flagged = u32::from_le_bytes(*bytes);
    let Ok(id) = CanId::from_flagged(flagged) else { return };
    assert_eq!(id.flagged(), flagged);
    if let Ok(cob) = Cob::try_from(id) {
        assert_eq!(CanId::from(cob), id);
    }
}

fn tapped(data: &[u8]) {
    let mut bytes = Unstructured::new(data);
    let Ok((time_ns, id, bus, flags, length, bytes)) = bytes.arbitrary::<(u64, u32, u16, u8, u8, [u8; 64])>()
    else {
        return;
    };
    let (&said, _) = bytes.split_first_chunk().expect("64 bytes");
    if let Ok(report) = ErrorReport::decode(time_ns, id, said) {
        let (id, data) = report.encode();
        assert_eq!(ErrorReport::decode(time_ns, id, data), Ok(report));
    }
    let data = CanData { length: length.into(), bytes };
    let (bus_index, flags) = (bus.into(), flags.into());
    let message = FrameTap { time_ns, id, bus: bus_index, flags, data, ..FrameTap::default() };
    let read = FrameTap::from_body(message.body()).expect("a body makes a message");
    assert_eq!(read.body(), message.body());
    let Ok(tapped) = tap::decode(&message) else { return };
    assert_eq!(tap::decode(&tap::encode(bus, &tapped)), Ok(tapped));
    let mut line = String::new();
    candump::write(&mut line, "can0", &tapped).expect("a string takes any text");
    let read = candump::read(&line).next().expect("a line").expect("what is written is read");
    assert_eq!((read.interface, read.tapped.time_ns()), ("can0", time_ns / 1000 * 1000), "{line}");
    assert_eq!(
        read.tapped.frame().map(|read| read.frame),
        tapped.frame().map(|tapped| tapped.frame),
        "{line}"
    );
}

/// A stream means the same however it comes in pieces.
fn socketcand_stream(data: &[u8]) {
    let mut at_once = Requests::default();
    at_once.push(data);
    let expected: Vec<_> = std::iter::from_fn(|| at_once.take()).collect();
    let mut in_pieces = Requests::default();
    let mut found = Vec::new();
    for byte in data {
        in_pieces.push(&[*byte]);
        found.extend(std::iter::from_fn(|| in_pieces.take()));
    }
    assert_eq!(found, expected);
}
