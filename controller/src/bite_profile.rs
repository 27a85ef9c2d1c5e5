//! The desired bite force over the time since the contact.

use std::f64::consts::PI;

use masseter_scenario::{BiteProfile, ForceControlConfig};

/// Share of a bite in which the force of a hold is reached.
const RAMP_SHARE: f64 = 0.1;

/// The desired bite force at a time since the contact (s), N; none after the bite.
pub(crate) fn desired_n(config: &ForceControlConfig, time_s: f64) -> Option<f64> {
    let share = time_s / config.bite_s;
    let raised = match config.profile {
        BiteProfile::HalfSine => (PI * share).sin(),
        BiteProfile::Hold => (share / RAMP_SHARE).min(1.0),
    };
    (share < 1.0).then_some(config.contact_n + (config.peak_n - config.contact_n) * raised)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bite_begins_with_the_force_of_contact_and_comes_to_its_peak() {
        let half_sine =
            ForceControlConfig { contact_n: 10.0, peak_n: 50.0, bite_s: 0.2, ..Default::default() };
        let hold = ForceControlConfig { profile: BiteProfile::Hold, ..half_sine };
        let table = [
            (half_sine, [Some(10.0), Some(38.284), Some(50.0), Some(38.284), None]),
            (hold, [Some(10.0), Some(50.0), Some(50.0), Some(50.0), None]),
        ];
        for (config, expected_n) in table {
            for (time_s, expected_n) in [0.0, 0.05, 0.1, 0.15, 0.2].into_iter().zip(expected_n) {
                let found_n = desired_n(&config, time_s);
                let is_near =
                    found_n.zip(expected_n).is_none_or(|(found, expected)| (found - expected).abs() < 0.01);
                assert!(found_n.is_some() == expected_n.is_some() && is_near, "{time_s} s: {found_n:?}");
            }
        }
    }
}
