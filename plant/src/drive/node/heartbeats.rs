//! Heartbeats: the drive's own (1017h) and those it consumes (1016h).
//!
//! The module only decides when a heartbeat is due or lost; the node sends and reacts.

use masseter_can::canopen::NodeId;
use masseter_runtime::clock::MILLISECOND_NS;

use crate::drive::dictionary::{CONSUMED, Objects, names};

/// The drive's own heartbeat.
#[derive(Debug, Clone)]
pub(super) struct Producer {
    interval_ns: u64,
    next_ns: u64,
}

impl Producer {
    /// The first heartbeat is due at `first_ns`.
    pub(super) fn new(objects: &Objects, first_ns: u64) -> Self {
        Self {
            interval_ns: u64::from(objects.get(names::PRODUCER_HEARTBEAT_TIME_MS)) * MILLISECOND_NS,
            next_ns: first_ns,
        }
    }

    /// Applies a new interval, which begins at `now_ns`.
    pub(super) fn configure(&mut self, objects: &Objects, now_ns: u64) {
        *self = Self::new(objects, now_ns);
        self.next_ns += self.interval_ns;
    }

    /// Whether a heartbeat is due. The next one is due an interval later; missed ones are skipped.
    pub(super) fn is_due(&mut self, now_ns: u64) -> bool {
        if self.interval_ns == 0 || now_ns < self.next_ns {
            return false;
        }
        let missed = (now_ns - self.next_ns) / self.interval_ns;
        self.next_ns += (missed + 1) * self.interval_ns;
        true
    }
}

/// Bits of the time in an entry of 1016h, ms. The byte above is the node id, the highest byte is reserved.
const TIME_BITS: u32 = 0xFFFF;

/// The node of an entry of 1016h; none without a time or with an invalid node id, which leaves the entry unused.
pub(super) fn consumed_node(word: u32) -> Option<NodeId> {
    NodeId::new((word >> 16) as u8).ok().filter(|_| word & TIME_BITS > 0)
}

/// A consumed heartbeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct ConsumedHeartbeat {
    node: Option<NodeId>,
    timeout_ns: u64,
    /// None before the first heartbeat, and once it is lost.
    heard_ns: Option<u64>,
    is_lost: bool,
}

/// The consumed heartbeats.
#[derive(Debug, Clone)]
pub(super) struct Consumer {
    entries: [ConsumedHeartbeat; CONSUMED],
}

impl Consumer {
    /// The configured heartbeats, none received yet.
    pub(super) fn new(objects: &Objects) -> Self {
        let entries = std::array::from_fn(|place| {
            let word = objects.words[names::CONSUMER_HEARTBEAT_TIME.place + place];
            let timeout_ns = u64::from(word & TIME_BITS) * MILLISECOND_NS;
            ConsumedHeartbeat { node: consumed_node(word), timeout_ns, heard_ns: None, is_lost: false }
        });
        Self { entries }
    }

    /// A heartbeat arrived: supervision begins with the first one, and again after a loss.
    pub(super) fn hear(&mut self, now_ns: u64, node: NodeId) {
        for entry in &mut self.entries {
            if entry.node == Some(node) {
                (entry.heard_ns, entry.is_lost) = (Some(now_ns), false);
            }
        }
    }

    /// Whether a heartbeat was lost since the last call.
    pub(super) fn loses(&mut self, now_ns: u64) -> bool {
        let mut loses = false;
        for entry in &mut self.entries {
            let is_late = |heard_ns: &mut u64| now_ns.saturating_sub(*heard_ns) > entry.timeout_ns;
            if entry.heard_ns.take_if(is_late).is_some() {
                entry.is_lost = true;
                loses = true;
            }
        }
        loses
    }

    /// Whether no heartbeat is missing.
    pub(super) fn hears_all(&self) -> bool {
        self.entries.iter().all(|entry| !entry.is_lost)
    }
}
