//! `masseter run`: plays a motion, judges the run, and writes its folder.

use masseter_terminal::{Exit, Failure};

/// Plays, judges and reports the run.
pub(super) fn run(request: &crate::run::request::RunRequest) -> Result<Exit, Failure> {
    let prepared = crate::run::PreparedRun::new(request)?;
    let interrupts = crate::run::interrupts::Interrupts::of_verb()?;
    let played = prepared.play(&interrupts);
    interrupts.restore_default_actions();
    played?.report()
}
