//! Arguments that several verbs of `robot` share, and the parsers of their values.

use std::path::PathBuf;

use clap::Args;
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_plan::{read_scenario_with, set_keys};
use masseter_scenario::{Dimension, Quantity, Scenario};

use crate::cli::arguments::{Wires, parse_wires};

/// Robot and evidence.
#[derive(Debug, Clone, Args)]
pub(crate) struct RobotArgs {
    /// Scenario file [default: the built-in scenario]
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
        read_scenario_with(self.scenario.as_deref(), |scenario| {
            set_keys(scenario, None, &[])?;
            if let Some(Wires(interfaces)) = &self.can {
                scenario.can.interfaces.clone_from(interfaces);
            }
            Ok(())
        })
    }
}

/// The arguments of a step with one axis after the other: `robot watchdog` and `robot home`.
#[derive(Debug, Clone, Args)]
pub(crate) struct AxesArgs {
    #[command(flatten)]
    pub(crate) robot: RobotArgs,
    /// The axis: d1 to l3 [default: all]
    #[arg(long, value_parser = parse_axis)]
    pub(crate) axis: Option<usize>,
    /// Go on without the evidence of the earlier steps
    #[arg(long)]
    pub(crate) out_of_order: bool,
}

/// The arguments of `robot configure` and `robot restore`.
#[derive(Debug, Clone, Args)]
pub(crate) struct WriteArgs {
    #[command(flatten)]
    pub(crate) robot: RobotArgs,
    /// This axis alone
    #[arg(long, value_parser = parse_axis)]
    axis: Option<usize>,
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

/// A length with its unit, such as 1mm, -0.5mm, 20um or 0.001m: metres.
pub(super) fn parse_length(text: &str) -> Result<f64, String> {
    si_of(text, Dimension::Length)
        .ok_or_else(|| "give a length with its unit, such as 1mm or -0.5mm".to_owned())
}

/// A speed with its unit, such as 2mm/s: m/s.
pub(super) fn parse_speed(text: &str) -> Result<f64, String> {
    let speed_m_s = si_of(text, Dimension::Velocity).filter(|speed_m_s| *speed_m_s > 0.0);
    speed_m_s.ok_or_else(|| "give a speed above 0 with its unit, such as 2mm/s".to_owned())
}

fn si_of(text: &str, dimension: Dimension) -> Option<f64> {
    text.parse::<Quantity>().ok()?.si_of(dimension).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_and_speeds_need_their_unit() {
        for (text, length_m) in [("1mm", 1e-3), ("-0.5 mm", -5e-4), ("20um", 2e-5), ("0.01m", 0.01)] {
            assert!((parse_length(text).unwrap() - length_m).abs() < 1e-15, "{text}");
        }
        for text in ["1", "mm", "1 inch", "NaNmm", ""] {
            assert!(parse_length(text).is_err(), "{text}");
        }
        assert!((parse_speed("2mm/s").unwrap() - 2e-3).abs() < 1e-15);
        assert!(["2mm", "0mm/s", "-1mm/s"].iter().all(|text| parse_speed(text).is_err()));
    }
}
