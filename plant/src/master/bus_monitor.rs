//! The state of a bus as the master sees it: bus-off, nodes that nobody configured, and turns for SDO.

use masseter_can::canopen::NodeId;
use masseter_can::{ErrorState, SendError};
use masseter_model::geometry::AXES;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bus_reports_each_change_once_and_each_stranger_once() {
        let mut bus = BusMonitor::default();
        let states = [
            (ErrorState::Active, None, false),
            (ErrorState::Passive, None, false),
            (ErrorState::BusOff, Some(true), true),
            (ErrorState::BusOff, None, true),
            (ErrorState::Passive, Some(false), false),
            (ErrorState::Active, None, false),
        ];
        for (state, change, is_off) in states {
            assert_eq!(bus.set_error_state(state), change, "{state:?}");
            assert_eq!(bus.is_off(), is_off);
        }
        let strangers = [1, 2, 127, 1, 127, 1, 3, 2].map(|id| bus.is_new_unknown(NodeId::new(id).unwrap()));
        assert_eq!(strangers, [true, true, true, false, false, false, true, false]);
    }

    #[test]
    fn a_refusal_to_send_is_explained_by_bus_off_or_by_drives_that_are_not_there_yet() {
        let mut bus = BusMonitor::default();
        let refusals = [
            SendError::BusOff { tec: 256 },
            SendError::QueueFull { capacity: 9 },
            SendError::Os { errno: 100 },
        ];
        assert_eq!(refusals.each_ref().map(|refusal| bus.is_unexplained(refusal)), [false, false, true]);
        bus.note_drive();
        assert_eq!(refusals.each_ref().map(|refusal| bus.is_unexplained(refusal)), [false, true, true]);
    }

    #[test]
    fn the_axis_served_last_is_the_last_to_be_served_again() {
        let mut bus = BusMonitor::default();
        bus.note_served(3);
        assert_eq!(bus.turns().collect::<Vec<_>>(), [4, 5, 0, 1, 2, 3]);
    }
}
