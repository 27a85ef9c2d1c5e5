//! Stops of an axis: the hard stops at its ends, those of faults, and a seized guide.

use super::friction::{CONTACT, Element, Spring};

/// The largest force of a seized guide, N.
const MOST_N: f64 = 2000.0;

/// A seized guide.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) struct Seizure {
    pub(super) held_at_m: f64,
}

impl Seizure {
    /// The force on the axis in a step.
    pub(super) fn hold(&mut self, position_m: f64, speed_m_s: f64, step_s: f64) -> Element {
        // The spring slides along beyond the stretch of the largest force.
        let most_m = MOST_N / CONTACT.stiffness_n_per_m;
        let stretch_m = (position_m - self.held_at_m).clamp(-most_m, most_m);
        self.held_at_m = position_m - stretch_m;
        let held = Element::spring(CONTACT, stretch_m, speed_m_s, step_s);
        if held.force_n.abs() <= MOST_N {
            return held;
        }
        // The largest damping with which the force stays the largest one and the axis does not turn back.
        let damping_n_s_per_m = held.damping_n_s_per_m.min(MOST_N / speed_m_s.abs());
        Element { force_n: held.force_n.clamp(-MOST_N, MOST_N), damping_n_s_per_m }
    }
}

/// Two stops.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
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

    /// The force on the axis in a step; `None` if the axis touches no stop before its end.
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

    /// Where a mass is, and how fast, after so many steps of 125 µs under a load.
    fn after(steps: usize, mass_kg: f64, start_m_s: f64, load_n: f64) -> (f64, f64) {
        const STEP_S: f64 = 1.25e-4;
        let mut seizure = Seizure { held_at_m: 0.0 };
        let (mut position_m, mut speed_m_s) = (0.0, start_m_s);
        for _ in 0..steps {
            let Element { force_n, damping_n_s_per_m } = seizure.hold(position_m, speed_m_s, STEP_S);
            speed_m_s += STEP_S * (force_n + load_n) / (mass_kg + STEP_S * damping_n_s_per_m);
            position_m += STEP_S * speed_m_s;
        }
        (position_m, speed_m_s)
    }

    #[test]
    fn a_seizure_holds_a_load_without_creeping_and_yields_to_more_than_two_kilonewtons() {
        // A load that comes at once stretches the spring for a moment by up to twice as much.
        for mass_kg in [0.01, 0.4, 3.0] {
            let (position_m, speed_m_s) = after(8000, mass_kg, 0.0, 900.0);
            assert!((position_m - 0.9e-4).abs() < 1e-6 && speed_m_s.abs() < 1e-6, "{mass_kg}: {position_m}");
        }
        let (position_m, _) = after(800, 1.0, 0.0, 2200.0);
        assert!(position_m > 0.5, "200 N accelerate a kilogram for 0.1 s: {position_m}");
    }

    #[test]
    fn a_seizure_stops_a_moving_axis_without_throwing_it_back() {
        for mass_kg in [0.01, 0.4, 3.0] {
            let (position_m, speed_m_s) = after(800, mass_kg, 0.4, 0.0);
            assert!(speed_m_s.abs() < 1e-5, "{mass_kg} kg: {speed_m_s}");
            assert!((-1e-4..4e-4).contains(&position_m), "{mass_kg} kg: {position_m}");
        }
    }

    #[test]
    fn stops_push_back_and_never_pull() {
        let stops = Stops::between([-0.01, 0.01], CONTACT);
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
