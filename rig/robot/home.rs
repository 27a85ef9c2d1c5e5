//! `masseter robot home`: one axis after the other.

use masseter_commissioning::{HomeReport, Wish, home as find};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_terminal::{Exit, Failure, OrFailure, result_line};

use super::power_mark::{Homed, leave_mark};
use super::{args::AxesArgs, robot_line::failed, session::Session, step::Step};

/// The legs come first: a slide moves a leg whose length is known.
const ORDER: [usize; AXES] = [3, 4, 5, 0, 1, 2];

/// What is kept of one axis.
#[derive(Debug, serde::Serialize)]
struct AxisResult {
    #[serde(flatten)]
    homed: Homed,
    #[serde(flatten)]
    report: HomeReport,
}

/// Homes, prints what was found, and keeps it.
pub(crate) fn home(args: &AxesArgs) -> Result<Exit, Failure> {
    let axes = args.axis.map_or_else(|| ORDER.to_vec(), |axis| vec![axis]);
    let earlier = (!args.out_of_order).then_some(|_: usize| Step::Watchdog);
    let mut session = Session::begin(&args.robot, Step::Home, &axes, earlier)?;
    let stop = session.stop.clone();
    let mut operator = |_| if stop.is_made() { Wish::Stop } else { Wish::Move };
    let mut results = Vec::with_capacity(axes.len());
    for &axis in &axes {
        let report = match find(&mut session.line, &session.scenario, axis, &mut operator) {
            Ok(report) => report,
            Err(error) => return Err(session.fail_motion(error)),
        };
        print(axis, &report).incomplete()?;
        results.push(AxisResult { homed: Homed { axis: AXIS_NAMES[axis].to_owned(), mark: None }, report });
        session.results = Some(serde_json::json!(results));
    }
    let marked = leave_marks(&mut session, &axes, &mut results);
    session.finish_session(marked.is_ok(), &results)?;
    marked.map(|()| Exit::Passed).map_err(failed)
}

/// Leaves a mark in each drive that forgets its position without power.
fn leave_marks(session: &mut Session, axes: &[usize], results: &mut [AxisResult]) -> anyhow::Result<()> {
    for (&axis, result) in axes.iter().zip(results) {
        result.homed.mark = leave_mark(&session.scenario, &mut session.line, axis)?;
    }
    Ok(session.check_present()?)
}

fn print(axis: usize, report: &HomeReport) -> anyhow::Result<()> {
    let HomeReport { position_m, way_m, spread_m } = *report;
    let (name, position_mm) = (AXIS_NAMES[axis], position_m * 1e3);
    match spread_m {
        None => {
            result_line!("{name}: {position_mm:.4} mm, within its stroke; the encoder keeps its position")
        }
        Some(spread_m) => result_line!(
            "{name}: home after {:.4} mm, 6064h shows {position_mm:.4} mm; the second homing is {:.4} mm beside \
             the first",
            way_m * 1e3,
            spread_m * 1e3
        ),
    }
}
