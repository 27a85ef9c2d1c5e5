//! Network management commands (CiA 301, 7.2.8).

use super::{Cob, NodeId};
use crate::frame::Frame;

codes! {
    /// A command to a node.
    NmtCommand as u8 {
        /// Enter operational.
        Start = 0x01 "start",
        /// Enter stopped.
        Stop = 0x02 "stop",
        /// Enter pre-operational.
        EnterPreOperational = 0x80 "enter_pre_operational",
        /// Restart the application.
        ResetNode = 0x81 "reset_node",
        /// Restart the communication.
        ResetCommunication = 0x82 "reset_communication",
    }
}

/// The nodes that a command is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NmtTarget {
    /// Every node (node id 0 on the wire).
    All,
    /// One node.
    Node(NodeId),
}

impl NmtTarget {
    /// Whether the command is for that node.
    pub fn includes(self, node: NodeId) -> bool {
        self == Self::All || self == Self::Node(node)
    }
}

/// A network management message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Nmt {
    /// The command.
    pub command: NmtCommand,
    /// The nodes that execute the command.
    pub target: NmtTarget,
}

impl Nmt {
    /// The frame that carries the command.
    pub fn frame(self) -> Frame {
        let target = match self.target {
            NmtTarget::All => 0,
            NmtTarget::Node(node) => node.get(),
        };
        Frame::fixed(Cob::Nmt.into(), [self.command.code(), target])
    }

    /// Reads the data bytes; `None` for another length than 2, an unknown command or a target above 127.
    pub fn decode(data: &[u8]) -> Option<Self> {
        let &[code, target] = data else { return None };
        let command = NmtCommand::try_from(code).ok()?;
        let target = if target == 0 { NmtTarget::All } else { NmtTarget::Node(NodeId::new(target).ok()?) };
        Some(Self { command, target })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoded_bytes_encode_to_the_same_bytes() {
        let mut decoded = 0;
        for (code, target) in (0..=255).flat_map(|code| (0..=255).map(move |target| (code, target))) {
            if let Some(nmt) = Nmt::decode(&[code, target]) {
                assert_eq!(nmt.frame().data(), [code, target]);
                decoded += 1;
            }
        }
        assert_eq!(decoded, 5 * 128, "five commands to all or one of 127 nodes");
    }

    #[test]
    fn another_length_command_or_target_is_refused() {
        let refused: [&[u8]; 5] = [&[], &[1], &[1, 0, 0], &[3, 0], &[1, 128]];
        assert_eq!(refused.map(Nmt::decode), [None; 5]);
    }

    #[test]
    fn a_target_includes_its_nodes_only() {
        let [one, two] = [1, 2].map(|id| NodeId::new(id).unwrap());
        assert!(NmtTarget::All.includes(one));
        assert!(NmtTarget::Node(one).includes(one));
        assert!(!NmtTarget::Node(one).includes(two));
    }
}
