//! Opening, protrusion and lateral excursion: a straight way through the mandible's postures to the
//! farthest one, and back.
//!
//! Opening advances the condyles in proportion to its angle, 14.8 mm in 32.2° (Kordaß 2014, n = 259:
//! 14.5 and 15.1 mm right and left), from the first millimetre on (Mehl 2025). Protrusion glides
//! along the condylar path without turning; in a lateral excursion the balancing condyle advances
//! alone. Simplified: no tooth guides the jaw near the closed pose.

use masseter_model::geometry::Pose;
use masseter_scenario::{JawConfig, LateralConfig, OpeningConfig, ProtrusionConfig};

use super::TrajectoryError;
use super::error::require;
use super::mandible::{Mandible, Posture, reach};
use super::rhythm::MotionRhythm;

/// Condylar advance a radian of opening, m/rad.
const ADVANCE_PER_PITCH_M: f64 = 0.0148 / (32.2 * std::f64::consts::PI / 180.0);
/// Widest opening that is looked for, radians (measured: up to 41.8°).
const LARGEST_PITCH_RAD: f64 = 0.8;
/// Farthest advance of the balancing condyle that is looked for, metres.
const LARGEST_BALANCING_M: f64 = 0.025;

/// The generator.
#[derive(Debug, Clone, Copy)]
pub(super) struct Excursion {
    mandible: Mandible,
    pub cycle: MotionRhythm,
    farthest: Posture,
}

impl Excursion {
    pub(super) fn opening(config: &OpeningConfig, jaw: &JawConfig) -> Result<Self, TrajectoryError> {
        let mandible = Mandible::symmetric(jaw, config.condylar_inclination_deg)?;
        let cycle = MotionRhythm::new(config.cycle_rate_hz, &config.phases)?;
        let posture = |pitch_rad| Posture {
            pitch_rad,
            advance_m: ADVANCE_PER_PITCH_M * pitch_rad,
            ..Default::default()
        };
        let travel = |at: &Pose| at.translation.vector.norm();
        let pitch_rad = farthest(config.amplitude_mm, LARGEST_PITCH_RAD, |pitch_rad| {
            travel(&mandible.displacement(&posture(pitch_rad)))
        })?;
        Ok(Self { mandible, cycle, farthest: posture(pitch_rad) })
    }

    pub(super) fn protrusion(config: &ProtrusionConfig, jaw: &JawConfig) -> Result<Self, TrajectoryError> {
        let mandible = Mandible::symmetric(jaw, config.condylar_inclination_deg)?;
        let cycle = MotionRhythm::new(config.cycle_rate_hz, &config.phases)?;
        let amplitude_mm = config.amplitude_mm;
        require("motion.amplitude_mm", amplitude_mm, (0.0..=15.0).contains(&amplitude_mm), "0 to 15 mm")?;
        let farthest = Posture { advance_m: amplitude_mm / 1000.0, ..Default::default() };
        Ok(Self { mandible, cycle, farthest })
    }

    pub(super) fn lateral(config: &LateralConfig, jaw: &JawConfig) -> Result<Self, TrajectoryError> {
        let LateralConfig { condylar_inclination_deg, bennett_angle_deg, side, .. } = *config;
        let mandible = Mandible::new(jaw, condylar_inclination_deg, bennett_angle_deg, side)?;
        let cycle = MotionRhythm::new(config.cycle_rate_hz, &config.phases)?;
        let posture = |balancing_m| Posture { balancing_m, ..Default::default() };
        let balancing_m = farthest(config.amplitude_mm, LARGEST_BALANCING_M, |balancing_m| {
            side.sign() * mandible.displacement(&posture(balancing_m)).translation.y
        })?;
        Ok(Self { mandible, cycle, farthest: posture(balancing_m) })
    }

    /// Displacement of the jaw from the closed pose, jaw frame.
    pub(super) fn displacement(&self, motion_s: f64) -> Pose {
        let opened = self.cycle.opened(self.cycle.phase(motion_s));
        self.mandible.displacement(&self.farthest.scaled(opened))
    }
}

/// The coordinate at which the incisal point's travel, metres, is the amplitude.
fn farthest(amplitude_mm: f64, highest: f64, travel_m: impl Fn(f64) -> f64) -> Result<f64, TrajectoryError> {
    require("motion.amplitude_mm", amplitude_mm, amplitude_mm >= 0.0, "0 or above")?;
    reach("motion.amplitude_mm", amplitude_mm, highest, |coordinate| Some(travel_m(coordinate)))
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::Vec3;
    use masseter_scenario::JawSide;

    use super::*;

    /// Millimetres at the farthest point.
    fn farthest_mm(excursion: &Excursion) -> Vec3 {
        excursion.mandible.displacement(&excursion.farthest).translation.vector * 1000.0
    }

    #[test]
    fn amplitudes_are_reached() {
        let jaw = JawConfig::default();
        for amplitude_mm in [5.0, 35.0, 56.1] {
            let config = OpeningConfig { amplitude_mm, ..Default::default() };
            let incisal = farthest_mm(&Excursion::opening(&config, &jaw).unwrap());
            assert!(
                (incisal.norm() - amplitude_mm).abs() < 1e-9 && incisal.z < 0.0 && incisal.y.abs() < 1e-12
            );
        }
        let config = ProtrusionConfig { amplitude_mm: 9.0, ..Default::default() };
        let incisal = farthest_mm(&Excursion::protrusion(&config, &jaw).unwrap());
        assert!((incisal.norm() - 9.0).abs() < 1e-9 && incisal.x > 0.0);
        for side in [JawSide::Left, JawSide::Right] {
            let config = LateralConfig { side, ..Default::default() };
            let incisal = farthest_mm(&Excursion::lateral(&config, &jaw).unwrap());
            assert!((incisal.y * side.sign() - 8.0).abs() < 1e-9);
        }
    }

    /// Mean opening of 259 subjects: 44.3 mm at 32.2°.
    #[test]
    fn the_mean_opening_has_about_the_mean_angle() {
        let config = OpeningConfig { amplitude_mm: 44.3, ..Default::default() };
        let opening = Excursion::opening(&config, &JawConfig::default()).unwrap();
        assert!((opening.farthest.pitch_rad.to_degrees() - 32.2).abs() < 6.0);
    }

    #[test]
    fn too_much_is_refused_with_what_is_possible() {
        let config = OpeningConfig { amplitude_mm: 120.0, ..Default::default() };
        let error = Excursion::opening(&config, &JawConfig::default()).unwrap_err();
        assert!(error.to_string().contains("out of reach: the mandible reaches at most 68.7 mm"), "{error}");
        let config = LateralConfig { amplitude_mm: f64::NAN, ..Default::default() };
        assert!(Excursion::lateral(&config, &JawConfig::default()).is_err());
    }
}
