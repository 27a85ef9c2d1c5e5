//! `masseter ik`: poses to joint coordinates.

use masseter_controller::kinematics::Assembly;
use masseter_model::geometry::{InverseError, Joints, Mechanism, Pose};
use masseter_runtime::messages::pose_from_fields;
use masseter_terminal::Exit;

use super::table::{Columns, CsvArgs, convert, mechanism};

/// How far a quaternion's norm may be from 1.
const UNIT_TOLERANCE: f64 = 1e-3;

const COLUMNS: Columns = Columns {
    read: "x_m,y_m,z_m,qw,qx,qy,qz",
    written: "d1_m,d2_m,d3_m,l1_m,l2_m,l3_m,theta1_rad,theta2_rad,theta3_rad",
};

/// Status `ok`; `outside_stroke`, or `wrong_assembly` where the mechanism cannot stand as it is built (the values are
/// written all the same); or `singular` (a leg without length).
pub(crate) fn inverse(args: &CsvArgs) -> anyhow::Result<Exit> {
    let mechanism = mechanism(args)?;
    convert(args, COLUMNS, |_, values, lines| {
        match mechanism.inverse(&pose(values)?) {
            Ok(joints) => {
                let values = joints.actuators.to_axes().into_iter().chain(joints.theta_rad);
                lines.row(values, status(&mechanism, &joints));
            }
            Err(InverseError::NoLength { .. } | InverseError::NotFinite) => lines.row([], "singular"),
        }
        Ok(())
    })
}

fn pose([x, y, z, qw, qx, qy, qz]: [f64; 7]) -> Result<Pose, String> {
    let norm = nalgebra::Vector4::new(qw, qx, qy, qz).norm();
    if (norm - 1.0).abs() > UNIT_TOLERANCE {
        return Err(format!("the quaternion has norm {norm}, not 1"));
    }
    Ok(pose_from_fields([x, y, z], [qw, qx, qy, qz]))
}

fn status(mechanism: &Mechanism, joints: &Joints) -> &'static str {
    if !Assembly::new(mechanism, &joints.actuators, &joints.theta_rad).is_true() {
        "wrong_assembly"
    } else if mechanism.strokes().check(&joints.actuators).is_err() {
        "outside_stroke"
    } else {
        "ok"
    }
}
