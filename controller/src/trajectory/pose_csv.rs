//! Recordings of poses: position of a reference point and orientation, relative to the closed pose.

use masseter_model::geometry::{Pose, Vec3};
use nalgebra::{Quaternion, UnitQuaternion};

use super::axes::Axes;

/// Within this of 1 a quaternion counts as rounded, beyond it as wrong.
const NORM_TOLERANCE: f64 = 1e-3;

/// Displacement of the incisal point and the jaw from that of a reference point fixed to the jaw, given in the jaw frame
/// at the closed pose, metres.
pub(super) fn displacement(values: &[f64], axes: &Axes, reference: &Vec3) -> Result<Pose, String> {
    let moved = axes.vector(&(Vec3::from_column_slice(&values[..3]) / 1000.0));
    let q = &values[3..];
    let quaternion = Quaternion::new(q[0], q[1], q[2], q[3]);
    let norm = quaternion.norm();
    if (norm - 1.0).abs() > NORM_TOLERANCE {
        let remedy = "write unit quaternions in the order qw,qx,qy,qz";
        return Err(format!("the quaternion's norm is {norm:.6}, not 1; {remedy}"));
    }
    let rotation = axes.rotation(&UnitQuaternion::from_quaternion(quaternion));
    let incisal = reference + moved - rotation * reference;
    Ok(Pose::from_parts(incisal.into(), rotation))
}

#[cfg(test)]
mod tests {
    use super::*;
    fn axes() -> Axes {
        Axes::parse(&["+x", "+y", "+z"].map(String::from)).unwrap()
    }

    #[test]
    fn turning_about_the_reference_point_lowers_the_incisal_point() {
        let (sin, cos) = 0.1_f64.sin_cos();
        let reference = Vec3::new(-0.08, 0.0, 0.03);
        let pose = displacement(&[1.0, 0.0, 0.0, cos, 0.0, sin, 0.0], &axes(), &reference).unwrap();
        let at_reference = pose.rotation * reference + pose.translation.vector - reference;
        assert!((at_reference - Vec3::new(0.001, 0.0, 0.0)).norm() < 1e-12);
        assert!(pose.translation.z < -0.015);
    }

    #[test]
    fn quaternions_are_renormalised_within_rounding_and_refused_beyond() {
        let read = |qw: f64| displacement(&[0.0, 0.0, 0.0, qw, 0.0, 0.0, 0.0], &axes(), &Vec3::zeros());
        assert!((read(1.0005).unwrap().rotation.norm() - 1.0).abs() < 1e-15);
        for qw in [0.99, 0.0] {
            assert!(read(qw).unwrap_err().contains("the quaternion's norm is 0."));
        }
    }
}
