//! The stiffness of a bite, as the course of its height and its force shows it.
//!
//! Height and force pass the same high-pass, whose time constant is the delay of the loop: what is left are the
//! frequencies at which the loop can shake. The doubt in a change of force is taken off; an error beyond the doubt shows as
//! stiffness, and the bite is slower. This module changes no damping and has no foods.

/// Least change of height that shows a stiffness, m: more than encoders and drives deviate.
const LEAST_M: f64 = 4e-6;
/// Margin of the damping for the part of a change of force that its doubt hides.
const MARGIN: f64 = 1.5;
/// Delays for which a change of height counts: the period of an oscillation at the limit of stability. So the turning points of a
/// slow motion, where force and height are out of phase, show no stiffness.
const PERIOD_IN_DELAYS: f64 = 4.0;

/// The largest stiffness so far.
#[derive(Debug, Clone)]
pub(super) struct ShownStiffness {
    pub(super) n_per_m: f64,
    /// What a probe has shown; 0 before a probe.
    probed_n_per_m: f64,
    delay_s: f64,
    /// Shares of a cycle in the low-passes of the force's source and of the loop's delay.
    source_share: f64,
    delay_share: f64,
    /// Share of the change of height that is left after a cycle.
    kept_share: f64,
    /// Height as the source of the force delays it, and both as the delay of the loop shows them; none before the first sample.
    slow: Option<Slow>,
}

#[derive(Debug, Clone, Copy)]
struct Slow {
    height_m: f64,
    late_m: f64,
    late_n: f64,
    /// Largest change of height of late, m.
    way_m: f64,
}

impl ShownStiffness {
    /// Nothing known yet, for delays of the force and of the loop, s.
    pub(super) fn new(period_s: f64, source_s: f64, delay_s: f64) -> Self {
        let share = |time_s: f64| period_s / (period_s + time_s);
        let (source_share, delay_share) = (share(source_s), share(delay_s));
        let kept_share = 1.0 - share(PERIOD_IN_DELAYS * delay_s);
        Self { n_per_m: 0.0, probed_n_per_m: 0.0, delay_s, source_share, delay_share, kept_share, slow: None }
    }

    /// Takes the requested height at a sample (m) and the force there (N), whose changes may be wrong by `doubt_n`.
    pub(super) fn take(&mut self, height_m: f64, bite_n: f64, doubt_n: f64) {
        let first = Slow { height_m, late_m: height_m, late_n: bite_n, way_m: 0.0 };
        let slow = self.slow.get_or_insert(first);
        slow.height_m += (height_m - slow.height_m) * self.source_share;
        slow.late_m += (slow.height_m - slow.late_m) * self.delay_share;
        slow.late_n += (bite_n - slow.late_n) * self.delay_share;
        let (way_m, rise_n) = (slow.height_m - slow.late_m, bite_n - slow.late_n);
        let certain_n = rise_n.abs() - doubt_n;
        slow.way_m = (slow.way_m * self.kept_share).max(way_m.abs());
        if slow.way_m > LEAST_M && way_m * rise_n > 0.0 && certain_n > 0.0 {
            self.n_per_m = self.n_per_m.max(certain_n / slow.way_m);
        }
    }

    /// Takes the end of a probe: a rise of the force (N) over a way (m) between two rests. Returns the stiffness, N/m; none where
    /// the rise is within its doubt or the way shows no stiffness.
    pub(super) fn take_probe(&mut self, rise_n: f64, way_m: f64, doubt_n: f64) -> Option<f64> {
        let shows = rise_n > doubt_n && way_m > LEAST_M;
        shows.then(|| {
            self.probed_n_per_m = rise_n / way_m;
            self.n_per_m = self.n_per_m.max(self.probed_n_per_m);
            self.probed_n_per_m
        })
    }

    pub(super) fn is_probed(&self) -> bool {
        self.probed_n_per_m > 0.0
    }

    /// What a probe has shown, N/m; 0 before.
    pub(super) fn probed_n_per_m(&self) -> f64 {
        self.probed_n_per_m
    }

    /// Another bite begins. What a probe has shown stays known.
    pub(super) fn forget(&mut self) {
        self.n_per_m = self.probed_n_per_m;
    }

    /// Speed at which the force gains this much (N) until the loop answers, m/s; none before a probe.
    pub(super) fn approach_m_s(&self, room_n: f64) -> Option<f64> {
        self.is_probed().then(|| room_n / (self.probed_n_per_m * self.delay_s))
    }

    /// The damping that this stiffness needs, N per m/s.
    pub(super) fn least_damping_n_s_per_m(&self) -> f64 {
        MARGIN * masseter_scenario::ForceControlConfig::least_damping_n_s_per_m(self.n_per_m, self.delay_s)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// The stiffness shown by a second of a swing of 20 µm at this frequency on 1 N/µm.
    fn shown_n_per_m(frequency_hz: f64, doubt_n: f64) -> f64 {
        let mut shown = ShownStiffness::new(1e-3, 0.003, 0.008);
        let mut bite_n = 0.0;
        for cycle in 0..1000 {
            let height_m = 2e-5 * (TAU * frequency_hz * f64::from(cycle) * 1e-3).sin();
            bite_n += (1e6 * height_m - bite_n) * 0.25;
            shown.take(height_m, bite_n, doubt_n);
        }
        shown.n_per_m
    }

    #[test]
    fn a_swing_shows_its_stiffness_and_what_may_be_an_error_of_the_force_shows_none() {
        for frequency_hz in [20.0, 40.0] {
            let n_per_m = shown_n_per_m(frequency_hz, 0.0);
            assert!((0.9e6..1.1e6).contains(&n_per_m), "{frequency_hz} Hz: {n_per_m}");
            let n_per_m = shown_n_per_m(frequency_hz, 2.0);
            assert!((0.80e6..0.90e6).contains(&n_per_m), "{frequency_hz} Hz with doubt: {n_per_m}");
        }
        assert!(shown_n_per_m(20.0, 12.0) > 1.0);
        assert!(shown_n_per_m(20.0, 20.0) < 1.0);
    }

    #[test]
    fn a_probe_without_a_clear_rise_and_way_shows_nothing() {
        let mut shown = ShownStiffness::new(1e-3, 3e-3, 8e-3);
        for (rise_n, way_m) in [(1.2, 1e-3), (-5.0, 1e-3), (10.0, 4e-6), (10.0, -1e-3), (f64::NAN, 1e-3)] {
            assert_eq!(shown.take_probe(rise_n, way_m, 1.3), None, "{rise_n} N, {way_m} m");
            assert!(!shown.is_probed() && shown.approach_m_s(15.0).is_none());
        }
        assert_eq!(shown.take_probe(10.0, 2e-3, 1.3), Some(5000.0));
        assert_eq!(shown.approach_m_s(15.0), Some(15.0 / (5000.0 * 8e-3)));
    }

    #[test]
    fn another_bite_begins_without_the_stiffness_of_the_last_one() {
        let mut shown = ShownStiffness { n_per_m: 1e6, ..ShownStiffness::new(1e-3, 0.003, 0.008) };
        assert!((shown.least_damping_n_s_per_m() - 7639.4).abs() < 0.1, "1.5 · 2/π · 1e6 N/m · 8 ms");
        shown.forget();
        assert!(shown.least_damping_n_s_per_m() < 1.0);
    }
}
