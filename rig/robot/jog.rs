//! `masseter robot jog`: one axis, a short way and back.

use std::time::Duration;

use anyhow::anyhow;
use clap::Args;
use masseter_model::geometry::AXIS_NAMES;
use masseter_plant::bringup::{JogOrder, JogReport, Wish, jog as play};
use masseter_terminal::{Exit, Failure, result_line, status};
use serde_json::json;

use super::args::{RobotArgs, parse_axis};
use super::hold::Hold;
use super::lengths::{parse_length, parse_speed};
use super::robot_line::failed;
use super::session::Session;
use super::step::Step;
use crate::arguments::parse_duration;

/// A ruler's reading may differ by this share from the way that the drive shows.
const DEVIATION: f64 = 0.02;

/// The arguments of `robot jog`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter robot jog --axis l1 --by 1mm\n  masseter robot jog --axis l1 --by 1mm --dwell 10s\n  masseter robot jog --axis l1 --by 1mm --measured 0.99mm"
)]
pub(crate) struct JogArgs {
    #[command(flatten)]
    robot: RobotArgs,
    /// The axis: d1 to l3
    #[arg(long, value_parser = parse_axis)]
    axis: usize,
    /// The way, such as 1mm or -1mm; the axis comes back
    #[arg(long, value_name = "LENGTH", value_parser = parse_length, allow_hyphen_values = true)]
    by: f64,
    /// Speed [default: 5 % of the axis' limit, and so slow that the way takes a second]
    #[arg(long, value_name = "SPEED", value_parser = parse_speed)]
    speed: Option<f64>,
    /// Force limit in percent of the drive's [default: 20]
    #[arg(long, value_name = "PERCENT", value_parser = clap::value_parser!(u8).range(1..=100))]
    torque: Option<u8>,
    /// How long the axis stays at the far end, such as 10s to read a gauge
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    dwell: Option<Duration>,
    /// What a gauge showed at the far end; the sign is that of d and l
    #[arg(long, value_name = "LENGTH", value_parser = parse_length, allow_hyphen_values = true)]
    measured: Option<f64>,
    /// Move only while input arrives on standard input: hold the Enter key
    #[arg(long)]
    hold: bool,
    /// Go on without the evidence of the earlier steps
    #[arg(long)]
    out_of_order: bool,
}

/// Jogs, prints what was found, and keeps it.
pub(crate) fn jog(args: &JogArgs) -> Result<Exit, Failure> {
    let &JogArgs { axis, by, out_of_order, .. } = args;
    let earlier = |_| (!out_of_order).then_some(Step::Configure);
    let mut session = Session::begin(&args.robot, Step::Jog(axis), &[axis], earlier)?;
    let mut hold = args.hold.then(Hold::of_stdin);
    if hold.is_some() {
        status!("hold the Enter key to move {}; Ctrl-C stops", AXIS_NAMES[axis]);
    }
    let order = order(args, &session);
    let stop = session.stop.clone();
    let mut operator = |now_ns| match &mut hold {
        _ if stop.is_made() => Wish::Stop,
        Some(hold) => hold.wish(now_ns),
        None => Wish::Move,
    };
    let report = match play(&mut session.line, &session.scenario, &order, &mut operator) {
        Ok(report) => report,
        Err(error) => return Err(session.fail(error)),
    };
    if let Err(disturbance) = session.check_present() {
        session.finish(false, &json!({ "error": disturbance.to_string() }))?;
        return Err(failed(disturbance));
    }
    let text = text(axis, &report);
    let factor = args.measured.map(|measured_m| measured_m / report.moved_m());
    let is_right = factor.is_some_and(|factor| (factor - 1.0).abs() <= DEVIATION);
    session.finish(is_right, &data(by, &report, args.measured, factor))?;
    result_line!("{text}").map_err(|error| Failure::with(Exit::Incomplete, error))?;
    match factor {
        Some(factor) if !is_right => Err(Failure::with(Exit::Failed, wrong_scale(axis, factor))),
        Some(_) => Ok(Exit::Passed),
        None => {
            status!("not passed yet: jog again with --measured and what a gauge shows at the far end");
            Ok(Exit::Passed)
        }
    }
}

fn order(args: &JogArgs, session: &Session) -> JogOrder {
    let mut order = JogOrder::usual(&session.scenario, args.axis, args.by);
    let drive = session.scenario.drives.of_axis(args.axis);
    order.caution.speed_m_s = args.speed.unwrap_or(order.caution.speed_m_s).min(drive.max_velocity_m_s);
    if let Some(percent) = args.torque {
        order.caution.force_n = f64::from(percent) / 100.0 * drive.max_force_n;
    }
    order.dwell_ns = args.dwell.map_or(order.dwell_ns, |dwell| dwell.as_nanos() as u64);
    order
}

fn wrong_scale(axis: usize, factor: f64) -> anyhow::Error {
    let name = AXIS_NAMES[axis];
    if factor < 0.0 {
        return anyhow!("{name}: the axis moved the other way; change drive_profile.reversed for {name}");
    }
    anyhow!(
        "{name}: the gauge shows {factor:.4} times the way of 6064h, more than {:.0} % off; multiply encoder_resolution_m \
         by this factor, or correct the drive's gear",
        DEVIATION * 100.0
    )
}

fn text(axis: usize, report: &JogReport) -> String {
    let [there, back] = report.ways;
    let forces = report.friction_and_load_n().map_or_else(
        || "too few looks for friction; jog further or slower".to_owned(),
        |[friction_n, load_n]| format!("friction {friction_n:.1} N, load {load_n:.1} N"),
    );
    let answer = report.sync_answer_ns.map_or_else(
        || "no answer to a SYNC".to_owned(),
        |answer_ns| format!("SYNC answered within {} µs (can.answer_us)", answer_ns.div_ceil(1000)),
    );
    format!(
        "{}: moved {:.4} mm and back to {:.4} mm; noise ±{:.4} mm\nthere: rise {:.3} s, overshoot {:.4} mm, settled {:.3} s\n\
         back:  rise {:.3} s, overshoot {:.4} mm, settled {:.3} s\n{forces}; {:.4} mm of motion as the brake closed\n{answer}",
        AXIS_NAMES[axis],
        report.moved_m() * 1e3,
        (report.positions_m[2] - report.positions_m[0]) * 1e3,
        report.noise_m * 1e3,
        there.rise_s,
        there.overshoot_m * 1e3,
        there.settled_s,
        back.rise_s,
        back.overshoot_m * 1e3,
        back.settled_s,
        report.drop_m * 1e3,
    )
}

fn data(by_m: f64, report: &JogReport, measured_m: Option<f64>, factor: Option<f64>) -> serde_json::Value {
    let forces = report.friction_and_load_n();
    json!({
        "by_m": by_m,
        "moved_m": report.moved_m(),
        "positions_m": report.positions_m,
        "noise_m": report.noise_m,
        "rise_s": report.ways.map(|way| way.rise_s),
        "overshoot_m": report.ways.map(|way| way.overshoot_m),
        "settled_s": report.ways.map(|way| way.settled_s),
        "force_n": report.ways.map(|way| way.force_n),
        "friction_n": forces.map(|[friction_n, _]| friction_n),
        "load_n": forces.map(|[_, load_n]| load_n),
        "drop_m": report.drop_m,
        "answer_us": report.sync_answer_ns.map(|answer_ns| answer_ns.div_ceil(1000)),
        "measured_m": measured_m,
        "measured_by_moved": factor,
    })
}
