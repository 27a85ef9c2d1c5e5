//! Heartbeat and boot-up (CiA 301, 7.2.8.3): a node's NMT state, sent by the node itself.

use super::{Cob, LengthError, NodeId, exactly};
use crate::frame::Frame;

codes! {
    /// State of a node's network management.
    NmtState as u8 {
        /// Just booted: the one boot-up message before pre-operational.
        BootUp = 0x00 "boot_up",
        /// NMT and heartbeat only.
        Stopped = 0x04 "stopped",
        /// Everything, PDOs included.
        Operational = 0x05 "operational",
        /// Everything but PDOs.
        PreOperational = 0x7F "pre_operational",
    }
}

/// One heartbeat (object 1017 sets its period); the first after a reset is the boot-up message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Heartbeat {
    /// State of the node that sends it.
    pub state: NmtState,
}

/// Data that is no heartbeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum HeartbeatError {
    /// Wrong length.
    #[error(transparent)]
    Length(#[from] LengthError),
    /// A state that CiA 301 does not define; with bit 7 set it may be node guarding, which is not
    /// supported.
    #[error("{code:02X}h is no NMT state of a heartbeat")]
    UnknownState {
        /// The number received.
        code: u8,
    },
}

impl Heartbeat {
    /// The frame in which that node sends it.
    pub fn frame(self, node: NodeId) -> Frame {
        Frame::fixed(Cob::Heartbeat(node).into(), [self.state.code()])
    }

    /// Reads the data byte.
    ///
    /// # Errors
    /// [`HeartbeatError`] for another length than 1 or an unknown state.
    pub fn decode(data: &[u8]) -> Result<Self, HeartbeatError> {
        let [code] = exactly("heartbeat", data)?;
        let state = NmtState::try_from(code).map_err(|_| HeartbeatError::UnknownState { code })?;
        Ok(Self { state })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_bytes_are_states_and_encode_to_themselves() {
        let node = NodeId::new(9).unwrap();
        let known: Vec<u8> = (0..=255)
            .filter(|&code| match Heartbeat::decode(&[code]) {
                Ok(heartbeat) => heartbeat.frame(node).data() == [code],
                Err(error) => {
                    assert_eq!(error, HeartbeatError::UnknownState { code });
                    false
                }
            })
            .collect();
        assert_eq!(known, [0x00, 0x04, 0x05, 0x7F]);
    }

    #[test]
    fn another_length_is_refused() {
        let error = Heartbeat::decode(&[5, 0]).unwrap_err();
        assert_eq!(error.to_string(), "data bytes of heartbeat: 2, expected 1");
    }
}
