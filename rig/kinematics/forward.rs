//! `masseter fk`: actuator coordinates to poses.

use masseter_controller::kinematics::{ForwardTracker, Solution};
use masseter_shared::geometry::Actuators;
use masseter_shared::messages::pose_fields;

use super::table::{Row, convert, mechanism};
use crate::cli::FkArgs;
use crate::exit::{Exit, Failure};

const COLUMNS_IN: [&str; 6] = ["d1_m", "d2_m", "d3_m", "l1_m", "l2_m", "l3_m"];
const COLUMNS_OUT: [&str; 12] = [
    "x_m",
    "y_m",
    "z_m",
    "qw",
    "qx",
    "qy",
    "qz",
    "theta1_rad",
    "theta2_rad",
    "theta3_rad",
    "iterations",
    "residual_m",
];

/// Status `ok`, `outside_stroke`, or the reason of [`ForwardError`](masseter_controller::kinematics::ForwardError).
pub(crate) fn forward(args: &FkArgs) -> Result<Exit, Failure> {
    let mechanism = mechanism(&args.csv)?;
    let strokes = *mechanism.strokes();
    let mut tracker = ForwardTracker::new(mechanism);
    convert(&args.csv, COLUMNS_IN, COLUMNS_OUT, |values| {
        let actuators = Actuators::from_axes(values);
        if !args.continuous {
            tracker.reset();
        }
        Ok(match (strokes.check(&actuators), tracker.update(&actuators)) {
            (Ok(()), Ok(solution)) => Row { values: Some(row(&solution)), status: "ok" },
            (Err(_), Ok(solution)) => Row { values: Some(row(&solution)), status: "outside_stroke" },
            (_, Err(error)) => Row { values: None, status: error.reason() },
        })
    })
}

fn row(solution: &Solution) -> [f64; 12] {
    let ([x, y, z], [qw, qx, qy, qz]) = pose_fields(&solution.pose);
    let [t1, t2, t3] = solution.theta_rad;
    [x, y, z, qw, qx, qy, qz, t1, t2, t3, f64::from(solution.iterations), solution.residual_m]
}
