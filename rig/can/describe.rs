//! `masseter can eds` and `masseter can dbc`: descriptions of the drives and the link for other tools.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use masseter_model::geometry::AXIS_NAMES;
use masseter_plan::read_scenario;
use masseter_plant::description;
use masseter_terminal::{Exit, result};

/// The arguments of `can eds`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter can eds --axis l1 > l1.eds")]
pub(crate) struct EdsArgs {
    /// Scenario file with the drives [default: the published rig]
    scenario: Option<PathBuf>,
    /// Axis of the drive
    #[arg(long, default_value = "d1", value_parser = PossibleValuesParser::new(AXIS_NAMES).map(|name| axis_of(&name)))]
    axis: usize,
}

/// The arguments of `can dbc`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter can dbc > masseter.dbc")]
pub(crate) struct DbcArgs {
    /// Scenario file with the drives [default: the published rig]
    scenario: Option<PathBuf>,
}

/// Prints the electronic data sheet of one drive.
pub(crate) fn eds(args: &EdsArgs) -> anyhow::Result<Exit> {
    let sheets = description::eds(&read_scenario(args.scenario.as_deref())?)?;
    result(&sheets[args.axis])?;
    Ok(Exit::Passed)
}

/// Prints the messages of the whole link.
pub(crate) fn dbc(args: &DbcArgs) -> anyhow::Result<Exit> {
    result(&description::dbc(&read_scenario(args.scenario.as_deref())?)?)?;
    Ok(Exit::Passed)
}

fn axis_of(name: &str) -> usize {
    AXIS_NAMES.iter().position(|axis| *axis == name).expect("the parser knows no other names")
}
