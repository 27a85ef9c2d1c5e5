//! A scenario as a part of another document, for `#[serde(with = "masseter_scenario::embedded")]`.
//!
//! This crate compiles the code that reads and writes a scenario once. The derived code is generic, so each crate with
//! an embedded scenario would compile the code again.

use serde::{Deserializer, Serializer, de::Error};

use crate::Scenario;

/// Writes a scenario with all defaults filled in.
///
/// # Errors
/// Those of the writer.
pub fn serialize<S: Serializer>(scenario: &Scenario, serializer: S) -> Result<S::Ok, S::Error> {
    erased_serde::serialize(as_written(scenario), serializer)
}

/// Reads a scenario.
///
/// # Errors
/// Those of the reader, and unknown keys.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Scenario, D::Error> {
    read(&mut <dyn erased_serde::Deserializer>::erase(deserializer)).map_err(D::Error::custom)
}

fn as_written(scenario: &Scenario) -> &dyn erased_serde::Serialize {
    scenario
}

fn read(deserializer: &mut dyn erased_serde::Deserializer<'_>) -> Result<Scenario, erased_serde::Error> {
    erased_serde::deserialize(deserializer)
}
