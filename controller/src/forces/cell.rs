//! The load cell beside the observer: both measure the bite force, each with an uncertainty of its own.

use masseter_scenario::LoadCellConfig;

/// Uncertainties are this many standard deviations.
pub(super) const COVERAGE: f64 = 2.0;
/// A cell within this many standard deviations of an end of its range may stand at this end.
const NEAR_END: f64 = 4.0;

/// A bite force with its uncertainty, N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Known {
    pub bite_n: f64,
    pub uncertainty_n: f64,
}

impl Known {
    /// The mean of both, weighted by their variances. Where they differ by more than both uncertainties allow, one of them is
    /// wrong: then the uncertainty reaches beyond both.
    fn fused_with(self, other: Self) -> Self {
        let both = [self, other];
        let [own, others] = both.map(|known| known.uncertainty_n.powi(-2));
        let bite_n = (self.bite_n * own + other.bite_n * others) / (own + others);
        let reaches_n = both.map(|known| (bite_n - known.bite_n).abs() + known.uncertainty_n);
        let is_wrong = (self.bite_n - other.bite_n).abs() > self.uncertainty_n.hypot(other.uncertainty_n);
        let uncertainty_n =
            if is_wrong { reaches_n[0].max(reaches_n[1]) } else { (own + others).sqrt().recip() };
        Self { bite_n, uncertainty_n }
    }
}

/// A load cell, tared while nothing touches the jaw.
#[derive(Debug, Clone)]
pub(super) struct Cell {
    config: LoadCellConfig,
    /// Share of what is new that a low-pass as slow as the cell takes in a period.
    share: f64,
    /// What the cell shows, N; NaN before the first sample.
    shown_n: f64,
    /// This behind the low-pass, N: as late behind the cell as the cell behind the force.
    late_n: f64,
    /// Sum (N) and number of the samples without load.
    tare_n: f64,
    tares: f64,
    /// None where the cell sticks, is at an end of its range, or has no tare.
    known: Option<Known>,
}

impl Cell {
    pub(super) fn new(config: LoadCellConfig, period_s: f64) -> Self {
        let share = period_s / (period_s + config.time_s());
        Self { config, share, shown_n: f64::NAN, late_n: 0.0, tare_n: 0.0, tares: 0.0, known: None }
    }

    /// Takes a sample (N). A noisy cell that shows the very same value twice sticks, or stands at an end of its range.
    pub(super) fn take_sample(&mut self, shown_n: f64, is_loaded: bool) {
        let LoadCellConfig { noise_n, range_n, .. } = self.config;
        let before_n = std::mem::replace(&mut self.shown_n, shown_n);
        self.late_n += (shown_n - self.late_n) * self.share;
        let measures =
            shown_n.to_bits() != before_n.to_bits() && shown_n.abs() < range_n - NEAR_END * noise_n;
        if measures && !is_loaded {
            (self.tare_n, self.tares) = (self.tare_n + shown_n, self.tares + 1.0);
        }
        self.known = (measures && is_loaded && self.tares > 0.0).then(|| {
            let noises_n = COVERAGE * noise_n * (1.0 + 1.0 / self.tares).sqrt();
            Known {
                bite_n: shown_n - self.tare_n / self.tares,
                uncertainty_n: noises_n.hypot(shown_n - self.late_n),
            }
        });
    }

    /// What observer and cell know together; the observer's alone where the cell measures nothing.
    pub(super) fn fused(&self, observed: Known) -> Known {
        self.known.map_or(observed, |known| known.fused_with(observed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OBSERVED: Known = Known { bite_n: 32.0, uncertainty_n: 6.0 };
    const CELL: LoadCellConfig =
        LoadCellConfig { bandwidth_hz: 500.0, noise_n: 0.1, offset_n: 7.0, range_n: 100.0 };

    /// A sample of a force, N: 7 N of offset, and noise of 0.1 N rms whose sign alternates.
    fn shown_n(cycle: u32, force_n: f64) -> f64 {
        (force_n + 7.0 + if cycle.is_multiple_of(2) { 0.1 } else { -0.1 }).clamp(-100.0, 100.0)
    }

    /// A cell after 1000 samples without load and 20 with these.
    fn after(loaded_n: impl Fn(u32) -> f64) -> Cell {
        let mut cell = Cell::new(CELL, 1e-3);
        (0..1000).for_each(|cycle| cell.take_sample(shown_n(cycle, 0.0), false));
        (0..20).for_each(|cycle| cell.take_sample(loaded_n(cycle), true));
        cell
    }

    #[test]
    fn a_tared_cell_counts_by_its_noise_whatever_its_offset() {
        let fused = after(|cycle| shown_n(cycle, 30.0)).fused(OBSERVED);
        assert!((fused.bite_n - 30.0).abs() < 0.11, "{fused:?}");
        assert!((0.2..0.3).contains(&fused.uncertainty_n), "{fused:?}");
    }

    #[test]
    fn a_cell_at_the_end_of_its_range_or_without_a_tare_leaves_the_observers_value() {
        let near_end_n = |cycle| shown_n(cycle, 92.8);
        for cell in [after(|cycle| shown_n(cycle, 200.0)), after(near_end_n), Cell::new(CELL, 1e-3)] {
            assert_eq!(cell.fused(OBSERVED), OBSERVED);
        }
        let mut untared = Cell::new(CELL, 1e-3);
        (0..20).for_each(|cycle| untared.take_sample(shown_n(cycle, 30.0), true));
        assert_eq!(untared.fused(OBSERVED), OBSERVED);
    }

    #[test]
    fn a_cell_that_sticks_leaves_the_observers_value_even_near_it() {
        for stuck_n in [7.0, 37.0] {
            assert_eq!(after(|_| stuck_n).fused(OBSERVED), OBSERVED, "{stuck_n}");
        }
    }

    #[test]
    fn a_noisy_cell_beside_the_load_widens_the_uncertainty_over_both_values() {
        // A bypass takes the load: the cell shows none, the observer 32 N.
        let Known { bite_n, uncertainty_n } = after(|cycle| shown_n(cycle, 0.0)).fused(OBSERVED);
        assert!(bite_n - uncertainty_n < 0.0 && bite_n + uncertainty_n > 37.9, "{bite_n} {uncertainty_n}");
    }

    #[test]
    fn two_values_that_agree_are_weighted_by_their_variances() {
        let [one, other] =
            [(10.0, 3.0), (15.0, 4.0)].map(|(bite_n, uncertainty_n)| Known { bite_n, uncertainty_n });
        let fused = one.fused_with(other);
        assert!(
            (fused.bite_n - 11.8).abs() < 1e-12 && (fused.uncertainty_n - 2.4).abs() < 1e-12,
            "{fused:?}"
        );
    }
}
