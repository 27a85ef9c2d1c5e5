//! Heartbeats of the drive: its own (object 1017) and those it watches (object 1016).

use masseter_can::canopen::NodeId;
use masseter_shared::clock::MILLISECOND_NS;

use super::dictionary::{Objects, WATCHED, names};

/// When its own heartbeat is due.
#[derive(Debug, Clone)]
pub(super) struct Producer {
    interval_ns: u64,
    next_ns: u64,
}

impl Producer {
    /// The first one at `first_ns`.
    pub(super) fn new(objects: &Objects, first_ns: u64) -> Self {
        Self { interval_ns: u64::from(objects.get(names::HEARTBEAT_MS)) * MILLISECOND_NS, next_ns: first_ns }
    }

    /// Takes up a new interval, which begins at `now_ns`.
    pub(super) fn configure(&mut self, objects: &Objects, now_ns: u64) {
        *self = Self::new(objects, now_ns);
        self.next_ns += self.interval_ns;
    }

    /// Whether one is due; then the next one is an interval later. Those that were missed meanwhile are left out.
    pub(super) fn is_due(&mut self, now_ns: u64) -> bool {
        if self.interval_ns == 0 || now_ns < self.next_ns {
            return false;
        }
        let missed = (now_ns - self.next_ns) / self.interval_ns;
        self.next_ns += (missed + 1) * self.interval_ns;
        true
    }
}

/// Time-out in an entry of object 1016, ms. The node stands in the byte above, and the highest byte is reserved.
const TIME: u32 = 0xFFFF;

/// The node that an entry of object 1016 means; one without a time or with the number of no node is not used.
pub(super) fn watched(word: u32) -> Option<NodeId> {
    NodeId::new((word >> 16) as u8).ok().filter(|_| word & TIME > 0)
}

/// A watched node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Watch {
    node: Option<NodeId>,
    timeout_ns: u64,
    /// `None` before the first heartbeat, and once it is lost.
    heard_ns: Option<u64>,
    is_lost: bool,
}

/// The watched nodes.
#[derive(Debug, Clone)]
pub(super) struct Consumer {
    watches: [Watch; WATCHED],
}

impl Consumer {
    /// As configured, nothing heard.
    pub(super) fn new(objects: &Objects) -> Self {
        let watches = std::array::from_fn(|place| {
            let word = objects.word(names::WATCHED_HEARTBEAT.place() + place);
            let timeout_ns = u64::from(word & TIME) * MILLISECOND_NS;
            Watch { node: watched(word), timeout_ns, heard_ns: None, is_lost: false }
        });
        Self { watches }
    }

    /// A heartbeat came: supervision begins with the first, and after a loss again.
    pub(super) fn hear(&mut self, now_ns: u64, node: NodeId) {
        for watch in &mut self.watches {
            if watch.node == Some(node) {
                (watch.heard_ns, watch.is_lost) = (Some(now_ns), false);
            }
        }
    }

    /// Whether a heartbeat was lost since the last call.
    pub(super) fn loses(&mut self, now_ns: u64) -> bool {
        let mut loses = false;
        for watch in &mut self.watches {
            let is_late = |heard_ns: &mut u64| now_ns.saturating_sub(*heard_ns) > watch.timeout_ns;
            if watch.heard_ns.take_if(is_late).is_some() {
                watch.is_lost = true;
                loses = true;
            }
        }
        loses
    }

    /// Whether no heartbeat is missing.
    pub(super) fn hears_all(&self) -> bool {
        self.watches.iter().all(|watch| !watch.is_lost)
    }
}
