//! Recordings of three markers on the jaw: their rigid motion from the first row (Kabsch 1976).

use masseter_model::geometry::{Pose, Vec3};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};

use super::axes::Axes;

type Markers = [Vec3; 3];

/// A triangle lower than this share of its longest side fixes no orientation.
const FLATTEST: f64 = 0.05;
/// Markers on one rigid carrier change their distances by noise only; a jaw tracker's is 0.03 mm.
const LARGEST_CHANGE_M: f64 = 0.002;
const SIDES: [(usize, usize); 3] = [(0, 1), (1, 2), (2, 0)];

/// Displacement of the jaw since the first row; `origin` is the incisal point at the closed pose in file coordinates,
/// metres, by default the markers' centroid.
pub(super) fn displacement(
    first: &[f64],
    values: &[f64],
    axes: &Axes,
    origin: Option<Vec3>,
) -> Result<Pose, String> {
    let (closed, now) = (markers(first), markers(values));
    check_spread(&closed)?;
    check_rigid(&closed, &now)?;
    let origin = origin.unwrap_or_else(|| centroid(&closed));
    let motion = rigid_motion(&closed, &now);
    let moved = motion.rotation * origin + motion.translation.vector - origin;
    Ok(Pose::from_parts(axes.vector(&moved).into(), axes.rotation(&motion.rotation)))
}

/// The rigid motion that carries one set of points to the other with the least squared error, by
/// singular value decomposition of their covariance.
fn rigid_motion(from: &Markers, to: &Markers) -> Pose {
    let (from_centre, to_centre) = (centroid(from), centroid(to));
    let covariance: Matrix3<f64> =
        from.iter().zip(to).map(|(a, b)| (b - to_centre) * (a - from_centre).transpose()).sum();
    let svd = covariance.svd_unordered(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { return Pose::identity() };
    // Three points lie in a plane: their least singular value is 0, and its axis may come mirrored.
    let mut upright = Matrix3::identity();
    let least = svd.singular_values.imin();
    upright[(least, least)] = (u * v_t).determinant().signum();
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * upright * v_t));
    Pose::from_parts(Translation3::from(to_centre - rotation * from_centre), rotation)
}

fn markers(values_mm: &[f64]) -> Markers {
    std::array::from_fn(|marker| Vec3::from_column_slice(&values_mm[3 * marker..][..3]) / 1000.0)
}

fn centroid(markers: &Markers) -> Vec3 {
    markers.iter().sum::<Vec3>() / 3.0
}

fn check_spread(markers: &Markers) -> Result<(), String> {
    let [a, b, c] = markers;
    let longest_m = SIDES.map(|(i, j)| (markers[i] - markers[j]).norm()).into_iter().fold(0.0, f64::max);
    let height_m = (b - a).cross(&(c - a)).norm() / longest_m.max(f64::MIN_POSITIVE);
    if height_m <= FLATTEST * longest_m {
        let (height_mm, longest_mm) = (1000.0 * height_m, 1000.0 * longest_m);
        return Err(format!(
            "the markers lie on a line (triangle of height {height_mm:.3} mm over {longest_mm:.3} mm); \
             three points off one line are needed"
        ));
    }
    Ok(())
}

fn check_rigid(closed: &Markers, now: &Markers) -> Result<(), String> {
    for (i, j) in SIDES {
        let change_m = (now[i] - now[j]).norm() - (closed[i] - closed[j]).norm();
        if change_m.abs() > LARGEST_CHANGE_M {
            return Err(format!(
                "markers {} and {} are {:+.2} mm farther apart than in the first row, limit {} mm: \
                 one is loose or swapped; cut or correct the recording",
                i + 1,
                j + 1,
                1000.0 * change_m,
                1000.0 * LARGEST_CHANGE_M
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn coordinates() -> impl Strategy<Value = Vec3> {
        [-0.1..0.1f64, -0.1..0.1f64, -0.1..0.1f64].prop_map(Vec3::from)
    }

    proptest! {
        #[test]
        fn any_rigid_motion_is_recovered(
            a in coordinates(), b in coordinates(), c in coordinates(),
            by in coordinates(), turn in [-1.8..1.8f64, -1.8..1.8f64, -1.8..1.8f64],
        ) {
            let from = [a, b, c];
            prop_assume!(check_spread(&from).is_ok());
            let rotation = UnitQuaternion::from_scaled_axis(Vec3::from(turn));
            let to = from.map(|point| rotation * point + by);
            let motion = rigid_motion(&from, &to);
            for (from, to) in from.iter().zip(&to) {
                prop_assert!((motion.rotation * from + motion.translation.vector - to).norm() < 1e-9);
            }
            prop_assert!((motion.rotation.inverse() * rotation).scaled_axis().norm() < 1e-6);
        }
    }

    fn read(values_mm: [f64; 9]) -> Result<Pose, String> {
        displacement(&CLOSED, &values_mm, &Axes::parse(&["+y", "-x", "+z"].map(String::from)).unwrap(), None)
    }

    const CLOSED: [f64; 9] = [0.0, 0.0, 0.0, 40.0, 0.0, 0.0, 0.0, 40.0, 0.0];

    #[test]
    fn a_shift_of_all_markers_is_a_shift_of_the_jaw_in_its_own_axes() {
        let moved = [1.0, 2.0, 3.0, 41.0, 2.0, 3.0, 1.0, 42.0, 3.0];
        let pose = read(moved).unwrap();
        assert!((pose.translation.vector - Vec3::new(0.002, -0.001, 0.003)).norm() < 1e-12);
        assert!(pose.rotation.angle() < 1e-7);
    }

    #[test]
    fn markers_that_tell_no_pose_are_refused() {
        let axes = Axes::parse(&["+x", "+y", "+z"].map(String::from)).unwrap();
        for flat in [[0.0, 0.0, 0.0, 40.0, 0.0, 0.0, 80.0, 1.0, 0.0], [5.0; 9]] {
            let error = displacement(&flat, &flat, &axes, None).unwrap_err();
            assert!(error.contains("lie on a line"), "{error}");
        }
        let mut loose = CLOSED;
        loose[3] = 43.0;
        assert!(read(loose).unwrap_err().starts_with("markers 1 and 2 are +3.00 mm farther apart"));
    }
}
