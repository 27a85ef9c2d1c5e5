//! The end of a transmission: changes of the ports and the tap.

use super::confinement::Confinement;
use super::nodes::Nodes;
use super::transmission::{Transmission, TransmissionOutcome};
use crate::bus::{ErrorState, Received};
use crate::error_frame::{ErrorKind, ErrorReport};
use crate::faults::NumberedFrame;
use crate::tap::{Tapped, TappedFrame};

/// Pause of an error passive transmitter before it may send again, behind the interframe space.
const SUSPEND_BITS: u32 = 8;

/// A transmission that has just ended.
pub(super) struct Completion<'a> {
    pub(super) nodes: &'a mut Nodes,
    pub(super) transmission: &'a Transmission,
}

impl Completion<'_> {
    /// Changes ports and tap.
    pub(super) fn apply(&mut self) {
        let transmission = self.transmission;
        self.nodes.idle_from_ns = transmission.idle_from_ns;
        if let Some(activation) = transmission.activation {
            self.nodes.faults.record(activation);
        }
        match transmission.outcome {
            TransmissionOutcome::Received => self.complete(),
            TransmissionOutcome::ReceivedAndRepeated => {
                self.deliver();
                self.fail(ErrorKind::Bit);
            }
            TransmissionOutcome::Destroyed(kind) => self.fail(kind),
        }
        self.suspend_passive();
        for station in &mut self.nodes.stations {
            station.confinement.saw_end(transmission.idle_from_ns);
        }
    }

    /// The frame has arrived, and its senders are done with it.
    fn complete(&mut self) {
        let transmission = self.transmission;
        let end_ns = transmission.end_ns;
        self.deliver();
        for port in 0..self.nodes.stations.len() {
            if transmission.arbitration.senders.contains(port) {
                self.nodes.confine(port, end_ns, Confinement::transmitted);
                if !transmission.arbitration.babbling.contains(port) {
                    self.nodes.stations[port].transmit.remove_most_urgent(transmission.start_ns);
                }
            } else if transmission.arbitration.losers.contains(port) {
                self.transmit_error(port, end_ns);
            }
        }
    }

    /// Delivers the frame to all receivers.
    fn deliver(&mut self) {
        let transmission = self.transmission;
        let time_ns = transmission.received_ns;
        let &Transmission { frame, queued_ns, .. } = transmission;
        let (received, queued_ns) = (Received { frame, time_ns }, Some(queued_ns));
        self.nodes.tap.push(time_ns, Tapped::Frame(TappedFrame { frame, time_ns, queued_ns }));
        for port in 0..self.nodes.stations.len() {
            if transmission.is_from(port) || !self.nodes.is_on_bus(port, transmission.start_ns) {
                continue;
            }
            self.nodes.confine(port, time_ns, Confinement::received);
            if !self.loses(port) {
                self.nodes.stations[port].receive.push(time_ns, received);
            }
        }
    }

    /// Whether a fault makes the port lose the frame.
    fn loses(&mut self, port: usize) -> bool {
        let (at_ns, id) = (self.transmission.start_ns, self.transmission.frame.id());
        // Every receiver has numbers of its own, so receivers lose frames independently.
        let number = self.nodes.transmissions ^ (port as u64 + 1) << 48;
        self.nodes.faults.loses(NumberedFrame { at_ns, port, id, number })
    }

    /// An error frame has ended the transmission; the frame stays queued, to be sent again.
    fn fail(&mut self, kind: ErrorKind) {
        let transmission = self.transmission;
        let is_received = transmission.outcome == TransmissionOutcome::ReceivedAndRepeated;
        for port in 0..self.nodes.stations.len() {
            if transmission.is_from(port) {
                self.fail_to_send(port, kind);
            } else if !is_received && self.nodes.is_on_bus(port, transmission.start_ns) {
                self.nodes.confine(port, transmission.end_ns, Confinement::receive_error);
            }
        }
    }

    /// Counts the error at a sender. The tap gets the error frame once, with the counters of the first sender after
    /// the error, and before the resulting change of state.
    fn fail_to_send(&mut self, port: usize, kind: ErrorKind) {
        let transmission = self.transmission;
        let (now_ns, restart_after_ns) = (transmission.end_ns, self.nodes.config.restart_after_ns);
        let count = |node: &mut Confinement| match kind {
            ErrorKind::Acknowledge => node.unacknowledged(now_ns, restart_after_ns),
            _ => node.transmit_error(now_ns, restart_after_ns),
        };
        if !(0..port).any(|other| transmission.is_from(other)) {
            let mut counted = self.nodes.stations[port].confinement;
            count(&mut counted);
            self.nodes
                .tap
                .push(now_ns, Tapped::Error(ErrorReport::new(now_ns, port as u8, kind, counted.status())));
        }
        self.nodes.confine(port, now_ns, count);
    }

    fn transmit_error(&mut self, port: usize, now_ns: u64) {
        let restart_after_ns = self.nodes.config.restart_after_ns;
        self.nodes.confine(port, now_ns, |node| node.transmit_error(now_ns, restart_after_ns));
    }

    /// A passive transmitter pauses.
    fn suspend_passive(&mut self) {
        let transmission = self.transmission;
        for (port, station) in self.nodes.stations.iter_mut().enumerate() {
            if transmission.is_from(port) && station.confinement.state() == ErrorState::Passive {
                let pause_ns = self.nodes.config.bitrate.bits_to_ns(SUSPEND_BITS);
                station.suspended_until_ns = transmission.idle_from_ns + pause_ns;
            }
        }
    }
}
