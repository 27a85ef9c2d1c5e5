//! The drive's modes of operation and their numbers (6060h).

/// Mode of operation (6060h).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mode {
    ProfilePosition = 1,
    Homing = 6,
    CyclicPosition = 8,
    CyclicTorque = 10,
}

impl Mode {
    /// The mode of that number; `None` where the drive has no such mode.
    pub(crate) fn from_number(number: i8) -> Option<Self> {
        let modes = [Self::ProfilePosition, Self::Homing, Self::CyclicPosition, Self::CyclicTorque];
        modes.into_iter().find(|mode| mode.number() == number)
    }

    /// The mode's number.
    pub(crate) const fn number(self) -> i8 {
        self as i8
    }
}
