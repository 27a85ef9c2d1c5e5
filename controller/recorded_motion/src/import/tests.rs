//! Axes, poses and markers of single rows.

use super::*;

fn parsed(names: [&str; 3]) -> Result<Axes, String> {
    Axes::parse(&names.map(String::from))
}

#[test]
fn a_tracker_frame_becomes_anterior_left_up() {
    let axes = parsed(["+y", "-x", "+z"]).unwrap();
    assert!((axes.vector(&Vec3::new(1.0, 2.0, 3.0)) - Vec3::new(2.0, -1.0, 3.0)).norm() < 1e-15);
    let about_file_y = UnitQuaternion::from_axis_angle(&Vec3::y_axis(), 0.3);
    let about_anterior = UnitQuaternion::from_axis_angle(&Vec3::x_axis(), 0.3);
    assert!(axes.rotation(&about_file_y).angle_to(&about_anterior) < 1e-12);
}

#[test]
fn axes_that_are_no_right_handed_frame_are_refused() {
    let table =
        [(["x", "+y", "+z"], "one of"), (["+x", "+x", "+z"], "twice"), (["+y", "+x", "+z"], "left-handed")];
    for (names, reason) in table {
        assert!(parsed(names).unwrap_err().contains(reason));
    }
}

#[test]
fn turning_about_the_reference_point_lowers_the_incisal_point() {
    let (sin, cos) = 0.1_f64.sin_cos();
    let reference = Vec3::new(-0.08, 0.0, 0.03);
    let pose = displacement_of_pose(
        &[1.0, 0.0, 0.0, cos, 0.0, sin, 0.0],
        &parsed(["+x", "+y", "+z"]).unwrap(),
        &reference,
    )
    .unwrap();
    let at_reference = pose.rotation * reference + pose.translation.vector - reference;
    assert!((at_reference - Vec3::new(0.001, 0.0, 0.0)).norm() < 1e-12);
    assert!(pose.translation.z < -0.015);
}

#[test]
fn quaternions_are_renormalised_within_rounding_and_refused_beyond() {
    let read = |qw: f64| {
        displacement_of_pose(
            &[0.0, 0.0, 0.0, qw, 0.0, 0.0, 0.0],
            &parsed(["+x", "+y", "+z"]).unwrap(),
            &Vec3::zeros(),
        )
    };
    assert!((read(1.0005).unwrap().rotation.norm() - 1.0).abs() < 1e-15);
    for qw in [0.99, 0.0] {
        assert!(read(qw).unwrap_err().contains("the quaternion's norm is 0."));
    }
}

fn read(values_mm: [f64; 9]) -> Result<Pose, String> {
    let names = ["m1", "m2", "m3"].map(String::from);
    displacement_of_markers(&Body::new(&names, &CLOSED)?, &values_mm, &parsed(["+y", "-x", "+z"])?, None)
}

const CLOSED: [f64; 9] = [0.0, 0.0, 0.0, 40.0, 0.0, 0.0, 0.0, 40.0, 0.0];

#[test]
fn a_shift_of_all_markers_is_a_shift_of_the_jaw_in_its_own_axes() {
    let moved = [1.0, 2.0, 3.0, 41.0, 2.0, 3.0, 1.0, 42.0, 3.0];
    let pose = read(moved).unwrap();
    assert!((pose.translation.vector - Vec3::new(0.002, -0.001, 0.003)).norm() < 1e-12);
    assert!(pose.rotation.angle() < 1e-7);
}
