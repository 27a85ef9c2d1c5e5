//! Command-line arguments that several verbs share, and the parsers of their values.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use masseter_controller::hold_position::HoldPosition;
use masseter_controller::motion_controller::MotionController;
use masseter_controller::process::BuildController;
use masseter_shared::lifecycle::{Patience, ProcessArguments};

/// The arguments that the supervisor passes to every process of a run.
#[derive(Debug, Clone, Args)]
pub(crate) struct ProcessArgs {
    #[arg(long)]
    scenario: PathBuf,
    #[arg(long)]
    domain: String,
    /// For a run in lockstep
    #[arg(long, value_parser = parse_patience)]
    lockstep: Option<Patience>,
}

impl ProcessArgs {
    pub(crate) fn process_arguments(self) -> ProcessArguments {
        ProcessArguments { scenario: self.scenario, domain: self.domain, lockstep: self.lockstep }
    }
}

/// A controller of the rig.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum ControllerKind {
    /// Plays the motion of the scenario
    #[default]
    Motion,
    /// Holds the position found at the start, for as long as the motion takes
    Hold,
}

impl ControllerKind {
    /// How the controller is built.
    pub(crate) fn builder(self) -> BuildController {
        match self {
            Self::Motion => {
                |scenario, mechanism, motion| Box::new(MotionController::new(scenario, mechanism, motion))
            }
            Self::Hold => |scenario, mechanism, motion| {
                Box::new(HoldPosition::new(scenario, mechanism, motion.duration_s()))
            },
        }
    }
}

/// The name of a value on the command line.
pub(crate) fn name_of(value: &impl ValueEnum) -> String {
    value.to_possible_value().expect("no value is skipped").get_name().to_owned()
}

/// The real CAN interface of each bus; none for simulated buses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Wires(pub Vec<String>);

pub(crate) fn parse_cores(text: &str) -> Result<[usize; 2], String> {
    let cores: Result<Vec<usize>, _> = text.split(',').map(|core| core.trim().parse()).collect();
    match cores.as_deref() {
        Ok([controller, plant]) => Ok([*controller, *plant]),
        _ => Err("expected two cores, such as 0,1".to_owned()),
    }
}

/// `none`, or a duration.
pub(crate) fn parse_patience(text: &str) -> Result<Patience, String> {
    if text == "none" {
        return Ok(Patience(None));
    }
    let duration = humantime::parse_duration(text);
    duration.map(|duration| Patience(Some(duration))).map_err(|error| format!("{error}; or `none`"))
}

/// The same as [`parse_patience`] reads.
pub(crate) fn patience_text(Patience(patience): Patience) -> String {
    patience.map_or_else(|| "none".to_owned(), |patience| humantime::format_duration(patience).to_string())
}

pub(crate) fn parse_wires(text: &str) -> Result<Wires, String> {
    if text == "virtual" {
        return Ok(Wires(Vec::new()));
    }
    let names: Vec<_> = text.split(',').map(|name| name.trim().to_owned()).collect();
    if names.iter().any(String::is_empty) {
        return Err("expected `virtual`, or interfaces such as can0,can1".to_owned());
    }
    Ok(Wires(names))
}
