//! The emulated drives for other people's tools: the electronic data sheet of a drive (EDS, CiA 306) and
//! the messages of the whole link (DBC), both made from the drives' object dictionary.
//!
//! Written for the scenario's drives: what it configures stands in the files as default values, scales
//! and identifiers.

mod dbc;
mod eds;

use masseter_shared::config::Scenario;

use masseter_shared::geometry::AXES;

use crate::build::{PlantError, all_drive_settings};

/// The electronic data sheets of the drives, in the order of the axes.
///
/// # Errors
/// [`PlantError`] where the scenario's drives cannot be.
pub fn eds(scenario: &Scenario) -> Result<[String; AXES], PlantError> {
    Ok(all_drive_settings(scenario)?.map(|settings| eds::write(&settings)))
}

/// The messages between the master and all drives.
///
/// # Errors
/// [`PlantError`] where the scenario's drives cannot be.
pub fn dbc(scenario: &Scenario) -> Result<String, PlantError> {
    Ok(dbc::write(&all_drive_settings(scenario)?))
}
