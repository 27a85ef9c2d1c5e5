//! Motion of an axis: the values that its parts exchange. What is demanded over time is in [`demand`](super::demand).

use crate::{dictionary::Objects, names};

/// Position and velocity of an axis at an instant.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Motion {
    /// Position, m.
    pub(crate) position_m: f64,
    /// Velocity, m/s.
    pub(crate) velocity_m_s: f64,
}

impl Motion {
    /// At rest at a position.
    pub(crate) const fn at_rest(position_m: f64) -> Self {
        Self { position_m, velocity_m_s: 0.0 }
    }
}

/// The value clamped to `[low, high]`, and whether it was outside.
pub(super) fn clamp(asked: f64, [low, high]: [f64; 2]) -> (f64, bool) {
    let kept = asked.max(low).min(high);
    (kept, kept.to_bits() != asked.to_bits())
}

/// Mode of operation (6060h).
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) enum Mode {
    ProfilePosition = 1,
    ProfileVelocity = 3,
    ProfileTorque = 4,
    Homing = 6,
    CyclicPosition = 8,
    CyclicVelocity = 9,
    CyclicTorque = 10,
}

impl Mode {
    /// The mode of that number; `None` for an unknown mode.
    pub(crate) fn from_number(number: i8) -> Option<Self> {
        let profiles = [Self::ProfilePosition, Self::ProfileVelocity, Self::ProfileTorque, Self::Homing];
        let cyclic = [Self::CyclicPosition, Self::CyclicVelocity, Self::CyclicTorque];
        let mut modes = profiles.into_iter().chain(cyclic);
        modes.find(|mode| mode.number() == number)
    }

    /// The mode of that number; `None` where the dictionary (6502h) does not support it.
    pub(crate) fn supported(number: i8, objects: &Objects) -> Option<Self> {
        let mode = Self::from_number(number)?;
        (objects.get(names::SUPPORTED_MODES) >> (number - 1) & 1 == 1).then_some(mode)
    }

    /// The mode's number.
    pub(crate) const fn number(self) -> i8 {
        self as i8
    }
}

/// Targets that are new; those of the cyclic modes wait for SYNC.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) struct NewTargets {
    /// Target position (607Ah).
    pub(crate) position: bool,
    /// Target torque (6071h).
    pub(crate) torque: bool,
    /// Target velocity (60FFh).
    pub(crate) velocity: bool,
}

/// Positions of an axis as a mode of operation sees them, increments of the dictionary.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PositionView {
    /// Position actual value (6064h).
    pub(super) actual: i32,
    /// Lowest and highest target that the software position limits allow from here.
    pub(super) allowed: [i32; 2],
}

impl PositionView {
    /// The nearest allowed target.
    pub(super) fn clamp(self, target: i32) -> i32 {
        let [lowest, highest] = self.allowed;
        target.min(highest).max(lowest)
    }
}

/// A command of a mode of operation to its axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MotionCommand {
    /// Move to rest at a target, increments of the dictionary.
    MoveTo { target: i32 },
    /// Slow down to rest.
    SlowDown,
    /// Come to rest at once in place: the axis stands at a stop.
    Hold,
    /// Make that count of the encoder the home position.
    SetHome { counts: i32 },
}

#[cfg(test)]
mod motion_tests {
    use super::*;

    #[test]
    fn a_value_outside_becomes_the_nearer_limit_and_is_reported() {
        let table = [(3.0, (2.0, true)), (2.0, (2.0, false)), (-0.0, (-0.0, false)), (-5.0, (-1.0, true))];
        for (asked, kept) in table {
            assert_eq!(clamp(asked, [-1.0, 2.0]), kept);
        }
    }

    #[test]
    fn a_target_is_moved_to_the_nearest_end_of_what_is_allowed() {
        let view = PositionView { actual: 0, allowed: [-20, 30] };
        assert_eq!([-50, -20, 5, 30, 50].map(|target| view.clamp(target)), [-20, -20, 5, 30, 30]);
    }

    #[test]
    fn a_mode_has_the_number_of_cia_402() {
        let numbers: Vec<_> =
            (i8::MIN..=i8::MAX).filter(|&number| Mode::from_number(number).is_some()).collect();
        assert_eq!(numbers, [1, 3, 4, 6, 8, 9, 10]);
        for number in numbers {
            assert_eq!(Mode::from_number(number).map(Mode::number), Some(number));
        }
    }
}
