//! The rhythm of a generated motion: out, back, rest, each phase from rest to rest.
//!
//! Phases follow the minimum-jerk polynomial, which describes human chewing (Yashiro 2001:
//! R² 0.85–0.88). Velocity and acceleration vanish at the ends of each, so the whole is C².

use masseter_scenario::PhaseShares;

use super::TrajectoryError;
use super::error::require;

/// Share of the opening after which a swing to the side begins: the jaw opens near the midline.
const SWING_BEGINS: f64 = 0.3;

/// A repeating cycle.
#[derive(Debug, Clone, Copy)]
pub(super) struct MotionRhythm {
    rate_hz: f64,
    /// The phase at which the jaw is widest open.
    pub opening: f64,
    closing: f64,
}

impl MotionRhythm {
    pub(super) fn new(rate_hz: f64, phases: &PhaseShares) -> Result<Self, TrajectoryError> {
        let PhaseShares { opening, closing, occlusion } = *phases;
        require(
            "motion.cycle_rate_hz",
            rate_hz,
            rate_hz > 0.0 && rate_hz <= 10.0,
            "above 0 and at most 10 Hz",
        )?;
        require("motion.phases.opening", opening, opening > 0.0, "above 0")?;
        require("motion.phases.closing", closing, closing > 0.0, "above 0")?;
        require("motion.phases.occlusion", occlusion, occlusion >= 0.0, "0 or above")?;
        let sum = opening + closing + occlusion;
        if (sum - 1.0).abs() > 1e-6 {
            let problem = "opening, closing and occlusion must add up to 1";
            return Err(TrajectoryError(format!("motion.phases add up to {sum:?}; {problem}")));
        }
        Ok(Self { rate_hz, opening, closing })
    }

    /// Where in its cycle the motion is, 0 to 1.
    pub(super) fn phase(&self, motion_s: f64) -> f64 {
        (motion_s * self.rate_hz).rem_euclid(1.0)
    }

    /// How far out of the closed pose, 0 to 1.
    pub(super) fn opened(&self, phase: f64) -> f64 {
        if phase < self.opening { minimum_jerk(phase / self.opening) } else { self.returning(phase) }
    }

    /// How far to the working side, 0 to 1: later out than [`opened`](Self::opened), back with it.
    pub(super) fn swung(&self, phase: f64) -> f64 {
        let begin = SWING_BEGINS * self.opening;
        if phase < self.opening {
            minimum_jerk((phase - begin) / (self.opening - begin))
        } else {
            self.returning(phase)
        }
    }

    fn returning(&self, phase: f64) -> f64 {
        1.0 - minimum_jerk((phase - self.opening) / self.closing)
    }

    /// The time of as many whole cycles as fit, at least one, s.
    pub(super) fn whole_cycles_s(&self, available_s: f64) -> f64 {
        // The tiny surplus keeps a fit that is exact from falling to one cycle less by rounding.
        (available_s * self.rate_hz + 1e-9).floor().max(1.0) / self.rate_hz
    }
}

/// 10x³ − 15x⁴ + 6x⁵, from rest to rest with the least jerk; held at 0 below and at 1 above.
pub(crate) fn minimum_jerk(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (10.0 + x * (6.0 * x - 15.0))
}

/// The integral of [`minimum_jerk`] from 0 to x, for x from 0 to 1; 1/2 at the end.
pub(super) fn minimum_jerk_integral(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * x * (2.5 + x * (x - 3.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cycle_goes_out_comes_back_and_rests() {
        let cycle = MotionRhythm::new(1.43, &PhaseShares::default()).unwrap();
        let table = [(0.0, 0.0), (0.215, 0.5), (0.43, 1.0), (0.63, 0.5), (0.83, 0.0), (0.95, 0.0)];
        for (phase, opened) in table {
            assert!((cycle.opened(phase) - opened).abs() < 1e-12, "{phase}");
            assert!(cycle.swung(phase) <= cycle.opened(phase) + 1e-12, "{phase}");
        }
    }

    #[test]
    fn shares_that_do_not_fill_the_cycle_are_refused() {
        let phases = PhaseShares { opening: 0.5, ..Default::default() };
        assert!(
            MotionRhythm::new(1.0, &phases).unwrap_err().to_string().starts_with("motion.phases add up to ")
        );
        for rate_hz in [0.0, -1.0, f64::NAN, 11.0] {
            assert!(MotionRhythm::new(rate_hz, &PhaseShares::default()).is_err());
        }
    }

    #[test]
    fn whole_cycles_fill_the_time_without_exceeding_it() {
        let cycle = MotionRhythm::new(2.0, &PhaseShares::default()).unwrap();
        assert!((cycle.whole_cycles_s(9.9) - 9.5).abs() < 1e-12);
        assert!((cycle.whole_cycles_s(9.5) - 9.5).abs() < 1e-12);
        assert!((cycle.whole_cycles_s(0.1) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn the_integral_is_the_polynomials_own() {
        let h = 1e-6;
        for x in [0.1, 0.4, 0.8] {
            let slope = (minimum_jerk_integral(x + h) - minimum_jerk_integral(x - h)) / (2.0 * h);
            assert!((slope - minimum_jerk(x)).abs() < 1e-9);
        }
        assert!((minimum_jerk_integral(1.0) - 0.5).abs() < 1e-15);
    }
}
