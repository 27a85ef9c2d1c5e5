//! `masseter signals`: the signals of a run, for `[[require]]`.
//!
//! Signals that your own program declares are known only once it runs: a run's manifest has them.

use std::path::PathBuf;

use clap::Args;
use masseter_analysis::requirements::event_names;
use masseter_analysis::signals::Registry;
use masseter_plan::{RunPlan, read_scenario};
use masseter_terminal::{Exit, Format, result};

use crate::arguments::ControllerChoice;

/// The arguments of `signals`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter signals | grep incisal")]
pub(crate) struct SignalsArgs {
    /// Scenario file [default: ten seconds of chewing]
    scenario: Option<PathBuf>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Prints every signal with its unit and its meaning.
pub(crate) fn signals(args: &SignalsArgs) -> anyhow::Result<Exit> {
    let plan = RunPlan::of_file(read_scenario(args.scenario.as_deref())?, args.scenario.as_deref())?;
    let build = ControllerChoice::default().builder().expect("the default controller is the rig's");
    let declared = build(&plan.scenario, plan.mechanism.clone(), plan.trajectory.clone()).declared();
    let registry = Registry::new(&plan.scenario, &declared);
    let text = match args.format {
        Format::Json => serde_json::to_string_pretty(registry.signals())? + "\n",
        Format::Human => {
            let signals = registry.signals().iter().fold(String::new(), |text, signal| {
                text + &format!("{:<26} {:<6} {}\n", signal.name, signal.unit, signal.about)
            });
            let names: Vec<_> = event_names().collect();
            format!("{signals}\nevents: {}\n", names.join(", "))
        }
    };
    result(&text)?;
    Ok(Exit::Passed)
}
