//! The state of the node: network management with its boot-up, heartbeats (1016h, 1017h), and errors.
//!
//! Errors are the present ones, error register (1001h), history (1003h), error code (603Fh) and EMCY contents. The
//! module decides the due actions; the node sends and reacts.

use arrayvec::ArrayVec;
use masseter_can::canopen::{Emergency, EmergencyCode, NmtState, NodeId};

use crate::names::{ERROR_CODE, ERROR_COUNT, ERROR_REGISTER, NEWEST_ERROR};
use crate::table::{CONSUMED, HISTORY};
use crate::{MILLISECOND_NS, dictionary::Objects, names};

/// From power-on to the boot-up message, ns.
pub(super) const BOOT_NS: u64 = 20 * MILLISECOND_NS;

/// The state.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) struct Nmt {
    /// None while the node boots.
    pub(super) state: Option<NmtState>,
    boot_at_ns: u64,
    /// Boot-up messages left before the node has booted: a boot loader sends one of its own.
    boot_ups: u8,
}

impl Nmt {
    /// A node that begins to boot at `now_ns`, and sends so many boot-up messages.
    pub(super) fn booting(now_ns: u64, boot_ups: u8) -> Self {
        Self { state: None, boot_at_ns: now_ns + BOOT_NS, boot_ups }
    }

    /// Whether process data are exchanged.
    pub(super) fn is_operational(self) -> bool {
        self.state == Some(NmtState::Operational)
    }

    /// Whether the node takes part in SDO, SYNC and EMCY.
    pub(super) fn is_served(self) -> bool {
        matches!(self.state, Some(NmtState::Operational | NmtState::PreOperational))
    }

    /// Ends the boot when it is time; returns whether a boot-up message is due.
    pub(super) fn boot(&mut self, now_ns: u64) -> bool {
        let is_due = self.state.is_none() && now_ns >= self.boot_at_ns;
        if is_due {
            self.boot_ups = self.boot_ups.saturating_sub(1);
            self.boot_at_ns += BOOT_NS;
            self.state = (self.boot_ups == 0).then_some(NmtState::PreOperational);
        }
        is_due
    }
}

/// The drive's own heartbeat.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Producer {
    interval_ns: u64,
    next_ns: u64,
}

impl Producer {
    /// The heartbeat with its first due time `first_ns`.
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

    /// Whether a heartbeat has been due for `wait_ns`. The next one is due an interval later; missed ones are skipped.
    pub(super) fn is_due(&mut self, now_ns: u64, wait_ns: u64) -> bool {
        if self.interval_ns == 0 || now_ns < self.next_ns + wait_ns {
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
struct ConsumedHeartbeat {
    node: Option<NodeId>,
    timeout_ns: u64,
    /// None before the first heartbeat, and once it is lost.
    heard_ns: Option<u64>,
    is_lost: bool,
}

/// The consumed heartbeats.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
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

    /// Takes a heartbeat: supervision begins with the first heartbeat, and again after a loss.
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

/// Bits of the error register (1001h).
const GENERIC: u8 = 0x01;
const COMMUNICATION: u8 = 0x10;
const PROFILE: u8 = 0x20;
const CURRENT: u8 = 0x02;
const VOLTAGE: u8 = 0x04;
const TEMPERATURE: u8 = 0x08;

/// The number of errors that the drive can report: room for each of them once.
const COUNT: usize = 12;

/// The errors that put the drive into fault and last until a reset. In this order: the following error beyond window and
/// time out; an encoder that jumps or contradicts another one; an axis off the ramp of its stop or ahead of its demand; the
/// loss of control (6007h); a logic supply that is too low.
const FAULTS: [EmergencyCode; 5] = [
    EmergencyCode::FOLLOWING_ERROR,
    EmergencyCode::POSITION_SENSOR,
    EmergencyCode::VELOCITY,
    EmergencyCode::COMMUNICATION,
    EmergencyCode::LOGIC_SUPPLY,
];

/// The present errors, the newest first.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct Errors {
    /// The fault that is present at power-on.
    at_power_on: Option<EmergencyCode>,
    present: ArrayVec<EmergencyCode, COUNT>,
}

impl Errors {
    /// No errors yet, of a drive with that fault at power-on.
    pub(super) fn new(at_power_on: Option<u16>) -> Self {
        Self { at_power_on: at_power_on.map(EmergencyCode), ..Self::default() }
    }

    /// The errors that a fault reset clears.
    pub(super) fn faults(&self) -> impl Iterator<Item = EmergencyCode> + use<> {
        FAULTS.into_iter().chain(self.at_power_on)
    }

    /// Adds an error; returns its emergency message, unless the error is already present.
    pub(super) fn raise(&mut self, error: EmergencyCode, objects: &mut Objects) -> Option<Emergency> {
        if self.present.contains(&error) {
            return None;
        }
        self.present.insert(0, error);
        remember(error, objects);
        Some(self.emergency(error, objects))
    }

    /// Removes an error; returns the emergency message, if the error is present.
    pub(super) fn clear(&mut self, error: EmergencyCode, objects: &mut Objects) -> Option<Emergency> {
        let place = self.present.iter().position(|present| *present == error)?;
        self.present.remove(place);
        Some(self.emergency(EmergencyCode::RESET, objects))
    }

    /// Clears the errors of the communication without a message, as its reset does; faults stay.
    pub(super) fn forget_communication(&mut self, objects: &mut Objects) {
        let at_power_on = self.at_power_on;
        self.present.retain(|error| FAULTS.contains(error) || Some(*error) == at_power_on);
        self.show(objects);
    }

    fn emergency(&self, code: EmergencyCode, objects: &mut Objects) -> Emergency {
        Emergency { code, register: self.show(objects), vendor: [0; 5] }
    }

    /// Updates the error register and the error code (603Fh), which is that of the newest present error.
    fn show(&self, objects: &mut Objects) -> u8 {
        let register = self.present.iter().fold(0, |register, error| register | register_bits(*error));
        objects.set(ERROR_REGISTER, register);
        objects.set(ERROR_CODE, self.present.first().map_or(0, |error| error.0));
        register
    }
}

/// The bits of an error in the error register.
fn register_bits(error: EmergencyCode) -> u8 {
    GENERIC
        | match error {
            EmergencyCode::FOLLOWING_ERROR | EmergencyCode::VELOCITY => PROFILE,
            EmergencyCode(0x2000..0x3000) => CURRENT,
            EmergencyCode(0x3000..0x4000) | EmergencyCode::LOGIC_SUPPLY => VOLTAGE,
            EmergencyCode(0x4000..0x5000) => TEMPERATURE,
            EmergencyCode(0x8100..0x8300) => COMMUNICATION,
            _ => 0,
        }
}

/// Adds an error at the beginning of the history; the oldest one drops out.
fn remember(code: EmergencyCode, objects: &mut Objects) {
    objects.words[NEWEST_ERROR.place..][..HISTORY].rotate_right(1);
    objects.set(NEWEST_ERROR, u32::from(code.0));
    objects.set(ERROR_COUNT, objects.get(ERROR_COUNT).saturating_add(1).min(HISTORY as u8));
}

/// Empties the history.
pub(super) fn clear_history(objects: &mut Objects) {
    objects.words[ERROR_COUNT.place..][..=HISTORY].fill(0);
}

#[cfg(test)]
mod tests {
    use masseter_can::canopen::NodeId;

    use super::*;

    #[test]
    fn errors_are_reported_when_they_appear_and_disappear_and_not_in_between() {
        let mut objects = Objects::new(NodeId::new(3).unwrap());
        let mut errors = Errors::default();
        let emergency = errors.raise(EmergencyCode::FOLLOWING_ERROR, &mut objects).unwrap();
        assert_eq!((emergency.code, emergency.register), (EmergencyCode::FOLLOWING_ERROR, 0x21));
        assert_eq!(errors.raise(EmergencyCode::FOLLOWING_ERROR, &mut objects), None);
        let emergency = errors.raise(EmergencyCode::HEARTBEAT, &mut objects).unwrap();
        assert_eq!((emergency.code, emergency.register), (EmergencyCode::HEARTBEAT, 0x31));
        let emergency = errors.clear(EmergencyCode::FOLLOWING_ERROR, &mut objects).unwrap();
        assert_eq!((emergency.code, emergency.register), (EmergencyCode::RESET, 0x11), "one is left");
        let emergency = errors.clear(EmergencyCode::HEARTBEAT, &mut objects).unwrap();
        assert_eq!(emergency, Emergency::RESET);
        assert_eq!(errors.clear(EmergencyCode::HEARTBEAT, &mut objects), None);
        assert_eq!((objects.get(ERROR_REGISTER), objects.get(ERROR_CODE)), (0, 0));
    }

    #[test]
    fn the_error_code_is_that_of_the_newest_error_still_present() {
        let mut objects = Objects::new(NodeId::new(3).unwrap());
        let mut errors = Errors::default();
        let [following, heartbeat, short] =
            [EmergencyCode::FOLLOWING_ERROR, EmergencyCode::HEARTBEAT, EmergencyCode::PDO_LENGTH];
        for error in [following, heartbeat, short] {
            errors.raise(error, &mut objects);
        }
        assert_eq!(objects.get(ERROR_CODE), 0x8210);
        errors.clear(heartbeat, &mut objects);
        assert_eq!(objects.get(ERROR_CODE), 0x8210);
        errors.clear(short, &mut objects);
        assert_eq!(objects.get(ERROR_CODE), 0x8611);
        errors.raise(heartbeat, &mut objects);
        errors.forget_communication(&mut objects);
        assert_eq!((objects.get(ERROR_CODE), objects.get(ERROR_REGISTER)), (0x8611, 0x21));
    }

    #[test]
    fn the_history_holds_the_newest_first_and_at_most_eight() {
        let mut objects = Objects::new(NodeId::new(3).unwrap());
        let mut errors = Errors::default();
        for _ in 0..5 {
            errors.raise(EmergencyCode::PDO_LENGTH, &mut objects);
            errors.raise(EmergencyCode::PDO_LENGTH_EXCEEDED, &mut objects);
            errors.clear(EmergencyCode::PDO_LENGTH, &mut objects);
            errors.clear(EmergencyCode::PDO_LENGTH_EXCEEDED, &mut objects);
        }
        assert_eq!(objects.get(ERROR_COUNT), 8);
        let history = |place: usize| objects.words[NEWEST_ERROR.place + place];
        assert_eq!([history(0), history(1), history(7)], [0x8220, 0x8210, 0x8210]);
        let [before, behind] = [ERROR_COUNT.place - 1, NEWEST_ERROR.place + HISTORY];
        (objects.words[before], objects.words[behind]) = (77, 77);
        clear_history(&mut objects);
        assert_eq!((objects.get(ERROR_COUNT), objects.get(NEWEST_ERROR)), (0, 0));
        assert_eq!([before, NEWEST_ERROR.place + 7, behind].map(|place| objects.words[place]), [77, 0, 77]);
    }
}
