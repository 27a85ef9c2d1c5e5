//! Descriptions of the emulated drives for other tools: the electronic data sheet of a drive (EDS, CiA 306) and
//! the messages of all buses (DBC). Both follow from the drives' object dictionary.
//!
//! A description is that of one scenario: the scenario's values are its default values, scales and identifiers.

mod dbc;
mod eds;

use masseter_model::geometry::AXES;
use masseter_scenario::Scenario;

use crate::drive::DriveSettings;
use crate::error::PlantError;

/// The electronic data sheets of the drives, in the order of the axes.
///
/// # Errors
/// [`PlantError`] for drives that cannot be built.
///
/// ```
/// let [d1, ..] = masseter_plant::description::eds(&masseter_scenario::Scenario::default())?;
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
/// let dbc = masseter_plant::description::dbc(&masseter_scenario::Scenario::default())?;
/// assert!(dbc.contains("BO_ 385 d1_TPDO1: 8 d1"));
/// # Ok::<_, masseter_plant::PlantError>(())
/// ```
pub fn dbc(scenario: &Scenario) -> Result<String, PlantError> {
    Ok(dbc::write(&DriveSettings::for_axes(scenario)?, scenario.period_ns()))
}

#[cfg(test)]
mod tests {
    use masseter_scenario::{QuirkConfig, QuirkKindConfig};

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
    fn a_sheet_lists_what_the_drive_lets_clients_read() {
        let mut scenario = Scenario::default();
        scenario.drives.quirk = vec![QuirkConfig {
            axes: Some(vec!["d1".to_owned()]),
            ..QuirkConfig::new(QuirkKindConfig::MissingObjects)
        }];
        let [d1, d2, ..] = eds(&scenario).unwrap();
        for index in ["6007", "6066", "6085"] {
            assert!(!d1.contains(&format!("[{index}]")) && !d1.contains(&format!("=0x{index}\n")), "{index}");
            assert!(d2.contains(&format!("[{index}]")) && d2.contains(&format!("=0x{index}\n")), "{index}");
        }
        assert_eq!(d1.matches("AccessType=").count(), ENTRIES.len() - 3);
    }

    #[test]
    fn messages_have_ranges_and_cycle_times() {
        let dbc = dbc(&Scenario::default()).unwrap();
        for line in [
            " SG_ Position_actual_value : 16|32@1- (0.000001,0) [0.24|0.3] \"m\" Master\n",
            " SG_ Torque_actual_value : 48|16@1- (0.5,0) [-1000|1000] \"N\" Master\n",
            "BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 65535;\n",
            "BA_ \"GenMsgCycleTime\" BO_ 128 1;\n",
            "BA_ \"GenMsgCycleTime\" BO_ 388 1;\n",
            "BA_ \"GenMsgCycleTime\" BO_ 1796 50;\n",
        ] {
            assert!(dbc.contains(line), "{line}");
        }
        let fast = super::dbc(&Scenario { rate_hz: 2000, ..Scenario::default() }).unwrap();
        assert!(!fast.contains("Time\" BO_ 128 "), "half a millisecond cannot be said");
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
