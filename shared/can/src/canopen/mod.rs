//! CANopen messages (CiA 301): node ids, the predefined connection set, NMT, heartbeat, SYNC, EMCY, SDO, and device
//! [descriptions](dcf).
//!
//! This module encodes and decodes messages. Supervision, boot-up and reactions are not part of the crate. The PDOs are
//! in the [crate root](crate).

use std::fmt;

use crate::frame::CanId;

pub mod dcf;
mod messages;
mod sdo;

pub use messages::{
    Emergency, EmergencyCode, Heartbeat, HeartbeatError, Nmt, NmtCommand, NmtState, NmtTarget, sync,
};
pub use sdo::{
    AbortCode, BlockMessage, BlockSegment, Expedited, SdoError, SdoRequest, SdoResponse, Segment, block_crc,
};

/// A number that is no node id.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{0} is no CANopen node id (1 to 127)")]
pub struct NodeIdError(pub u8);

/// A CANopen node id, 1 to 127.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub struct NodeId(u8);

impl NodeId {
    /// The node of that number.
    ///
    /// # Errors
    /// [`NodeIdError`] outside 1 to 127.
    pub const fn new(id: u8) -> Result<Self, NodeIdError> {
        if matches!(id, 1..=127) { Ok(Self(id)) } else { Err(NodeIdError(id)) }
    }

    /// The number, 1 to 127.
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Index and sub-index (the "multiplexer" of CiA 301).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub struct ObjectAddress {
    /// Index.
    pub index: u16,
    /// Sub-index; 0 for an object without any.
    pub subindex: u8,
}

impl ObjectAddress {
    /// The entry of that index and sub-index.
    pub const fn new(index: u16, subindex: u8) -> Self {
        Self { index, subindex }
    }
}

impl fmt::Display for ObjectAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h:{:02X}h", self.index, self.subindex)
    }
}

/// A COB-ID in an object dictionary (CiA 301, 7.5.2): an identifier, and whether its communication object exists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CobId(pub u32);

impl CobId {
    /// Bit 30 of the COB-ID of a TPDO: the TPDO answers no remote request.
    pub const NO_REMOTE_REQUEST: u32 = 1 << 30;

    /// Bit 31: the communication object does not exist.
    pub const NOT_VALID: u32 = 1 << 31;
    const IS_EXTENDED: u32 = 1 << 29;
    const NUMBER: u32 = 0x1FFF_FFFF;

    /// Whether the communication object exists.
    pub const fn is_valid(self) -> bool {
        self.0 & Self::NOT_VALID == 0
    }

    /// The identifier with bit 31 set: the object does not exist.
    #[must_use]
    pub const fn invalidated(self) -> Self {
        Self(self.0 | Self::NOT_VALID)
    }

    /// The number of the identifier.
    pub const fn number(self) -> u32 {
        self.0 & Self::NUMBER
    }

    /// Whether the identifier has 11 bits.
    pub const fn is_standard(self) -> bool {
        self.0 & Self::IS_EXTENDED == 0 && self.number() <= 0x7FF
    }

    /// The identifier, if it has 11 bits and the object exists.
    pub fn identifier(self) -> Option<CanId> {
        let id = CanId::standard(self.number() as u16).ok();
        id.filter(|_| self.is_valid() && self.is_standard())
    }
}

/// A communication object and its node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Cob {
    /// Network management, 000h.
    Nmt,
    /// Synchronisation, 080h.
    Sync,
    /// Emergency of a node, 080h + node.
    Emergency(NodeId),
    /// First PDO a node transmits, 180h + node.
    Tpdo1(NodeId),
    /// First PDO a node receives, 200h + node.
    Rpdo1(NodeId),
    /// A node's answer to SDO requests, 580h + node.
    SdoResponse(NodeId),
    /// A request to a node's SDO server, 600h + node.
    SdoRequest(NodeId),
    /// Heartbeat and boot-up of a node, 700h + node.
    Heartbeat(NodeId),
}

/// An identifier outside the supported part of the predefined connection set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("identifier {0} is not in the supported part of the predefined connection set")]
pub struct CobError(pub CanId);

const NMT: u16 = 0x000;
const SYNC: u16 = 0x080;
const EMERGENCY: u16 = 0x080;
const TPDO1: u16 = 0x180;
const RPDO1: u16 = 0x200;
const SDO_RESPONSE: u16 = 0x580;
const SDO_REQUEST: u16 = 0x600;
const HEARTBEAT: u16 = 0x700;

const NODE_MASK: u16 = 0x7F;

impl From<Cob> for CanId {
    fn from(cob: Cob) -> Self {
        let with_node = |function: u16, node: NodeId| function + u16::from(node.get());
        let number = match cob {
            Cob::Nmt => NMT,
            Cob::Sync => SYNC,
            Cob::Emergency(node) => with_node(EMERGENCY, node),
            Cob::Tpdo1(node) => with_node(TPDO1, node),
            Cob::Rpdo1(node) => with_node(RPDO1, node),
            Cob::SdoResponse(node) => with_node(SDO_RESPONSE, node),
            Cob::SdoRequest(node) => with_node(SDO_REQUEST, node),
            Cob::Heartbeat(node) => with_node(HEARTBEAT, node),
        };
        CanId::standard(number).expect("function codes and node ids stay below 780h")
    }
}

impl TryFrom<CanId> for Cob {
    type Error = CobError;

    fn try_from(id: CanId) -> Result<Self, CobError> {
        let unknown = CobError(id);
        if id.is_extended() {
            return Err(unknown);
        }
        let number = id.number() as u16;
        match number {
            NMT => return Ok(Self::Nmt),
            SYNC => return Ok(Self::Sync),
            _ => {}
        }
        let node = NodeId::new((number & NODE_MASK) as u8).map_err(|_| unknown)?;
        match number & !NODE_MASK {
            EMERGENCY => Ok(Self::Emergency(node)),
            TPDO1 => Ok(Self::Tpdo1(node)),
            RPDO1 => Ok(Self::Rpdo1(node)),
            SDO_RESPONSE => Ok(Self::SdoResponse(node)),
            SDO_REQUEST => Ok(Self::SdoRequest(node)),
            HEARTBEAT => Ok(Self::Heartbeat(node)),
            _ => Err(unknown),
        }
    }
}

/// An object of a length that its definition does not allow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("data bytes of {object}: {actual}, expected {expected}")]
pub struct LengthError {
    /// The communication object.
    pub object: &'static str,
    /// Bytes that the definition requires.
    pub expected: usize,
    /// Bytes received.
    pub actual: usize,
}

/// The data as an array of the object's length.
pub(crate) fn exactly<const N: usize>(object: &'static str, data: &[u8]) -> Result<[u8; N], LengthError> {
    data.try_into().map_err(|_| LengthError { object, expected: N, actual: data.len() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_1_to_127_are_nodes() {
        for id in 0..=255 {
            assert_eq!(NodeId::new(id).map(NodeId::get).ok(), (1..128).contains(&id).then_some(id));
        }
    }

    #[test]
    fn a_cob_id_has_an_identifier_of_11_bits_if_its_object_exists() {
        let of = |word: u32| CobId(word).identifier().map(CanId::number);
        assert_eq!(of(0x0000_0185), Some(0x185));
        assert_eq!(of(CobId::NO_REMOTE_REQUEST | 0x185), Some(0x185));
        assert_eq!(of(CobId(0x185).invalidated().0), None);
        assert_eq!([0x2000_0185, 0x0000_0800, 0x0001_0185].map(of), [None; 3], "29 bits");
        assert_eq!(CobId(0xC000_0185).number(), 0x185);
    }

    #[test]
    fn identifiers_are_those_of_the_predefined_connection_set() {
        let node = NodeId::new(5).unwrap();
        let table = [
            (Cob::Nmt, 0x000),
            (Cob::Sync, 0x080),
            (Cob::Emergency(node), 0x085),
            (Cob::Tpdo1(node), 0x185),
            (Cob::Rpdo1(node), 0x205),
            (Cob::SdoResponse(node), 0x585),
            (Cob::SdoRequest(node), 0x605),
            (Cob::Heartbeat(node), 0x705),
        ];
        for (cob, number) in table {
            assert_eq!(CanId::from(cob).number(), number);
        }
    }

    #[test]
    fn every_identifier_means_one_object_or_is_refused() {
        let known = (0..=0x7FF)
            .map(|number| CanId::standard(number).unwrap())
            .filter(|&id| match Cob::try_from(id) {
                Ok(cob) => CanId::from(cob) == id,
                Err(error) => {
                    assert_eq!(error, CobError(id));
                    false
                }
            })
            .count();
        assert_eq!(known, 2 + 6 * 127, "NMT, SYNC and six objects of 127 nodes");
        assert!(Cob::try_from(CanId::extended(0x181).unwrap()).is_err());
    }
}
