//! Descriptions of the emulated drives for other tools: the electronic data sheet of a drive (EDS, CiA 306) and
//! the messages of all buses (DBC). Both follow from the drives' object dictionary.
//!
//! A description is that of one scenario: the scenario's values are its default values, scales and identifiers.

mod dbc;
mod eds;

use masseter_shared::config::Scenario;
use masseter_shared::geometry::AXES;

use crate::drive::DriveSettings;
use crate::error::PlantError;

/// The electronic data sheets of the drives, in the order of the axes.
///
/// # Errors
/// [`PlantError`] for drives that cannot be built.
///
/// ```
/// let [d1, ..] = masseter_plant::description::eds(&masseter_shared::config::Scenario::default())?;
/// assert!(d1.contains("ParameterName=Controlword"));
/// # Ok::<_, masseter_plant::PlantError>(())
/// ```
pub fn eds(scenario: &Scenario) -> Result<[String; AXES], PlantError> {
    Ok(DriveSettings::for_axes(scenario)?.map(|settings| eds::write(&settings)))
}

/// The messages between the master and all drives as a DBC file.
///
/// # Errors
/// [`PlantError`] for drives that cannot be built.
///
/// ```
/// let dbc = masseter_plant::description::dbc(&masseter_shared::config::Scenario::default())?;
/// assert!(dbc.contains("BO_ 385 d1_TPDO1: 8 d1"));
/// # Ok::<_, masseter_plant::PlantError>(())
/// ```
pub fn dbc(scenario: &Scenario) -> Result<String, PlantError> {
    Ok(dbc::write(&DriveSettings::for_axes(scenario)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::dictionary::{ENTRIES, OBJECTS};

    #[test]
    fn a_sheet_has_every_object_and_every_entry_once() {
        let [first, ..] = eds(&Scenario::default()).unwrap();
        for object in OBJECTS {
            let heading = format!("[{:04X}]\n", object.index());
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
