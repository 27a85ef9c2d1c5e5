//! Units and ratios of a drive beside those of its profile: a wrong one scales every motion. This module writes nothing.

use masseter_can::canopen::ObjectAddress;
use masseter_scenario::{
    AccelerationUnit, DriveProfile, INCREMENTS, ObjectConfig, ObjectKey, ObjectRule, VelocityUnit,
};

use crate::deviation::{Deviation, Outcome};
use crate::{object_words::value_text, settings::Survey};

/// Degrees, tenths of a degree and turns of the screw; millimetres and micrometres (CiA 303-2).
const DEGREES: u32 = 0x0041_0000;
const TENTH_DEGREES: u32 = 0xFF41_0000;
const TURNS: u32 = 0x00B4_0000;
const MILLIMETRES: u32 = 0xFD01_0000;
const MICROMETRES: u32 = 0xFA01_0000;

/// The unit of a code in words.
fn unit_name(code: u32) -> Option<&'static str> {
    const NAMES: [(u32, &str); 11] = [
        (INCREMENTS, "increments"),
        (DEGREES, "degrees"),
        (TENTH_DEGREES, "0.1 degrees"),
        (TURNS, "turns"),
        (MILLIMETRES, "mm"),
        (MICROMETRES, "µm"),
        (AccelerationUnit::IncrementsS2.code(), "increments/s²"),
        (AccelerationUnit::RpmPerS.code(), "rpm/s"),
        (VelocityUnit::IncrementsS.code(), "increments/s"),
        (VelocityUnit::TenthIncrementsS.code(), "0.1 increments/s"),
        (VelocityUnit::Rpm.code(), "rpm"),
    ];
    NAMES.iter().find(|(known, _)| *known == code).map(|(_, name)| *name)
}

/// Way of a unit of position, m. None for other units, and for units of the screw without its lead.
fn way_m(code: u32, lead_m: Option<f64>) -> Option<f64> {
    match code {
        MICROMETRES => Some(1e-6),
        MILLIMETRES => Some(1e-3),
        TENTH_DEGREES => lead_m.map(|lead_m| lead_m / 3600.0),
        DEGREES => lead_m.map(|lead_m| lead_m / 360.0),
        TURNS => lead_m,
        _ => None,
    }
}

/// The unit of 6064h (60A8h): a unit of the length of the rig's increment is as good as increments.
fn of_position(survey: &Survey, profile: &DriveProfile, increment_m: f64) -> Option<Deviation> {
    let object = ObjectAddress::new(0x60A8, 0);
    let code = told(survey, profile, object).filter(|&code| code != INCREMENTS)?;
    let Some(unit) = unit_name(code) else {
        let (found, key) = (value_text(object, code), "drive_profile.objects");
        let remedy =
            format!("the drive counts position in {found}, the profile declares increments: change one");
        return Some(Deviation::new(object, "increments", found, Outcome::Doubtful, remedy, key));
    };
    let (remedy, key) = match way_m(code, profile.units.lead_m) {
        Some(way_m) if (way_m / increment_m - 1.0).abs() < 1e-6 => return None,
        Some(way_m) => {
            let [way_um, increment_um] = [way_m, increment_m].map(|length_m| (length_m * 1e9).round() / 1e3);
            let remedy = format!(
                "the drive counts position in {unit} ({way_um} µm), an increment of the scenario is {increment_um} µm: change one"
            );
            (remedy, "encoder_resolution_m")
        }
        None => {
            let remedy = format!(
                "the drive counts position in {unit}: enter the lead of the screw, or let the drive count increments"
            );
            (remedy, "drive_profile.units.lead_m")
        }
    };
    Some(Deviation::new(object, "increments", unit, Outcome::Refused, remedy, key))
}

/// Units of the drive, as far as the drive has objects for them (60A8h to 60AAh). A value that `configure` writes
/// counts, not the replaced value.
pub(crate) fn of_units(survey: &Survey, profile: &DriveProfile, increment_m: f64) -> Vec<Deviation> {
    let units = &profile.units;
    let declared = [
        (0x60A9, units.velocity.code(), "velocity", "drive_profile.units.velocity"),
        (0x60AA, units.acceleration.code(), "acceleration", "drive_profile.units.acceleration"),
    ];
    let of_code = |(index, declared, quantity, key)| {
        let object = ObjectAddress::new(index, 0);
        let code = told(survey, profile, object).filter(|&code| code != declared)?;
        let declared = unit_name(declared).expect("every unit of a profile has a name");
        // Drives use codes of their own for the rig's units: such a code proves nothing.
        let (found, outcome) = match unit_name(code) {
            Some(name) => (name.to_owned(), Outcome::Refused),
            None => (value_text(object, code), Outcome::Doubtful),
        };
        let remedy =
            format!("the drive counts {quantity} in {found}, the profile declares {declared}: change one");
        Some(Deviation::new(object, declared, found, outcome, remedy, key))
    };
    of_position(survey, profile, increment_m)
        .into_iter()
        .chain(declared.into_iter().filter_map(of_code))
        .collect()
}

/// The value of an object after `configure`: a written value counts, not the replaced value. None if the drive or its
/// profile has no such object.
fn told(survey: &Survey, profile: &DriveProfile, object: ObjectAddress) -> Option<u32> {
    let ObjectConfig { rule, value, .. } = profile.object(ObjectKey(object));
    let found = || survey.number(object);
    match rule {
        ObjectRule::Absent => None,
        ObjectRule::Write => value.map(|value| value as u32).or_else(found),
        ObjectRule::Expect | ObjectRule::Optional => found(),
    }
}

/// Ratios of the drive for its way, as far as the drive has them: gear, feed and encoder. A wrong ratio scales every
/// motion. Without a lead the profile declares no travel, so a wrong gear is only doubtful. A feed decides the unit of
/// 6064h; the encoder decides without one.
pub(crate) fn of_ratios(survey: &Survey, profile: &DriveProfile, increment_m: f64) -> Vec<Deviation> {
    let units = &profile.units;
    let part = |index, subindex| told(survey, profile, ObjectAddress::new(index, subindex)).map(f64::from);
    let ratio = |index| Some(part(index, 1)? / part(index, 2).filter(|&turns| turns > 0.0)?);
    let feed = units.lead_m.map(|lead_m| lead_m / increment_m);
    let encoder = feed.map(|feed| feed / units.gear_ratio);
    let decides = |decides| if decides { Outcome::Refused } else { Outcome::Doubtful };
    let [gear_key, lead_key] = ["drive_profile.units.gear_ratio", "drive_profile.units.lead_m"];
    let gear = Some(units.gear_ratio);
    let ratios = [
        (0x6091, gear, "motor turns/screw turn", decides(units.lead_m.is_some()), gear_key),
        (0x6092, feed, "increments/screw turn", Outcome::Refused, lead_key),
        (0x608F, encoder, "increments/motor turn", decides(ratio(0x6092).is_none()), lead_key),
    ];
    let of_ratio = |(index, wanted, unit, outcome, key)| {
        let object = ObjectAddress::new(index, 1);
        let (wanted, found): (f64, f64) = (wanted?, ratio(index)?);
        let text = |ratio: f64| format!("{} {unit}", (ratio * 1e6).round() / 1e6);
        let remedy = format!("the drive has {}, the profile {}: change one", text(found), text(wanted));
        let is_right = (found / wanted - 1.0).abs() < 1e-6;
        (!is_right).then(|| Deviation::new(object, text(wanted), text(found), outcome, remedy, key))
    };
    ratios.into_iter().filter_map(of_ratio).collect()
}
#[cfg(test)]
mod tests {
    use std::path::Path;

    use masseter_scenario::Scenario;

    use super::*;

    #[test]
    fn a_unit_is_told_in_words() {
        let mut survey = Survey::default();
        survey.insert(ObjectAddress::new(0x60AA, 0), 0x00C0_0300);
        let all = of_units(&survey, &DriveProfile::default(), 1e-6);
        assert_eq!(
            all[0].remedy,
            "the drive counts acceleration in rpm/s, the profile declares increments/s²: change one"
        );
        assert_eq!(all[0].outcome, Outcome::Refused);
    }

    /// The check also covers the default profile: some drives are delivered with tenths of a degree.
    #[test]
    fn units_of_every_profile_are_those_of_the_drive() {
        let units = |found: &[(u16, u32)], profile: &str| {
            let mut survey = Survey::default();
            for &(index, code) in found {
                survey.insert(ObjectAddress::new(index, 0), code);
            }
            let scenario = Scenario::parse(Path::new("robot.toml"), profile).unwrap();
            let all = of_units(&survey, scenario.profile(3), 1e-6);
            all.into_iter().map(|one| (one.object.to_string(), one.outcome, one.remedy)).collect::<Vec<_>>()
        };
        let profile = |keys: &str| format!("[[drive_profile]]\n{keys}");
        let right = [(0x60A8, 0x00B5_0000), (0x60A9, 0x00B5_0300), (0x60AA, 0x00B5_5700)];
        for keys in ["", &profile("kind = 'n5'")] {
            assert_eq!(units(&right, keys), []);
            assert_eq!(units(&[], keys), [], "a drive need not tell its units");
            let degrees = units(&[(0x60A8, 0xFF41_0000)], keys);
            let remedy = "the drive counts position in 0.1 degrees: enter the lead of the screw, or let the drive count \
                      increments";
            assert_eq!(degrees, [("60A8h:00h".to_owned(), Outcome::Refused, remedy.to_owned())]);
            let wrong = units(&[(0x60A8, 0x0001_0000), (0x60A9, 0x00B4_4700), (0x60AA, 0x00C0_0300)], keys);
            let outcomes: Vec<_> = wrong.iter().map(|(.., outcome, _)| *outcome).collect();
            assert_eq!(outcomes, [Outcome::Doubtful, Outcome::Refused, Outcome::Refused], "{wrong:?}");
        }
        let degrees = [(0x60A8, 0xFF41_0000)];
        assert_eq!(units(&degrees, &profile("objects.60A8h = { rule = 'absent' }")), []);
        let written = "objects.60A8h = { value = 0x00B5_0000, bytes = 4 }";
        assert_eq!(units(&degrees, &profile(written)), [], "configure writes it");
    }

    /// The drive's units µm or 0.1° equal an increment of 1 µm, or of a tenth of a degree of a screw.
    #[test]
    fn a_unit_as_long_as_an_increment_is_as_good_as_increments() {
        let units = |code, increment_m, keys: &str| {
            let mut survey = Survey::default();
            survey.insert(ObjectAddress::new(0x60A8, 0), code);
            let profile = format!("[[drive_profile]]\n{keys}");
            let scenario = Scenario::parse(Path::new("robot.toml"), &profile).unwrap();
            let all = of_units(&survey, scenario.profile(3), increment_m);
            all.into_iter().map(|one| (one.outcome, one.remedy)).collect::<Vec<_>>()
        };
        let lead = "units = { lead_m = 0.003 }";
        for (code, increment_m) in [
            (0xFA01_0000, 1e-6),
            (0xFD01_0000, 1e-3),
            (0xFF41_0000, 0.003 / 3600.0),
            (0x0041_0000, 0.003 / 360.0),
        ] {
            assert_eq!(units(code, increment_m, lead), []);
            let [(outcome, remedy)] = &units(code, 2.0 * increment_m, lead)[..] else { panic!("{code:X}") };
            assert_eq!(*outcome, Outcome::Refused);
            assert!(remedy.ends_with(" µm: change one"), "{remedy}");
        }
        assert_eq!(
            units(0xFA01_0000, 5e-7, "")[0].1,
            "the drive counts position in µm (1 µm), an increment of the scenario is 0.5 µm: change one"
        );
    }

    /// Where 6092h decides the unit of 6064h, a wrong 608Fh is only doubtful.
    #[test]
    fn ratios_of_the_drive_are_those_of_the_profile() {
        let ratios = |found: &[(u16, u32, u32)], profile: &str| {
            let mut survey = Survey::default();
            for &(index, many, turns) in found {
                survey.insert(ObjectAddress::new(index, 1), many);
                survey.insert(ObjectAddress::new(index, 2), turns);
            }
            let text = format!("[[drive_profile]]\n{profile}");
            let scenario = Scenario::parse(Path::new("robot.toml"), &text).unwrap();
            let all = of_ratios(&survey, scenario.profile(3), 1e-6);
            all.into_iter().map(|one| (one.outcome, one.remedy)).collect::<Vec<_>>()
        };
        let lead = "units = { gear_ratio = 2.5, lead_m = 0.01 }";
        let right = [(0x6091, 5, 2), (0x6092, 10_000, 1), (0x608F, 4000, 1)];
        assert_eq!(ratios(&right, lead), []);
        let [(gear, gear_text), (feed, feed_text), (encoder, _)] =
            &ratios(&[(0x6091, 26, 1), (0x6092, 6000, 1), (0x608F, 2048, 1)], lead)[..]
        else {
            panic!("three ratios differ")
        };
        assert_eq!([gear, feed, encoder], [&Outcome::Refused, &Outcome::Refused, &Outcome::Doubtful]);
        assert_eq!(
            gear_text,
            "the drive has 26 motor turns/screw turn, the profile 2.5 motor turns/screw turn: change one"
        );
        assert!(feed_text.contains("6000 increments/screw turn, the profile 10000"), "{feed_text}");
        assert_eq!(ratios(&[(0x608F, 2048, 1)], lead)[0].0, Outcome::Refused);
        assert_eq!(
            ratios(&[(0x6091, 26, 1), (0x6092, 6000, 1)], "")[..],
            [(
                Outcome::Doubtful,
                "the drive has 26 motor turns/screw turn, the profile 1 motor turns/screw turn: change one"
                    .to_owned()
            )]
        );
        let left = format!("{lead}\nobjects.'608Fh:01' = {{ rule = 'absent' }}");
        assert_eq!(ratios(&[(0x608F, 2048, 1)], &left), []);
        let written = format!("{lead}\nobjects.'6091h:01' = {{ value = 5, bytes = 4 }}");
        assert_eq!(ratios(&[(0x6091, 26, 2)], &written), [], "configure writes it");
        assert_eq!(ratios(&[(0x6091, 5, 1)], &written)[0].0, Outcome::Refused, "what it writes is wrong");
        let absent = format!("{lead}\nobjects.'6092h:01' = {{ rule = 'absent' }}");
        let found = [(0x6092, 10_000, 1), (0x608F, 2048, 1)];
        assert_eq!(ratios(&found, &absent)[0].0, Outcome::Refused, "without a feed the encoder decides");
    }
}
