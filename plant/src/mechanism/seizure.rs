//! An axis that jams: a guide seizes, holds the axis where it is, and yields only to a large force.
//!
//! Elastoplastic friction (Dahl, A Solid Friction Model, Aerospace Corporation, 1968; Dupont et al., IEEE Trans. Automatic
//! Control 47, 2002): a stiff spring to the place where the guide seized, which slides along at the largest force. So a
//! load below that force does not make the axis creep.

use super::element::{CONTACT, Element};

/// The largest force of a seized guide, N.
const MOST_N: f64 = 2000.0;

/// A seized guide.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seizure {
    held_at_m: f64,
}

impl Seizure {
    /// A guide that seizes at a position.
    pub(super) fn at(position_m: f64) -> Self {
        Self { held_at_m: position_m }
    }

    /// The force on the axis in a step.
    pub(super) fn hold(&mut self, position_m: f64, speed_m_s: f64, step_s: f64) -> Element {
        // The spring slides along where it is stretched by more than the largest force takes.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Where a mass is, and how fast, after so many steps of 125 µs under a load.
    fn after(steps: usize, mass_kg: f64, start_m_s: f64, load_n: f64) -> (f64, f64) {
        const STEP_S: f64 = 1.25e-4;
        let mut seizure = Seizure::at(0.0);
        let (mut position_m, mut speed_m_s) = (0.0, start_m_s);
        for _ in 0..steps {
            let Element { force_n, damping_n_s_per_m } = seizure.hold(position_m, speed_m_s, STEP_S);
            speed_m_s += STEP_S * (force_n + load_n) / (mass_kg + STEP_S * damping_n_s_per_m);
            position_m += STEP_S * speed_m_s;
        }
        (position_m, speed_m_s)
    }

    #[test]
    fn it_holds_a_load_without_creeping_and_yields_to_more_than_two_kilonewtons() {
        // A load that comes at once stretches the spring for a moment by up to twice as much.
        for mass_kg in [0.01, 0.4, 3.0] {
            let (position_m, speed_m_s) = after(8000, mass_kg, 0.0, 900.0);
            assert!((position_m - 0.9e-4).abs() < 1e-6 && speed_m_s.abs() < 1e-6, "{mass_kg}: {position_m}");
        }
        let (position_m, _) = after(800, 1.0, 0.0, 2200.0);
        assert!(position_m > 0.5, "200 N accelerate a kilogram for 0.1 s: {position_m}");
    }

    #[test]
    fn it_stops_a_moving_axis_without_throwing_it_back() {
        for mass_kg in [0.01, 0.4, 3.0] {
            let (position_m, speed_m_s) = after(800, mass_kg, 0.4, 0.0);
            assert!(speed_m_s.abs() < 1e-5, "{mass_kg} kg: {speed_m_s}");
            assert!((-1e-4..4e-4).contains(&position_m), "{mass_kg} kg: {position_m}");
        }
    }
}
