//! `masseter fk --all`: every solution of an input, and which conditions it meets.

use std::iter;

use masseter_controller::kinematics::{Assembly, ForwardError, Solution, Solutions, nearest_assembly_m};
use masseter_model::geometry::{Actuators, Conditioning, Jacobian, Joints, LEGS, Mechanism};
use masseter_runtime::messages::pose_fields;
use masseter_terminal::Exit;

use super::table::{ACTUATOR_COLUMNS, Columns, CsvArgs, Lines, convert};

/// `line` is the input's line. Conditions are 1 where they hold and 0 where not; `separation_rad` is
/// the largest difference of a leg's angle to the nearest other solution; `condition` is that of the
/// whole mechanism, with turns taken at the platform's first side.
const COLUMNS: Columns = Columns {
    read: ACTUATOR_COLUMNS,
    written: "line,x_m,y_m,z_m,qw,qx,qy,qz,theta1_rad,theta2_rad,theta3_rad,legs_above_base,hinges_below_platform,\
              corners_in_order,positive_determinant,separation_rad,determinant,condition,residual_m,nearest_m",
};

/// The status of a solution is `true` if the mechanism can stand in it, `singular` if double precision does not separate
/// it from another (both are written), and otherwise `other`. An input without a solution gives one line with the reason
/// of [`ForwardError`]; `nearest_m` is then the least root of the error (the paper, eq. 2) over all leg angles.
pub(super) fn every_solution(args: &CsvArgs, mechanism: &Mechanism) -> anyhow::Result<Exit> {
    convert(args, COLUMNS, |line, values, lines| {
        let actuators = Actuators::from_axes(values);
        match Solutions::new(mechanism, &actuators) {
            Ok(solutions) if solutions.count() > 0 => {
                for solution in solutions.iter() {
                    let values = values_of(mechanism, &actuators, &solutions, solution);
                    lines.row(iter::once(line as f64).chain(values), status(solution));
                }
            }
            Ok(_) => {
                let nearest_m = nearest_assembly_m(mechanism, &actuators);
                write_none(line, nearest_m, &ForwardError::Unassemblable, lines);
            }
            Err(error) => write_none(line, f64::NAN, &error, lines),
        }
        Ok(())
    })
}

fn status(solution: &Solution) -> &'static str {
    match (solution.certificate, solution.assembly.is_true()) {
        (None, _) => "singular",
        (Some(_), true) => "true",
        (Some(_), false) => "other",
    }
}

fn write_none(line: u64, nearest_m: f64, error: &ForwardError, lines: &mut Lines) {
    let absent = COLUMNS.written.split(',').count() - 2;
    let values = iter::once(line as f64).chain(iter::repeat_n(f64::NAN, absent)).chain([nearest_m]);
    lines.row(values, error.reason());
}

/// The values after the line.
fn values_of(
    mechanism: &Mechanism,
    actuators: &Actuators,
    solutions: &Solutions,
    solution: &Solution,
) -> impl Iterator<Item = f64> {
    let (position_m, quaternion) = pose_fields(&solution.pose);
    let Assembly { legs_above_base, hinges_below_platform, corners_in_order, positive_determinant } =
        solution.assembly;
    let all = |each: [bool; LEGS]| each == [true; LEGS];
    let conditions =
        [all(legs_above_base), all(hinges_below_platform), corners_in_order, positive_determinant];
    let joints = Joints { actuators: *actuators, theta_rad: solution.theta_rad };
    let separation_rad = solutions.separation_rad(solution).unwrap_or(f64::NAN);
    // Of actuator rates to the platform's twist.
    let condition = Conditioning::new(&Jacobian::new(mechanism, &solution.pose, &joints)).number();
    let quality = [separation_rad, solution.determinant, condition, solution.residual_m, 0.0];
    let pose = position_m.into_iter().chain(quaternion).chain(solution.theta_rad);
    pose.chain(conditions.map(f64::from)).chain(quality)
}
