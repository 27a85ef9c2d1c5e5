//! Errors of the drive: which are present, the error register, the history, and what EMCY tells.

use masseter_shared::can::canopen::{Emergency, EmergencyCode};

use super::dictionary::names::{ERROR_CODE, ERROR_COUNT, ERROR_REGISTER, NEWEST_ERROR};
use super::dictionary::{HISTORY, Objects};

/// Bits of the error register (object 1001).
const GENERIC: u8 = 1 << 0;
const COMMUNICATION: u8 = 1 << 4;
const PROFILE: u8 = 1 << 5;

/// What can be wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum DriveError {
    /// A watched heartbeat is overdue.
    Heartbeat,
    /// A PDO was too short.
    PdoShort,
    /// A PDO was too long.
    PdoLong,
    /// SYNC came with another length than object 1019 says.
    SyncLength,
    /// The event timer of an RPDO ran out.
    RpdoTimeout,
    /// The following error window was left for too long.
    FollowingError,
}

impl DriveError {
    const ALL: [Self; 6] = [
        Self::Heartbeat,
        Self::PdoShort,
        Self::PdoLong,
        Self::SyncLength,
        Self::RpdoTimeout,
        Self::FollowingError,
    ];

    const fn code(self) -> EmergencyCode {
        match self {
            Self::Heartbeat => EmergencyCode::HEARTBEAT,
            Self::PdoShort => EmergencyCode::PDO_LENGTH,
            Self::PdoLong => EmergencyCode::PDO_LENGTH_EXCEEDED,
            Self::SyncLength => EmergencyCode::SYNC_LENGTH,
            Self::RpdoTimeout => EmergencyCode::RPDO_TIMEOUT,
            Self::FollowingError => EmergencyCode::FOLLOWING_ERROR,
        }
    }

    const fn register(self) -> u8 {
        match self {
            Self::FollowingError => GENERIC | PROFILE,
            _ => GENERIC | COMMUNICATION,
        }
    }

    const fn bit(self) -> u8 {
        1 << self as u8
    }
}

/// The errors that are present.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Errors {
    present: u8,
}

impl Errors {
    /// An error came; what to tell, unless it was there already.
    pub(super) fn raise(&mut self, error: DriveError, objects: &mut Objects) -> Option<Emergency> {
        if self.present & error.bit() != 0 {
            return None;
        }
        self.present |= error.bit();
        remember(error.code(), objects);
        objects.set(ERROR_CODE, error.code().0);
        Some(self.emergency(error.code(), objects))
    }

    /// An error is gone; what to tell, if it was there.
    pub(super) fn clear(&mut self, error: DriveError, objects: &mut Objects) -> Option<Emergency> {
        if self.present & error.bit() == 0 {
            return None;
        }
        self.present &= !error.bit();
        Some(self.emergency(EmergencyCode::RESET, objects))
    }

    /// The communication begins anew: its errors are gone without a word, those of the axis stay.
    pub(super) fn forget_communication(&mut self, objects: &mut Objects) {
        self.present &= DriveError::FollowingError.bit();
        self.show(objects);
    }

    fn emergency(self, code: EmergencyCode, objects: &mut Objects) -> Emergency {
        Emergency { code, register: self.show(objects), vendor: [0; 5] }
    }

    /// Brings the error register up to date, and 603F once nothing is wrong.
    fn show(self, objects: &mut Objects) -> u8 {
        let present = DriveError::ALL.into_iter().filter(|error| self.present & error.bit() != 0);
        let register = present.fold(0, |register, error| register | error.register());
        objects.set(ERROR_REGISTER, register);
        if register == 0 {
            objects.set(ERROR_CODE, 0);
        }
        register
    }
}

/// Puts an error at the beginning of the history; the oldest falls out.
fn remember(code: EmergencyCode, objects: &mut Objects) {
    for place in (1..HISTORY).rev() {
        let word = objects.word(NEWEST_ERROR.place() + place - 1);
        objects.set_word(NEWEST_ERROR.place() + place, word);
    }
    objects.set(NEWEST_ERROR, u32::from(code.0));
    objects.set(ERROR_COUNT, objects.get(ERROR_COUNT).saturating_add(1).min(HISTORY as u8));
}

/// Empties the history.
pub(super) fn forget(objects: &mut Objects) {
    for place in ERROR_COUNT.place()..=ERROR_COUNT.place() + HISTORY {
        objects.set_word(place, 0);
    }
}

#[cfg(test)]
mod tests {
    use masseter_shared::can::canopen::NodeId;

    use super::*;

    #[test]
    fn errors_are_told_when_they_come_and_go_and_not_in_between() {
        let mut objects = Objects::new(NodeId::new(3).unwrap());
        let mut errors = Errors::default();
        let told = errors.raise(DriveError::FollowingError, &mut objects).unwrap();
        assert_eq!((told.code, told.register), (EmergencyCode::FOLLOWING_ERROR, 0x21));
        assert_eq!(errors.raise(DriveError::FollowingError, &mut objects), None);
        let told = errors.raise(DriveError::Heartbeat, &mut objects).unwrap();
        assert_eq!((told.code, told.register), (EmergencyCode::HEARTBEAT, 0x31));
        let told = errors.clear(DriveError::FollowingError, &mut objects).unwrap();
        assert_eq!((told.code, told.register), (EmergencyCode::RESET, 0x11), "one is left");
        let told = errors.clear(DriveError::Heartbeat, &mut objects).unwrap();
        assert_eq!(told, Emergency::RESET);
        assert_eq!(errors.clear(DriveError::Heartbeat, &mut objects), None);
        assert_eq!((objects.get(ERROR_REGISTER), objects.get(ERROR_CODE)), (0, 0));
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
        forget(&mut objects);
        assert_eq!((objects.get(ERROR_COUNT), objects.get(NEWEST_ERROR)), (0, 0));
    }
}
