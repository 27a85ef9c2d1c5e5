//! The law of every contact: Hunt and Crossley, "Coefficient of restitution interpreted as damping in vibroimpact", 1975.
//!
//! The damping grows with the elastic force. So the force begins at 0 with the contact, however fast the contact comes.

/// The force of a contact, N, from its elastic force (N), its damping (s/m) and the speed of its compression (m/s). A contact
/// pushes and never pulls.
pub(super) fn force_n(elastic_n: f64, damping_s_per_m: f64, closing_m_s: f64) -> f64 {
    elastic_n * (1.0 + damping_s_per_m * closing_m_s).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contact_at_any_speed_begins_without_a_jump_and_never_pulls() {
        assert!([0.06, 5.0].iter().all(|closing_m_s| force_n(0.0, 2.5, *closing_m_s).abs() < 1e-12));
        assert!(force_n(100.0, 2.5, -10.0).abs() < 1e-12);
        assert!(force_n(100.0, 2.5, 0.06) > 100.0 && force_n(100.0, 2.5, -0.06) < 100.0);
    }
}
