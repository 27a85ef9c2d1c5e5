//! Seeded faults over any port: all faults except corrupted frames.
//!
//! A frame is lost on reception, delayed or sent twice. A node babbles, is disconnected or is off the bus. A node in
//! bus-off returns after the restart time, like a controller with `restart-ms`, but without the 128 sequences of
//! recessive bits.

use std::ops::Range;

use crate::faults::{Fault, FaultKind, FaultNote, Faults, NumberedFrame};
use crate::{Bus, BusStatus, ErrorState, Frame, ReceiveError, Received, SendError};

/// Frames that may be held back at one time.
const HELD: usize = 64;
/// Transmit error counter of a node in forced bus-off: the least above the limit.
const OFF_TEC: u16 = 256;

/// A fault that needs a wire, not a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("fault {0}: a frame is corrupted on the wire; inject that into a simulated one")]
pub struct NotByPort(pub usize);

/// The faults of one port.
///
/// ```
/// use masseter_can::faults::{Fault, FaultKind};
/// use masseter_can::{Bus, CanId, Frame, PortFaults, VirtualWire};
/// # use masseter_can::{Bitrate, WireConfig};
///
/// # let config = WireConfig {
/// #     bitrate: Bitrate::MAX,
/// #     ports: 2,
/// #     transmit_capacity: 8,
/// #     receive_capacity: 8,
/// #     restart_after_ns: None,
/// # };
/// let loses_one = Fault {
///     number: 0,
///     kind: FaultKind::Lose,
///     from_ns: 0,
///     until_ns: u64::MAX,
///     id: None,
///     port: None,
///     probability: 1.0,
///     count: 1,
/// };
/// let mut faults = PortFaults::new(vec![loses_one], 1, 7, None)?;
/// let mut wire = VirtualWire::new(&config);
/// for byte in [1, 2] {
///     wire.port(0).send(0, Frame::fixed(CanId::standard(0x181)?, [byte]))?;
/// }
/// wire.advance(1_000_000);
/// let received = faults.over(wire.port(1)).receive(1_000_000)?.expect("only the first frame is lost");
/// assert_eq!(received.frame.data(), [2]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct PortFaults {
    faults: Faults,
    port: usize,
    sent: u64,
    received: u64,
    held: Vec<Held>,
    restart_after_ns: Option<u64>,
    off_since_ns: Option<u64>,
}

/// A frame held back.
#[derive(Debug, Clone, Copy)]
struct Held {
    due_ns: u64,
    frame: Frame,
}

impl PortFaults {
    /// The faults of this port; the same seed makes the same choices. After bus-off a port without a restart time stays
    /// off. The port allocates nothing later.
    ///
    /// # Errors
    /// [`NotByPort`] for a fault that corrupts frames.
    pub fn new(
        faults: Vec<Fault>,
        port: usize,
        seed: u64,
        restart_after_ns: Option<u64>,
    ) -> Result<Self, NotByPort> {
        if let Some(fault) = faults.iter().find(|fault| fault.kind == FaultKind::Corrupt) {
            return Err(NotByPort(fault.number));
        }
        let held = Vec::with_capacity(HELD);
        let faults = Faults::new(faults, seed);
        Ok(Self { faults, port, sent: 0, received: 0, held, restart_after_ns, off_since_ns: None })
    }

    /// The port with these faults.
    pub fn over<B: Bus>(&mut self, bus: B) -> Faulty<'_, B> {
        Faulty { faults: self, bus }
    }

    /// The next note on the faults up to `now_ns`.
    pub fn next_note(&mut self, now_ns: u64) -> Option<FaultNote> {
        self.faults.next_note(now_ns)
    }

    /// Sets the time of a fault. A number of no fault has no effect.
    pub fn set_fault_window(&mut self, number: usize, window_ns: Range<u64>) {
        self.faults.set_window(number, window_ns);
    }

    fn numbered(&self, at_ns: u64, frame: &Frame, number: u64) -> NumberedFrame {
        NumberedFrame { at_ns, port: self.port, id: frame.id(), number }
    }

    /// Whether a fault duplicates a frame. Counts the activation.
    fn duplicates(&mut self, now_ns: u64, frame: &Frame, number: u64) -> bool {
        let activation = self.faults.duplicates(self.numbered(now_ns, frame, number));
        activation.inspect(|&activation| self.faults.record(activation)).is_some()
    }

    /// Whether a fault makes the port lose a received frame. Counts the activation.
    fn loses(&mut self, time_ns: u64, frame: &Frame) -> bool {
        let number = self.received;
        self.received += 1;
        self.faults.loses(self.numbered(time_ns, frame, number))
    }

    /// Holds a frame back if a fault delays the frame, and returns whether a fault does.
    fn holds_back(&mut self, now_ns: u64, frame: Frame, number: u64) -> Result<bool, SendError> {
        let delay = self.faults.delays(self.numbered(now_ns, &frame, number));
        let Some((activation, by_ns)) = delay else { return Ok(false) };
        if self.held.len() == HELD {
            return Err(SendError::QueueFull { capacity: HELD });
        }
        self.faults.record(activation);
        self.held.push(Held { due_ns: now_ns.saturating_add(by_ns), frame });
        Ok(true)
    }

    /// Whether the node is off the bus or disconnected at that time.
    fn is_cut_off(&mut self, now_ns: u64) -> bool {
        if let (Some(since_ns), Some(after_ns)) = (self.off_since_ns, self.restart_after_ns)
            && now_ns >= since_ns.saturating_add(after_ns)
        {
            self.off_since_ns = None;
        }
        self.faults.begin_disconnections(now_ns);
        if self.off_since_ns.is_none()
            && let Some(activation) = self.faults.puts_off(now_ns, self.port)
        {
            self.faults.record(activation);
            self.off_since_ns = Some(now_ns);
            self.held.clear();
        }
        self.off_since_ns.is_some() || self.faults.is_disconnected(now_ns, self.port)
    }

    /// The babbled frame of the node at that time.
    fn babbled(&mut self, now_ns: u64) -> Option<Frame> {
        let (activation, frame) = self.faults.makes_babble(now_ns, self.port)?;
        self.faults.record(activation);
        Some(frame)
    }

    /// The next delayed frame that is due at that time.
    fn release_held(&mut self, now_ns: u64) -> Option<Frame> {
        let due = self.held.iter().position(|held| held.due_ns <= now_ns)?;
        Some(self.held.remove(due).frame)
    }
}

/// A port with faults.
#[derive(Debug)]
pub struct Faulty<'a, B> {
    faults: &'a mut PortFaults,
    bus: B,
}

impl<B: Bus> Faulty<'_, B> {
    /// Sends babbled and delayed frames. A frame that the port refuses is lost.
    fn send_own(&mut self, now_ns: u64) {
        let babbled = self.faults.babbled(now_ns);
        for frame in babbled.into_iter().chain(std::iter::from_fn(|| self.faults.release_held(now_ns))) {
            let _ = self.bus.send(now_ns, frame);
        }
    }
}

impl<B: Bus> Bus for Faulty<'_, B> {
    fn send(&mut self, now_ns: u64, frame: Frame) -> Result<(), SendError> {
        if self.faults.is_cut_off(now_ns) {
            if self.faults.off_since_ns.is_some() {
                return Err(SendError::BusOff { tec: OFF_TEC });
            }
            // A disconnected controller keeps a frame until its queue is full; here it is full at once.
            return Err(SendError::QueueFull { capacity: 0 });
        }
        self.send_own(now_ns);
        let number = self.faults.sent;
        self.faults.sent += 1;
        if self.faults.holds_back(now_ns, frame, number)? {
            return Ok(());
        }
        self.bus.send(now_ns, frame)?;
        if self.faults.duplicates(now_ns, &frame, number) {
            // The frame itself is queued, so a copy without room is no failure of the sender.
            let _ = self.bus.send(now_ns, frame);
        }
        Ok(())
    }

    fn receive(&mut self, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        let is_cut_off = self.faults.is_cut_off(now_ns);
        if !is_cut_off {
            self.send_own(now_ns);
        }
        // Each turn takes a frame from the port, so the loop ends with the last arrived frame.
        loop {
            let received = self.bus.receive(now_ns)?;
            let Some(Received { frame, time_ns }) = received else { return Ok(None) };
            let is_lost = self.faults.loses(time_ns, &frame);
            if !is_cut_off && !is_lost {
                return Ok(received);
            }
        }
    }

    fn status(&self) -> BusStatus {
        let status = self.bus.status();
        if self.faults.off_since_ns.is_some() {
            BusStatus { state: ErrorState::BusOff, tec: OFF_TEC, ..status }
        } else {
            status
        }
    }

    fn unsent(&self) -> usize {
        self.faults.held.len() + self.bus.unsent()
    }
}

#[cfg(test)]
mod tests;
