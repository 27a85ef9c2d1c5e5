//! `masseter robot check-pose`: whether the six positions tell the closed pose.

use anyhow::{Context, anyhow, bail};
use clap::Args;
use masseter_controller::kinematics::Solutions;
use masseter_controller::trajectory::{closed_jaw_points, closed_pose};
use masseter_model::geometry::{
    AXES, AXIS_NAMES, Actuators, Conditioning, Jacobian, Joints, Mechanism, Pose, Vec3,
};
use masseter_plant::bringup::{MotionError, Stand, stand};
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_runtime::messages::pose_fields;
use masseter_scenario::Scenario;
use masseter_terminal::{Exit, Failure, result_line};
use serde_json::{Value, json};

use super::args::RobotArgs;
use super::lengths::parse_length;
use super::power_mark::{self, Marks};
use super::robot_line::failed;
use super::session::Session;
use super::step::Step;

/// How long the axes must stand, ns, and how far they may move meanwhile, m.
const STAND_NS: u64 = 200 * MILLISECOND_NS;
const STILL_M: f64 = 1e-4;
/// The widest tolerances that say something of signs, scales and zeros.
const WIDEST_M: f64 = 5e-3;
const WIDEST_DEG: f64 = 5.0;
/// By how much an axis is assumed to be wrong, m.
const WRONG_M: f64 = 1e-3;

/// The arguments of `robot check-pose`.
#[derive(Debug, Clone, Args)]
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

/// What six positions tell.
struct Found {
    pose: Pose,
    condition: f64,
    /// Distances of incisal point, right and left condyle from the closed pose, m.
    apart_m: [f64; 3],
    /// Angle to the closed pose, degrees.
    turned_deg: f64,
    /// By how much each axis differs from the closed pose, m.
    differs_m: [f64; AXES],
    /// What each axis would move the three points by, if it were wrong by [`WRONG_M`], m; none without a pose there.
    wrong_m: [Option<[f64; 3]>; AXES],
}

/// Reads, computes, prints, and keeps the pose. Nothing is moved.
pub(crate) fn check_pose(args: &CheckPoseArgs) -> Result<Exit, Failure> {
    if args.tolerance > WIDEST_M || args.angle > WIDEST_DEG {
        let error = anyhow!("--tolerance goes up to {} mm, --angle up to {WIDEST_DEG}°", WIDEST_M * 1e3);
        return Err(Failure::with(Exit::Usage, error));
    }
    let axes: Vec<usize> = (0..AXES).collect();
    let earlier = |_| (!args.out_of_order).then_some(Step::Home);
    let mut session = Session::begin(&args.robot, Step::CheckPose, &axes, earlier)?;
    let marks = if args.out_of_order { Ok(Marks::default()) } else { check_marks(&mut session) };
    let stand = match stand(&mut session.line, &session.scenario, STAND_NS) {
        Ok(stand) => stand,
        // No drive has power by this step: there is nothing to stop.
        Err(error @ MotionError::Line(_)) => {
            let error = session.check_undisturbed().err().map_or_else(|| error.into(), anyhow::Error::new);
            session.finish(false, &json!({ "error": error.to_string() }))?;
            return Err(failed(error));
        }
        Err(error) => return Err(session.fail(error)),
    };
    let (judged, data) = match find(&mut session, marks, &stand) {
        Ok((marks, found)) => {
            let mut data = found.data(&stand);
            data["marks"] = json!(marks);
            (found.judge(args, &session.scenario), data)
        }
        Err(error) => {
            let data = json!({ "error": error.to_string(), "positions_m": stand.positions_m });
            (Err(error), data)
        }
    };
    session.finish(judged.is_ok(), &data)?;
    judged.map(|()| Exit::Passed).map_err(|error| Failure::with(Exit::Failed, error))
}

/// The pose of the robot where it stands, printed; an error where the positions are none of a robot at rest.
fn find(
    session: &mut Session,
    marks: anyhow::Result<Marks>,
    stand: &Stand,
) -> anyhow::Result<(Marks, Found)> {
    session.check_present()?;
    let marks = marks?;
    at_rest(stand)?;
    within_strokes(&session.scenario, &stand.positions_m)?;
    let found = Found::new(&session.scenario, stand.positions_m)?;
    found.print(stand)?;
    Ok((marks, found))
}

/// The marks that home left. A drive without its mark may have lost its position.
fn check_marks(session: &mut Session) -> anyhow::Result<Marks> {
    let Session { past, scenario, line, .. } = session;
    let mut marks = Marks::default();
    for (axis, mark) in marks.iter_mut().enumerate() {
        let (_, homed) = past.newest(Step::Home, axis).context("there is no home")?;
        *mark = power_mark::of_home(homed, axis)?;
        power_mark::check_axis(scenario, *mark, &homed.started, line, axis)?;
    }
    Ok(marks)
}

fn at_rest(stand: &Stand) -> anyhow::Result<()> {
    for (name, moved_m) in AXIS_NAMES.iter().zip(stand.moved_m) {
        if moved_m.abs() > STILL_M {
            bail!("{name}: moved {:.3} mm; check its brake, and hold the robot still", moved_m * 1e3);
        }
    }
    Ok(())
}

/// Positions outside of the strokes are no positions of this robot: most often an encoder that lost its zero.
fn within_strokes(scenario: &Scenario, positions_m: &[f64; AXES]) -> anyhow::Result<()> {
    for (axis, &position_m) in positions_m.iter().enumerate() {
        let [low_m, high_m] = scenario.mechanism.strokes.of_axis(axis);
        if !(low_m - STILL_M..=high_m + STILL_M).contains(&position_m) {
            bail!(
                "{}: 6064h shows {:.3} mm, the stroke is {:.1} to {:.1} mm; home it again: an incremental encoder loses its \
                 zero without power",
                AXIS_NAMES[axis],
                position_m * 1e3,
                low_m * 1e3,
                high_m * 1e3
            );
        }
    }
    Ok(())
}

/// The only true pose of six positions.
fn pose_of(mechanism: &Mechanism, actuators: &Actuators) -> anyhow::Result<(Pose, Joints)> {
    let solutions = Solutions::new(mechanism, actuators)?;
    let true_ones: Vec<_> = solutions.true_ones().collect();
    match true_ones[..] {
        [only] => Ok((only.pose, Joints { actuators: *actuators, theta_rad: only.theta_rad })),
        [] => {
            Err(anyhow!("the six positions fit no pose; check home, reversed and resolution of every axis"))
        }
        _ => Err(anyhow!(
            "the six positions fit {} poses; check home, reversed and resolution of every axis",
            true_ones.len()
        )),
    }
}

fn distances_m(points: &[Vec3; 3], a: &Pose, b: &Pose) -> [f64; 3] {
    points.map(|point| (a.transform_point(&point.into()) - b.transform_point(&point.into())).norm())
}

impl Found {
    fn new(scenario: &Scenario, positions_m: [f64; AXES]) -> anyhow::Result<Self> {
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
        Ok(Self {
            pose,
            condition: Conditioning::new(&Jacobian::new(&mechanism, &pose, &joints)).number(),
            apart_m: distances_m(&points, &pose, &closed),
            turned_deg: pose.rotation.angle_to(&closed.rotation).to_degrees(),
            differs_m: std::array::from_fn(|axis| positions_m[axis] - closed_m[axis]),
            wrong_m: std::array::from_fn(wrong),
        })
    }

    fn judge(&self, args: &CheckPoseArgs, scenario: &Scenario) -> anyhow::Result<()> {
        let furthest_m = self.apart_m.into_iter().fold(0.0, f64::max);
        let most = scenario.limits.max_condition;
        if furthest_m > args.tolerance || self.turned_deg > args.angle {
            let worst =
                (0..AXES).max_by(|&a, &b| self.differs_m[a].abs().total_cmp(&self.differs_m[b].abs()));
            let worst = worst.unwrap_or_default();
            bail!(
                "the pose is {:.3} mm and {:.3}° from the closed pose, allowed are {:.3} mm and {:.3}°; {} differs most, by \
                 {:.3} mm: home it again, or bring the jaw to the closed pose (jaw.closed_leg_m)",
                furthest_m * 1e3,
                self.turned_deg,
                args.tolerance * 1e3,
                args.angle,
                AXIS_NAMES[worst],
                self.differs_m[worst] * 1e3
            );
        }
        if self.condition > most {
            bail!("the condition number is {:.2}, allowed is {most} (limits.max_condition)", self.condition);
        }
        Ok(())
    }

    fn print(&self, stand: &Stand) -> anyhow::Result<()> {
        let (position_m, quaternion) = pose_fields(&self.pose);
        result_line!("platform at {} mm, quaternion {quaternion:.6?}", in_mm(&position_m))?;
        result_line!(
            "from the closed pose: incisal point, right and left condyle {} mm, turned {:.3}°; condition number {:.2}",
            in_mm(&self.apart_m),
            self.turned_deg,
            self.condition
        )?;
        result_line!("axis  6064h, mm  from closed, mm  1 mm wrong moves the three points by, mm  drive")?;
        for (axis, name) in AXIS_NAMES.iter().enumerate() {
            let wrong = self.wrong_m[axis].map_or_else(|| "no pose".to_owned(), |wrong_m| in_mm(&wrong_m));
            result_line!(
                "{name:<4} {:>10.4} {:>16.4}  {wrong:<42} {}",
                stand.positions_m[axis] * 1e3,
                self.differs_m[axis] * 1e3,
                stand.states[axis]
            )?;
        }
        Ok(())
    }

    fn data(&self, stand: &Stand) -> Value {
        let (position_m, quaternion) = pose_fields(&self.pose);
        json!({
            "positions_m": stand.positions_m,
            "position_m": position_m,
            "quaternion": quaternion,
            "points_from_closed_m": self.apart_m,
            "turned_deg": self.turned_deg,
            "condition": self.condition,
            "axes_from_closed_m": self.differs_m,
            "axis_wrong_by_1mm_moves_points_m": self.wrong_m,
        })
    }
}

fn in_mm(lengths_m: &[f64]) -> String {
    // A rounded −0 is 0.
    let rounded = |length_m: &f64| (length_m * 1e7).round() / 1e4 + 0.0;
    let each: Vec<_> = lengths_m.iter().map(|length_m| format!("{:.4}", rounded(length_m))).collect();
    each.join(" ")
}
