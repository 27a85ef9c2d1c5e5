//! `masseter can plan`: the plan of every bus, as a table or as JSON.

use std::path::PathBuf;

use clap::Args;
use masseter_plant::core as plant;
use masseter_shared::can::{BusPlan, PlannedMessage};
use masseter_shared::config::Scenario;
use masseter_shared::schedule::{CycleSchedule, plans};
use serde_json::{Value, json};

use crate::cli::Format;
use crate::exit::Exit;
use crate::say::result;

/// What `can plan` takes.
#[derive(Debug, Clone, Args)]
pub(crate) struct PlanArgs {
    /// Scenario file; without one, the default rig
    scenario: Option<PathBuf>,
    /// Cycles per second
    #[arg(long)]
    rate_hz: Option<u32>,
    /// How the plan is written to standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Prints the plan; exit code 2 where the rig could not run by it.
pub(crate) fn plan(args: &PlanArgs) -> anyhow::Result<Exit> {
    let mut scenario = args.scenario.as_deref().map(Scenario::read).transpose()?.unwrap_or_default();
    scenario.rate_hz = args.rate_hz.unwrap_or(scenario.rate_hz);
    scenario.validate()?;
    let plans = plans(&scenario.can, scenario.period_ns())?;
    let refusal = refusal(&scenario, &plans);
    let text = match args.format {
        Format::Human => {
            let tables: String =
                plans.iter().fold(String::new(), |text, plan| text + &plan.to_string() + "\n\n");
            let verdict = refusal.as_ref().map_or_else(|| "fits".to_owned(), |why| format!("refused: {why}"));
            format!("{tables}{verdict}\n")
        }
        Format::Json => {
            let buses: Vec<_> = plans.iter().map(of_bus).collect();
            format!("{:#}\n", json!({ "fits": refusal.is_none(), "refusal": refusal, "buses": buses }))
        }
    };
    result(&text)?;
    Ok(if refusal.is_none() { Exit::Passed } else { Exit::Usage })
}

/// Why the rig could not run by the plan.
fn refusal(scenario: &Scenario, plans: &[BusPlan]) -> Option<String> {
    if let Some(overload) = plans.iter().find_map(|plan| plan.check().err()) {
        return Some(format!("bus {} does not fit", overload.0.bus()));
    }
    let schedule = CycleSchedule::new(&scenario.can, scenario.period_ns()).map_err(|error| error.to_string());
    let plant = plant::check(scenario).map_err(|error| error.to_string());
    schedule.and(plant).err()
}

fn of_bus(plan: &BusPlan) -> Value {
    json!({
        "bus": plan.bus(),
        "fits": plan.check().is_ok(),
        "cycle_time_ns": plan.cycle_time_ns(),
        "utilisation": plan.utilisation(),
        "max_rate_hz": plan.max_rate_hz(),
        "messages": plan.messages().iter().map(of_message).collect::<Vec<_>>(),
    })
}

fn of_message(planned: &PlannedMessage) -> Value {
    let message = &planned.message;
    json!({
        "name": message.name,
        "id": message.id.to_string(),
        "data_length": message.data_length,
        "period_ns": message.period_ns,
        "deadline_ns": message.deadline_ns,
        "transmission_ns": planned.transmission_ns,
        "jitter_ns": planned.jitter_ns,
        "response_ns": planned.response_ns,
        "fits": planned.fits(),
    })
}
