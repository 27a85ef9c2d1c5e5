//! Received frames as messages to the master.
//!
//! Decoding only: the effect of a message is the master's matter.

use masseter_can::Tpdo1;
use masseter_can::canopen::{
    Cob, Emergency, Heartbeat, HeartbeatError, LengthError, NmtState, NodeId, SdoError, SdoResponse,
};

/// A kind of object that the master receives from a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Heartbeat,
    ProcessData,
    Emergency,
    SdoAnswer,
}

impl Kind {
    pub(super) const COUNT: usize = 4;

    /// The kind of an object and its node; none where the master receives no such object.
    pub(super) const fn from_cob(cob: Cob) -> Option<(Self, NodeId)> {
        match cob {
            Cob::Heartbeat(node) => Some((Self::Heartbeat, node)),
            Cob::Tpdo1(node) => Some((Self::ProcessData, node)),
            Cob::Emergency(node) => Some((Self::Emergency, node)),
            Cob::SdoResponse(node) => Some((Self::SdoAnswer, node)),
            Cob::Nmt | Cob::Sync | Cob::Rpdo1(_) | Cob::SdoRequest(_) => None,
        }
    }
}

/// The contents of an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Message {
    Heartbeat(NmtState),
    ProcessData(Tpdo1),
    Emergency(Emergency),
    SdoAnswer(SdoResponse),
    /// Node guarding of somebody else, or an answer of a service that the master does not use.
    Foreign,
}

impl Message {
    /// Decodes the data of an object.
    pub(super) fn decode(kind: Kind, data: &[u8]) -> Result<Self, LengthError> {
        match kind {
            Kind::Heartbeat => match Heartbeat::decode(data) {
                Ok(Heartbeat { state }) => Ok(Self::Heartbeat(state)),
                Err(HeartbeatError::Length(error)) => Err(error),
                Err(HeartbeatError::UnknownState { .. }) => Ok(Self::Foreign),
            },
            Kind::ProcessData => Tpdo1::decode(data).map(Self::ProcessData),
            Kind::Emergency => Emergency::decode(data).map(Self::Emergency),
            Kind::SdoAnswer => match SdoResponse::decode(data) {
                Ok(answer) => Ok(Self::SdoAnswer(answer)),
                Err(SdoError::Length(error)) => Err(error),
                Err(SdoError::UnknownCommand { .. }) => Ok(Self::Foreign),
            },
        }
    }
}
