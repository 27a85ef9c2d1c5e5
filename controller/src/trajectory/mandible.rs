//! The mandible as a rigid body on two condylar paths, and its place on the platform.
//!
//! Condyles and incisal point form Bonwill's triangle, inclined to the occlusal plane by Balkwill's angle. A posture
//! has three coordinates. They are the advance of both condyles along the sagittal path, the further advance of the
//! balancing condyle, and the pitch about their line. The balancing path turns inward by the Bennett angle. The working
//! condyle shifts sideways as the fixed distance between the condyles demands (the Bennett movement, about half a
//! millimetre).
//!
//! Simplified: the paths are straight, working and balancing side share their inclination, and
//! neither discs, muscles nor tooth contacts guide anything.

use masseter_model::geometry::{Actuators, LEGS, Mechanism, Pose, Vec3};
use masseter_recorded_motion::{TrajectoryError, condylar_middle, points_in_jaw_frame, ranges_of};
use masseter_scenario::{JawConfig, JawSide};
use nalgebra::{Quaternion, Translation3, UnitQuaternion};

/// Largest error of a reached amplitude, mm.
const REACHED_MM: f64 = 1e-6;

/// A rigid mandible; jaw frame at the closed pose.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mandible {
    /// Middle between the condyles.
    middle: Vec3,
    /// Angle of the incisal point below the condyles, seen from the condyles, rad.
    declination_rad: f64,
    width_m: f64,
    path: Vec3,
    balancing_path: Vec3,
    /// +1 when the left side works, −1 when the right does.
    working: f64,
}

/// The mandible's position on its paths.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Posture {
    /// Opening about the line between the condyles, radians.
    pub pitch_rad: f64,
    /// Advance of both condyles along the sagittal path, metres.
    pub advance_m: f64,
    /// Further advance of the balancing condyle along its own path, metres.
    pub balancing_m: f64,
}

impl Posture {
    pub(super) fn scaled(&self, share: f64) -> Self {
        Self {
            pitch_rad: self.pitch_rad * share,
            advance_m: self.advance_m * share,
            balancing_m: self.balancing_m * share,
        }
    }
}

/// Effect of the balancing condyle alone on the line between the condyles.
struct CondylarLine {
    shift: Vec3,
    turn: UnitQuaternion<f64>,
    /// Its direction, from right to left.
    direction: Vec3,
}

impl Mandible {
    /// The inclination and the Bennett angle set the paths along which the condyles glide.
    pub(super) fn new(
        jaw: &JawConfig,
        inclination_deg: f64,
        bennett_angle_deg: f64,
        working: JawSide,
    ) -> Result<Self, TrajectoryError> {
        let (down, forward) = inclination_deg.to_radians().sin_cos();
        let (inward, straight) = bennett_angle_deg.to_radians().sin_cos();
        let working = working.sign();
        let middle = condylar_middle(jaw)?;
        Ok(Self {
            middle,
            declination_rad: declination(&-middle),
            width_m: jaw.bonwill_side_m,
            path: Vec3::new(forward, 0.0, -down),
            balancing_path: Vec3::new(forward * straight, working * forward * inward, -down),
            working,
        })
    }

    /// A mandible for symmetric motions.
    pub(super) fn symmetric(jaw: &JawConfig, inclination_deg: f64) -> Result<Self, TrajectoryError> {
        Self::new(jaw, inclination_deg, 0.0, JawSide::Left)
    }

    /// Displacement of the jaw from the closed pose: the way of the incisal point, and the turn.
    pub(super) fn displacement(&self, posture: &Posture) -> Pose {
        let line = self.condylar_line(posture.balancing_m);
        let pitch = UnitQuaternion::from_axis_angle(&Vec3::y_axis(), posture.pitch_rad);
        let rotation = line.turn * pitch;
        let middle = self.middle + line.shift + self.path * posture.advance_m;
        Pose::from_parts((middle - rotation * self.middle).into(), rotation)
    }

    /// The posture with the incisal point at these coordinates in the midsagittal plane and this advance of the
    /// balancing condyle. The lateral coordinate follows. None out of reach.
    ///
    /// The incisal point lies at its fixed distance from the condyles' middle M + c u, in the plane across their line.
    /// This condition is a quadratic in the advance c.
    pub(super) fn posture_at(&self, anterior_m: f64, up_m: f64, balancing_m: f64) -> Option<Posture> {
        let line = self.condylar_line(balancing_m);
        let across = |x: f64, z: f64| {
            Vec3::new(x, -(x * line.direction.x + z * line.direction.z) / line.direction.y, z)
        };
        let from = self.middle + line.shift;
        let arm = across(anterior_m - from.x, up_m - from.z);
        let path = across(self.path.x, self.path.z);
        let half = arm.dot(&path);
        let beyond = arm.norm_squared() - self.middle.norm_squared();
        let root_squared = half * half - path.norm_squared() * beyond;
        if root_squared < 0.0 {
            return None;
        }
        let advance_m = (half - root_squared.sqrt()) / path.norm_squared();
        let arm = line.turn.inverse() * (arm - path * advance_m);
        let pitch_rad = declination(&arm) - self.declination_rad;
        Some(Posture { pitch_rad, advance_m, balancing_m })
    }

    fn condylar_line(&self, balancing_m: f64) -> CondylarLine {
        let advance = self.balancing_path * balancing_m;
        let across_m = (self.width_m.powi(2) - advance.x.powi(2) - advance.z.powi(2)).max(0.0).sqrt();
        let side_shift_m = self.working * advance.y - self.width_m + across_m;
        let shift = (advance + Vec3::y() * (self.working * side_shift_m)) / 2.0;
        let direction =
            Vec3::new(-self.working * advance.x, across_m, -self.working * advance.z) / self.width_m;
        CondylarLine { shift, turn: turn_of_y_to(&direction), direction }
    }
}

/// Angle below the horizontal in the sagittal plane, radians.
fn declination(arm: &Vec3) -> f64 {
    (-arm.z).atan2(arm.x)
}

/// The shortest rotation of ŷ to a unit vector that is not −ŷ.
fn turn_of_y_to(direction: &Vec3) -> UnitQuaternion<f64> {
    let half = Quaternion::from_parts(1.0 + direction.y, Vec3::y().cross(direction));
    UnitQuaternion::from_quaternion(half)
}

/// The coordinate in 0..=`highest` at which the incisal point's travel (metres, rising from 0) is an amplitude. A
/// coordinate without a travel is too high. Sixty halvings exhaust double precision.
pub(super) fn reach(
    name: &str,
    amplitude_mm: f64,
    highest: f64,
    travel_m: impl Fn(f64) -> Option<f64>,
) -> Result<f64, TrajectoryError> {
    let (mut below, mut above) = (0.0, highest);
    for _ in 0..60 {
        let middle = f64::midpoint(below, above);
        let is_below = travel_m(middle).is_some_and(|travel_m| 1000.0 * travel_m < amplitude_mm);
        if is_below { below = middle } else { above = middle }
    }
    let reached_mm = 1000.0 * travel_m(below).unwrap_or_default();
    if amplitude_mm - reached_mm > REACHED_MM {
        return Err(TrajectoryError(format!(
            "{name} of {amplitude_mm:?} mm is out of reach: the mandible reaches at most {reached_mm:.1} mm; \
             choose a smaller amplitude"
        )));
    }
    Ok(below)
}

/// The jaw on the platform: from displacements of the lower jaw to poses of the platform.
///
/// Platform = closed · X · T · X⁻¹, where X is the jaw frame in the platform frame at the closed pose. The jaw frame
/// has its origin at the incisal point, and axes parallel to the base's.
#[derive(Debug, Clone, Copy)]
pub(super) struct JawFrame {
    /// closed · X: the jaw frame in the base frame.
    jaw: Pose,
    /// X⁻¹.
    platform_in_jaw: Pose,
}

impl JawFrame {
    pub(super) fn new(jaw: &JawConfig, mechanism: &Mechanism) -> Result<Self, TrajectoryError> {
        let closed = closed_pose(jaw, mechanism)?;
        let jaw_in_platform = jaw_in_platform(jaw, &closed);
        Ok(Self { jaw: closed * jaw_in_platform, platform_in_jaw: jaw_in_platform.inverse() })
    }

    /// The platform in the base frame for a displacement of the jaw from the closed pose.
    pub(super) fn platform(&self, displacement: &Pose) -> Pose {
        self.jaw * displacement * self.platform_in_jaw
    }
}

/// X.
fn jaw_in_platform(jaw: &JawConfig, closed: &Pose) -> Pose {
    Pose::from_parts(Translation3::from(jaw.reference_point_m), closed.rotation.inverse())
}

/// The platform in the base frame for the closed jaw.
///
/// # Errors
/// When a value lies outside its range, or no such pose exists.
pub fn closed_pose(jaw: &JawConfig, mechanism: &Mechanism) -> Result<Pose, TrajectoryError> {
    let JawConfig { closed_leg_m, closed_offset_m, .. } = *jaw;
    jaw.check_ranges(ranges_of("jaw"))?;
    let actuators = Actuators { slide_m: [0.0; LEGS], leg_m: [closed_leg_m; LEGS] };
    let closed = crate::kinematics::solve_completely(mechanism, &actuators).map_err(|error| {
        TrajectoryError(format!("jaw.closed_leg_m = {closed_leg_m:?} m gives no closed pose: {error}"))
    })?;
    Ok(Translation3::from(closed_offset_m) * closed.pose)
}

/// Incisal point, right and left condyle in the platform frame, with the closed jaw at that pose.
///
/// # Errors
/// When a dimension of the mandible lies outside its range.
pub fn closed_jaw_points(jaw: &JawConfig, closed: &Pose) -> Result<[Vec3; 3], TrajectoryError> {
    let jaw_in_platform = jaw_in_platform(jaw, closed);
    Ok(points_in_jaw_frame(jaw)?.map(|point| jaw_in_platform.transform_point(&point.into()).coords))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn mandible(working: JawSide) -> Mandible {
        Mandible::new(&JawConfig::default(), 40.0, 8.0, working).unwrap()
    }

    /// Ways of the condyles, working and balancing, metres.
    fn condyles(mandible: &Mandible, displacement: &Pose) -> [Vec3; 2] {
        [1.0, -1.0].map(|side| {
            let at = mandible.middle + Vec3::y() * (side * mandible.working * mandible.width_m / 2.0);
            displacement.rotation * at + displacement.translation.vector - at
        })
    }

    proptest! {
        #[test]
        fn condyles_stay_on_their_paths(
            pitch_rad in 0.0..0.7f64, advance_m in 0.0..0.02f64, balancing_m in 0.0..0.012f64, left: bool,
        ) {
            let mandible = mandible(if left { JawSide::Left } else { JawSide::Right });
            let displacement = mandible.displacement(&Posture { pitch_rad, advance_m, balancing_m });
            let [working, balancing] = condyles(&mandible, &displacement);
            let common = mandible.path * advance_m;
            prop_assert!((balancing - common - mandible.balancing_path * balancing_m).norm() < 1e-12);
            let shift = working - common;
            prop_assert!(shift.x.abs() < 1e-12 && shift.z.abs() < 1e-12);
            prop_assert!(shift.y.abs() < 0.0011);
        }

        #[test]
        fn the_posture_for_a_point_is_the_one_that_led_there(
            pitch_rad in 0.0..0.7f64, advance_m in 0.0..0.02f64, balancing_m in 0.0..0.012f64,
        ) {
            let mandible = mandible(JawSide::Left);
            let posture = Posture { pitch_rad, advance_m, balancing_m };
            let incisal = mandible.displacement(&posture).translation;
            let again = mandible.posture_at(incisal.x, incisal.z, balancing_m).unwrap();
            prop_assert!((again.pitch_rad - pitch_rad).abs() < 1e-9);
            prop_assert!((again.advance_m - advance_m).abs() < 1e-10);
        }
    }

    #[test]
    fn opening_lowers_the_incisal_point_and_balancing_swings_it_to_the_working_side() {
        for (side, sign) in [(JawSide::Left, 1.0), (JawSide::Right, -1.0)] {
            let mandible = mandible(side);
            let opened = mandible.displacement(&Posture { pitch_rad: 0.2, ..Default::default() });
            assert!(opened.translation.z < -0.01 && opened.translation.x < 0.0);
            let swung = mandible.displacement(&Posture { balancing_m: 0.005, ..Default::default() });
            assert!(swung.translation.y * sign > 0.002);
        }
    }

    #[test]
    fn what_lies_beyond_the_mandible_is_out_of_reach() {
        assert_eq!(mandible(JawSide::Left).posture_at(-0.3, -0.3, 0.0), None);
    }
}
