//! Arguments that several verbs of `robot` share.

use std::path::PathBuf;

use clap::Args;
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_plan::{Overrides, scenario_with_overrides};
use masseter_scenario::Scenario;

use crate::arguments::{Wires, parse_wires};

/// Robot and evidence.
#[derive(Debug, Clone, Args)]
pub(crate) struct RobotArgs {
    /// Scenario file [default: the published rig]
    scenario: Option<PathBuf>,
    /// Simulated buses, or the CAN interface of each bus, such as can0,can1
    #[arg(long, value_name = "virtual|IF[,IF]", value_parser = parse_wires)]
    can: Option<Wires>,
    /// Folder with the evidence of all steps
    #[arg(long, value_name = "DIR", default_value = "bringup")]
    pub(crate) folder: PathBuf,
}

impl RobotArgs {
    /// The scenario with the interfaces of the command line.
    ///
    /// # Errors
    /// When the file cannot be read or a value is out of range.
    pub(crate) fn scenario(&self) -> anyhow::Result<Scenario> {
        let interfaces = self.can.as_ref().map(|wires| wires.0.clone());
        scenario_with_overrides(self.scenario.as_deref(), &Overrides { interfaces, ..Overrides::default() })
    }
}

/// The arguments of `robot configure` and `robot restore`.
#[derive(Debug, Clone, Args)]
pub(crate) struct WriteArgs {
    #[command(flatten)]
    pub(crate) robot: RobotArgs,
    /// This axis alone
    #[arg(long, value_parser = parse_axis)]
    pub(crate) axis: Option<usize>,
    /// Store in the drives' memory, and prove it by a reset
    #[arg(long)]
    pub(crate) store: bool,
    /// Stop a drive that somebody else left with power, instead of refusing
    #[arg(long)]
    pub(crate) take_over: bool,
}

impl WriteArgs {
    /// The axes to be written.
    pub(crate) fn axes(&self) -> Vec<usize> {
        self.axis.map_or_else(|| (0..AXES).collect(), |axis| vec![axis])
    }
}

/// An axis by its name.
pub(crate) fn parse_axis(name: &str) -> Result<usize, String> {
    let axis = AXIS_NAMES.iter().position(|axis| *axis == name);
    axis.ok_or_else(|| format!("give one of {}", AXIS_NAMES.join(", ")))
}
