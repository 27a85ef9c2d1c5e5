//! The plan and the clock of a run, from its arguments; refuses what this machine or the controller does not have.

use std::path::Path;

use anyhow::ensure;
use masseter_analysis::requirements::{RequirementError, check_requirements};
use masseter_controller::process::BuildController;
use masseter_plan::RunPlan;
use masseter_plant::core as plant;
use masseter_runtime::control::{Operator, OperatorError};
use masseter_runtime::named::{NameError, NamedValues};
use masseter_scenario::Scenario;
use masseter_scenario::input::excerpt;

use super::args::RunArgs;
use super::clock::{self, needs_processes};
use crate::arguments::{ControllerKind, check_cores};
use masseter_recorder::live;

/// Plans the run and chooses its clock; refuses interfaces and addresses that this machine does not have.
pub(super) fn resolve(args: &RunArgs) -> anyhow::Result<(RunPlan, RunArgs)> {
    let scenario = masseter_plan::scenario_with_overrides(args.scenario.as_deref(), &args.overrides())?;
    args.cores.map_or(Ok(()), |cores| check_cores(&cores))?;
    let args = clock::choose(args, &scenario);
    clock::check(&args, &scenario)?;
    args.live.map_or(Ok(()), live::check)?;
    let plan = RunPlan::of_file(scenario, args.scenario.as_deref())?;
    plant::check_interfaces(&plan.scenario)?;
    let checked = match args.controller.builder() {
        Some(build) => check_controller(&plan, build),
        None => check_requirements(&plan.scenario, None).map_err(Unknown::from),
    };
    checked.map_err(|unknown| unknown.at(&plan.scenario, args.scenario.as_deref()))?;
    Ok((plan, args))
}

/// The plan of a scenario, of a file if it comes from one, for virtual time, under which a controller of the rig runs alone.
pub(super) fn resolve_simulated(
    scenario: &Scenario,
    path: Option<&Path>,
    build: BuildController,
) -> anyhow::Result<RunPlan> {
    ensure!(
        !needs_processes(scenario),
        "a fault of a process needs processes, which virtual time does not have"
    );
    let of_file = |path| RunPlan::of_file(scenario.clone(), Some(path));
    let plan = path.map_or_else(|| RunPlan::new(scenario.clone()), of_file)?;
    check_controller(&plan, build).map_err(|unknown| unknown.at(scenario, path))?;
    Ok(plan)
}

/// Refuses a scenario that virtual time cannot play.
pub(crate) fn check_simulated(
    scenario: &Scenario,
    path: Option<&Path>,
    controller: ControllerKind,
) -> anyhow::Result<()> {
    resolve_simulated(scenario, path, controller.builder()).map(drop)
}

/// Refuses requirements, parameters and changes of parameters that the controller does not know.
fn check_controller(plan: &RunPlan, build: BuildController) -> Result<(), Unknown> {
    let controller = build(&plan.scenario, plan.mechanism.clone(), plan.trajectory.clone());
    let declared = controller.declared();
    check_requirements(&plan.scenario, Some(&declared))?;
    let named = NamedValues::new(declared, &plan.scenario.parameters)?;
    Operator::new(&plan.scenario, named.settings().declared(), 0)?;
    Ok(())
}

/// What the controller, or nobody, knows of a scenario.
#[derive(Debug, thiserror::Error)]
enum Unknown {
    #[error(transparent)]
    Requirement(#[from] RequirementError),
    #[error("{}{}", .0, question(.0))]
    Parameter(#[from] NameError),
    #[error(transparent)]
    Stimulus(#[from] OperatorError),
}

impl Unknown {
    /// The refusal with its key, and with its place where the file of the scenario has this value.
    fn at(self, scenario: &Scenario, path: Option<&Path>) -> anyhow::Error {
        let (key, entry) = match &self {
            Self::Requirement(RequirementError { key, entry, .. }) => ((*key).to_owned(), *entry),
            Self::Parameter(error) => {
                (["parameters"].into_iter().chain(error.name()).collect::<Vec<_>>().join("."), None)
            }
            Self::Stimulus(error) => match error.key() {
                Some((key, entry)) => (key.to_owned(), Some(entry)),
                None => return self.into(),
            },
        };
        let place = path.and_then(|path| scenario.place_of_key(path, &key, entry));
        let place = place.map_or_else(String::new, |place| format!("{place}: "));
        anyhow::Error::from(self).context(format!("{place}{}", excerpt(&key)))
    }
}

/// A name that `--set` was given may be meant as a key of the scenario.
fn question(error: &NameError) -> String {
    let question = match error {
        NameError::Unknown { name, .. } => Scenario::question_for(name),
        _ => None,
    };
    question.map_or_else(String::new, |question| format!("; of the keys of a scenario, {question}"))
}
