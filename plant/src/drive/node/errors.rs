//! Errors of the drive: present errors, error register (1001h), history (1003h), error code (603Fh) and EMCY contents.
//!
//! The module sends nothing; its caller does.

use arrayvec::ArrayVec;
use masseter_can::canopen::{Emergency, EmergencyCode};

use crate::drive::dictionary::names::{ERROR_CODE, ERROR_COUNT, ERROR_REGISTER, NEWEST_ERROR};
use crate::drive::dictionary::{HISTORY, Objects};

/// Bits of the error register (1001h).
const GENERIC: u8 = 0x01;
const COMMUNICATION: u8 = 0x10;
const PROFILE: u8 = 0x20;
const CURRENT: u8 = 0x02;
const VOLTAGE: u8 = 0x04;
const TEMPERATURE: u8 = 0x08;

/// The number of errors that the drive can report: room for each of them once.
const COUNT: usize = 11;

/// The errors that put the drive into fault and last until a reset: the axis was outside the following window for longer
/// than the time out; nobody controls the drive, and 6007h makes that a fault; the logic supply is too low.
const FAULTS: [EmergencyCode; 3] =
    [EmergencyCode::FOLLOWING_ERROR, EmergencyCode::COMMUNICATION, EmergencyCode::LOGIC_SUPPLY];

/// The present errors, the newest first.
#[derive(Debug, Clone, Default)]
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

    /// An error appears; returns its emergency message, unless the error was present already.
    pub(super) fn raise(&mut self, error: EmergencyCode, objects: &mut Objects) -> Option<Emergency> {
        if self.present.contains(&error) {
            return None;
        }
        self.present.insert(0, error);
        remember(error, objects);
        Some(self.emergency(error, objects))
    }

    /// An error disappears; returns the emergency message, if the error was present.
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
            EmergencyCode::FOLLOWING_ERROR => PROFILE,
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
