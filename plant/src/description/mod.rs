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
    use crate::drive::dictionary::{Access, ENTRIES, Initial, Mapping, OBJECTS};
    use masseter_can::canopen::dcf::{self, Dcf};

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
    fn a_reader_of_sheets_finds_every_entry_as_it_is_in_the_dictionary() {
        let settings = DriveSettings::for_axes(&Scenario::default()).unwrap();
        for settings in &settings {
            let sheet = Dcf::parse(&eds::write(settings)).unwrap();
            let mut entries: Vec<_> = ENTRIES.iter().collect();
            entries.sort_by_key(|entry| (entry.address.index, entry.address.subindex));
            assert_eq!(sheet.entries().len(), entries.len());
            for (read, entry) in sheet.entries().zip(entries) {
                let at = entry.address;
                assert_eq!((read.address, read.name.as_str()), (at, entry.name));
                assert_eq!(read.data_type.0, entry.kind as u16, "{at}");
                assert_eq!(read.is_mappable, entry.mapping != Mapping::Never, "{at}");
                let access = match entry.access {
                    Access::Constant => dcf::Access::Constant,
                    Access::ReadOnly => dcf::Access::ReadOnly,
                    Access::ReadWrite => dcf::Access::ReadWrite,
                };
                assert_eq!(read.access, access, "{at}");
                let number =
                    |value: &Option<dcf::Value>| value.as_ref().and_then(|v| v.number(settings.node));
                let limits = entry.limits.map(|(lowest, highest)| (lowest.into(), highest.into()));
                assert_eq!(number(&read.lowest).zip(number(&read.highest)), limits, "{at}");
                let value = match entry.initial {
                    Initial::Text(text) => text.as_bytes().to_vec(),
                    _ => settings.objects.at(at.index, at.subindex).to_le_bytes()[..entry.kind.bytes()]
                        .to_vec(),
                };
                let default = read.default.as_ref().unwrap();
                assert_eq!(read.encode(default, settings.node), Some(value), "{at}");
            }
        }
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
