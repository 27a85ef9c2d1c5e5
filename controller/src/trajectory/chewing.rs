//! Chewing: a tear-drop loop of the incisal point.
//!
//! The incisal point goes down and back, near the midline at first, swings to the working side, and
//! closes from there to rest in occlusion. The defaults follow published figures:
//! - cycle of 0.70 s (Dental Biotribology); rates of 1.46 ± 0.21 Hz (Fuentes 2018) and 1.57 Hz (Po 2011);
//! - opening 16–20 mm, lateral 3–5 mm, anteroposterior 3–6 mm (textbook);
//! - condylar inclination 40° and Bennett angle 8° (about 42° and 7–9°, IADR 177411);
//! - phases of 43, 40 and 17 %.
//!
//! Simplified: every cycle is the same, the sagittal path is a straight line, food does not matter.

use masseter_model::geometry::Pose;
use masseter_scenario::{ChewingConfig, JawConfig};

use super::TrajectoryError;
use super::error::require;
use super::mandible::{Mandible, Posture, reach};
use super::rhythm::MotionRhythm;

/// Advance of the balancing condyle beyond which no jaw goes, metres.
const LARGEST_BALANCING_M: f64 = 0.02;
/// A condyle may go back from the closed pose by as much as to the retruded contact, metres.
const LARGEST_RETRUSION_M: f64 = 0.001;
/// Points of the cycle at which the path is proven before it is played.
const PROOF_POINTS: u32 = 256;

/// The generator.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chewing {
    mandible: Mandible,
    pub cycle: MotionRhythm,
    down_m: f64,
    back_m: f64,
    balancing_m: f64,
}

impl Chewing {
    pub(super) fn new(config: &ChewingConfig, jaw: &JawConfig) -> Result<Self, TrajectoryError> {
        let ChewingConfig { vertical_mm, lateral_mm, anterior_posterior_mm, .. } = *config;
        require("motion.vertical_mm", vertical_mm, (0.0..=60.0).contains(&vertical_mm), "0 to 60 mm")?;
        require("motion.lateral_mm", lateral_mm, (0.0..=15.0).contains(&lateral_mm), "0 to 15 mm")?;
        let range = -15.0..=40.0;
        let holds = range.contains(&anterior_posterior_mm);
        require("motion.anterior_posterior_mm", anterior_posterior_mm, holds, "-15 to 40 mm")?;
        let (inclination_deg, bennett_angle_deg) =
            (config.condylar_inclination_deg, config.bennett_angle_deg);
        let mut chewing = Self {
            mandible: Mandible::new(jaw, inclination_deg, bennett_angle_deg, config.side)?,
            cycle: MotionRhythm::new(config.cycle_rate_hz, &config.phases)?,
            down_m: vertical_mm / 1000.0,
            back_m: anterior_posterior_mm / 1000.0,
            balancing_m: 0.0,
        };
        // A point that is out of reach without a swing is reported as such.
        chewing.prove()?;
        chewing.balancing_m = chewing.balancing_for(lateral_mm, config.side.sign())?;
        chewing.prove()?;
        Ok(chewing)
    }

    /// Displacement of the jaw from the closed pose, jaw frame.
    pub(super) fn displacement(&self, motion_s: f64) -> Pose {
        // Postures exist at all proven points; a gap between two would be a jump, which `check` stops.
        let posture = self.posture(self.cycle.phase(motion_s)).unwrap_or_default();
        self.mandible.displacement(&posture)
    }

    fn posture(&self, phase: f64) -> Option<Posture> {
        let opened = self.cycle.opened(phase);
        let balancing_m = self.balancing_m * self.cycle.swung(phase);
        self.mandible.posture_at(-self.back_m * opened, -self.down_m * opened, balancing_m)
    }

    /// The balancing condyle's advance that swings the widest open jaw this far to the side.
    fn balancing_for(&self, lateral_mm: f64, sign: f64) -> Result<f64, TrajectoryError> {
        let swing_m = |balancing_m| {
            let widest = Self { balancing_m, ..*self }.posture(self.cycle.opening)?;
            Some(sign * self.mandible.displacement(&widest).translation.y)
        };
        reach("motion.lateral_mm", lateral_mm, LARGEST_BALANCING_M, swing_m)
    }

    fn prove(&self) -> Result<(), TrajectoryError> {
        for point in 0..PROOF_POINTS {
            let phase = f64::from(point) / f64::from(PROOF_POINTS);
            let Some(Posture { advance_m, .. }) = self.posture(phase) else {
                return Err(TrajectoryError(format!(
                    "motion: at {phase:.2} of the chewing cycle the incisal point would be out of the mandible's reach; \
                     bring vertical_mm or anterior_posterior_mm closer to the defaults (18 and 5), or condylar_inclination_deg (40)"
                )));
            };
            if advance_m < -LARGEST_RETRUSION_M {
                let advance_mm = 1000.0 * advance_m;
                return Err(TrajectoryError(format!(
                    "motion: at {phase:.2} of the chewing cycle the condyles would be {advance_mm:.1} mm along their paths; \
                     bring anterior_posterior_mm or lateral_mm closer to what vertical_mm allows (defaults 5, 4 and 18)"
                )));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use masseter_scenario::JawSide;

    use super::*;

    fn chewing(config: &ChewingConfig) -> Chewing {
        Chewing::new(config, &JawConfig::default()).unwrap()
    }

    #[test]
    fn amplitudes_are_reached_on_the_working_side() {
        for (side, sign) in [(JawSide::Left, 1.0), (JawSide::Right, -1.0)] {
            let config = ChewingConfig { side, ..Default::default() };
            let widest_s = config.phases.opening / config.cycle_rate_hz;
            let incisal_mm = chewing(&config).displacement(widest_s).translation.vector * 1000.0;
            assert!((incisal_mm.x + 5.0).abs() < 1e-6);
            assert!((incisal_mm.y - sign * 4.0).abs() < 1e-6);
            assert!((incisal_mm.z + 18.0).abs() < 1e-6);
        }
    }

    #[test]
    fn sides_are_mirror_images() {
        let left = chewing(&ChewingConfig { side: JawSide::Left, ..Default::default() });
        let right = chewing(&ChewingConfig { side: JawSide::Right, ..Default::default() });
        for step in 0..70 {
            let (a, b) =
                (left.displacement(f64::from(step) / 100.0), right.displacement(f64::from(step) / 100.0));
            let (p, q) = (a.translation.vector, b.translation.vector);
            assert!((p.x - q.x).abs() < 1e-12 && (p.y + q.y).abs() < 1e-12 && (p.z - q.z).abs() < 1e-12);
            let (r, s) = (a.rotation.scaled_axis(), b.rotation.scaled_axis());
            assert!((r.x + s.x).abs() < 1e-12 && (r.y - s.y).abs() < 1e-12 && (r.z + s.z).abs() < 1e-12);
        }
    }

    #[test]
    fn the_loop_opens_medially_and_closes_laterally() {
        let config = ChewingConfig::default();
        let chewing = chewing(&config);
        // Half open, going down and coming up.
        let [down, up] =
            [0.215, 0.63].map(|phase| chewing.displacement(phase / config.cycle_rate_hz).translation);
        assert!((down.z - up.z).abs() < 1e-9);
        assert!(up.y - down.y > 0.0005);
    }

    #[test]
    fn what_no_mandible_can_do_is_refused_with_its_name() {
        let level_and_wide =
            ChewingConfig { condylar_inclination_deg: 0.0, vertical_mm: 60.0, ..Default::default() };
        let bad = [
            (ChewingConfig { vertical_mm: f64::NAN, ..Default::default() }, "vertical_mm"),
            (ChewingConfig { lateral_mm: 15.0, vertical_mm: 5.0, ..Default::default() }, "lateral_mm"),
            (ChewingConfig { lateral_mm: -1.0, ..Default::default() }, "lateral_mm"),
            (ChewingConfig { condylar_inclination_deg: 90.0, ..Default::default() }, "inclination"),
            (ChewingConfig { anterior_posterior_mm: 25.0, ..Default::default() }, "anterior_posterior_mm"),
            (level_and_wide, "vertical_mm"),
        ];
        for (config, name) in bad {
            let error = Chewing::new(&config, &JawConfig::default()).unwrap_err().to_string();
            assert!(error.contains(name) && !error.contains("inf") && !error.contains("NaN mm"), "{error}");
        }
    }
}
