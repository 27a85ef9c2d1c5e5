//! The state of a bus as the master sees it: bus-off, nodes that nobody configured, and turns for SDO.

use masseter_can::canopen::NodeId;
use masseter_can::{ErrorState, SendError};
use masseter_shared::geometry::AXES;

/// Memory of a bus.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BusMonitor {
    /// Whether the master's controller is in bus-off.
    is_off: bool,
    /// Whether any drive was ever received.
    has_drives: bool,
    /// The axis whose SDO request was sent last.
    last_served: usize,
    /// Nodes reported as unknown, bit i for node i.
    unknown_nodes: u128,
}

impl BusMonitor {
    /// Takes the error state of the master's controller; returns whether the bus is off, once after a change.
    pub(super) fn set_error_state(&mut self, state: ErrorState) -> Option<bool> {
        let is_off = state == ErrorState::BusOff;
        (std::mem::replace(&mut self.is_off, is_off) != is_off).then_some(is_off)
    }

    /// Whether the master's controller is in bus-off.
    pub(super) fn is_off(self) -> bool {
        self.is_off
    }

    /// A drive was received.
    pub(super) fn note_drive(&mut self) {
        self.has_drives = true;
    }

    /// The axes in the order of their turns for SDO.
    pub(super) fn turns(self) -> impl Iterator<Item = usize> {
        (1..=AXES).map(move |step| (self.last_served + step) % AXES)
    }

    /// An SDO request was sent to an axis.
    pub(super) fn note_served(&mut self, axis: usize) {
        self.last_served = axis;
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
            SendError::Os { .. } => true,
        }
    }
}
