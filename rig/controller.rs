//! The hidden verb `controller`: the controller's process, started by the supervisor.

use masseter_controller::process::{self, Outcome};
use masseter_terminal::Exit;

use crate::arguments::ProcessArgs;

/// Runs the controller to the end of its motion or a safe stop.
pub(crate) fn control(args: ProcessArgs) -> anyhow::Result<Exit> {
    Ok(match process::run(&args.assignment())? {
        Outcome::Finished => Exit::Passed,
        Outcome::SafeStop => Exit::SafeStop,
    })
}
