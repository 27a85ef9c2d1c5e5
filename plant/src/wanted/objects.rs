//! All objects of a drive as the rig needs them: what the scenario needs, as the drive's profile allows.

use masseter_can::canopen::ObjectAddress;
use masseter_scenario::{DriveProfile, ObjectConfig, ObjectKey, ObjectRule, Scenario};

use super::known::known_objects;
use super::object::{OFFSETS, TORQUE_OFFSET, WantedObject};
use crate::error::PlantError;

/// Where the profile has a value of its own, that one; the profile's further objects come last.
pub(super) fn objects(scenario: &Scenario, axis: usize) -> Result<Vec<WantedObject>, PlantError> {
    let profile = scenario.profile(axis);
    let known = known_objects(scenario, axis)?;
    let mut wanted = Vec::with_capacity(known.len());
    for (index, subindex, value, bytes, key) in known {
        let object = ObjectAddress::new(index, subindex);
        let config = in_this_run(profile.object(ObjectKey(object)), object, scenario)?;
        let value = config.value.unwrap_or(value);
        if config.rule == ObjectRule::Absent {
            continue;
        }
        if !config.takes(value) {
            return Err(beyond(profile, key, object, value, &config));
        }
        let rule = if may_lack(object, scenario) && config == ObjectConfig::default() {
            ObjectRule::Optional
        } else {
            config.rule
        };
        wanted.push(WantedObject { object, value: value as u32, bytes, rule, key });
    }
    wanted.extend(offsets(profile));
    for (&ObjectKey(object), config) in &profile.objects {
        let is_known = wanted.iter().any(|known| known.object == object);
        let (Some(value), false, false) = (config.value, is_known, config.rule == ObjectRule::Absent) else {
            continue;
        };
        let Some(bytes) = config.bytes else {
            let reason = "enter bytes = 1, 2 or 4: the rig does not know the object";
            return Err(PlantError::Scenario(format!(
                "drive_profile.objects.{}: {reason}",
                ObjectKey(object)
            )));
        };
        let key = "drive_profile.objects";
        wanted.push(WantedObject {
            object,
            value: value as u32,
            bytes: bytes.into(),
            rule: config.rule,
            key,
        });
    }
    Ok(wanted)
}

/// Offsets that the process data do not carry: 0, instead of the last value of other process data. The torque offset of
/// an earlier run acts in every drive that has the object; the others are those that the profile names.
fn offsets(profile: &DriveProfile) -> impl Iterator<Item = WantedObject> + '_ {
    let mapping = profile.pdos.rpdo1();
    OFFSETS.into_iter().filter_map(move |(index, bytes)| {
        let object = ObjectAddress::new(index, 0);
        let may_lack = ObjectConfig { rule: ObjectRule::Optional, ..ObjectConfig::default() };
        let named = profile.objects.get(&ObjectKey(object)).copied();
        let of_every_profile = ((index, bytes) == TORQUE_OFFSET).then_some(may_lack);
        let ObjectConfig { rule, value, .. } = named.or(of_every_profile)?;
        let is_mapped = mapping.entries().iter().any(|entry| entry >> 16 == u32::from(index));
        let is_left = is_mapped || rule == ObjectRule::Absent;
        let value = value.unwrap_or(0) as u32;
        (!is_left).then_some(WantedObject { object, value, bytes, rule, key: "drive_profile.objects" })
    })
}

fn beyond(
    profile: &DriveProfile,
    key: &str,
    object: ObjectAddress,
    value: i64,
    config: &ObjectConfig,
) -> PlantError {
    let end = |end: Option<i64>| end.map_or_else(|| "any".to_owned(), |end| end.to_string());
    let (lowest, highest) = (end(config.lowest), end(config.highest));
    PlantError::Scenario(format!(
        "{key}: object {object} would be {value}; the drive takes {lowest} to {highest} (drive_profile '{}')",
        profile.kind
    ))
}

/// What the profile says of an object, in a dry run with less force: no rule may keep that from the drive.
fn in_this_run(
    config: ObjectConfig,
    object: ObjectAddress,
    scenario: &Scenario,
) -> Result<ObjectConfig, PlantError> {
    if object != ObjectAddress::new(0x6072, 0) || !scenario.dry.is_on {
        return Ok(config);
    }
    if matches!(config.rule, ObjectRule::Absent | ObjectRule::Expect) {
        let reason = "a dry run must reduce the force; give the object the rule write";
        return Err(PlantError::Scenario(format!("drive_profile.objects.{}: {reason}", ObjectKey(object))));
    }
    let value = config.value.map(|value| (value as f64 * scenario.dry.force).round() as i64);
    Ok(ObjectConfig { rule: ObjectRule::Write, value, ..config })
}

/// Whether a drive may lack an object of which the profile says nothing. Many have no event timer for RPDOs; heartbeat
/// and master supervise these drives too. A bring-up that was killed may have left another fault reaction (605Eh). Only
/// a dry run needs the limit of force.
fn may_lack(object: ObjectAddress, scenario: &Scenario) -> bool {
    match (object.index, object.subindex) {
        (0x1400, 5) | (0x605E, 0) => true,
        (0x6072, 0) => !scenario.dry.is_on,
        _ => false,
    }
}
