//! Every deviation of one drive from scenario and profile, with the remedy. This module writes nothing.

use masseter_can::canopen::{CobId, ObjectAddress};
use masseter_can::cia402::Statusword;
use masseter_plant::wanted::{Setting, WantedDrive, WantedIdentity};
use masseter_scenario::{DriveProfile, ObjectKey, ObjectRule};

use crate::deviation::{Deviation, Outcome};
use crate::object_words::{reason_text, value_text};
use crate::settings::{Difference, Settings, Survey};
use crate::units::{of_ratios, of_units};

/// Bit of 6502h: cyclic synchronous position.
const CYCLIC_POSITION: u32 = 1 << 7;

/// Every deviation of a drive.
pub fn deviations(
    survey: &Survey,
    wanted: &WantedDrive,
    settings: &Settings,
    profile: &DriveProfile,
) -> Vec<Deviation> {
    let mut all: Vec<_> =
        wanted.identity.iter().filter_map(|&identity| of_identity(survey, identity)).collect();
    all.extend(of_state(survey));
    all.extend(of_units(survey, profile, wanted.increment_m));
    let differences = settings.differences(survey);
    // `configure` mends a unit that the profile writes; a unit that the profile expects gets a sentence.
    all.retain(|found| {
        let mut written = differences.iter().filter(|one| one.wanted.rule != ObjectRule::Expect);
        !written.any(|one| one.wanted.object.0 == found.object)
    });
    all.extend(of_ratios(survey, profile, wanted.increment_m));
    let is_told = |one: &&Difference| all.iter().any(|found| found.object == one.wanted.object.0);
    let others: Vec<_> =
        differences.iter().filter(|one| !is_told(one)).map(|one| of_object(survey, one)).collect();
    all.extend(others);
    all
}

/// A value, or the reason for its absence.
fn found_text(survey: &Survey, object: ObjectAddress) -> String {
    let refusal = || survey.refusal(object).map_or_else(|| "not there".to_owned(), reason_text);
    survey.number(object).map_or_else(refusal, |value| value_text(object, value))
}

fn of_identity(survey: &Survey, WantedIdentity { object, mask, value }: WantedIdentity) -> Option<Deviation> {
    let is_right = survey.number(object).is_some_and(|found| found & mask == value & mask);
    let key = match object {
        ObjectAddress { index: 0x1000, .. } => "drive_profile.identity.device_type",
        ObjectAddress { subindex: 1, .. } => "drive_profile.identity.vendor_id",
        ObjectAddress { subindex: 2, .. } => "drive_profile.identity.product_code",
        _ => "drive_profile.identity.revision",
    };
    let (wanted, found) = (value_text(object, value & mask), found_text(survey, object));
    let remedy = "enter this drive's identity, or use the drive that the profile is for";
    (!is_right).then(|| Deviation::new(object, wanted, found, Outcome::Refused, remedy, key))
}

fn of_state(survey: &Survey) -> Vec<Deviation> {
    let (modes, status) = (ObjectAddress::new(0x6502, 0), ObjectAddress::new(0x6041, 0));
    let mut all = Vec::new();
    if survey.number(modes).is_some_and(|modes| modes & CYCLIC_POSITION == 0) {
        let remedy = "the drive has no cyclic synchronous position mode: the rig cannot use it";
        let found = found_text(survey, modes);
        all.push(Deviation::new(modes, "bit 7", found, Outcome::Refused, remedy, ""));
    }
    let state = survey.number(status).map(|word| Statusword(word as u16).state());
    if let Some(Ok(state)) = state
        && state.is_powered()
    {
        let remedy = "configure refuses unless --take-over may stop the drive";
        let found = format!("{state:?}");
        all.push(Deviation::new(status, "no voltage", found, Outcome::Doubtful, remedy, ""));
    }
    let error = ObjectAddress::new(0x603F, 0);
    if survey.number(error).is_some_and(|code| code != 0) {
        let (found, remedy) = (found_text(survey, error), "find the cause in the drive's manual");
        all.push(Deviation::new(error, "0h", found, Outcome::Doubtful, remedy, ""));
    }
    all.extend(of_switches(survey));
    all
}

/// A closed limit switch of an axis at rest.
fn of_switches(survey: &Survey) -> Option<Deviation> {
    let inputs = ObjectAddress::new(0x60FD, 0);
    let closed = match survey.number(inputs)? & 0b11 {
        0 => return None,
        0b01 => "negative closed",
        0b10 => "positive closed",
        _ => "both closed",
    };
    let remedy =
        "a limit switch: the axis is at its end, or its wire is broken; no jog goes in its direction";
    Some(Deviation::new(inputs, "open", closed, Outcome::Doubtful, remedy, ""))
}

fn of_object(survey: &Survey, difference: &Difference) -> Deviation {
    let Difference { wanted: Setting { object: ObjectKey(object), value, rule, key, .. }, found } =
        difference;
    let is_pdo = (0x1400..0x1C00).contains(&object.index);
    let is_communication = matches!(object.index, 0x1400..0x1600 | 0x1800..0x1A00);
    let is_off = is_communication && object.subindex == 1 && !CobId(*value).is_valid();
    let wanted = if is_off { "off".to_owned() } else { value_text(*object, *value) };
    let write = format!("write {wanted}");
    let (outcome, remedy) = match (rule, found) {
        (ObjectRule::Expect, _) => (Outcome::Refused, "the profile expects another value"),
        (ObjectRule::Optional, None) => (Outcome::Doubtful, "left"),
        (_, None) if !is_pdo => {
            (Outcome::Refused, "the drive has no such object: give it the rule 'absent' or 'optional'")
        }
        (_, None) if is_communication => (Outcome::Refused, "the drive has no such PDO"),
        (_, None) => (Outcome::Mended, "map"),
        (_, Some(_)) if is_off => (Outcome::Mended, "switch off"),
        (_, Some(_)) => (Outcome::Mended, write.as_str()),
    };
    let is_missing = outcome == Outcome::Refused && found.is_none() && !is_pdo;
    let key = if is_missing { "drive_profile.objects" } else { key };
    Deviation::new(*object, wanted, found_text(survey, *object), outcome, remedy, key)
}

#[cfg(test)]
mod deviations_tests {
    use std::io;
    use std::path::Path;

    use masseter_can::canopen::NodeId;
    use masseter_runtime::clock::MILLISECOND_NS;
    use masseter_scenario::Scenario;

    use super::*;
    use crate::line::Line;

    /// Needs of this profile that emulated drives lack.
    fn of_profile(text: &str) -> Vec<(String, Outcome, String)> {
        let scenario = Scenario::parse(Path::new("robot.toml"), text).unwrap();
        let mut line = Line::open(&Scenario::default(), Box::new(io::sink())).unwrap();
        line.listen(100 * MILLISECOND_NS).unwrap();
        let wanted = WantedDrive::of_axis(&scenario, 3, NodeId::new(4).unwrap()).unwrap();
        let settings = Settings::wanted(&wanted);
        let survey = Survey::of_drive(&mut line, 3, settings.addresses()).unwrap();
        let all = deviations(&survey, &wanted, &settings, scenario.profile(3));
        all.into_iter().map(|one| (one.object.to_string(), one.outcome, one.remedy)).collect()
    }

    #[test]
    fn an_emulated_drive_has_all_that_the_rig_needs_but_the_event_timer() {
        let timer = ("1400h:05h".to_owned(), Outcome::Mended, "write 150".to_owned());
        assert_eq!(of_profile(""), [timer]);
    }

    #[test]
    fn every_deviation_is_found_at_once_with_what_becomes_of_it() {
        let all = of_profile(
            "[[drive_profile]]\nidentity.revision = 7\nobjects.6066h = { value = 9 }\n\
         objects.6007h = { rule = 'expect', value = 1 }\nobjects.2222h = { value = 1, bytes = 1 }\n\
         homing = { home_object = '30B0h', home_position_m = 0.1 }",
        );
        let of = |object: &str| {
            let found = all.iter().find(|(at, ..)| at == object);
            found.map(|(_, outcome, remedy)| (*outcome, remedy.as_str()))
        };
        assert_eq!(of("6066h:00h"), Some((Outcome::Mended, "write 9")));
        assert_eq!(of("6007h:00h"), Some((Outcome::Refused, "the profile expects another value")));
        for object in ["1018h:03h", "2222h:00h", "30B0h:00h"] {
            assert_eq!(of(object).map(|(outcome, _)| outcome), Some(Outcome::Refused), "{object}: {all:?}");
        }
    }

    /// Emulated drives have a gear of 1, so a profile with another gear is wrong.
    #[test]
    fn a_ratio_that_the_profile_itself_makes_wrong_is_refused() {
        let all = of_profile(
            "[[drive_profile]]\nunits = { gear_ratio = 2.5, lead_m = 0.025 }\n\
         objects.'6091h:01' = { value = 26, bytes = 4 }",
        );
        let gear: Vec<_> = all.iter().filter(|(object, ..)| object == "6091h:01h").collect();
        assert!(matches!(gear[..], [(_, Outcome::Refused, _)]), "{all:?}");
    }

    #[test]
    fn a_limit_switch_that_is_closed_is_worth_a_look() {
        for (bits, found) in [(0b100, None), (0b110, Some("positive closed")), (0b011, Some("both closed"))] {
            let mut survey = Survey::default();
            survey.insert(ObjectAddress::new(0x60FD, 0), bits);
            let deviation = of_switches(&survey);
            assert_eq!(deviation.as_ref().map(|one| one.found.as_str()), found);
            assert!(deviation.is_none_or(|one| one.outcome == Outcome::Doubtful));
        }
        assert!(of_switches(&Survey::default()).is_none(), "a drive without that object");
    }
}
