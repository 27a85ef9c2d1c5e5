//! From a scenario to the settings of its drives. What the settings mean is tested with the drives.

use super::*;

/// The drives' settings of a scenario.
fn settings(text: &str) -> Result<[DriveSettings; AXES], PlantError> {
    let scenario = Scenario::parse(Path::new("quirks.toml"), text).unwrap();
    scenario.validate().unwrap();
    drive_settings(&scenario)
}

/// The drive of l1 is that of the drives' own tests.
#[test]
fn the_settings_without_keys_are_those_of_the_drives_own_tests() {
    let [_, _, _, l1, ..] = settings("").unwrap();
    let plain = DriveSettings::new(NodeId::new(4).unwrap());
    let identity = Identity { serial_number: Some(4), ..plain.identity };
    let expected = DriveSettings { stroke_m: l1.stroke_m, identity, ..plain };
    assert_eq!(format!("{l1:?}"), format!("{expected:?}"));
}

/// Each kind becomes the drive's quirk of the same name, with the values of the scenario.
#[test]
fn every_kind_is_the_drives_quirk_of_its_name() {
    let object = ObjectAddress::new(0x6065, 0);
    let with_values = [
        Quirk::AccelerationInRpmS { increments_per_turn: 4096 },
        Quirk::SlowSave { for_ns: 500_000_000 },
        Quirk::SlowBrake { open_ns: 250_000_000, close_ns: 0 },
        Quirk::StoAtPowerOn { for_ns: Some(500_000_000) },
        Quirk::SecondEncoder { limit_m: 0.001 },
        Quirk::FaultAtPowerOn { code: 0x7305 },
        Quirk::Restarts { after_ns: 750_000_000 },
        Quirk::LateWatchdog { for_ns: 500_000_000 },
        Quirk::Creeps { speed_m_s: 5e-5 },
        Quirk::Shows { object, value: 7 },
        Quirk::Lacks { object },
    ];
    for kind in Kind::ALL.iter().filter(|kind| **kind != Kind::SwappedIds) {
        let value = |key: &&str| match *key {
            "increments_per_turn" => "increments_per_turn = 4096\n",
            "code" => "code = 0x7305\n",
            "objects" => "objects = ['6065h']\n",
            "value" => "value = 7\n",
            "limit_m" => "limit_m = 0.001\n",
            "speed_m_s" => "speed_m_s = 5e-5\n",
            "open_s" => "open_s = 0.25\n",
            "after_s" => "after_s = 0.75\n",
            "for_s" => "for_s = 0.5\n",
            _ => "",
        };
        let values: String = kind.keys().concat().iter().map(value).collect();
        let [d1, ..] = settings(&format!("[[drives.quirk]]\nkind = '{kind}'\n{values}")).unwrap();
        let [quirk] = d1.quirks[..] else { panic!("{kind}: {:?}", d1.quirks) };
        let name = |quirk: &Quirk| format!("{quirk:?} ").split(' ').next().unwrap().to_owned();
        assert_eq!(name(&quirk), format!("{kind:?}"));
        let expected = with_values.iter().find(|known| name(known) == name(&quirk));
        assert!(expected.is_none_or(|expected| *expected == quirk), "{quirk:?}, not {expected:?}");
        assert_eq!(expected.is_none(), values.is_empty(), "{quirk:?}");
    }
}

#[test]
fn an_object_that_no_emulated_drive_has_is_refused_with_the_key() {
    let refusal = settings("[[drives.quirk]]\nkind = 'lacks'\nobjects = ['9999h']").unwrap_err().to_string();
    assert!(refusal.starts_with("drives.quirk.objects: 9999h:00h: "), "{refusal}");
}

#[test]
fn a_quirk_is_on_its_axes_alone() {
    let all = settings("[[drives.quirk]]\nkind = 'missing_objects'\naxes = ['l2', 'd1']").unwrap();
    let has = all.map(|settings| settings.quirks == [Quirk::MissingObjects]);
    assert_eq!(has, [true, false, false, false, true, false]);
}
