//! State of a simulated controller: its fault confinement, and its bounded queues, which allocate only in the
//! constructor.

use std::collections::VecDeque;

use crate::{Bitrate, BusStatus, ErrorState, Frame, ReceiveError, SendError, wire::frame_bits};

/// A counter above this makes a node error passive.
const ACTIVE_MAX: u16 = 127;
/// A transmit error counter above this takes a node off the bus.
const PASSIVE_MAX: u16 = 255;
const TRANSMIT_ERROR: u16 = 8;
/// Receive counter of a passive receiver after a success; the standard allows 119 to 127.
const RECEIVE_AFTER_SUCCESS: u16 = 119;
/// Sequences of 11 recessive bits that lead back from bus-off.
const RECOVERY_SEQUENCES: u64 = 128;
/// Bits of such a sequence: also acknowledge delimiter, end of frame and intermission of a frame.
pub(super) const SEQUENCE_BITS: u32 = 11;

/// Fault confinement of one port: error counters, error states and the way back from bus-off (ISO 11898-1, 12.1.4).
/// Counting rules are those of the Bosch specification 2.0, chapter 8.
///
/// The receiver's +8 for a dominant bit behind its own error flag is not counted. That rule distinguishes the
/// disturbing node from the others, and a simulated receiver never disturbs by itself.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Confinement {
    tec: u16,
    rec: u16,
    off: Option<Off>,
}

/// Off the bus.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Off {
    /// Time of the controller's restart by the host, past or future; `None` without a restart.
    restart_ns: Option<u64>,
    /// Recessive sequences still to be seen after that.
    sequences: u64,
    /// End of the search for sequences so far.
    seen_to_ns: u64,
}

impl Confinement {
    pub(super) const fn status(&self) -> BusStatus {
        BusStatus { state: self.state(), tec: self.tec, rec: self.rec }
    }

    pub(super) const fn is_off(&self) -> bool {
        self.off.is_some()
    }

    pub(super) const fn state(&self) -> ErrorState {
        if self.is_off() {
            ErrorState::BusOff
        } else if self.tec > ACTIVE_MAX || self.rec > ACTIVE_MAX {
            ErrorState::Passive
        } else {
            ErrorState::Active
        }
    }

    /// Counts a sent frame. The counters of a node off the bus do not change.
    pub(super) const fn transmitted(&mut self) {
        self.tec = self.tec.saturating_sub(1);
    }

    /// Counts a received frame.
    pub(super) const fn received(&mut self) {
        self.rec = if self.rec > ACTIVE_MAX { RECEIVE_AFTER_SUCCESS } else { self.rec.saturating_sub(1) };
    }

    /// Counts an error of the transmitter. A controller beyond 255 leaves the bus until `restart_ns`.
    pub(super) fn transmit_error(&mut self, now_ns: u64, restart_after_ns: Option<u64>) {
        self.tec += TRANSMIT_ERROR;
        if self.tec > PASSIVE_MAX {
            self.leave_bus(now_ns, restart_after_ns);
        }
    }

    /// Counts a missing acknowledgement. A passive node does not count it, so that a lone node stays on the bus.
    pub(super) fn unacknowledged(&mut self, now_ns: u64, restart_after_ns: Option<u64>) {
        if self.state() == ErrorState::Active {
            self.transmit_error(now_ns, restart_after_ns);
        }
    }

    /// Counts an error of the receiver.
    pub(super) fn receive_error(&mut self) {
        self.rec = (self.rec + 1).min(PASSIVE_MAX);
    }

    /// Puts the controller off the bus at once.
    pub(super) fn leave_bus(&mut self, now_ns: u64, restart_after_ns: Option<u64>) {
        self.tec = self.tec.max(PASSIVE_MAX + 1);
        let restart_ns = restart_after_ns.map(|after_ns| now_ns.saturating_add(after_ns));
        self.off = Some(Off { restart_ns, sequences: RECOVERY_SEQUENCES, seen_to_ns: now_ns });
    }

    /// Time of the return to the bus if the wire stays idle and 11 bits take `sequence_ns`. `None` on the bus, or
    /// without a restart.
    pub(super) fn back_at_ns(&self, sequence_ns: u64) -> Option<u64> {
        let off = self.off?;
        Some(off.seen_to_ns.max(off.restart_ns?).saturating_add(off.sequences * sequence_ns))
    }

    /// Notes an idle wire until `idle_until_ns`, from the end of the last search.
    pub(super) fn saw_idle(&mut self, idle_until_ns: u64, sequence_ns: u64) {
        let Some(off) = &mut self.off else { return };
        let Some(restart_ns) = off.restart_ns else { return };
        let from_ns = off.seen_to_ns.max(restart_ns);
        let seen = idle_until_ns.saturating_sub(from_ns) / sequence_ns;
        if seen > 0 {
            off.sequences = off.sequences.saturating_sub(seen);
            off.seen_to_ns = from_ns + seen * sequence_ns;
        }
    }

    /// Notes the end of a frame or an error frame, with the sequence that ends both.
    pub(super) fn saw_end(&mut self, idle_from_ns: u64) {
        if let Some(off) = &mut self.off {
            if off.restart_ns.is_some_and(|restart_ns| restart_ns <= idle_from_ns) {
                off.sequences = off.sequences.saturating_sub(1);
            }
            off.seen_to_ns = off.seen_to_ns.max(idle_from_ns);
        }
    }

    /// Lets the node take part again, with both counters at 0.
    pub(super) fn come_back(&mut self) {
        *self = Self::default();
    }
}

/// A frame waiting for the wire.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) struct Queued {
    pub(super) frame: Frame,
    /// Duration on the wire with interframe space, computed once, because arbitration needs the value many times.
    pub(super) duration_ns: u64,
    pub(super) since_ns: u64,
}

impl Queued {
    pub(super) fn new(frame: Frame, bitrate: Bitrate, since_ns: u64) -> Self {
        Self { frame, duration_ns: bitrate.bits_to_ns(frame_bits(&frame)), since_ns }
    }
}

/// Frames in the order of priority; frames of one identifier in the order of arrival.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct TransmitQueue {
    pub(super) frames: Vec<Queued>,
    capacity: usize,
}

impl TransmitQueue {
    pub(super) fn new(capacity: usize) -> Self {
        Self { frames: Vec::with_capacity(capacity), capacity }
    }

    pub(super) fn push(&mut self, queued: Queued) -> Result<(), SendError> {
        if self.frames.len() == self.capacity {
            return Err(SendError::QueueFull { capacity: self.capacity });
        }
        let place = self.frames.partition_point(|other| other.frame.id() <= queued.frame.id());
        self.frames.insert(place, queued);
        Ok(())
    }

    /// Arrival of the frame that waits longest.
    pub(super) fn earliest_ns(&self) -> Option<u64> {
        self.frames.iter().map(|queued| queued.since_ns).min()
    }

    /// The most urgent frame queued up to that time.
    pub(super) fn most_urgent(&self, at_ns: u64) -> Option<&Queued> {
        self.frames.iter().find(|queued| queued.since_ns <= at_ns)
    }

    /// Removes the frame.
    pub(super) fn remove_most_urgent(&mut self, at_ns: u64) {
        if let Some(place) = self.frames.iter().position(|queued| queued.since_ns <= at_ns) {
            self.frames.remove(place);
        }
    }
}

/// Received items that are not fetched yet, oldest first. An item that does not fit is lost and counted.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct ReceiveQueue<T> {
    /// Items with their times of arrival, ns.
    arrived: VecDeque<(u64, T)>,
    capacity: usize,
    lost: u64,
}

impl<T> ReceiveQueue<T> {
    pub(super) fn new(capacity: usize) -> Self {
        Self { arrived: VecDeque::with_capacity(capacity), capacity, lost: 0 }
    }

    pub(super) fn push(&mut self, time_ns: u64, item: T) {
        if self.arrived.is_empty() {
            // An empty queue starts at its front again, because the other entries of a long queue are not in the cache.
            self.arrived.clear();
        }
        if self.arrived.len() == self.capacity {
            self.lost += 1;
        } else {
            self.arrived.push_back((time_ns, item));
        }
    }

    /// The oldest item that has arrived by then. A report of losses comes first, once.
    pub(super) fn pop(&mut self, now_ns: u64) -> Result<Option<T>, ReceiveError> {
        match std::mem::take(&mut self.lost) {
            0 if self.arrived.front().is_some_and(|(time_ns, _)| *time_ns <= now_ns) => {
                Ok(self.arrived.pop_front().map(|(_, item)| item))
            }
            0 => Ok(None),
            lost => Err(ReceiveError::Overrun { lost }),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn sixteen_errors_make_a_transmitter_passive_and_thirty_two_take_it_off_the_bus() {
        let mut node = Confinement::default();
        let states: Vec<_> = (0..32)
            .map(|_| {
                node.transmit_error(0, None);
                node.state()
            })
            .collect();
        assert_eq!(states[..15], [ErrorState::Active; 15]);
        assert_eq!(states[15..31], [ErrorState::Passive; 16]);
        assert_eq!(states[31], ErrorState::BusOff);
    }

    #[test]
    fn a_success_after_being_passive_makes_a_receiver_active_again() {
        let mut node = Confinement::default();
        (0..200).for_each(|_| node.receive_error());
        assert_eq!(node.status(), BusStatus { state: ErrorState::Passive, tec: 0, rec: 200 });
        node.received();
        assert_eq!(node.status(), BusStatus { state: ErrorState::Active, tec: 0, rec: 119 });
    }

    #[test]
    fn missing_acknowledgement_alone_leads_no_further_than_passive() {
        let mut node = Confinement::default();
        (0..1000).for_each(|_| node.unacknowledged(0, None));
        assert_eq!(node.status(), BusStatus { state: ErrorState::Passive, tec: 128, rec: 0 });
    }

    #[test]
    fn a_node_in_bus_off_waits_for_its_restart_and_then_for_128_sequences() {
        const SEQUENCE_NS: u64 = 11_000;
        let mut node = Confinement::default();
        node.leave_bus(1000, None);
        assert_eq!(node.back_at_ns(SEQUENCE_NS), None, "without a restart");
        let mut node = Confinement::default();
        node.leave_bus(1000, Some(2000));
        assert_eq!(node.back_at_ns(SEQUENCE_NS), Some(3000 + 128 * SEQUENCE_NS));
        node.saw_idle(3000 + 100 * SEQUENCE_NS + 5, SEQUENCE_NS);
        assert_eq!(node.back_at_ns(SEQUENCE_NS), Some(3000 + 128 * SEQUENCE_NS));
        node.saw_end(2_000_000);
        assert_eq!(
            node.back_at_ns(SEQUENCE_NS),
            Some(2_000_000 + 27 * SEQUENCE_NS),
            "a frame ends with one more"
        );
        node.come_back();
        assert_eq!(node.status(), BusStatus { state: ErrorState::Active, tec: 0, rec: 0 });
    }

    proptest! {
        #[test]
        fn the_state_is_that_of_the_counters(steps in prop::collection::vec(0_u8..4, 0..2000)) {
            let mut node = Confinement::default();
            for step in steps {
                let before = node.status();
                match step {
                    0 => node.transmitted(),
                    1 => node.received(),
                    2 => node.receive_error(),
                    _ => node.transmit_error(0, None),
                }
                let BusStatus { state, tec, rec } = node.status();
                prop_assert!(tec <= before.tec + 8 && rec <= before.rec + 1);
                let expected = match (tec, rec) {
                    (256.., _) => ErrorState::BusOff,
                    (128.., _) | (_, 128..) => ErrorState::Passive,
                    _ => ErrorState::Active,
                };
                prop_assert_eq!(state, expected);
                if state == ErrorState::BusOff {
                    break;
                }
            }
        }
    }
}
