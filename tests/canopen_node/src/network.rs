//! Network management: states, boot-up, the node's own heartbeat and the heartbeats that it watches.

use std::collections::BTreeMap;

use crate::dictionary::Dictionary;

const MILLISECOND_NS: u64 = 1_000_000;
/// The time from the boot loader's message to the application's.
const BOOT_LOADER_NS: u64 = 100 * MILLISECOND_NS;

/// The state, by its number in a heartbeat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NetworkState {
    /// No application runs yet: the node is deaf.
    Booting = 0x00,
    Stopped = 0x04,
    Operational = 0x05,
    PreOperational = 0x7F,
}

/// Network management of the node.
#[derive(Debug)]
pub(crate) struct Network {
    pub(crate) state: NetworkState,
    application_at_ns: u64,
    boot_ups: u32,
    beaten_ns: u64,
    /// The last heartbeats of watched nodes; supervision begins with the first one.
    heard: BTreeMap<u8, u64>,
}

impl Network {
    /// A node that starts at that time.
    pub(crate) fn start(now_ns: u64, has_boot_loader: bool) -> Self {
        let (boot_ups, wait_ns) = if has_boot_loader { (2, BOOT_LOADER_NS) } else { (1, 0) };
        Self {
            state: NetworkState::Booting,
            application_at_ns: now_ns + wait_ns,
            boot_ups,
            beaten_ns: now_ns,
            heard: BTreeMap::new(),
        }
    }

    /// The data of the boot-up message or heartbeat that is due.
    pub(crate) fn beat(&mut self, dictionary: &Dictionary, now_ns: u64) -> Option<u8> {
        if self.boot_ups > 0 {
            let is_last = self.boot_ups == 1;
            if is_last && now_ns < self.application_at_ns {
                return None;
            }
            self.boot_ups -= 1;
            if is_last {
                (self.state, self.beaten_ns) = (NetworkState::PreOperational, now_ns);
            }
            return Some(NetworkState::Booting as u8);
        }
        let period_ns = dictionary.number((0x1017, 0)) as u64 * MILLISECOND_NS;
        if period_ns == 0 || now_ns < self.beaten_ns + period_ns {
            return None;
        }
        self.beaten_ns = now_ns;
        Some(self.state as u8)
    }

    /// Takes the heartbeat of another node.
    pub(crate) fn hear(&mut self, node: u8, now_ns: u64) {
        self.heard.insert(node, now_ns);
    }

    /// Whether a watched node has fallen silent. Each silence is told once.
    pub(crate) fn misses_a_heartbeat(&mut self, dictionary: &Dictionary, now_ns: u64) -> bool {
        let mut missed = false;
        for subindex in dictionary.subindices(0x1016) {
            let watched = dictionary.number((0x1016, subindex));
            let (node, limit_ns) = ((watched >> 16) as u8, (watched & 0xFFFF) as u64 * MILLISECOND_NS);
            let is_silent = |heard_ns: &u64| limit_ns > 0 && now_ns > heard_ns + limit_ns;
            if self.heard.get(&node).is_some_and(is_silent) {
                self.heard.remove(&node);
                missed = true;
            }
        }
        missed
    }
}
