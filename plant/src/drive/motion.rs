//! Position and velocity of an axis at an instant.

/// How an axis moves, or shall move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Motion {
    /// Position, m.
    pub(crate) position_m: f64,
    /// Velocity, m/s.
    pub(crate) velocity_m_s: f64,
}

impl Motion {
    /// Standing there.
    pub(crate) const fn at_rest(position_m: f64) -> Self {
        Self { position_m, velocity_m_s: 0.0 }
    }
}
