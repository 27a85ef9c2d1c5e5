//! Values that the parts of an axis exchange: motion, the view of a mode of operation, and its commands.

/// Position and velocity of an axis at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
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
    /// Make that count of the encoder the home position.
    SetHome { counts: i32 },
}
