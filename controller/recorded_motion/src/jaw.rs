//! The points of the lower jaw whose ways are judged. Condyles and incisal point form Bonwill's triangle, inclined to
//! the occlusal plane by Balkwill's angle.

use masseter_model::geometry::Vec3;
use masseter_scenario::JawConfig;

use super::{TrajectoryError, ranges_of, require};

/// Incisal point, right and left condyle in the jaw frame at the closed pose, m.
///
/// # Errors
/// When a dimension of the mandible lies outside its range.
pub fn points_in_jaw_frame(jaw: &JawConfig) -> Result<[Vec3; 3], TrajectoryError> {
    let middle = condylar_middle(jaw)?;
    let aside = Vec3::new(0.0, jaw.bonwill_side_m / 2.0, 0.0);
    Ok([Vec3::zeros(), middle - aside, middle + aside])
}

/// The middle between the condyles in the jaw frame at the closed pose.
///
/// # Errors
/// When a dimension of the mandible lies outside its range.
pub fn condylar_middle(jaw: &JawConfig) -> Result<Vec3, TrajectoryError> {
    let side_m = jaw.bonwill_side_m;
    let balkwill_deg = jaw.balkwill_angle_deg;
    jaw.check_ranges(ranges_of("jaw"))?;
    require("jaw.balkwill_angle_deg", balkwill_deg, (0.0..90.0).contains(&balkwill_deg), "0 to below 90")?;
    let height_m = side_m * 3f64.sqrt() / 2.0;
    let (sin, cos) = balkwill_deg.to_radians().sin_cos();
    Ok(Vec3::new(-height_m * cos, 0.0, height_m * sin))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jaw_of_impossible_size_is_refused() {
        let of = |bonwill_side_m, balkwill_angle_deg| {
            let jaw = JawConfig { bonwill_side_m, balkwill_angle_deg, ..JawConfig::default() };
            condylar_middle(&jaw).map_err(|error| error.to_string())
        };
        assert!([(0.01, 0.0), (1.0, 89.9)].into_iter().all(|(side_m, deg)| of(side_m, deg).is_ok()));
        for side_m in [0.0099, 1.01, 3.8e173, f64::NAN] {
            assert!(of(side_m, 22.5).is_err_and(|error| error.contains("0.01 to 1 m")), "{side_m}");
        }
        for deg in [-0.1, 90.0] {
            assert!(of(0.1, deg).is_err_and(|error| error.contains("0 to below 90")), "{deg}");
        }
    }
}
