//! The statusword, object 6041: a drive's state and a few flags beside it.

use super::DriveState;

/// The bits of the statusword that encode the state, and their value in each state.
const PATTERNS: [(u16, u16, DriveState); 8] = [
    (0x4F, 0x00, DriveState::NotReadyToSwitchOn),
    (0x4F, 0x40, DriveState::SwitchOnDisabled),
    (0x6F, 0x21, DriveState::ReadyToSwitchOn),
    (0x6F, 0x23, DriveState::SwitchedOn),
    (0x6F, 0x27, DriveState::OperationEnabled),
    (0x6F, 0x07, DriveState::QuickStopActive),
    (0x4F, 0x0F, DriveState::FaultReactionActive),
    (0x4F, 0x08, DriveState::Fault),
];

/// A bit of the statusword that is not part of the state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum StatusBit {
    /// The power stage has voltage.
    VoltageEnabled = 4,
    /// A warning is present; the state did not change.
    Warning = 7,
    /// The drive obeys the controlword.
    Remote = 9,
    /// Profile position and homing: the target is reached.
    TargetReached = 10,
    /// An internal limit is active, such as the software position limit 607D.
    #[doc(alias = "internal limit active")]
    InternalLimit = 11,
    /// Cyclic synchronous modes: the target is being followed.
    TargetFollowed = 12,
    /// Position modes: the following error window was left for too long.
    FollowingError = 13,
}

impl StatusBit {
    /// Profile position: the new set-point was taken.
    pub const SETPOINT_ACKNOWLEDGED: Self = Self::TargetFollowed;
    /// Homing: the home position was found.
    pub const HOMING_ATTAINED: Self = Self::TargetFollowed;
    /// Homing: it failed.
    pub const HOMING_ERROR: Self = Self::FollowingError;
}

/// Object 6041 as it is on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Statusword(pub u16);

/// A statusword whose bits encode no state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("statusword {bits:04X}h encodes no state of CiA 402")]
pub struct StatuswordError {
    /// The statusword.
    pub bits: u16,
}

impl Statusword {
    /// The statusword of a state, all other bits 0.
    pub fn for_state(state: DriveState) -> Self {
        let mut patterns = PATTERNS.into_iter();
        let pattern = patterns.find(|pattern| pattern.2 == state);
        let (_, bits, _) = pattern.expect("every state has a pattern");
        Self(bits)
    }

    /// The same with one bit set or cleared.
    #[must_use]
    pub const fn with(self, bit: StatusBit, set: bool) -> Self {
        let mask = 1 << bit as u8;
        Self(if set { self.0 | mask } else { self.0 & !mask })
    }

    /// Whether that bit is set.
    pub const fn has(self, bit: StatusBit) -> bool {
        self.0 >> bit as u8 & 1 == 1
    }

    /// The state of the drive.
    ///
    /// # Errors
    /// [`StatuswordError`] where the bits are those of no state.
    pub fn state(self) -> Result<DriveState, StatuswordError> {
        let mut patterns = PATTERNS.into_iter();
        let pattern = patterns.find(|&(mask, bits, _)| self.0 & mask == bits);
        pattern.map(|(_, _, state)| state).ok_or(StatuswordError { bits: self.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLAGS: [StatusBit; 7] = [
        StatusBit::VoltageEnabled,
        StatusBit::Warning,
        StatusBit::Remote,
        StatusBit::TargetReached,
        StatusBit::InternalLimit,
        StatusBit::TargetFollowed,
        StatusBit::FollowingError,
    ];

    #[test]
    fn every_statusword_encodes_at_most_one_state() {
        for bits in 0..=u16::MAX {
            let matching: Vec<_> = PATTERNS.iter().filter(|pattern| bits & pattern.0 == pattern.1).collect();
            assert!(matching.len() <= 1, "{bits:04X}h matches {matching:?}");
            assert_eq!(Statusword(bits).state().ok(), matching.first().map(|pattern| pattern.2));
        }
    }

    #[test]
    fn a_state_survives_any_flags() {
        for state in DriveState::ALL {
            let all = FLAGS.into_iter().fold(Statusword::for_state(state), |word, bit| word.with(bit, true));
            assert_eq!(all.state(), Ok(state));
            assert!(FLAGS.into_iter().all(|bit| all.has(bit) && !all.with(bit, false).has(bit)));
        }
    }

    #[test]
    fn bits_of_no_state_are_refused() {
        assert_eq!(Statusword(0x0001).state(), Err(StatuswordError { bits: 0x0001 }));
        assert_eq!(
            StatuswordError { bits: 0x61 }.to_string(),
            "statusword 0061h encodes no state of CiA 402"
        );
    }

    #[test]
    fn words_seen_on_drives_are_understood() {
        let enabled = Statusword(0x1237);
        assert_eq!(enabled.state(), Ok(DriveState::OperationEnabled));
        assert!(enabled.has(StatusBit::TargetFollowed) && enabled.has(StatusBit::Remote));
        assert_eq!(Statusword(0x0250).state(), Ok(DriveState::SwitchOnDisabled));
        assert_eq!(Statusword(0x0218).state(), Ok(DriveState::Fault));
    }
}
