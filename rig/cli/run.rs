//! `masseter run`: plays a motion, judges the run, and writes its folder.

use masseter_terminal::{Exit, Failure};

use crate::run::PreparedRun;
use crate::run::interrupts::Interrupts;
use crate::run::request::RunRequest;

/// Plays, judges and reports the run.
pub(super) fn run(request: &RunRequest) -> Result<Exit, Failure> {
    let prepared = PreparedRun::new(request)?;
    let interrupts = Interrupts::of_verb()?;
    let played = prepared.play(&interrupts);
    interrupts.restore_default_actions();
    played?.report()
}
