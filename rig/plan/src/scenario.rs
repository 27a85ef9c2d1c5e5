//! Reads scenarios for verbs. `Scenario::validate` holds the rules.

use std::path::Path;

use masseter_scenario::Scenario;

/// The valid scenario of a file, or the default one.
///
/// # Errors
/// When the file cannot be read or a value is out of range.
pub fn read_scenario(path: Option<&Path>) -> anyhow::Result<Scenario> {
    read_scenario_with(path, |_| Ok(()))
}

/// The same after `change`, which applies the arguments of a verb. Only the result must be valid.
///
/// # Errors
/// When the file cannot be read, `change` fails, or a value is out of range.
pub fn read_scenario_with(
    path: Option<&Path>,
    change: impl FnOnce(&mut Scenario) -> anyhow::Result<()>,
) -> anyhow::Result<Scenario> {
    let mut scenario = path.map_or_else(|| Ok(Scenario::default()), Scenario::read)?;
    change(&mut scenario)?;
    let checked = scenario.validate();
    checked.map_err(|error| match path {
        Some(path) => Scenario::place_refusal(error, path),
        None => error,
    })?;
    Ok(scenario)
}
