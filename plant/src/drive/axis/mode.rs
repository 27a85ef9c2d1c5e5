//! The drive's modes of operation and their numbers (6060h).

/// Mode of operation (6060h).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mode {
    ProfilePosition,
    Homing,
    CyclicPosition,
    CyclicTorque,
}

impl Mode {
    /// The mode of that number; `None` where the drive has no such mode.
    pub(crate) const fn from_number(number: i8) -> Option<Self> {
        match number {
            1 => Some(Self::ProfilePosition),
            6 => Some(Self::Homing),
            8 => Some(Self::CyclicPosition),
            10 => Some(Self::CyclicTorque),
            _ => None,
        }
    }

    /// The mode's number.
    pub(crate) const fn number(self) -> i8 {
        match self {
            Self::ProfilePosition => 1,
            Self::Homing => 6,
            Self::CyclicPosition => 8,
            Self::CyclicTorque => 10,
        }
    }
}
