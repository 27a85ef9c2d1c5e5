//! The signals and parameters that a controller declares. A program states them when it is ready: it is started for a
//! scenario, without plant and recorder, and left before the first cycle.

use masseter_runtime::{lifecycle::attach::Invitation, named::Declared};

use super::{controller::Controller, request::ControllerChoice, supervisor::reserve_domain};
use crate::prelude::*;

/// The declaration of this controller for a planned scenario.
///
/// # Errors
/// For a controller that the rig does not start, and a program that ends, is refused, or is not ready in time.
pub(crate) fn declared_by(choice: &ControllerChoice, plan: &RunPlan) -> anyhow::Result<Declared> {
    if let Some(build) = choice.builder() {
        return Ok(build(&plan.scenario, plan.mechanism.clone(), plan.trajectory.clone()).declared());
    }
    if !matches!(choice, ControllerChoice::Executable(..)) {
        bail!(
            "the rig lists the signals of a controller that it starts: give --controller a path, motion or hold"
        );
    }
    let (domain, claim) = reserve_domain(None)?;
    let mut scenario = plan.scenario.clone();
    for (_, file) in scenario.files_mut() {
        *file = std::path::absolute(&file)?;
    }
    let path = domain.root().join("scenario.toml");
    fs::write(&path, scenario.to_toml()).with_context(|| format!("cannot write {}", path.display()))?;
    let start = Controller::start_process(choice, &domain, Invitation::new(path, None), Vec::new(), 0.0);
    // The end of the controller closes its line, by which the program ends.
    let ready = start.and_then(|mut controller| controller.wait_ready(|| false, || None));
    drop(claim);
    domain.sweep()?;
    Ok(ready?.map(|ready| ready.declared).unwrap_or_default())
}
