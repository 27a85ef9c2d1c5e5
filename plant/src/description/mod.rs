//! The emulated drives for other people's tools: the electronic data sheet of a drive (EDS, CiA 306) and
//! the messages of the whole link (DBC), both made from the drives' object dictionary.
//!
//! Written for the scenario's drives: what it configures stands in the files as default values, scales
//! and identifiers.

mod dbc;
mod eds;

use masseter_shared::config::Scenario;

use masseter_shared::geometry::AXES;

use crate::build::all_drive_settings;
use crate::error::PlantError;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::dictionary::{ENTRIES, OBJECTS};

    #[test]
    fn a_sheet_has_every_object_and_every_entry_once() {
        let [first, ..] = eds(&Scenario::default()).unwrap();
        for object in OBJECTS {
            let heading = format!("[{:04X}]\n", object.index);
            assert_eq!(first.matches(&heading).count(), 1, "{heading}");
        }
        let headings = first.matches("AccessType=").count();
        assert_eq!(headings, ENTRIES.len());
    }

    #[test]
    fn sheets_follow_the_scenario() {
        let mut scenario = Scenario::default();
        scenario.can.node_ids = [11, 12, 13, 14, 15, 16];
        scenario.can.heartbeat_producer_ms = 70;
        let [first, ..] = eds(&scenario).unwrap();
        assert!(first.contains("FileName=drive11.eds"));
        assert!(first.contains("[1017]\nParameterName=Producer heartbeat time\nObjectType=0x7\nDataType=0x0006\nAccessType=rw\nDefaultValue=0x46\n"));
        assert!(dbc(&scenario).unwrap().contains("BO_ 395 d1_TPDO1: 8 d1"));
        scenario.can.node_ids[1] = 11;
        assert!(dbc(&scenario).is_err());
    }
}
