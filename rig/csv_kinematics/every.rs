//! `masseter fk --all`: every solution of an input, and which conditions it meets.

use masseter_controller::kinematics::{ForwardError, Solution, Solutions, nearest_assembly_m};
use masseter_shared::geometry::{Actuators, LEGS, Mechanism};
use masseter_shared::messages::pose_fields;

use super::forward::COLUMNS_IN;
use super::table::{Columns, CsvArgs, Lines, convert};
use masseter_terminal::Exit;

/// `line` is the input's line. Conditions are 1 where they hold and 0 where not; `separation_rad` is
/// the largest difference of a leg's angle to the nearest other solution; `condition` is that of the
/// whole mechanism, with turns taken at the platform's first side.
const COLUMNS_OUT: [&str; 20] = [
    "line",
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
    "legs_above_base",
    "hinges_below_platform",
    "corners_in_order",
    "positive_determinant",
    "separation_rad",
    "determinant",
    "condition",
    "residual_m",
    "nearest_m",
];

/// The status of a solution is `true` if the mechanism can stand in it, `singular` if double precision does not separate
/// it from another (both are written), and otherwise `other`. An input without a solution gives one line with the reason
/// of [`ForwardError`]; `nearest_m` is then the least root of the error (the paper, eq. 2) over all leg angles.
pub(super) fn every_solution(args: &CsvArgs, mechanism: &Mechanism) -> anyhow::Result<Exit> {
    let columns = Columns { read: COLUMNS_IN, written: &COLUMNS_OUT };
    convert(args, columns, |line, values, lines| {
        let actuators = Actuators::from_axes(values);
        match Solutions::new(mechanism, &actuators) {
            Ok(solutions) if solutions.count() > 0 => {
                for solution in solutions.iter() {
                    lines.row(&row(line, mechanism, &actuators, &solutions, solution), status(solution));
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
    let mut values = [f64::NAN; COLUMNS_OUT.len()];
    (values[0], values[COLUMNS_OUT.len() - 1]) = (line as f64, nearest_m);
    lines.row(&values, error.reason());
}

fn row(
    line: u64,
    mechanism: &Mechanism,
    actuators: &Actuators,
    solutions: &Solutions,
    solution: &Solution,
) -> [f64; COLUMNS_OUT.len()] {
    let ([x, y, z], [qw, qx, qy, qz]) = pose_fields(&solution.pose);
    let [t1, t2, t3] = solution.theta_rad;
    let assembly = &solution.assembly;
    let holds = |holds: bool| f64::from(u8::from(holds));
    let all = |each: &[bool; LEGS]| holds(each.iter().all(|holds| *holds));
    [
        line as f64,
        x,
        y,
        z,
        qw,
        qx,
        qy,
        qz,
        t1,
        t2,
        t3,
        all(&assembly.legs_above_base),
        all(&assembly.hinges_below_platform),
        holds(assembly.corners_in_order),
        holds(assembly.positive_determinant),
        solutions.separation_rad(solution).unwrap_or(f64::NAN),
        solution.determinant,
        condition(mechanism, actuators, solution),
        solution.residual_m,
        0.0,
    ]
}

/// Of actuator rates to the platform's twist.
fn condition(mechanism: &Mechanism, actuators: &Actuators, solution: &Solution) -> f64 {
    let joints = masseter_shared::geometry::Joints { actuators: *actuators, theta_rad: solution.theta_rad };
    mechanism.condition(&solution.pose, &joints)
}
