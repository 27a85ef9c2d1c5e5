//! The state of a bus as the master sees it: bus-off, and nodes that nobody configured.

use masseter_can::canopen::NodeId;
use masseter_can::{ErrorState, SendError};

/// Memory of a bus.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BusMonitor {
    is_off: bool,
    /// Whether any drive was ever received.
    has_drives: bool,
    /// Nodes reported as unknown, bit i for node i.
    unknown_nodes: u128,
}

impl BusMonitor {
    /// Whether the master's controller is in bus-off.
    pub(super) fn is_off(self) -> bool {
        self.is_off
    }

    /// Takes the error state of the master's controller; returns whether it is in bus-off now, if that changed.
    pub(super) fn set_error_state(&mut self, state: ErrorState) -> Option<bool> {
        let is_off = state == ErrorState::BusOff;
        let is_changed = is_off != self.is_off;
        self.is_off = is_off;
        is_changed.then_some(is_off)
    }

    /// A drive was received.
    pub(super) fn note_drive(&mut self) {
        self.has_drives = true;
    }

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
            _ => true,
        }
    }
}
