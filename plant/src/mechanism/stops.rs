//! Hard stops at both ends of an axis' way: they push and never pull.

use super::element::{CONTACT, Element, Spring};

/// Two stops.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stops {
    low_m: f64,
    high_m: f64,
    spring: Spring,
}

impl Stops {
    /// Stops at these positions, of a stiffness and a damping.
    pub(super) fn between([low_m, high_m]: [f64; 2], spring: Spring) -> Self {
        Self { low_m, high_m, spring }
    }

    /// Stops of steel at these positions.
    pub(super) fn steel(ends_m: [f64; 2]) -> Self {
        Self::between(ends_m, CONTACT)
    }

    /// The force on the axis in a step; none where the axis touches no stop before its end.
    pub(super) fn touch(&self, position_m: f64, speed_m_s: f64, step_s: f64) -> Option<Element> {
        let next_m = position_m + speed_m_s * step_s;
        let (into_m, away) = if next_m > self.high_m {
            (position_m - self.high_m, -1.0)
        } else if next_m < self.low_m {
            (position_m - self.low_m, 1.0)
        } else {
            return None;
        };
        let contact = Element::spring(self.spring, into_m, speed_m_s, step_s);
        (contact.force_n * away > 0.0).then_some(contact)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_push_back_and_never_pull() {
        let stops = Stops::steel([-0.01, 0.01]);
        let force_n = |position_m, speed_m_s| {
            stops.touch(position_m, speed_m_s, 1e-4).map_or(0.0, |contact| contact.force_n)
        };
        for (position_m, speed_m_s) in [(0.0, 0.0), (0.0099, 0.0), (0.0095, 0.4), (0.01001, -0.4)] {
            assert!(stops.touch(position_m, speed_m_s, 1e-4).is_none(), "{position_m}");
        }
        assert!(force_n(0.01001, 0.0) < -90.0 && force_n(-0.01001, 0.0) > 90.0);
        assert!(force_n(0.00999, 0.4) < -100.0, "it is there within the step");
    }
}
