//! `masseter can`: verbs on the CAN link alone. They run no controller and no real interface.

mod serve;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use masseter_can::{BusPlan, PlannedMessage};
use masseter_commissioning::description;
use masseter_model::geometry::AXIS_NAMES;
use masseter_plan::{read_scenario, read_scenario_with};
use masseter_plant::core as plant;
use masseter_runtime::schedule::queued::{QueuedPlan, master_queue, queued_plans};
use masseter_runtime::schedule::{CycleSchedule, Room, ScheduleError, plans};
use serde_json::{Value, json};

use crate::prelude::*;

/// Verbs of `can`.
#[derive(Debug, Clone, clap::Subcommand)]
pub(crate) enum CanVerb {
    /// Print the load and the worst-case response times of every bus
    Plan(PlanArgs),
    /// Print the electronic data sheet (EDS, CiA 306) of a drive
    #[command(after_help = "Example:\n  masseter can eds --axis l1 > l1.eds")]
    Eds {
        /// Scenario file with the drives [default: the built-in scenario]
        scenario: Option<PathBuf>,
        /// Axis of the drive
        #[arg(long, default_value = "d1", value_parser = PossibleValuesParser::new(AXIS_NAMES).map(|name| axis_of(&name)))]
        axis: usize,
    },
    /// Print the messages of the link as a DBC file
    #[command(after_help = "Example:\n  masseter can dbc > masseter.dbc")]
    Dbc {
        /// Scenario file with the drives [default: the built-in scenario]
        scenario: Option<PathBuf>,
    },
    /// Serve the simulated buses and drives to other tools (socketcand protocol)
    Serve(serve::ServeArgs),
}

/// The arguments of `can plan`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter can plan --rate-hz 500")]
pub(crate) struct PlanArgs {
    /// Scenario file with the buses [default: the built-in scenario]
    scenario: Option<PathBuf>,
    /// Cycles per second
    #[arg(long)]
    rate_hz: Option<u32>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Executes a verb.
pub(crate) fn execute(verb: &CanVerb) -> anyhow::Result<Exit> {
    match verb {
        CanVerb::Plan(args) => plan(args),
        CanVerb::Eds { scenario, axis } => {
            result(&description::eds(&read_scenario(scenario.as_deref())?)?[*axis])?;
            Ok(Exit::Passed)
        }
        CanVerb::Dbc { scenario } => {
            result(&description::dbc(&read_scenario(scenario.as_deref())?)?)?;
            Ok(Exit::Passed)
        }
        CanVerb::Serve(args) => serve::serve(args),
    }
}

fn axis_of(name: &str) -> usize {
    AXIS_NAMES.iter().position(|axis| *axis == name).expect("the parser knows no other names")
}

/// Prints the plan; exit code 2 if a run with it would be refused.
fn plan(args: &PlanArgs) -> anyhow::Result<Exit> {
    let scenario = read_scenario_with(args.scenario.as_deref(), |scenario| {
        scenario.rate_hz = args.rate_hz.unwrap_or(scenario.rate_hz);
        Ok(())
    })?;
    let plans = plans(&scenario)?;
    let room = Room::for_link(&scenario)?;
    let refusal = refusal(&scenario, &plans, &room);
    // A refused cycle has no times at which the master queues its messages.
    let queued = queued_plans(&scenario).unwrap_or_default();
    let text = match args.format {
        Format::Human => {
            let plans = plans.iter().map(BusPlan::to_string).chain(queued.iter().map(QueuedPlan::to_string));
            let tables = plans.fold(String::new(), |text, plan| text + &plan + "\n\n");
            let verdict =
                refusal.as_ref().map_or_else(|| format!("fits; {room}"), |why| format!("refused: {why}"));
            format!("{tables}{verdict}\n")
        }
        Format::Json => {
            let queued = |bus| queued.iter().find(|plan| plan.bus == bus);
            let buses = plans.iter().map(|plan| of_bus(plan, queued(plan.bus), &scenario));
            let (fits, max_rate_hz) = (refusal.is_none(), room.max_rate_hz);
            let plan = json!({
                "fits": fits,
                "refusal": refusal,
                "max_rate_hz": max_rate_hz,
                "queue": master_queue(&scenario.can),
                "buses": buses.collect::<Result<Vec<_>, _>>()?,
            });
            format!("{plan:#}\n")
        }
    };
    result(&text)?;
    Ok(if refusal.is_none() { Exit::Passed } else { Exit::Usage })
}

/// Why a run with this plan would be refused.
fn refusal(scenario: &Scenario, plans: &[BusPlan], room: &Room) -> Option<String> {
    if let Some(overload) = plans.iter().find_map(|plan| plan.check().err()) {
        return Some(format!("bus {} does not fit; {room}", overload.0.bus));
    }
    let schedule = CycleSchedule::new(scenario).map_err(|error| error.to_string());
    let plant = plant::check_scenario(scenario).map_err(|error| error.to_string());
    schedule.and(plant).err()
}

fn of_bus(plan: &BusPlan, queued: Option<&QueuedPlan>, scenario: &Scenario) -> Result<Value, ScheduleError> {
    let mut alone = scenario.clone();
    alone.can.buses = vec![scenario.can.buses[plan.bus].clone()];
    Ok(json!({
        "bus": plan.bus,
        "fits": plan.check().is_ok(),
        "cycle_time_ns": plan.cycle_time_ns(),
        "utilisation": plan.utilisation(),
        "max_rate_hz": Room::for_link(&alone)?.max_rate_hz,
        "messages": plan.messages.iter().map(of_message).collect::<Vec<_>>(),
        "queued": queued.map(|queued| &queued.rows),
    }))
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
        "arrival_ns": planned.arrival_ns(),
        "fits": planned.fits(),
    })
}
