//! The hidden verb `controller`: the controller's process, started by the supervisor.

use clap::Args;
use masseter_controller::process;
use masseter_shared::control::Outcome;
use masseter_terminal::Exit;

use crate::arguments::{ControllerKind, ProcessArgs};

/// The arguments that the supervisor passes to the controller.
#[derive(Debug, Clone, Args)]
pub(crate) struct ControllerArgs {
    #[command(flatten)]
    process: ProcessArgs,
    #[arg(long, value_enum, default_value_t)]
    kind: ControllerKind,
}

/// Runs the controller to the end of its motion or a safe stop.
pub(crate) fn control(args: ControllerArgs) -> anyhow::Result<Exit> {
    Ok(match process::run(&args.process.process_arguments(), args.kind.builder())? {
        Outcome::Finished => Exit::Passed,
        Outcome::SafeStop => Exit::SafeStop,
    })
}
