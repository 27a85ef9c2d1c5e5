//! What the end of an attempt does to the ports, the tap and the statistics.

use super::VirtualWire;
use super::attempt::{Attempt, Ending};
use super::confinement::Confinement;
use crate::bus::{ErrorState, Received};
use crate::error_frame::{ErrorKind, ErrorReport};
use crate::faults::NumberedFrame;
use crate::id::CanId;
use crate::tap::{Tapped, TappedFrame};

/// Pause of an error passive transmitter before it may send again, behind the interframe space.
const SUSPEND_BITS: u32 = 8;

impl VirtualWire {
    /// Ends an attempt.
    pub(super) fn end(&mut self, attempt: &Attempt) {
        self.idle_from_ns = attempt.idle_from_ns;
        self.statistics.busy_ns += attempt.idle_from_ns - attempt.start_ns;
        self.statistics.collisions += u64::from(attempt.is_collision());
        if let Some(strike) = attempt.strike {
            self.faults.record(strike);
        }
        match attempt.ending {
            Ending::Received => self.complete(attempt),
            Ending::ReceivedAndRepeated => {
                self.deliver(attempt);
                self.fail(attempt, ErrorKind::Bit);
            }
            Ending::Destroyed(kind) => self.fail(attempt, kind),
        }
        self.suspend_passive(attempt);
        for station in &mut self.stations {
            station.confinement.saw_end(attempt.idle_from_ns);
        }
    }

    /// The frame has arrived, and its senders are done with it.
    fn complete(&mut self, attempt: &Attempt) {
        let end_ns = attempt.end_ns;
        self.deliver(attempt);
        for port in 0..self.stations.len() {
            if attempt.senders.contains(port) {
                self.confine(port, end_ns, Confinement::transmitted);
                if !attempt.babbling.contains(port) {
                    self.stations[port].transmit.remove_most_urgent(attempt.start_ns);
                }
            } else if attempt.losers.contains(port) {
                self.statistics.retransmissions += 1;
                self.transmit_error(port, end_ns);
            }
        }
    }

    /// Hands the frame to all who hear it.
    fn deliver(&mut self, attempt: &Attempt) {
        let time_ns = attempt.received_ns;
        self.statistics.count_frame(time_ns - attempt.queued_ns);
        let frame = self.frame_of(attempt);
        let received = Received { frame, time_ns };
        let queued_ns = Some(attempt.queued_ns);
        self.tap.push(Tapped::Frame(TappedFrame { frame, time_ns, queued_ns }));
        for port in 0..self.stations.len() {
            if attempt.is_from(port) || !self.is_on_bus(port, attempt.start_ns) {
                continue;
            }
            self.confine(port, time_ns, Confinement::received);
            if !self.loses(port, attempt, frame.id()) {
                self.stations[port].receive.push(received);
            }
        }
    }

    /// Whether a fault makes the port lose the frame.
    fn loses(&mut self, port: usize, attempt: &Attempt, id: CanId) -> bool {
        // Receivers choose by numbers of their own, so that one's loss is not the other's.
        let number = self.attempts ^ (port as u64 + 1) << 48;
        self.faults.loses(NumberedFrame { at_ns: attempt.start_ns, port, id, number })
    }

    /// An error frame has ended the attempt; the frame stays queued, to be sent again.
    fn fail(&mut self, attempt: &Attempt, kind: ErrorKind) {
        let is_received = attempt.ending == Ending::ReceivedAndRepeated;
        self.statistics.error_frames += 1;
        self.statistics.unacknowledged += u64::from(kind == ErrorKind::Acknowledge);
        for port in 0..self.stations.len() {
            if attempt.is_from(port) {
                self.statistics.retransmissions += 1;
                self.fail_to_send(port, attempt, kind);
            } else if !is_received && self.is_on_bus(port, attempt.start_ns) {
                self.confine(port, attempt.end_ns, Confinement::receive_error);
            }
        }
    }

    /// Counts the error at a sender. The error frame is tapped once, as the first of them reports it, with what it counts
    /// behind it and before the change of state that it brings.
    fn fail_to_send(&mut self, port: usize, attempt: &Attempt, kind: ErrorKind) {
        let (now_ns, restart_after_ns) = (attempt.end_ns, self.config.restart_after_ns);
        let count = |node: &mut Confinement| match kind {
            ErrorKind::Acknowledge => node.unacknowledged(now_ns, restart_after_ns),
            _ => node.transmit_error(now_ns, restart_after_ns),
        };
        if !(0..port).any(|other| attempt.is_from(other)) {
            let mut counted = self.stations[port].confinement;
            count(&mut counted);
            self.tap.push(Tapped::Error(ErrorReport::new(now_ns, port as u8, kind, counted.status())));
        }
        self.confine(port, now_ns, count);
    }

    fn transmit_error(&mut self, port: usize, now_ns: u64) {
        let restart_after_ns = self.config.restart_after_ns;
        self.confine(port, now_ns, |node| node.transmit_error(now_ns, restart_after_ns));
    }

    /// A passive transmitter pauses.
    fn suspend_passive(&mut self, attempt: &Attempt) {
        for (port, station) in self.stations.iter_mut().enumerate() {
            if attempt.is_from(port) && station.confinement.state() == ErrorState::Passive {
                let pause_ns = self.config.rates.nominal().bits_to_ns(SUSPEND_BITS);
                station.suspended_until_ns = attempt.idle_from_ns + pause_ns;
            }
        }
    }
}
