//! Seeded faults over a port: those that need no hand on the wire.
//!
//! Frames get lost on reception, are delayed or sent twice; the node babbles, is disconnected or off the bus. A
//! node put off the bus stays off for the time it is told, as a controller with `restart-ms`; the 128 sequences of
//! recessive bits that a real one then waits for are not waited for.

use crate::can::bus::{Bus, BusStatus, ErrorState, ReceiveError, Received, SendError};
use crate::can::faults::{Fault, FaultKind, FaultNote, Faults};
use crate::can::frame::Frame;

/// Frames that may be held back at one time.
const HELD: usize = 64;
/// Transmit error counter of a node put off the bus: the least above the limit.
const OFF_TEC: u16 = 256;

/// A fault that no port can carry out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("fault {index}: a frame is corrupted on the wire; inject that into a simulated one")]
pub struct NotByPort {
    /// Its place in the list.
    pub index: usize,
}

/// The faults of one port.
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
    /// Those of the faults that concern this port; the same seed makes the same choices. Nothing is allocated
    /// after this.
    ///
    /// # Errors
    /// [`NotByPort`] for a fault that corrupts frames.
    pub fn new(faults: Vec<Fault>, port: usize, seed: u64) -> Result<Self, NotByPort> {
        if let Some(index) = faults.iter().position(|fault| fault.kind == FaultKind::Corrupt) {
            return Err(NotByPort { index });
        }
        let held = Vec::with_capacity(HELD);
        let faults = Faults::new(faults, seed);
        Ok(Self { faults, port, sent: 0, received: 0, held, restart_after_ns: None, off_since_ns: None })
    }

    /// With a node that is back so long after it was put off the bus; without this it stays off.
    #[must_use]
    pub fn restarting_after(self, restart_after_ns: Option<u64>) -> Self {
        Self { restart_after_ns, ..self }
    }

    /// Lets the faults befall that port.
    pub fn over<B: Bus>(&mut self, bus: B) -> Faulty<'_, B> {
        Faulty { faults: self, bus }
    }

    /// What is to be told of the faults up to `now_ns`.
    pub fn next_note(&mut self, now_ns: u64) -> Option<FaultNote> {
        self.faults.next_note(now_ns)
    }

    /// Whether a fault strikes a frame, which is recorded then.
    fn strikes(&mut self, now_ns: u64, kind: FaultKind, frame: &Frame, number: u64) -> bool {
        let is_kind = |other| other == kind;
        let strike = self.faults.strikes_frame(now_ns, is_kind, self.port, frame.id(), number);
        strike.inspect(|&strike| self.faults.record(strike)).is_some()
    }

    /// Holds a frame back if a fault delays it; whether it did.
    fn holds_back(&mut self, now_ns: u64, frame: Frame, number: u64) -> Result<bool, SendError> {
        let is_delay = |kind| matches!(kind, FaultKind::Delay { .. });
        let strike = self.faults.strikes_frame(now_ns, is_delay, self.port, frame.id(), number);
        let Some(strike) = strike else { return Ok(false) };
        let FaultKind::Delay { by_ns } = self.faults.kind_of(strike) else { return Ok(false) };
        if self.held.len() == HELD {
            return Err(SendError::QueueFull { capacity: HELD });
        }
        self.faults.record(strike);
        self.held.push(Held { due_ns: now_ns.saturating_add(by_ns), frame });
        Ok(true)
    }

    /// Whether the node is off the bus or disconnected at that time.
    fn is_cut_off(&mut self, now_ns: u64) -> bool {
        self.restart_when_due(now_ns);
        self.faults.begin_disconnections(now_ns);
        let is_bus_off = |kind| kind == FaultKind::BusOff;
        if self.off_since_ns.is_none()
            && let Some(strike) = self.faults.of_node(now_ns, is_bus_off, self.port)
        {
            self.faults.record(strike);
            self.off_since_ns = Some(now_ns);
            self.held.clear();
        }
        let is_disconnect = |kind| kind == FaultKind::Disconnect;
        self.off_since_ns.is_some() || self.faults.of_node(now_ns, is_disconnect, self.port).is_some()
    }

    fn restart_when_due(&mut self, now_ns: u64) {
        if let (Some(since_ns), Some(after_ns)) = (self.off_since_ns, self.restart_after_ns)
            && now_ns >= since_ns.saturating_add(after_ns)
        {
            self.off_since_ns = None;
        }
    }

    /// A frame that the node babbles at that time.
    fn babbled(&mut self, now_ns: u64) -> Option<Frame> {
        let is_babble = |kind| matches!(kind, FaultKind::Babble { .. });
        let strike = self.faults.of_node(now_ns, is_babble, self.port)?;
        self.faults.record(strike);
        let FaultKind::Babble { frame } = self.faults.kind_of(strike) else { return None };
        Some(frame)
    }

    /// The next frame that was held back until then.
    fn due(&mut self, now_ns: u64) -> Option<Frame> {
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
    /// Sends what the faults have sent by themselves. What the port refuses is lost.
    fn send_own(&mut self, now_ns: u64) {
        let babbled = self.faults.babbled(now_ns);
        for frame in babbled.into_iter().chain(std::iter::from_fn(|| self.faults.due(now_ns))) {
            let _ = self.bus.send(now_ns, frame);
        }
    }
}

impl<B: Bus> Bus for Faulty<'_, B> {
    fn send(&mut self, now_ns: u64, frame: Frame) -> Result<(), SendError> {
        if self.faults.is_cut_off(now_ns) {
            // A disconnected controller keeps a frame until its queue is full; here it is full at once.
            let refused = SendError::QueueFull { capacity: 0 };
            return Err(if self.faults.off_since_ns.is_some() {
                SendError::BusOff { tec: OFF_TEC }
            } else {
                refused
            });
        }
        self.send_own(now_ns);
        let number = self.faults.sent;
        self.faults.sent += 1;
        if self.faults.holds_back(now_ns, frame, number)? {
            return Ok(());
        }
        self.bus.send(now_ns, frame)?;
        if self.faults.strikes(now_ns, FaultKind::Duplicate, &frame, number) {
            // The frame itself is queued: that its copy finds no room is no failure of the sender.
            let _ = self.bus.send(now_ns, frame);
        }
        Ok(())
    }

    fn receive(&mut self, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        let is_cut_off = self.faults.is_cut_off(now_ns);
        if !is_cut_off {
            self.send_own(now_ns);
        }
        // Each turn takes a frame from the port, so that this ends with what has arrived.
        loop {
            let received = self.bus.receive(now_ns)?;
            let Some(Received { frame, time_ns }) = received else { return Ok(None) };
            let number = self.faults.received;
            self.faults.received += 1;
            let is_lost = self.faults.strikes(time_ns, FaultKind::Lose, &frame, number);
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
}
