//! The state of a bus as the master sees it: bus-off, and nodes that nobody configured.

use masseter_can::SendError;
use masseter_can::canopen::NodeId;

/// Memory of a bus.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BusMonitor {
    /// Whether the master's controller is in bus-off.
    pub(super) is_off: bool,
    /// Whether any drive was ever received.
    pub(super) has_drives: bool,
    /// The axis whose SDO request was sent last.
    pub(super) last_served: usize,
    /// Nodes reported as unknown, bit i for node i.
    unknown_nodes: u128,
}

impl BusMonitor {
    /// Whether an unknown node is received for the first time.
    pub(super) fn is_new_unknown(&mut self, id: NodeId) -> bool {
        let bit = 1 << id.get();
        let is_new = self.unknown_nodes & bit == 0;
        self.unknown_nodes |= bit;
        is_new
    }

    /// Whether a refusal to send needs a report of its own. Bus-off has its own; and before any drive is switched on
    /// nobody acknowledges, so that the queue fills up.
    pub(super) fn is_unexplained(self, refusal: &SendError) -> bool {
        match refusal {
            SendError::BusOff { .. } => false,
            SendError::QueueFull { .. } => self.has_drives,
            SendError::Os { .. } => true,
        }
    }
}
