//! `masseter robot check-pose`: whether the six positions give the closed pose.

use anyhow::{Context, anyhow, bail, ensure};
use masseter_commissioning::{MotionError, Stand, stand};
use masseter_controller::trajectory::{closed_jaw_points, closed_pose};
use masseter_model::geometry::{
    AXES, AXIS_NAMES, Actuators, Conditioning, Jacobian, Joints, Mechanism, Pose, Vec3,
};
use masseter_runtime::{clock::MILLISECOND_NS, messages::pose_fields};
use masseter_scenario::Scenario;
use masseter_terminal::{Exit, Failure, OrFailure, result_line};

use super::args::{RobotArgs, parse_length};
use super::power_mark::{Marks, check_mark, mark_of_home};
use super::{robot_line::failed, session::Session, step::Step};

/// How long the axes must stand, ns, and how far they may move meanwhile, m.
const STAND_NS: u64 = 200 * MILLISECOND_NS;
const STILL_M: f64 = 1e-4;
/// The widest tolerances that say something of signs, scales and zeros.
const WIDEST_M: f64 = 5e-3;
const WIDEST_DEG: f64 = 5.0;
/// By how much an axis is assumed to be wrong, m.
const WRONG_M: f64 = 1e-3;

/// The arguments of `robot check-pose`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "Example:\n  masseter robot check-pose --tolerance 0.5mm --angle 0.5")]
pub(crate) struct CheckPoseArgs {
    #[command(flatten)]
    robot: RobotArgs,
    /// How far incisal point and condyles may be from the closed pose
    #[arg(long, value_name = "LENGTH", value_parser = parse_length, default_value = "0.5mm")]
    tolerance: f64,
    /// How far the platform may be turned from the closed pose, degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 0.5)]
    angle: f64,
    /// Go on without the evidence of the earlier steps
    #[arg(long)]
    out_of_order: bool,
}

/// What follows from six positions.
#[derive(Debug, serde::Serialize)]
struct Found {
    positions_m: [f64; AXES],
    /// Of the platform.
    position_m: [f64; 3],
    quaternion: [f64; 4],
    /// Distances of incisal point, right and left condyle from the closed pose.
    points_from_closed_m: [f64; 3],
    /// Angle to the closed pose.
    turned_deg: f64,
    condition: f64,
    /// By how much each axis differs from the closed pose.
    axes_from_closed_m: [f64; AXES],
    /// What each axis would move the three points by, if it were wrong by [`WRONG_M`]; none without a pose there.
    axis_wrong_by_1mm_moves_points_m: [Option<[f64; 3]>; AXES],
    /// What proves that the drives kept their positions since home.
    marks: Marks,
}

/// Reads, computes, prints, and keeps the pose. Nothing is moved.
pub(crate) fn check_pose(args: &CheckPoseArgs) -> Result<Exit, Failure> {
    if args.tolerance > WIDEST_M || args.angle > WIDEST_DEG {
        let widest_mm = WIDEST_M * 1e3;
        return Err(anyhow!("--tolerance goes up to {widest_mm} mm, --angle up to {WIDEST_DEG}°")).usage();
    }
    let earlier = (!args.out_of_order).then_some(|_: usize| Step::Home);
    let mut session = Session::begin(&args.robot, Step::CheckPose, &Step::CheckPose.axes(), earlier)?;
    let marks = if args.out_of_order { Ok(Marks::default()) } else { check_marks_of_home(&mut session) };
    let stand = match stand(&mut session.line, &session.scenario, STAND_NS) {
        Ok(stand) => stand,
        // No drive has power by this step: there is nothing to stop.
        Err(error @ MotionError::Line(_)) => {
            let error = session.check_undisturbed().err().map_or_else(|| error.into(), anyhow::Error::new);
            return Err(session.fail(Exit::Failed, error));
        }
        Err(error) => return Err(session.fail_motion(error)),
    };
    match find_pose(&mut session, marks, &stand) {
        Ok(found) => {
            let checked = found.check_closed(args, &session.scenario);
            session.finish_session(checked.is_ok(), &found)?;
            checked.map(|()| Exit::Passed).map_err(failed)
        }
        Err(error) => {
            let kept = serde_json::json!({ "error": error.to_string(), "positions_m": stand.positions_m });
            session.finish_session(false, &kept)?;
            Err(failed(error))
        }
    }
}

/// The pose of the robot where it stands, printed; an error where the positions are none of a robot at rest.
fn find_pose(session: &mut Session, marks: anyhow::Result<Marks>, stand: &Stand) -> anyhow::Result<Found> {
    session.check_present()?;
    let marks = marks?;
    check_at_rest(stand)?;
    check_strokes(&session.scenario, &stand.positions_m)?;
    let found = Found::new(&session.scenario, stand.positions_m, marks)?;
    found.print(stand)?;
    Ok(found)
}

/// The marks that home left. A drive without its mark may have lost its position.
fn check_marks_of_home(session: &mut Session) -> anyhow::Result<Marks> {
    let Session { past, scenario, line, .. } = session;
    let mut marks = Marks::default();
    for (axis, mark) in marks.iter_mut().enumerate() {
        let homed = past.newest(Step::Home, axis).context("there is no home")?;
        *mark = mark_of_home(homed, axis)?;
        check_mark(scenario, *mark, &homed.started, line, axis)?;
    }
    Ok(marks)
}

fn check_at_rest(stand: &Stand) -> anyhow::Result<()> {
    for (name, moved_m) in AXIS_NAMES.iter().zip(stand.moved_m) {
        if moved_m.abs() > STILL_M {
            bail!("{name}: moved {:.3} mm; check its brake, and hold the robot still", moved_m * 1e3);
        }
    }
    Ok(())
}

/// Positions outside of the strokes are no positions of this robot: most often an encoder that lost its zero.
fn check_strokes(scenario: &Scenario, positions_m: &[f64; AXES]) -> anyhow::Result<()> {
    for (axis, &position_m) in positions_m.iter().enumerate() {
        let [low_m, high_m] = scenario.mechanism.strokes.of_axis(axis);
        ensure!(
            (low_m - STILL_M..=high_m + STILL_M).contains(&position_m),
            "{}: 6064h shows {:.3} mm, the stroke is {:.1} to {:.1} mm; home it again: an incremental encoder \
             loses its zero without power",
            AXIS_NAMES[axis],
            position_m * 1e3,
            low_m * 1e3,
            high_m * 1e3
        );
    }
    Ok(())
}

/// The only true pose of six positions.
fn pose_of(mechanism: &Mechanism, actuators: &Actuators) -> anyhow::Result<(Pose, Joints)> {
    let solutions = masseter_controller::kinematics::Solutions::new(mechanism, actuators)?;
    let true_ones: Vec<_> = solutions.true_ones().collect();
    let fit = match true_ones[..] {
        [only] => return Ok((only.pose, Joints { actuators: *actuators, theta_rad: only.theta_rad })),
        [] => "no pose".to_owned(),
        _ => format!("{} poses", true_ones.len()),
    };
    bail!("the six positions fit {fit}; check home, reversed and resolution of every axis")
}

fn distances_m(points: &[Vec3; 3], a: &Pose, b: &Pose) -> [f64; 3] {
    points.map(|point| (a.transform_point(&point.into()) - b.transform_point(&point.into())).norm())
}

impl Found {
    fn new(scenario: &Scenario, positions_m: [f64; AXES], marks: Marks) -> anyhow::Result<Self> {
        let mechanism = Mechanism::new(&scenario.mechanism)?;
        let closed = closed_pose(&scenario.jaw, &mechanism)?;
        let points = closed_jaw_points(&scenario.jaw, &closed)?;
        let closed_m = mechanism.inverse(&closed)?.actuators.to_axes();
        let (pose, joints) = pose_of(&mechanism, &Actuators::from_axes(positions_m))
            .with_context(|| format!("positions {}", in_mm(&positions_m)))?;
        let wrong = |axis: usize| {
            let mut wrong_m = positions_m;
            wrong_m[axis] += WRONG_M;
            let (moved, _) = pose_of(&mechanism, &Actuators::from_axes(wrong_m)).ok()?;
            Some(distances_m(&points, &moved, &pose))
        };
        let (position_m, quaternion) = pose_fields(&pose);
        Ok(Self {
            positions_m,
            position_m,
            quaternion,
            points_from_closed_m: distances_m(&points, &pose, &closed),
            turned_deg: pose.rotation.angle_to(&closed.rotation).to_degrees(),
            condition: Conditioning::new(&Jacobian::new(&mechanism, &pose, &joints)).number(),
            axes_from_closed_m: std::array::from_fn(|axis| positions_m[axis] - closed_m[axis]),
            axis_wrong_by_1mm_moves_points_m: std::array::from_fn(wrong),
            marks,
        })
    }

    fn check_closed(&self, args: &CheckPoseArgs, scenario: &Scenario) -> anyhow::Result<()> {
        let furthest_m = self.points_from_closed_m.into_iter().fold(0.0, f64::max);
        let most = scenario.limits.max_condition;
        if furthest_m > args.tolerance || self.turned_deg > args.angle {
            let off_m = |axis: usize| self.axes_from_closed_m[axis].abs();
            let worst = (0..AXES).max_by(|&a, &b| off_m(a).total_cmp(&off_m(b))).unwrap_or_default();
            bail!(
                "the pose is {:.3} mm and {:.3}° from the closed pose, allowed are {:.3} mm and {:.3}°; {} \
                 differs most, by {:.3} mm: home it again, or bring the jaw to the closed pose (jaw.closed_leg_m)",
                furthest_m * 1e3,
                self.turned_deg,
                args.tolerance * 1e3,
                args.angle,
                AXIS_NAMES[worst],
                self.axes_from_closed_m[worst] * 1e3
            );
        }
        if self.condition > most {
            bail!("the condition number is {:.2}, allowed is {most} (limits.max_condition)", self.condition);
        }
        Ok(())
    }

    fn print(&self, stand: &Stand) -> anyhow::Result<()> {
        result_line!("platform at {} mm, quaternion {:.6?}", in_mm(&self.position_m), self.quaternion)?;
        result_line!(
            "from the closed pose: incisal point, right and left condyle {} mm, turned {:.3}°; condition number {:.2}",
            in_mm(&self.points_from_closed_m),
            self.turned_deg,
            self.condition
        )?;
        result_line!("axis  6064h, mm  from closed, mm  1 mm wrong moves the three points by, mm  drive")?;
        for (axis, name) in AXIS_NAMES.iter().enumerate() {
            let wrong_m = self.axis_wrong_by_1mm_moves_points_m[axis];
            let wrong = wrong_m.map_or_else(|| "no pose".to_owned(), |wrong_m| in_mm(&wrong_m));
            result_line!(
                "{name:<4} {:>10.4} {:>16.4}  {wrong:<42} {}",
                self.positions_m[axis] * 1e3,
                self.axes_from_closed_m[axis] * 1e3,
                stand.states[axis]
            )?;
        }
        Ok(())
    }
}

fn in_mm(lengths_m: &[f64]) -> String {
    // A rounded −0 is 0.
    let rounded = |length_m: &f64| (length_m * 1e7).round() / 1e4 + 0.0;
    lengths_m.iter().map(|length_m| format!("{:.4}", rounded(length_m))).collect::<Vec<_>>().join(" ")
}
