//! `masseter robot jog`: one axis, a short way and back. With the dead man's switch it moves only while input arrives
//! on standard input, such as the lines of a held Enter key.

use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::{io::Read, thread, time::Duration};

use anyhow::anyhow;
use masseter_commissioning::{JogOrder, JogReport, SyncAnswers, Wish, jog as play};
use masseter_model::geometry::AXIS_NAMES;
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_terminal::{Exit, Failure, OrFailure, result_line, status};

use super::args::{RobotArgs, parse_axis, parse_length, parse_speed};
use super::{robot_line::failed, session::Session, step::Step};

/// For how long a byte permits motion: longer than the time between two repeats of a key, ns.
const HELD_NS: u64 = 300 * MILLISECOND_NS;
/// A silence after which the drive is switched off, ns.
const RELEASED_NS: u64 = 3 * SECOND_NS;
/// How long the first byte may take, ns.
const FIRST_NS: u64 = 60 * SECOND_NS;
/// A gauge's reading may differ by this share from the way that the drive shows.
const DEVIATION: f64 = 0.02;
/// The shortest way that a reading proves, m: of less, a hundredth of a millimetre on the gauge is more than that share.
const LEAST_PROOF_M: f64 = 5e-4;

/// The arguments of `robot jog`.
#[derive(Debug, Clone, clap::Args)]
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
    #[arg(long, value_name = "TIME", value_parser = crate::cli::arguments::parse_duration)]
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
    if args.measured.is_some() && args.by.abs() < LEAST_PROOF_M {
        let least_mm = LEAST_PROOF_M * 1e3;
        return Err(anyhow!("--by: a gauge proves no way below {least_mm} mm; jog further")).usage();
    }
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
    let is_silent = report.sync_answers.unanswered > 0;
    let is_right = factor.is_some_and(|factor| (factor - 1.0).abs() <= DEVIATION) && !is_silent;
    session.finish_session(is_right, &JogResult::new(args, report, factor))?;
    result_line!("{}", report_text(axis, &report)).incomplete()?;
    if is_silent {
        return Err(failed(no_answer(axis, report.sync_answers)));
    }
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

fn no_answer(axis: usize, SyncAnswers { sent, unanswered, .. }: SyncAnswers) -> anyhow::Error {
    anyhow!(
        "{}: {unanswered} of {sent} SYNCs without process data; check 1800h (run configure), wires and termination",
        AXIS_NAMES[axis]
    )
}

fn wrong_scale(axis: usize, factor: f64) -> anyhow::Error {
    let name = AXIS_NAMES[axis];
    if factor.abs() <= DEVIATION {
        return anyhow!(
            "{name}: the gauge shows no motion, and 6064h does; did another axis move? compare can.node_ids with the \
             drives, and check the coupling of {name}"
        );
    }
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
    let [there, back] = report.ways.map(|way| {
        let (rise_s, overshoot_mm, settled_s) = (way.rise_s, way.overshoot_m * 1e3, way.settled_s);
        format!("rise {rise_s:.3} s, overshoot {overshoot_mm:.4} mm, settled {settled_s:.3} s")
    });
    let forces = report.friction_and_load_n().map_or_else(
        || "too few looks for friction; jog further or slower".to_owned(),
        |[friction_n, load_n]| format!("friction {friction_n:.1} N, load {load_n:.1} N"),
    );
    let SyncAnswers { sent, unanswered, longest_ns } = report.sync_answers;
    let answered = sent - unanswered;
    let answer = longest_ns.map_or_else(
        || "no answer to a SYNC".to_owned(),
        |ns| format!("{answered} of {sent} SYNCs answered, within {} µs (can.answer_us)", ns.div_ceil(1000)),
    );
    let positions_m = report.positions_m;
    let [moved_mm, back_mm] = [1, 2].map(|place| (positions_m[place] - positions_m[0]) * 1e3);
    format!(
        "{}: moved {moved_mm:.4} mm and back to {back_mm:.4} mm; noise ±{:.4} mm\n\
         there: {there}\nback:  {back}\n{forces}; {:.4} mm of motion as the brake closed\n{answer}",
        AXIS_NAMES[axis],
        report.noise_m * 1e3,
        report.drop_m * 1e3,
    )
}

/// What is kept of a jog.
#[derive(Debug, serde::Serialize)]
struct JogResult {
    by_m: f64,
    moved_m: f64,
    #[serde(flatten)]
    report: JogReport,
    friction_n: Option<f64>,
    load_n: Option<f64>,
    measured_m: Option<f64>,
    measured_by_moved: Option<f64>,
}

impl JogResult {
    fn new(args: &JogArgs, report: JogReport, measured_by_moved: Option<f64>) -> Self {
        let (friction_n, load_n) =
            report.friction_and_load_n().map(|[friction_n, load_n]| (friction_n, load_n)).unzip();
        let (by_m, moved_m, measured_m) = (args.by, report.moved_m(), args.measured);
        Self { by_m, moved_m, report, friction_n, load_n, measured_m, measured_by_moved }
    }
}

/// The dead man's switch.
#[derive(Debug)]
struct Hold {
    /// A message for what was read at once; closed at the end of standard input.
    input: Receiver<()>,
    /// When the newest input was seen, ns.
    held_ns: Option<u64>,
    /// When the switch was asked first, ns.
    asked_ns: Option<u64>,
}

impl Hold {
    /// Reads standard input from now on.
    fn of_stdin() -> Self {
        let (sender, input) = channel();
        thread::spawn(move || {
            let mut bytes = [0; 64];
            while let Ok(1..) = std::io::stdin().read(&mut bytes)
                && sender.send(()).is_ok()
            {}
        });
        Self::of_input(input)
    }

    fn of_input(input: Receiver<()>) -> Self {
        Self { input, held_ns: None, asked_ns: None }
    }

    /// What the person wants at that time.
    fn wish(&mut self, now_ns: u64) -> Wish {
        let asked_ns = *self.asked_ns.get_or_insert(now_ns);
        loop {
            match self.input.try_recv() {
                Ok(()) => self.held_ns = Some(now_ns),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return Wish::Stop,
            }
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
        let (key, input) = channel();
        let mut hold = Hold::of_input(input);
        let mut wish = |now_ms: u64| hold.wish(now_ms * MILLISECOND_NS);
        assert_eq!((wish(0), wish(59_000)), (Wish::Halt, Wish::Halt), "nobody has touched the key");
        key.send(()).unwrap();
        assert_eq!((wish(59_500), wish(59_799), wish(59_800)), (Wish::Move, Wish::Move, Wish::Halt));
        key.send(()).unwrap();
        assert_eq!((wish(60_000), wish(62_999), wish(63_000)), (Wish::Move, Wish::Halt, Wish::Stop));
        key.send(()).unwrap();
        drop(key);
        assert_eq!(wish(63_001), Wish::Stop);
    }
}
