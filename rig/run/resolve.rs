//! The plan and the clock of a run, from its arguments; refuses what this machine or the controller does not have.

use anyhow::ensure;
use masseter_analysis::requirements::check_requirements;
use masseter_controller::process::BuildController;
use masseter_plan::RunPlan;
use masseter_plant::core as plant;
use masseter_shared::config::Scenario;
use masseter_shared::control::Operator;
use masseter_shared::named::{NameError, NamedValues};

use super::args::RunArgs;
use super::clock::{self, needs_processes};
use crate::arguments::{ControllerKind, check_cores};
use crate::live;

/// Plans the run and chooses its clock; refuses interfaces and addresses that this machine does not have.
pub(super) fn resolve(args: &RunArgs) -> anyhow::Result<(RunPlan, RunArgs)> {
    let scenario = masseter_plan::scenario_with_overrides(args.scenario.as_deref(), &args.overrides())?;
    args.cores.map_or(Ok(()), |cores| check_cores(&cores))?;
    let args = clock::choose(args, &scenario);
    clock::check(&args, &scenario)?;
    args.live.map_or(Ok(()), live::check)?;
    let plan = RunPlan::of_file(scenario, args.scenario.as_deref())?;
    plant::check_interfaces(&plan.scenario)?;
    match args.controller.builder() {
        Some(build) => check_controller(&plan, build)?,
        None => check_requirements(&plan.scenario, None).map_err(anyhow::Error::msg)?,
    }
    Ok((plan, args))
}

/// The plan of a scenario for virtual time, under which a controller of the rig runs alone.
pub(super) fn resolve_simulated(scenario: &Scenario, build: BuildController) -> anyhow::Result<RunPlan> {
    ensure!(
        !needs_processes(scenario),
        "a fault of a process needs processes, which virtual time does not have"
    );
    let plan = RunPlan::new(scenario.clone())?;
    check_controller(&plan, build)?;
    Ok(plan)
}

/// Refuses a scenario that virtual time cannot play.
pub(crate) fn check_simulated(scenario: &Scenario, controller: ControllerKind) -> anyhow::Result<()> {
    resolve_simulated(scenario, controller.builder()).map(drop)
}

/// Refuses requirements, parameters and changes of parameters that the controller does not know.
fn check_controller(plan: &RunPlan, build: BuildController) -> anyhow::Result<()> {
    let controller = build(&plan.scenario, plan.mechanism.clone(), plan.trajectory.clone());
    let declared = controller.declared();
    check_requirements(&plan.scenario, Some(&declared)).map_err(anyhow::Error::msg)?;
    let named =
        NamedValues::new(declared, &plan.scenario.parameters).map_err(|error| with_question(&error))?;
    Operator::new(&plan.scenario, named.settings().declared(), 0)?;
    Ok(())
}

/// A refusal of `[parameters]`: a name that `--set` was given may be meant as a key of the scenario.
fn with_question(error: &NameError) -> anyhow::Error {
    let question = match error {
        NameError::Unknown { name, .. } => Scenario::question_for(name),
        _ => None,
    };
    let question =
        question.map_or_else(String::new, |question| format!("; of the keys of a scenario, {question}"));
    anyhow::anyhow!("[parameters]: {error}{question}")
}
