//! A cycle's path from the plant's deadline to the command on the wire, joined from messages of both processes.

use masseter_shared::messages::{Reading, State};

use super::hops::{Hop, HopTimes};

/// Times of a reading.
#[allow(clippy::struct_field_names, reason = "the unit")]
#[derive(Debug, Clone, Copy)]
pub(super) struct Sampled {
    due_ns: u64,
    woke_ns: u64,
    sampled_ns: u64,
    complete_ns: u64,
    published_ns: u64,
    stalled_when_due_ns: u64,
}

impl Sampled {
    pub(super) fn new(reading: &Reading, stalled_when_due_ns: u64) -> Self {
        let Reading { due_ns, woke_ns, sampled_ns, complete_ns, published_ns, .. } = *reading;
        Self { due_ns, woke_ns, sampled_ns, complete_ns, published_ns, stalled_when_due_ns }
    }
}

/// Times of the controller's work.
#[derive(Debug, Clone, Copy)]
pub(super) struct Computed {
    pub(super) reading_cycle: u64,
    due_ns: u64,
    woke_ns: u64,
    received_ns: u64,
    solved_ns: u64,
    commanded_ns: u64,
    stalled_when_due_ns: u64,
}

impl Computed {
    pub(super) fn new(state: &State, stalled_when_due_ns: u64) -> Self {
        let State { reading_cycle, due_ns, woke_ns, received_ns, solved_ns, commanded_ns, .. } = *state;
        Self { reading_cycle, due_ns, woke_ns, received_ns, solved_ns, commanded_ns, stalled_when_due_ns }
    }
}

/// Times of the command in the plant.
#[allow(clippy::struct_field_names, reason = "the unit")]
#[derive(Debug, Clone, Copy)]
pub(super) struct Sent {
    pub(super) received_ns: u64,
    pub(super) sent_ns: u64,
    /// The plant's counter at the deadline of the reading that reports them.
    pub(super) stalled_when_next_due_ns: u64,
}

/// The parts of a controller's cycle that were found so far.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Parts {
    pub(super) computed: Option<Computed>,
    pub(super) published_ns: Option<u64>,
    pub(super) sent: Option<Sent>,
    /// The controller's counter at its next deadline.
    pub(super) stalled_when_next_due_ns: Option<u64>,
}

/// The whole path.
#[derive(Debug, Clone, Copy)]
pub(super) struct CyclePath {
    /// The controller's cycle.
    pub(super) cycle: u64,
    pub(super) due_ns: u64,
    pub(super) total_ns: u64,
    pub(super) hops_ns: HopTimes,
    pub(super) stalled_ns: u64,
}

impl CyclePath {
    /// None while a part is missing.
    pub(super) fn new(cycle: u64, sampled: &Sampled, parts: &Parts) -> Option<Self> {
        let (computed, sent) = (parts.computed?, parts.sent?);
        let plant_ns = passed_ns(sampled.stalled_when_due_ns, sent.stalled_when_next_due_ns);
        let controller_ns = passed_ns(computed.stalled_when_due_ns, parts.stalled_when_next_due_ns?);
        Some(Self {
            cycle,
            due_ns: sampled.due_ns,
            total_ns: passed_ns(sampled.due_ns, sent.sent_ns),
            hops_ns: hops_ns(sampled, &computed, parts.published_ns?, &sent),
            stalled_ns: plant_ns.saturating_add(controller_ns),
        })
    }
}

fn hops_ns(sampled: &Sampled, computed: &Computed, published_ns: u64, sent: &Sent) -> HopTimes {
    // Until it wakes, the controller does not wait for the reading.
    let awaited_ns = sampled.published_ns.max(computed.woke_ns);
    Hop::ALL.map(|hop| match hop {
        Hop::PlantWakeUp => passed_ns(sampled.due_ns, sampled.woke_ns),
        Hop::ProcessData => passed_ns(sampled.sampled_ns, sampled.complete_ns),
        Hop::ReadingPublication => passed_ns(sampled.complete_ns, sampled.published_ns),
        Hop::ControllerWakeUp => passed_ns(computed.due_ns, computed.woke_ns),
        Hop::ReadingPickUp => passed_ns(awaited_ns, computed.received_ns),
        Hop::ForwardKinematics => passed_ns(computed.received_ns, computed.solved_ns),
        Hop::Control => passed_ns(computed.solved_ns, computed.commanded_ns),
        Hop::CommandPublication => passed_ns(computed.commanded_ns, published_ns),
        Hop::CommandTransport => passed_ns(published_ns, sent.received_ns),
        Hop::CommandToWire => passed_ns(sent.received_ns, sent.sent_ns),
    })
}

/// 0 where the two are in the wrong order, as in a damaged recording.
fn passed_ns(from_ns: u64, to_ns: u64) -> u64 {
    to_ns.saturating_sub(from_ns)
}
