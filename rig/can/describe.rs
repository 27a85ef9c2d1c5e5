//! `masseter can eds` and `masseter can dbc`: the drives as other tools read them, to standard output.

use std::path::{Path, PathBuf};

use clap::Args;
use masseter_plant::description;
use masseter_shared::geometry::AXIS_NAMES;

use masseter_plan::given;
use masseter_terminal::Exit;
use masseter_terminal::result;

/// What `can eds` takes.
#[derive(Debug, Clone, Args)]
pub(crate) struct EdsArgs {
    /// Scenario whose drives are meant [default: the published rig]
    scenario: Option<PathBuf>,
    /// Axis of the drive: d1, d2, d3, l1, l2 or l3
    #[arg(long, default_value = "d1", value_parser = parse_axis)]
    axis: usize,
}

/// The electronic data sheet of one drive.
pub(crate) fn eds(args: &EdsArgs) -> anyhow::Result<Exit> {
    let sheets = description::eds(&given(args.scenario.as_deref())?)?;
    result(&sheets[args.axis])?;
    Ok(Exit::Passed)
}

/// The messages of the whole link.
pub(crate) fn dbc(path: Option<&Path>) -> anyhow::Result<Exit> {
    result(&description::dbc(&given(path)?)?)?;
    Ok(Exit::Passed)
}

fn parse_axis(text: &str) -> Result<usize, String> {
    let axis = AXIS_NAMES.iter().position(|name| *name == text);
    axis.ok_or_else(|| format!("the axes are {}", AXIS_NAMES.join(" ")))
}
