//! The scenario that a verb is given, or the default one. What makes a scenario valid is its own affair.

use std::path::Path;

use masseter_shared::config::{Scenario, ScenarioError};

/// The scenario of a file, or the default one, found valid.
pub fn given(path: Option<&Path>) -> Result<Scenario, ScenarioError> {
    let scenario = unchecked(path)?;
    scenario.validate()?;
    Ok(scenario)
}

/// The same with what the arguments of the verb `change`, which alone may make it valid or not.
pub fn changed(
    path: Option<&Path>,
    change: impl FnOnce(&mut Scenario) -> anyhow::Result<()>,
) -> anyhow::Result<Scenario> {
    let mut scenario = unchecked(path)?;
    change(&mut scenario)?;
    scenario.validate()?;
    Ok(scenario)
}

fn unchecked(path: Option<&Path>) -> Result<Scenario, ScenarioError> {
    path.map_or_else(|| Ok(Scenario::default()), Scenario::read)
}
