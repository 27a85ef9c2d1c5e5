//! The messages of a plan, before and after the analysis.

use crate::id::CanId;

/// A message that a node sends periodically.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PeriodicMessage {
    /// Name of the message in tables.
    pub name: String,
    /// Identifier, which is also the priority.
    pub id: CanId,
    /// Data bytes.
    pub data_length: u32,
    /// The least time between two instances, ns.
    pub period_ns: u64,
    /// Latest arrival after the begin of the period, ns.
    pub deadline_ns: u64,
    /// The message whose arrival releases this one; without a release, the begin of the period releases it.
    pub release: Option<Release>,
}

/// The release of a message by another's arrival.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Release {
    /// The other message, which is more urgent.
    pub by: CanId,
    /// The most time from that arrival to the release, ns.
    pub within_ns: u64,
}

/// A message with the results of the analysis.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlannedMessage {
    /// The message.
    pub message: PeriodicMessage,
    /// Longest time on the wire, interframe space included, ns.
    pub transmission_ns: u64,
    /// The latest release after the begin of the period, ns; `None` where there is no bound.
    pub jitter_ns: Option<u64>,
    /// Longest time from release to arrival, ns; `None` where there is no bound.
    pub response_ns: Option<u64>,
}

impl PlannedMessage {
    /// Whether the message always meets its deadline.
    pub fn fits(&self) -> bool {
        self.arrival_ns().is_some_and(|arrival_ns| arrival_ns <= self.message.deadline_ns)
    }

    /// The latest arrival after the begin of the period, ns; `None` where there is no bound.
    pub fn arrival_ns(&self) -> Option<u64> {
        Some(self.jitter_ns? + self.response_ns?)
    }
}

/// Share of the time that the messages take at worst.
pub(super) fn utilisation(messages: &[PlannedMessage]) -> f64 {
    messages.iter().map(|planned| planned.transmission_ns as f64 / planned.message.period_ns as f64).sum()
}
