//! `masseter fk` and `masseter ik`: CSV in, CSV out, one mechanism state a line.
//!
//! Every input line gives one output line, with `fk --all` one for every solution, in order; only comments, lines that
//! begin with `#`, give none. A line that cannot be read, also an empty one, gives one with the status `bad_line`. Standard
//! error has the reason, and the command exits with 2 at the end.

mod table;

use std::iter;

use masseter_controller::kinematics::{
    Assembly, ForwardError, ForwardTracker, Method, Options, Solution, Solutions, solve,
};
use masseter_model::geometry::{
    AXES, Actuators, Conditioning, InverseError, Jacobian, Joints, LEGS, Mechanism, Pose, StrokeLimits,
};
use masseter_runtime::messages::{pose_fields, pose_from_fields};
use masseter_terminal::Exit;

pub(crate) use table::CsvArgs;
use table::{Columns, Lines, convert, convert_in_turn};

/// Columns of actuator positions, as `fk` reads and `ik` writes them.
const ACTUATORS: &str = "d1_m,d2_m,d3_m,l1_m,l2_m,l3_m";
const FORWARD: Columns = Columns {
    read: ACTUATORS,
    written: "x_m,y_m,z_m,qw,qx,qy,qz,theta1_rad,theta2_rad,theta3_rad,iterations,residual_m",
};
/// Of `fk --all`. `line` is the input's line. Conditions are 1 where they hold and 0 where not; `separation_rad` is
/// the largest difference of a leg's angle to the nearest other solution; `condition` is that of the
/// whole mechanism, with turns taken at the platform's first side.
const EVERY: Columns = Columns {
    read: ACTUATORS,
    written: "line,x_m,y_m,z_m,qw,qx,qy,qz,theta1_rad,theta2_rad,theta3_rad,legs_above_base,hinges_below_platform,\
              corners_in_order,positive_determinant,separation_rad,determinant,condition,residual_m",
};
const INVERSE: Columns = Columns {
    read: "x_m,y_m,z_m,qw,qx,qy,qz",
    written: "d1_m,d2_m,d3_m,l1_m,l2_m,l3_m,theta1_rad,theta2_rad,theta3_rad",
};
/// Farthest position, m: ten times the longest dimension of a mechanism. Beyond, rounding hides the mechanism.
const FARTHEST_M: f64 = 1000.0;
/// Status of a line with a position beyond.
const OUT_OF_RANGE: &str = "out_of_range";
/// How far a quaternion's norm may be from 1.
const UNIT_TOLERANCE: f64 = 1e-3;
/// Where the paper's and Newton's iteration start without `--guess`: the paper's neutral pose.
const NEUTRAL_RAD: [f64; LEGS] = [1.46; LEGS];

/// What `fk` takes.
#[derive(Debug, Clone, clap::Args)]
#[command(
    after_help = "Examples:\n  masseter fk < actuators.csv > poses.csv\n  masseter fk --all --input actuators.csv"
)]
pub(crate) struct FkArgs {
    #[command(flatten)]
    csv: CsvArgs,
    /// Which iteration: the controller's certified one, the paper's, or Newton-Raphson
    #[arg(long, value_enum, default_value_t)]
    solver: Solver,
    /// Leg angles to start every line from, with --continuous the first, radians [default: the paper's neutral pose,
    /// 1.46 each; the controller's solver needs none]
    #[arg(long, value_name = "RAD,RAD,RAD", value_parser = parse_guess, allow_hyphen_values = true)]
    guess: Option<[f64; 3]>,
    /// Start each line from the solution of the one before; takes one core only
    #[arg(long)]
    continuous: bool,
    /// Every solution of every line, a line each, with the conditions it meets
    #[arg(long, conflicts_with_all = ["solver", "guess", "continuous"])]
    all: bool,
}

/// Which forward solver.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
enum Solver {
    /// The certified one of the control loop: the true solution, or the reason why there is none.
    #[default]
    Controller,
    /// The paper's: some solution, from the guess.
    Published,
    /// Newton-Raphson: some solution, from the guess.
    Newton,
}

/// Status `ok`, `outside_stroke`, `out_of_range`, or the reason of [`ForwardError`]. The paper's and Newton's iteration
/// may come to a solution at which the mechanism cannot stand; its status is then `wrong_assembly`,
/// and the values are written all the same.
pub(crate) fn forward(args: &FkArgs) -> anyhow::Result<Exit> {
    let mechanism = args.csv.mechanism()?;
    if args.all {
        return every_solution(&args.csv, &mechanism);
    }
    let strokes = *mechanism.strokes();
    let mut solver = Chosen::new(args, mechanism);
    if args.continuous {
        return convert_in_turn(&args.csv, FORWARD, |line, values, lines| {
            write_solution(&strokes, &mut solver, line, values, lines);
            Ok(())
        });
    }
    convert(&args.csv, FORWARD, |line, values, lines| {
        write_solution(&strokes, &mut solver.clone(), line, values, lines);
        Ok(())
    })
}

/// The solver asked for, and where it starts next.
#[derive(Clone)]
enum Chosen {
    Controller(ForwardTracker),
    Iteration { method: Method, mechanism: Mechanism, start_rad: [f64; LEGS] },
}

impl Chosen {
    fn new(args: &FkArgs, mechanism: Mechanism) -> Self {
        let start_rad = args.guess.unwrap_or(NEUTRAL_RAD);
        match (args.solver, args.guess) {
            (Solver::Controller, None) => Self::Controller(ForwardTracker::new(mechanism)),
            (Solver::Controller, Some(guess)) => {
                Self::Controller(ForwardTracker::with_guess(mechanism, guess))
            }
            (Solver::Published, _) => Self::Iteration { method: Method::Published, mechanism, start_rad },
            (Solver::Newton, _) => Self::Iteration { method: Method::Newton, mechanism, start_rad },
        }
    }

    /// Solves, and starts from there the next time.
    fn solve(&mut self, actuators: &Actuators) -> Result<Solution, ForwardError> {
        match self {
            Self::Controller(tracker) => tracker.update(actuators),
            Self::Iteration { method, mechanism, start_rad } => {
                let solution = solve(*method, mechanism, actuators, start_rad, &Options::default())?;
                *start_rad = solution.theta_rad;
                Ok(solution)
            }
        }
    }
}

/// Whether a position of a line is too far away, which is then explained.
fn is_out_of_range(line: u64, positions_m: &[f64], lines: &mut Lines) -> bool {
    let far_m = positions_m.iter().find(|position_m| position_m.abs() > FARTHEST_M);
    if let Some(far_m) = far_m {
        lines.remark(line, format!("{far_m:e} m is out of range; use -{FARTHEST_M} to {FARTHEST_M} m"));
    }
    far_m.is_some()
}

fn write_solution(
    strokes: &StrokeLimits,
    solver: &mut Chosen,
    line: u64,
    values: [f64; AXES],
    lines: &mut Lines,
) {
    if is_out_of_range(line, &values, lines) {
        return lines.row([], OUT_OF_RANGE);
    }
    let actuators = &Actuators::from_axes(values);
    let solution = match solver.solve(actuators) {
        Ok(solution) => solution,
        Err(error) => return lines.row([], error.reason()),
    };
    let status = match strokes.check(actuators) {
        _ if !solution.assembly.is_true() => "wrong_assembly",
        Ok(()) => "ok",
        Err(_) => "outside_stroke",
    };
    let (position_m, quaternion) = pose_fields(&solution.pose);
    let values = position_m.into_iter().chain(quaternion).chain(solution.theta_rad);
    lines.row(values.chain([f64::from(solution.iterations), solution.residual_m]), status);
}

fn parse_guess(text: &str) -> Result<[f64; 3], &'static str> {
    let angle = |text: &str| text.trim().parse().ok().filter(|angle: &f64| angle.is_finite());
    let angles: Option<Vec<_>> = text.split(',').map(angle).collect();
    let three = angles.and_then(|angles| angles.try_into().ok());
    three.ok_or("give three leg angles in radians, such as 1.4,1.5,1.4")
}

/// The status of a solution is `true` if the mechanism can stand in it, `singular` if double precision does not
/// separate it from another (both are written), and otherwise `other`. An input without a solution gives one line
/// with the reason of [`ForwardError`].
fn every_solution(args: &CsvArgs, mechanism: &Mechanism) -> anyhow::Result<Exit> {
    convert(args, EVERY, |line, values, lines| {
        if is_out_of_range(line, &values, lines) {
            lines.row([line as f64], OUT_OF_RANGE);
            return Ok(());
        }
        let actuators = Actuators::from_axes(values);
        match Solutions::new(mechanism, &actuators) {
            Ok(solutions) if solutions.count() > 0 => {
                for solution in solutions.iter() {
                    let values = values_of(mechanism, &actuators, &solutions, solution);
                    lines.row(iter::once(line as f64).chain(values), status_among_all(solution));
                }
            }
            Ok(_) => lines.row([line as f64], ForwardError::Unassemblable.reason()),
            Err(error) => lines.row([line as f64], error.reason()),
        }
        Ok(())
    })
}

fn status_among_all(solution: &Solution) -> &'static str {
    match (solution.certificate, solution.assembly.is_true()) {
        (None, _) => "singular",
        (Some(_), true) => "true",
        (Some(_), false) => "other",
    }
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
    let quality = [separation_rad, solution.determinant, condition, solution.residual_m];
    let pose = position_m.into_iter().chain(quaternion).chain(solution.theta_rad);
    pose.chain(conditions.map(f64::from)).chain(quality)
}

/// Status `ok`; `outside_stroke`, or `wrong_assembly` where the mechanism cannot stand as it is built (the values are
/// written all the same); `out_of_range`; or `singular` (a leg without length).
pub(crate) fn inverse(args: &CsvArgs) -> anyhow::Result<Exit> {
    let mechanism = args.mechanism()?;
    convert(args, INVERSE, |line, values: [f64; 7], lines| {
        let pose = unit_pose(values)?;
        if is_out_of_range(line, &values[..3], lines) {
            lines.row([], OUT_OF_RANGE);
            return Ok(());
        }
        match mechanism.inverse(&pose) {
            Ok(joints) => {
                let values = joints.actuators.to_axes().into_iter().chain(joints.theta_rad);
                lines.row(values, inverse_status(&mechanism, &joints));
            }
            Err(InverseError::NoLength { .. } | InverseError::NotFinite) => lines.row([], "singular"),
        }
        Ok(())
    })
}

fn unit_pose([x, y, z, qw, qx, qy, qz]: [f64; 7]) -> Result<Pose, String> {
    let norm = nalgebra::Vector4::new(qw, qx, qy, qz).norm();
    if (norm - 1.0).abs() > UNIT_TOLERANCE {
        return Err(format!("the quaternion has norm {norm}, not 1"));
    }
    Ok(pose_from_fields([x, y, z], [qw, qx, qy, qz]))
}

fn inverse_status(mechanism: &Mechanism, joints: &Joints) -> &'static str {
    if !Assembly::new(mechanism, &joints.actuators, &joints.theta_rad).is_true() {
        "wrong_assembly"
    } else if mechanism.strokes().check(&joints.actuators).is_err() {
        "outside_stroke"
    } else {
        "ok"
    }
}
