//! The plan and the clock of a run, from its arguments; refuses what this machine or the controller does not have.

use masseter_analysis::requirements::check_requirements;
use masseter_plan::RunPlan;
use masseter_plant::core as plant;
use masseter_shared::config::Scenario;
use masseter_shared::control::Operator;
use masseter_shared::named::{NameError, NamedValues};

use super::args::RunArgs;
use super::clock;
use crate::arguments::check_cores;
use crate::foxglove;

/// Plans the run and chooses its clock; refuses interfaces and addresses that this machine does not have.
pub(super) fn resolve(args: &RunArgs) -> anyhow::Result<(RunPlan, RunArgs)> {
    let scenario = masseter_plan::scenario_with_overrides(args.scenario.as_deref(), &args.overrides())?;
    args.cores.map_or(Ok(()), |cores| check_cores(&cores))?;
    let args = clock::choose(args, &scenario);
    clock::check(&args, &scenario)?;
    args.live.map_or(Ok(()), foxglove::check)?;
    let plan = RunPlan::of_file(scenario, args.scenario.as_deref())?;
    plant::check_interfaces(&plan.scenario)?;
    if let Some(build) = args.controller.builder() {
        let controller = build(&plan.scenario, plan.mechanism.clone(), plan.trajectory.clone());
        let declared = controller.declared();
        check_requirements(&plan.scenario, Some(&declared)).map_err(anyhow::Error::msg)?;
        let named =
            NamedValues::new(declared, &plan.scenario.parameters).map_err(|error| with_question(&error))?;
        Operator::new(&plan.scenario, named.settings().declared(), 0)?;
    } else {
        check_requirements(&plan.scenario, None).map_err(anyhow::Error::msg)?;
    }
    Ok((plan, args))
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
