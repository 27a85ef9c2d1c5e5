//! Errors of the drive: which are present, the error register, the history, and what EMCY tells.

use masseter_can::canopen::{Emergency, EmergencyCode};

use super::dictionary::names::{ERROR_CODE, ERROR_COUNT, ERROR_REGISTER, NEWEST_ERROR};
use super::dictionary::{HISTORY, Objects};

/// Bits of the error register (object 1001).
const GENERIC: u8 = 1 << 0;
const COMMUNICATION: u8 = 1 << 4;
const PROFILE: u8 = 1 << 5;

/// What can be wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
    /// Its CAN controller is error passive.
    ErrorPassive,
    /// Its CAN controller was off the bus.
    WasBusOff,
    /// Nobody guided the drive any more, which object 6007 makes a fault.
    LinkLost,
}

/// How many there are.
const COUNT: usize = 9;

impl DriveError {
    /// Those that put the drive into fault, and last until it is reset.
    pub(super) const FAULTS: [Self; 2] = [Self::FollowingError, Self::LinkLost];

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
            Self::LinkLost => EmergencyCode::COMMUNICATION,
        }
    }

    const fn register(self) -> u8 {
        match self {
            Self::FollowingError => GENERIC | PROFILE,
            _ => GENERIC | COMMUNICATION,
        }
    }
}

/// The errors that are present, the newest first.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Errors {
    present: [Option<DriveError>; COUNT],
}

impl Errors {
    /// An error came; what to tell, unless it was there already.
    pub(super) fn raise(&mut self, error: DriveError, objects: &mut Objects) -> Option<Emergency> {
        if self.present.contains(&Some(error)) {
            return None;
        }
        // Every error has room once, so that the last place is free.
        self.present.rotate_right(1);
        self.present[0] = Some(error);
        remember(error.code(), objects);
        Some(self.emergency(error.code(), objects))
    }

    /// An error is gone; what to tell, if it was there.
    pub(super) fn clear(&mut self, error: DriveError, objects: &mut Objects) -> Option<Emergency> {
        let place = self.present.iter().position(|present| *present == Some(error))?;
        self.present[place] = None;
        self.present[place..].rotate_left(1);
        Some(self.emergency(EmergencyCode::RESET, objects))
    }

    /// The communication begins anew: its errors are gone without a word, what holds the drive in fault stays.
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

    /// Brings the error register up to date, and 603F, which shows the newest error still present.
    fn show(self, objects: &mut Objects) -> u8 {
        let present = self.present.into_iter().flatten();
        let register = present.fold(0, |register, error| register | error.register());
        objects.set(ERROR_REGISTER, register);
        objects.set(ERROR_CODE, self.present[0].map_or(0, |error| error.code().0));
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
    use masseter_can::canopen::NodeId;

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
        forget(&mut objects);
        assert_eq!((objects.get(ERROR_COUNT), objects.get(NEWEST_ERROR)), (0, 0));
    }
}
