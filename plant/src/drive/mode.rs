//! The modes of operation that the drive has, and their numbers.

/// Mode of operation (object 6060).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mode {
    ProfilePosition,
    Homing,
    CyclicPosition,
    CyclicTorque,
}

impl Mode {
    /// The mode of that number; `None` where the drive has no such mode.
    pub(super) const fn of(number: i8) -> Option<Self> {
        match number {
            1 => Some(Self::ProfilePosition),
            6 => Some(Self::Homing),
            8 => Some(Self::CyclicPosition),
            10 => Some(Self::CyclicTorque),
            _ => None,
        }
    }

    pub(super) const fn number(self) -> i8 {
        match self {
            Self::ProfilePosition => 1,
            Self::Homing => 6,
            Self::CyclicPosition => 8,
            Self::CyclicTorque => 10,
        }
    }
}
