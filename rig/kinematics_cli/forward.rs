//! `masseter fk`: actuator coordinates to poses.

use clap::{Args, ValueEnum};
use masseter_controller::kinematics::{ForwardError, ForwardTracker, Method, Options, Solution, solve};
use masseter_model::geometry::{AXES, Actuators, LEGS, Mechanism, StrokeLimits};
use masseter_runtime::messages::pose_fields;
use masseter_terminal::Exit;

use super::every;
use super::table::{ACTUATOR_COLUMNS, Columns, CsvArgs, Lines, convert, mechanism, solve_lines, stream};

const COLUMNS: Columns = Columns {
    read: ACTUATOR_COLUMNS,
    written: "x_m,y_m,z_m,qw,qx,qy,qz,theta1_rad,theta2_rad,theta3_rad,iterations,residual_m",
};
/// Where the paper's and Newton's iteration start without `--guess`: the paper's neutral pose.
const NEUTRAL_RAD: [f64; LEGS] = [1.46; LEGS];

/// What `fk` takes.
#[derive(Debug, Clone, Args)]
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
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum Solver {
    /// The certified one of the control loop: the true solution, or the reason why there is none.
    #[default]
    Controller,
    /// The paper's: some solution, from the guess.
    Published,
    /// Newton-Raphson: some solution, from the guess.
    Newton,
}

/// Status `ok`, `outside_stroke`, or the reason of [`ForwardError`]. The paper's and Newton's iteration
/// may come to a solution at which the mechanism cannot stand; its status is then `wrong_assembly`,
/// and the values are written all the same.
pub(crate) fn forward(args: &FkArgs) -> anyhow::Result<Exit> {
    let mechanism = mechanism(&args.csv)?;
    if args.all {
        return every::every_solution(&args.csv, &mechanism);
    }
    let strokes = *mechanism.strokes();
    let mut solver = Chosen::new(args, mechanism);
    if args.continuous {
        let mut in_turn = |_, values, lines: &mut Lines| {
            write(&strokes, &mut solver, values, lines);
            Ok(())
        };
        return stream(&args.csv, COLUMNS, |batch| vec![solve_lines(batch, COLUMNS, &mut in_turn)]);
    }
    convert(&args.csv, COLUMNS, |_, values, lines| {
        write(&strokes, &mut solver.clone(), values, lines);
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

fn write(strokes: &StrokeLimits, solver: &mut Chosen, values: [f64; AXES], lines: &mut Lines) {
    let actuators = Actuators::from_axes(values);
    let solution = match solver.solve(&actuators) {
        Ok(solution) => solution,
        Err(error) => return lines.row([], error.reason()),
    };
    let status = match strokes.check(&actuators) {
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
