//! `masseter robot jog`: one axis, a short way and back. With the dead man's switch it moves only while input arrives
//! on standard input, such as the lines of a held Enter key.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::{io::Read, sync::Arc, thread, time::Duration};

use anyhow::anyhow;
use clap::Args;
use masseter_model::geometry::AXIS_NAMES;
use masseter_plant::commissioning::{JogOrder, JogReport, Wish, jog as play};
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_terminal::{Exit, Failure, OrFailure, result_line, status};
use serde_json::json;

use super::args::{RobotArgs, parse_axis, parse_length, parse_speed};
use super::{evidence::Step, robot_line::failed, session::Session};
use crate::cli::arguments::parse_duration;

/// For how long a byte permits motion: longer than the time between two repeats of a key, ns.
const HELD_NS: u64 = 300 * MILLISECOND_NS;
/// A silence after which the drive is switched off, ns.
const RELEASED_NS: u64 = 3 * SECOND_NS;
/// How long the first byte may take, ns.
const FIRST_NS: u64 = 60 * SECOND_NS;
/// A ruler's reading may differ by this share from the way that the drive shows.
const DEVIATION: f64 = 0.02;

/// The arguments of `robot jog`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  masseter robot jog --axis l1 --by 1mm
  masseter robot jog --axis l1 --by 1mm --dwell 10s
  masseter robot jog --axis l1 --by 1mm --measured 0.99mm")]
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
    let axis = args.axis;
    let earlier = (!args.out_of_order).then_some(|_: usize| Step::Configure);
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
        Err(error) => return Err(session.fail_motion(error)),
    };
    if let Err(disturbance) = session.check_present() {
        return Err(session.fail(Exit::Failed, disturbance));
    }
    let factor = args.measured.map(|measured_m| measured_m / report.moved_m());
    let is_right = factor.is_some_and(|factor| (factor - 1.0).abs() <= DEVIATION);
    session.finish_session(is_right, &result(args, &report, factor))?;
    result_line!("{}", report_text(axis, &report)).incomplete()?;
    match factor {
        Some(factor) if !is_right => Err(failed(wrong_scale(axis, factor))),
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
        "{name}: the gauge shows {factor:.4} times the way of 6064h, more than {:.0} % off; multiply \
         encoder_resolution_m by this factor, or correct the drive's gear",
        DEVIATION * 100.0
    )
}

fn report_text(axis: usize, report: &JogReport) -> String {
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
        "{}: moved {:.4} mm and back to {:.4} mm; noise ±{:.4} mm\n\
         there: rise {:.3} s, overshoot {:.4} mm, settled {:.3} s\n\
         back:  rise {:.3} s, overshoot {:.4} mm, settled {:.3} s\n\
         {forces}; {:.4} mm of motion as the brake closed\n{answer}",
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

fn result(args: &JogArgs, report: &JogReport, factor: Option<f64>) -> serde_json::Value {
    let forces = report.friction_and_load_n();
    json!({
        "by_m": args.by,
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
        "measured_m": args.measured,
        "measured_by_moved": factor,
    })
}

/// What came on standard input.
#[derive(Debug, Default)]
struct Input {
    bytes: AtomicU64,
    is_over: AtomicBool,
}

/// The dead man's switch.
#[derive(Debug)]
pub(super) struct Hold {
    input: Arc<Input>,
    taken: u64,
    /// When the newest byte was seen, ns.
    held_ns: Option<u64>,
    /// When the switch was asked first, ns.
    asked_ns: Option<u64>,
}

impl Hold {
    /// Reads standard input from now on.
    pub(super) fn of_stdin() -> Self {
        let input = Arc::new(Input::default());
        let reader = Arc::clone(&input);
        thread::spawn(move || {
            let mut bytes = [0; 64];
            while let Ok(count @ 1..) = std::io::stdin().read(&mut bytes) {
                reader.bytes.fetch_add(count as u64, Ordering::Relaxed);
            }
            reader.is_over.store(true, Ordering::Relaxed);
        });
        Self::of_input(input)
    }

    fn of_input(input: Arc<Input>) -> Self {
        Self { input, taken: 0, held_ns: None, asked_ns: None }
    }

    /// What the person wants at that time.
    pub(super) fn wish(&mut self, now_ns: u64) -> Wish {
        let asked_ns = *self.asked_ns.get_or_insert(now_ns);
        let bytes = self.input.bytes.load(Ordering::Relaxed);
        if bytes != self.taken {
            (self.taken, self.held_ns) = (bytes, Some(now_ns));
        }
        if self.input.is_over.load(Ordering::Relaxed) {
            return Wish::Stop;
        }
        match self.held_ns {
            Some(held_ns) if now_ns - held_ns < HELD_NS => Wish::Move,
            Some(held_ns) if now_ns - held_ns >= RELEASED_NS => Wish::Stop,
            None if now_ns - asked_ns >= FIRST_NS => Wish::Stop,
            _ => Wish::Halt,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_permits_motion_for_a_while_and_the_end_of_input_none() {
        let input = Arc::new(Input::default());
        let mut hold = Hold::of_input(Arc::clone(&input));
        let mut wish = |now_ms: u64| hold.wish(now_ms * MILLISECOND_NS);
        assert_eq!((wish(0), wish(59_000)), (Wish::Halt, Wish::Halt), "nobody has touched the key");
        input.bytes.fetch_add(1, Ordering::Relaxed);
        assert_eq!((wish(59_500), wish(59_799), wish(59_800)), (Wish::Move, Wish::Move, Wish::Halt));
        input.bytes.fetch_add(1, Ordering::Relaxed);
        assert_eq!((wish(60_000), wish(62_999), wish(63_000)), (Wish::Move, Wish::Halt, Wish::Stop));
        input.bytes.fetch_add(1, Ordering::Relaxed);
        input.is_over.store(true, Ordering::Relaxed);
        assert_eq!(wish(63_001), Wish::Stop);
        assert_eq!(Hold::of_input(Arc::default()).wish(0), Wish::Halt);
    }
}
