//! `masseter robot home`: one axis after the other.

use clap::Args;
use masseter_model::geometry::AXIS_NAMES;
use masseter_plant::bringup::{HomeReport, Wish, home as find};
use masseter_terminal::{Exit, Failure, result_line};
use serde_json::{Value, json};

use super::args::{RobotArgs, parse_axis};
use super::power_mark;
use super::robot_line::failed;
use super::session::Session;
use super::step::Step;

/// The legs come first: a slide moves a leg whose length is known.
const ORDER: [usize; 6] = [3, 4, 5, 0, 1, 2];

/// The arguments of `robot home`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:\n  masseter robot home\n  masseter robot home --axis l1")]
pub(crate) struct HomeArgs {
    #[command(flatten)]
    robot: RobotArgs,
    /// The axis: d1 to l3 [default: all, the legs first]
    #[arg(long, value_parser = parse_axis, conflicts_with = "all")]
    axis: Option<usize>,
    /// All axes, one after the other, the legs first: the default
    #[arg(long)]
    all: bool,
    /// Go on without the evidence of the earlier steps
    #[arg(long)]
    out_of_order: bool,
}

/// Homes, prints what was found, and keeps it.
pub(crate) fn home(args: &HomeArgs) -> Result<Exit, Failure> {
    let axes = args.axis.map_or_else(|| ORDER.to_vec(), |axis| vec![axis]);
    let earlier = |axis| (!args.out_of_order).then_some(Step::Jog(axis));
    let mut session = Session::begin(&args.robot, Step::Home, &axes, earlier)?;
    let stop = session.stop.clone();
    let mut operator = |_| if stop.is_made() { Wish::Stop } else { Wish::Move };
    let mut data = Vec::with_capacity(axes.len());
    for &axis in &axes {
        match find(&mut session.line, &session.scenario, axis, &mut operator) {
            Ok(report) => {
                print(axis, &report).map_err(|error| Failure::with(Exit::Incomplete, error))?;
                data.push(axis_data(axis, &report));
            }
            Err(error) => return Err(session.fail(error)),
        }
    }
    let marked = mark(&mut session, &axes, &mut data);
    session.finish(marked.is_ok(), &data)?;
    marked.map(|()| Exit::Passed).map_err(failed)
}

/// Leaves a mark in each drive that forgets its position without power.
fn mark(session: &mut Session, axes: &[usize], data: &mut [Value]) -> anyhow::Result<()> {
    for (&axis, data) in axes.iter().zip(data) {
        data["mark"] = json!(power_mark::leave(&session.scenario, &mut session.line, axis)?);
    }
    Ok(session.check_present()?)
}

fn print(axis: usize, report: &HomeReport) -> anyhow::Result<()> {
    let HomeReport { position_m, way_m, spread_m } = *report;
    let name = AXIS_NAMES[axis];
    match spread_m {
        None => result_line!(
            "{name}: {:.4} mm, within its stroke; the encoder keeps its position",
            position_m * 1e3
        ),
        Some(spread_m) => result_line!(
            "{name}: home after {:.4} mm, 6064h shows {:.4} mm; the second homing is {:.4} mm beside the first",
            way_m * 1e3,
            position_m * 1e3,
            spread_m * 1e3
        ),
    }
}

fn axis_data(axis: usize, report: &HomeReport) -> Value {
    json!({
        "axis": AXIS_NAMES[axis],
        "position_m": report.position_m,
        "way_m": report.way_m,
        "spread_m": report.spread_m,
    })
}
