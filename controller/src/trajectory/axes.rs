//! From a file's axes to the jaw frame's: anterior, left, up.

use masseter_model::geometry::Vec3;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

/// A signed permutation of axes that keeps the hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axes(UnitQuaternion<f64>);

impl Axes {
    /// From names such as "+y": which file axis points anterior, left and up.
    pub(super) fn parse(names: &[String; 3]) -> Result<Self, String> {
        let refuse = |reason: &str| {
            format!(
                "axes {names:?}: {reason}; name the file's axes that point anterior, left and up, \
                 such as [\"+x\", \"+y\", \"+z\"]"
            )
        };
        let mut rows = Matrix3::zeros();
        for (row, name) in names.iter().enumerate() {
            let axis = direction(name).ok_or_else(|| refuse("an axis is one of +x -x +y -y +z -z"))?;
            rows.set_row(row, &axis.transpose());
        }
        let determinant = rows.determinant();
        if determinant == 0.0 {
            return Err(refuse("an axis is named twice"));
        }
        if determinant < 0.0 {
            return Err(refuse("the frame is left-handed; turn one sign, or the file mirrors the jaw"));
        }
        let rotation = Rotation3::from_matrix_unchecked(rows);
        Ok(Self(UnitQuaternion::from_rotation_matrix(&rotation)))
    }

    /// A vector of the file in the jaw frame.
    pub(super) fn vector(&self, in_file: &Vec3) -> Vec3 {
        self.0 * in_file
    }

    /// A rotation of the file in the jaw frame.
    pub(super) fn rotation(&self, in_file: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        self.0 * in_file * self.0.inverse()
    }
}

fn direction(name: &str) -> Option<Vec3> {
    let index = ["+x", "-x", "+y", "-y", "+z", "-z"].iter().position(|known| *known == name)?;
    Some(Vec3::ith(index / 2, if index % 2 == 0 { 1.0 } else { -1.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(names: [&str; 3]) -> Result<Axes, String> {
        Axes::parse(&names.map(String::from))
    }

    #[test]
    fn a_tracker_frame_becomes_anterior_left_up() {
        let axes = parse(["+y", "-x", "+z"]).unwrap();
        assert!((axes.vector(&Vec3::new(1.0, 2.0, 3.0)) - Vec3::new(2.0, -1.0, 3.0)).norm() < 1e-15);
        let about_file_y = UnitQuaternion::from_axis_angle(&Vec3::y_axis(), 0.3);
        let about_anterior = UnitQuaternion::from_axis_angle(&Vec3::x_axis(), 0.3);
        assert!(axes.rotation(&about_file_y).angle_to(&about_anterior) < 1e-12);
    }

    #[test]
    fn axes_that_are_no_right_handed_frame_are_refused() {
        let table = [
            (["x", "+y", "+z"], "one of"),
            (["+x", "+x", "+z"], "twice"),
            (["+y", "+x", "+z"], "left-handed"),
        ];
        for (names, reason) in table {
            assert!(parse(names).unwrap_err().contains(reason));
        }
    }
}
