//! Generated motions of the jaw: chewing, opening, protrusion and lateral excursion, in a rhythm of phases.

use masseter_model::geometry::Pose;
use masseter_recorded_motion::{TrajectoryError, ranges_of};
use masseter_scenario::{
    ChewingConfig, JawConfig, LateralConfig, OpeningConfig, PhaseShares, ProtrusionConfig,
};

use super::mandible::{Mandible, Posture, reach};

/// Share of the opening after which a swing to the side begins: the jaw opens near the midline.
const SWING_BEGINS: f64 = 0.3;
/// Largest advance of a balancing condyle, metres.
const CHEWING_BALANCING_M: f64 = 0.02;
/// Way of a condyle back from the closed pose to the retruded contact, metres.
const LARGEST_RETRUSION_M: f64 = 0.001;
/// Points of the cycle for the check of the path before its use.
const PROOF_POINTS: u32 = 256;
/// Condylar advance a radian of opening, m/rad.
const ADVANCE_PER_PITCH_M: f64 = 0.0148 / (32.2 * std::f64::consts::PI / 180.0);
/// Widest opening in the search, radians (measured: up to 41.8°).
const LARGEST_PITCH_RAD: f64 = 0.8;
/// Farthest advance of the balancing condyle in the search, metres.
const LARGEST_BALANCING_M: f64 = 0.025;

/// Chewing: a tear-drop loop of the incisal point.
///
/// The incisal point goes down and back, near the midline at first, swings to the working side, and
/// closes from there to rest in occlusion. The defaults follow published figures:
/// - cycle of 0.70 s (Dental Biotribology); rates of 1.46 ± 0.21 Hz (Fuentes 2018) and 1.57 Hz (Po 2011);
/// - opening 16–20 mm, lateral 3–5 mm, anteroposterior 3–6 mm (textbook);
/// - condylar inclination 40° and Bennett angle 8° (about 42° and 7–9°, IADR 177411);
/// - phases of 43, 40 and 17 %.
///
/// Simplified: every cycle is the same, the sagittal path is a straight line, food does not matter.
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
        let ChewingConfig { vertical_mm, lateral_mm, anterior_posterior_mm, side, .. } = *config;
        config.check_ranges(ranges_of("motion"))?;
        let mut chewing = Self {
            mandible: Mandible::new(jaw, config.condylar_inclination_deg, config.bennett_angle_deg, side)?,
            cycle: MotionRhythm::new(config.cycle_rate_hz, &config.phases)?,
            down_m: vertical_mm / 1000.0,
            back_m: anterior_posterior_mm / 1000.0,
            balancing_m: 0.0,
        };
        // A point out of reach without a swing has an error of its own.
        chewing.prove()?;
        chewing.balancing_m = chewing.balancing_for(lateral_mm, side.sign())?;
        chewing.prove()?;
        Ok(chewing)
    }

    /// Displacement of the jaw from the closed pose, jaw frame.
    pub(super) fn displacement(&self, motion_s: f64) -> Pose {
        // Postures exist at all checked points. `check` finds the jump of a gap between two points.
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
        reach("motion.lateral_mm", lateral_mm, CHEWING_BALANCING_M, swing_m)
    }

    fn prove(&self) -> Result<(), TrajectoryError> {
        for point in 0..PROOF_POINTS {
            let phase = f64::from(point) / f64::from(PROOF_POINTS);
            let problem = match self.posture(phase) {
                None => "the incisal point would be out of the mandible's reach; \
                         bring vertical_mm or anterior_posterior_mm closer to the defaults (18 and 5), or condylar_inclination_deg (40)"
                    .to_owned(),
                Some(Posture { advance_m, .. }) if advance_m < -LARGEST_RETRUSION_M => format!(
                    "the condyles would be {:.1} mm along their paths; \
                     bring anterior_posterior_mm or lateral_mm closer to what vertical_mm allows (defaults 5, 4 and 18)",
                    1000.0 * advance_m
                ),
                Some(_) => continue,
            };
            return Err(TrajectoryError(format!("motion: at {phase:.2} of the chewing cycle {problem}")));
        }
        Ok(())
    }
}

/// Opening, protrusion and lateral excursion: a straight way through the mandible's postures to the
/// farthest one, and back.
///
/// Opening advances the condyles in proportion to its angle, from the first millimetre on (Mehl 2025). The advance is
/// 14.8 mm in 32.2° (Kordaß 2014, n = 259: 14.5 and 15.1 mm right and left). Protrusion glides along the condylar path
/// without a turn. In a lateral excursion the balancing condyle advances alone. Simplified: no tooth guides the jaw
/// near the closed pose.
#[derive(Debug, Clone, Copy)]
pub(super) struct Excursion {
    mandible: Mandible,
    pub cycle: MotionRhythm,
    farthest: Posture,
}

impl Excursion {
    pub(super) fn opening(config: &OpeningConfig, jaw: &JawConfig) -> Result<Self, TrajectoryError> {
        config.check_ranges(ranges_of("motion"))?;
        let mandible = Mandible::symmetric(jaw, config.condylar_inclination_deg)?;
        let cycle = MotionRhythm::new(config.cycle_rate_hz, &config.phases)?;
        let posture = |pitch_rad| {
            let advance_m = ADVANCE_PER_PITCH_M * pitch_rad;
            Posture { pitch_rad, advance_m, balancing_m: 0.0 }
        };
        let pitch_rad = farthest(config.amplitude_mm, LARGEST_PITCH_RAD, |pitch_rad| {
            mandible.displacement(&posture(pitch_rad)).translation.vector.norm()
        })?;
        Ok(Self { mandible, cycle, farthest: posture(pitch_rad) })
    }

    pub(super) fn protrusion(config: &ProtrusionConfig, jaw: &JawConfig) -> Result<Self, TrajectoryError> {
        config.check_ranges(ranges_of("motion"))?;
        let mandible = Mandible::symmetric(jaw, config.condylar_inclination_deg)?;
        let cycle = MotionRhythm::new(config.cycle_rate_hz, &config.phases)?;
        let farthest = Posture { advance_m: config.amplitude_mm / 1000.0, ..Default::default() };
        Ok(Self { mandible, cycle, farthest })
    }

    pub(super) fn lateral(config: &LateralConfig, jaw: &JawConfig) -> Result<Self, TrajectoryError> {
        config.check_ranges(ranges_of("motion"))?;
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
    reach("motion.amplitude_mm", amplitude_mm, highest, |coordinate| Some(travel_m(coordinate)))
}

/// The rhythm of a generated motion: out, back, rest, each phase from rest to rest.
///
/// Phases follow the minimum-jerk polynomial, which describes human chewing (Yashiro 2001: R² 0.85–0.88). Velocity and
/// acceleration vanish at the ends of each, so the whole is C².
#[derive(Debug, Clone, Copy)]
pub(super) struct MotionRhythm {
    rate_hz: f64,
    /// The phase of the widest opening.
    opening: f64,
    closing: f64,
}

impl MotionRhythm {
    fn new(rate_hz: f64, phases: &PhaseShares) -> Result<Self, TrajectoryError> {
        let PhaseShares { opening, closing, occlusion } = *phases;
        phases.check_ranges(ranges_of("motion.phases"))?;
        let sum = opening + closing + occlusion;
        if (sum - 1.0).abs() > 1e-6 {
            let problem = "opening, closing and occlusion must add up to 1";
            return Err(TrajectoryError(format!("motion.phases add up to {sum:?}; {problem}")));
        }
        Ok(Self { rate_hz, opening, closing })
    }

    /// Place of the motion in its cycle, 0 to 1.
    fn phase(&self, motion_s: f64) -> f64 {
        (motion_s * self.rate_hz).rem_euclid(1.0)
    }

    /// Share of the way from the closed pose, 0 to 1.
    fn opened(&self, phase: f64) -> f64 {
        if phase < self.opening { minimum_jerk(phase / self.opening) } else { self.returning(phase) }
    }

    /// Share of the way to the working side, 0 to 1: later out than [`opened`](Self::opened), and back with it.
    fn swung(&self, phase: f64) -> f64 {
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

    /// Time of the whole cycles that fit, at least one, s.
    pub(super) fn whole_cycles_s(&self, available_s: f64) -> f64 {
        // The tiny surplus keeps an exact fit from losing a cycle by rounding.
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
    use masseter_model::geometry::Vec3;
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

    /// Millimetres at the farthest point.
    fn farthest_mm(excursion: &Excursion) -> Vec3 {
        excursion.mandible.displacement(&excursion.farthest).translation.vector * 1000.0
    }

    #[test]
    fn amplitudes_of_excursions_are_reached() {
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
            let config = ProtrusionConfig { cycle_rate_hz: rate_hz, ..Default::default() };
            assert!(Excursion::protrusion(&config, &JawConfig::default()).is_err());
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
