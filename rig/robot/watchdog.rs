//! `masseter robot watchdog`: one axis after the other stands with power, and must stop once the master sends nothing.

use masseter_commissioning::{LastFrame, Reaction, WatchdogReport, Wish, prove_watchdogs};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_terminal::{Exit, Failure, OrFailure, result_line};

use super::{args::AxesArgs, session::Session, step::Step};

/// What is kept of one axis.
#[derive(Debug, serde::Serialize)]
struct AxisResult {
    axis: &'static str,
    #[serde(flatten)]
    report: WatchdogReport,
}

/// Proves the watchdogs, prints what was found, and keeps it.
pub(crate) fn watchdog(args: &AxesArgs) -> Result<Exit, Failure> {
    let axes: Vec<usize> = args.axis.map_or_else(|| (0..AXES).collect(), |axis| vec![axis]);
    let earlier = (!args.out_of_order).then_some(Step::Jog);
    let mut session = Session::begin(&args.robot, Step::Watchdog, &axes, earlier)?;
    let stop = session.stop.clone();
    let mut operator = |_| if stop.is_made() { Wish::Stop } else { Wish::Move };
    let mut results = Vec::with_capacity(axes.len());
    for &axis in &axes {
        let report = match prove_watchdogs(&mut session.line, &session.scenario, axis, &mut operator) {
            Ok(report) => report,
            Err(error) => return Err(session.fail_motion(error)),
        };
        print(axis, &report).incomplete()?;
        results.push(AxisResult { axis: AXIS_NAMES[axis], report });
        session.results = Some(serde_json::json!(results));
    }
    if let Err(disturbance) = session.check_present() {
        return Err(session.fail(Exit::Failed, disturbance));
    }
    session.finish_session(true, &results)?;
    Ok(Exit::Passed)
}

fn print(axis: usize, report: &WatchdogReport) -> anyhow::Result<()> {
    let in_words = |silence: &str, reaction: &Reaction| {
        let Reaction { timeout_ms, stopped_after_ms, last_frame, emergency, moved_m } = reaction;
        let since = match last_frame {
            LastFrame::Left => "",
            LastFrame::Queued => " since its last frame was queued",
        };
        format!(
            "without {silence} off after {stopped_after_ms:.0} ms of {timeout_ms} ms{since}, emergency {emergency:04X}h, moved {:.4} mm",
            moved_m * 1e3
        )
    };
    let process_data = report.process_data.as_ref().map_or_else(
        || "no event timer watches the process data (1400h:05)".to_owned(),
        |reaction| in_words("process data", reaction),
    );
    result_line!("{}: {}; {process_data}", AXIS_NAMES[axis], in_words("heartbeat", &report.heartbeat))
}
