//! `masseter controller`: one of the rig's controllers as a program that attaches to a rig; with the supervisor's hidden
//! arguments, the controller's process.

use clap::Args;
use masseter_controller::process;
use masseter_runtime::control::Outcome;
use masseter_terminal::Exit;

use crate::arguments::{ControllerKind, ProcessArgs};

/// The arguments of `controller`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Example:\n  masseter run --controller external --name bench\n  masseter controller --rig bench"
)]
pub(crate) struct ControllerArgs {
    /// Name of the rig [default: that of MASSETER_RIG, or the only rig that takes a controller]
    #[arg(long, value_name = "NAME")]
    rig: Option<String>,
    /// Which controller
    #[arg(long, value_enum, default_value_t)]
    kind: ControllerKind,
    #[command(flatten)]
    process: Option<ProcessArgs>,
}

/// Runs the controller to the end of its motion or a safe stop.
pub(crate) fn control(args: ControllerArgs) -> anyhow::Result<Exit> {
    let build = args.kind.builder();
    let outcome = match args.process {
        Some(process) => process::run(&process.process_arguments(), build)?,
        None => process::run_attached(args.rig.as_deref(), build)?,
    };
    Ok(match outcome {
        Outcome::Finished => Exit::Passed,
        Outcome::SafeStop => Exit::SafeStop,
    })
}
