//! A load cell that measures the bite force of the emulated jaw: `[load_cell]`.

use super::error::ScenarioError;
use super::force::ForceControlConfig;
use super::need::{keyed, require_within};

section! {
    /// The load cell.
    #[derive(Copy)]
    pub struct LoadCellConfig {
        /// Bandwidth of its amplifier, a low-pass of first order, Hz.
        pub bandwidth_hz: f64 = 500.0,
        /// Noise of a sample, rms, N.
        pub noise_n: f64 = 0.1,
        /// What the cell shows without load, N.
        pub offset_n: f64 = 0.0,
        /// Ends of its range on both sides, N: beyond them the cell shows these.
        pub range_n: f64 = 1000.0,
    }
}

impl LoadCellConfig {
    /// Time constant of the low-pass, s.
    pub fn time_s(&self) -> f64 {
        1.0 / (std::f64::consts::TAU * self.bandwidth_hz)
    }

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        let bounds = [(1.0, 1e5), (0.0, 1000.0), (-1000.0, 1000.0), (0.1, 1e5)];
        let values = keyed!("load_cell", self, bandwidth_hz noise_n offset_n range_n);
        let within =
            values.into_iter().zip(bounds).map(|((key, value), (least, most))| (key, value, least, most));
        require_within(&within.collect::<Vec<_>>())
    }

    /// Refuses a cell by which this control cannot tell a bite: one that is full below the peak, or that shows a contact
    /// without one.
    pub(super) fn require_for(&self, control: &ForceControlConfig) -> Result<(), ScenarioError> {
        let Self { noise_n, offset_n, range_n, .. } = *self;
        let [most_offset_n, most_noise_n] = [control.contact_n / 2.0, control.contact_n / 5.0];
        let least_range_n = 1.2 * control.peak_n + offset_n.abs() + 5.0 * noise_n;
        let bad = |key, value, need: String| Err(ScenarioError::bad(key, &value, need));
        if offset_n.abs() >= most_offset_n {
            let need = format!(
                "use less than {most_offset_n} N on both sides, half of force_control.contact_n: with more, the controller \
                 takes the offset for a contact, or misses one"
            );
            return bad("load_cell.offset_n", offset_n, need);
        }
        if noise_n > most_noise_n {
            let need = format!(
                "use at most {most_noise_n} N, a fifth of force_control.contact_n: with more, noise looks like a contact"
            );
            return bad("load_cell.noise_n", noise_n, need);
        }
        if range_n < least_range_n {
            let need = format!(
                "use at least {least_range_n} N, 1.2 times force_control.peak_n with offset and five times the noise: a \
                 cell at the end of its range hides the force"
            );
            return bad("load_cell.range_n", range_n, need);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_load_cell_at_the_bounds_of_control_is_accepted() {
        let control = ForceControlConfig { peak_n: 60.0, ..ForceControlConfig::default() };
        let cell =
            LoadCellConfig { noise_n: 2.0, offset_n: -4.0, range_n: 86.0, ..LoadCellConfig::default() };
        assert!(cell.require_for(&control).is_ok());
        let narrow = LoadCellConfig { range_n: 85.9, ..cell };
        assert!(narrow.require_for(&control).is_err());
    }
}
