//! Errors of the drive: present errors, error register (1001h), history (1003h), error code (603Fh) and EMCY contents.
//!
//! The module sends nothing; its caller does.

use masseter_can::canopen::{Emergency, EmergencyCode};

use crate::drive::dictionary::names::{ERROR_CODE, ERROR_COUNT, ERROR_REGISTER, NEWEST_ERROR};
use crate::drive::dictionary::{HISTORY, Objects};

/// Bits of the error register (1001h).
const GENERIC: u8 = 1 << 0;
const COMMUNICATION: u8 = 1 << 4;
const PROFILE: u8 = 1 << 5;

/// An error of the drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DriveError {
    /// A consumed heartbeat is overdue.
    Heartbeat,
    /// A PDO was too short.
    PdoShort,
    /// A PDO was too long.
    PdoLong,
    /// The length of SYNC contradicts 1019h.
    SyncLength,
    /// The event timer of an RPDO ran out.
    RpdoTimeout,
    /// The following error was outside its window for longer than its time out.
    FollowingError,
    /// Its CAN controller is error passive.
    ErrorPassive,
    /// Its CAN controller was off the bus.
    WasBusOff,
    /// Nobody controlled the drive any more, which 6007h makes a fault.
    ConnectionAborted,
}

/// How many there are.
const COUNT: usize = 9;

impl DriveError {
    /// The errors that put the drive into fault and last until it is reset.
    pub(super) const FAULTS: [Self; 2] = [Self::FollowingError, Self::ConnectionAborted];

    const fn code(self) -> EmergencyCode {
        match self {
            Self::Heartbeat => EmergencyCode::HEARTBEAT,
            Self::PdoShort => EmergencyCode::PDO_LENGTH,
            Self::PdoLong => EmergencyCode::PDO_LENGTH_EXCEEDED,
            Self::SyncLength => EmergencyCode::SYNC_LENGTH,
            Self::RpdoTimeout => EmergencyCode::RPDO_TIMEOUT,
            Self::FollowingError => EmergencyCode::FOLLOWING_ERROR,
            Self::ErrorPassive => EmergencyCode::ERROR_PASSIVE,
            Self::WasBusOff => EmergencyCode::WAS_BUS_OFF,
            Self::ConnectionAborted => EmergencyCode::COMMUNICATION,
        }
    }

    const fn register(self) -> u8 {
        match self {
            Self::FollowingError => GENERIC | PROFILE,
            _ => GENERIC | COMMUNICATION,
        }
    }
}

/// The present errors, the newest first.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Errors {
    present: [Option<DriveError>; COUNT],
}

impl Errors {
    /// An error appears; returns its emergency message, unless the error was present already.
    pub(super) fn raise(&mut self, error: DriveError, objects: &mut Objects) -> Option<Emergency> {
        if self.present.contains(&Some(error)) {
            return None;
        }
        // There is room for every error once, so that the last place is free.
        self.present.rotate_right(1);
        self.present[0] = Some(error);
        remember(error.code(), objects);
        Some(self.emergency(error.code(), objects))
    }

    /// An error disappears; returns the emergency message, if the error was present.
    pub(super) fn clear(&mut self, error: DriveError, objects: &mut Objects) -> Option<Emergency> {
        let place = self.present.iter().position(|present| *present == Some(error))?;
        self.present[place] = None;
        self.present[place..].rotate_left(1);
        Some(self.emergency(EmergencyCode::RESET, objects))
    }

    /// Clears the errors of the communication without a message, as its reset does; faults stay.
    pub(super) fn forget_communication(&mut self, objects: &mut Objects) {
        let before = std::mem::take(&mut self.present);
        let faults = before.into_iter().flatten().filter(|error| DriveError::FAULTS.contains(error));
        for (place, fault) in self.present.iter_mut().zip(faults) {
            *place = Some(fault);
        }
        self.show(objects);
    }

    fn emergency(self, code: EmergencyCode, objects: &mut Objects) -> Emergency {
        Emergency { code, register: self.show(objects), vendor: [0; 5] }
    }

    /// Updates the error register and the error code (603Fh), which is that of the newest present error.
    fn show(self, objects: &mut Objects) -> u8 {
        let present = self.present.into_iter().flatten();
        let register = present.fold(0, |register, error| register | error.register());
        objects.set(ERROR_REGISTER, register);
        objects.set(ERROR_CODE, self.present[0].map_or(0, |error| error.code().0));
        register
    }
}

/// Adds an error at the beginning of the history; the oldest one drops out.
fn remember(code: EmergencyCode, objects: &mut Objects) {
    for place in (1..HISTORY).rev() {
        let word = objects.word(NEWEST_ERROR.place() + place - 1);
        objects.set_word(NEWEST_ERROR.place() + place, word);
    }
    objects.set(NEWEST_ERROR, u32::from(code.0));
    objects.set(ERROR_COUNT, objects.get(ERROR_COUNT).saturating_add(1).min(HISTORY as u8));
}

/// Empties the history.
pub(super) fn clear_history(objects: &mut Objects) {
    for place in ERROR_COUNT.place()..=ERROR_COUNT.place() + HISTORY {
        objects.set_word(place, 0);
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::canopen::NodeId;

    use super::*;

    #[test]
    fn errors_are_reported_when_they_appear_and_disappear_and_not_in_between() {
        let mut objects = Objects::new(NodeId::new(3).unwrap());
        let mut errors = Errors::default();
        let emergency = errors.raise(DriveError::FollowingError, &mut objects).unwrap();
        assert_eq!((emergency.code, emergency.register), (EmergencyCode::FOLLOWING_ERROR, 0x21));
        assert_eq!(errors.raise(DriveError::FollowingError, &mut objects), None);
        let emergency = errors.raise(DriveError::Heartbeat, &mut objects).unwrap();
        assert_eq!((emergency.code, emergency.register), (EmergencyCode::HEARTBEAT, 0x31));
        let emergency = errors.clear(DriveError::FollowingError, &mut objects).unwrap();
        assert_eq!((emergency.code, emergency.register), (EmergencyCode::RESET, 0x11), "one is left");
        let emergency = errors.clear(DriveError::Heartbeat, &mut objects).unwrap();
        assert_eq!(emergency, Emergency::RESET);
        assert_eq!(errors.clear(DriveError::Heartbeat, &mut objects), None);
        assert_eq!((objects.get(ERROR_REGISTER), objects.get(ERROR_CODE)), (0, 0));
    }

    #[test]
    fn the_error_code_is_that_of_the_newest_error_still_present() {
        let mut objects = Objects::new(NodeId::new(3).unwrap());
        let mut errors = Errors::default();
        let [following, heartbeat, short] =
            [DriveError::FollowingError, DriveError::Heartbeat, DriveError::PdoShort];
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
            errors.raise(DriveError::PdoShort, &mut objects);
            errors.raise(DriveError::PdoLong, &mut objects);
            errors.clear(DriveError::PdoShort, &mut objects);
            errors.clear(DriveError::PdoLong, &mut objects);
        }
        assert_eq!(objects.get(ERROR_COUNT), 8);
        let history = |place: usize| objects.word(NEWEST_ERROR.place() + place);
        assert_eq!([history(0), history(1), history(7)], [0x8220, 0x8210, 0x8210]);
        clear_history(&mut objects);
        assert_eq!((objects.get(ERROR_COUNT), objects.get(NEWEST_ERROR)), (0, 0));
    }
}
