//! Received frames as messages to the master.
//!
//! Decoding only: the master decides the effect of a message.

use masseter_can::canopen::{
    Cob, Emergency, Heartbeat, HeartbeatError, LengthError, NmtState, NodeId, SdoError, SdoResponse,
};
use masseter_can::{PdoMapping, Tpdo1};

/// The contents of an object that the master receives from a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Message {
    Heartbeat(NmtState),
    ProcessData(Tpdo1),
    Emergency(Emergency),
    SdoAnswer(SdoResponse),
    /// Node guarding of somebody else, or a message of a service that the master does not use.
    Foreign,
}

impl Message {
    /// The node that sends an object; none where the master receives no such object.
    pub(super) const fn sender(cob: Cob) -> Option<NodeId> {
        match cob {
            Cob::Heartbeat(node) | Cob::Tpdo1(node) | Cob::Emergency(node) | Cob::SdoResponse(node) => {
                Some(node)
            }
            Cob::Nmt | Cob::Sync | Cob::Rpdo1(_) | Cob::SdoRequest(_) => None,
        }
    }

    /// Decodes the data of an object, process data by that mapping.
    pub(super) fn decode(cob: Cob, data: &[u8], tpdo1: &PdoMapping) -> Result<Self, LengthError> {
        match cob {
            Cob::Heartbeat(_) => match Heartbeat::decode(data) {
                Ok(Heartbeat { state }) => Ok(Self::Heartbeat(state)),
                Err(HeartbeatError::Length(error)) => Err(error),
                Err(HeartbeatError::UnknownState { .. }) => Ok(Self::Foreign),
            },
            Cob::Tpdo1(_) => Tpdo1::decode(data, tpdo1).map(Self::ProcessData),
            Cob::Emergency(_) => Emergency::decode(data).map(Self::Emergency),
            Cob::SdoResponse(_) => match SdoResponse::decode(data) {
                Ok(answer) => Ok(Self::SdoAnswer(answer)),
                Err(SdoError::Length(error)) => Err(error),
                Err(SdoError::UnknownCommand { .. }) => Ok(Self::Foreign),
            },
            _ => Ok(Self::Foreign),
        }
    }
}
