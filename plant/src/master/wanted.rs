//! The objects of a drive as the rig needs them, from scenario and profile: once for the boot of a run, for inspection and
//! for configuration.
//!
//! Nothing here talks to a drive.

use masseter_can::canopen::{AbortCode, Cob, CobId, NodeId, ObjectAddress};
use masseter_can::cia402::interpolation_period;
use masseter_can::{CanId, EVERY_SYNC, PdoMapping};
use masseter_model::geometry::LEGS;
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_scenario::{
    AccelerationUnit, DriveProfile, MASTER_NODE, ObjectConfig, ObjectKey, ObjectRule, Scenario,
};

use crate::error::PlantError;

/// A drive as the rig needs it.
#[derive(Debug, Clone, PartialEq)]
pub struct WantedDrive {
    /// Device type and identity.
    pub identity: [WantedIdentity; 4],
    /// The two PDOs of the process data.
    pub pdos: [WantedPdo; 2],
    /// The object that sets 6064h at home, with its value; 0 where the drive's own zero is right.
    pub home: WantedObject,
    /// Length of an increment of 6064h, m.
    pub increment_m: f64,
    /// Unit of the drive's accelerations (60AAh).
    pub acceleration_unit: AccelerationUnit,
    /// The objects to write or to compare, in the order in which they are written.
    pub objects: Vec<WantedObject>,
}

impl WantedDrive {
    /// The drive of an axis.
    ///
    /// # Errors
    /// [`PlantError::Scenario`] for a value that the drive's profile does not allow.
    pub fn of_axis(scenario: &Scenario, axis: usize, node: NodeId) -> Result<Self, PlantError> {
        let profile = scenario.profile(axis);
        Ok(Self {
            identity: identity(profile),
            pdos: pdos(profile, node),
            home: home(scenario, axis),
            increment_m: scenario.scale(axis).increment_m.abs(),
            acceleration_unit: profile.units.acceleration,
            objects: objects(scenario, axis)?,
        })
    }
}

fn home(scenario: &Scenario, axis: usize) -> WantedObject {
    let profile = scenario.profile(axis);
    let increments = profile.homing.home_increments(scenario.scale(axis).increment_m);
    let ObjectKey(object) = profile.homing.home_object;
    let ObjectConfig { rule, .. } = profile.object(profile.homing.home_object);
    WantedObject {
        object,
        value: increments as u32,
        bytes: 4,
        rule,
        key: "drive_profile.homing.home_position_m",
    }
}

/// One object as it must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WantedObject {
    /// Its address.
    pub object: ObjectAddress,
    /// Its value, as the lowest bytes in the drive's order.
    pub value: u32,
    /// Bytes of the value.
    pub bytes: usize,
    /// What the master does with it; never [`ObjectRule::Absent`].
    pub rule: ObjectRule,
    /// The key of the scenario that decides the value.
    pub key: &'static str,
}

impl WantedObject {
    /// Whether a drive that refuses to show a written object with this code proves the write by its acknowledgement alone.
    /// Nothing else can prove it: nobody can read a write-only object.
    pub(crate) fn is_write_only(code: AbortCode) -> bool {
        code == AbortCode::WRITE_ONLY
    }
}

/// Objects that do not show what was written to them, with what proves the write instead.
const SHOWN_ELSEWHERE: [(u16, &str); 4] = [
    (0x1010, "a signature starts the saving, and a reset shows what was saved"),
    (0x1011, "as 1010h"),
    (0x6040, "a command, whose effect the statusword (6041h) shows"),
    (0x6060, "drives after DSP 402 2.0 do not show it; 6061h shows the mode"),
];

/// The bits of an object that must be those that were written to it; none where something else proves the write.
pub(crate) fn shown_bits(object: ObjectAddress, value: u32, bytes: usize) -> Option<u32> {
    let is_cob_id = matches!(object.index, 0x1400..0x1600 | 0x1800..0x1A00) && object.subindex == 1;
    match SHOWN_ELSEWHERE.iter().find(|(index, _)| *index == object.index) {
        Some(_) => None,
        // The number of a PDO that does not exist means nothing.
        None if is_cob_id && !CobId(value).is_valid() => Some(CobId::NOT_VALID),
        // A drive decides itself whether it answers remote requests, which nobody sends.
        None if is_cob_id => Some(COB_ID_BITS),
        None => Some(u32::MAX >> (32 - 8 * bytes)),
    }
}

/// Offsets of position, velocity and torque, with the bytes of each. A drive keeps the last value of its process data.
pub(crate) const OFFSETS: [(u16, usize); 3] = [(0x60B0, 4), (0x60B1, 4), TORQUE_OFFSET];
/// The only offset that process data of the rig may carry.
const TORQUE_OFFSET: (u16, usize) = (0x60B2, 2);

/// Whether a drive that has an object may keep another value. An offset moves the axis or loads it: the drive may lack
/// it, and no more.
pub(crate) fn may_keep(rule: ObjectRule, object: ObjectAddress) -> bool {
    rule == ObjectRule::Optional && OFFSETS.iter().all(|(index, _)| *index != object.index)
}

/// Where the profile has a value of its own, that one; the profile's further objects come last.
fn objects(scenario: &Scenario, axis: usize) -> Result<Vec<WantedObject>, PlantError> {
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

/// The profile's rule for an object, in a dry run with less force. A rule that keeps the reduced force from the drive
/// is refused.
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

/// Whether a drive may lack an object that the profile does not mention. Many have no event timer for RPDOs;
/// heartbeat and master supervise these drives too. A bring-up that was killed may have left another fault reaction
/// (605Eh). Only a dry run needs the limit of force.
fn may_lack(object: ObjectAddress, scenario: &Scenario) -> bool {
    match (object.index, object.subindex) {
        (0x1400, 5) | (0x605E, 0) => true,
        (0x6072, 0) => !scenario.dry.is_on,
        _ => false,
    }
}

/// Abort connection option code (6007h): quick stop.
const QUICK_STOP_AT_ABORT: i64 = 3;
/// Quick stop (605Ah) and fault reaction (605Eh) option codes: quick-stop ramp, then off.
const RAMP_THEN_OFF: i64 = 2;

/// Index, sub-index, value, bytes, and the key that decides the value.
type KnownObject = (u16, u8, i64, usize, &'static str);

/// The known objects of the drive of an axis, in the order in which they are written.
fn known_objects(scenario: &Scenario, axis: usize) -> Result<[KnownObject; 14], PlantError> {
    let (can, drive, scale) = (&scenario.can, scenario.drives.of_axis(axis), scenario.scale(axis));
    let profile = scenario.profile(axis);
    let consumed = i64::from(MASTER_NODE.get()) << 16 | i64::from(can.heartbeat_consumer_ms);
    let quick_stop = i64::from(scale.acceleration(drive.quick_stop_deceleration_m_s2));
    let window = i64::from(scale.window(drive.following_error_m));
    let [lowest, highest] = software_limits(scenario, axis);
    let force_share = drive.max_force_n / drive.rated_force_n * scenario.dry.force_now();
    let force_limit = (force_share * 1000.0).round().clamp(1.0, f64::from(u16::MAX)) as i64;
    let (period, exponent) = period(scenario, profile)?;
    let key = |slide, leg| if axis < LEGS { slide } else { leg };
    let quick_stop_key =
        key("drives.slide.quick_stop_deceleration_m_s2", "drives.leg.quick_stop_deceleration_m_s2");
    let window_key = key("drives.slide.following_error_m", "drives.leg.following_error_m");
    let timeout_key = key("drives.slide.following_error_timeout_ms", "drives.leg.following_error_timeout_ms");
    Ok([
        (0x1400, 5, rpdo_timeout_ms(scenario).into(), 2, "can.rpdo_timeout_ms"),
        (0x1017, 0, can.heartbeat_producer_ms.into(), 2, "can.heartbeat_producer_ms"),
        (0x1016, 1, consumed, 4, "can.heartbeat_consumer_ms"),
        (0x6007, 0, QUICK_STOP_AT_ABORT, 2, "drive_profile.objects"),
        (0x605A, 0, RAMP_THEN_OFF, 2, "drive_profile.objects"),
        (0x605E, 0, RAMP_THEN_OFF, 2, "drive_profile.objects"),
        (0x6085, 0, quick_stop, 4, quick_stop_key),
        (0x6065, 0, window, 4, window_key),
        (0x6066, 0, drive.following_error_timeout_ms.into(), 2, timeout_key),
        // A dry run before may have lowered the limit.
        (0x6072, 0, force_limit, 2, key("drives.slide.max_force_n", "drives.leg.max_force_n")),
        // The upper limit comes first: the boot opens the lower one before.
        (0x607D, 2, highest.into(), 4, "mechanism.strokes"),
        (0x607D, 1, lowest.into(), 4, "mechanism.strokes"),
        (0x60C2, 1, period, 1, "rate_hz"),
        (0x60C2, 2, exponent, 1, "rate_hz"),
    ])
}

/// The ends of the stroke as the drive counts them in 607Dh, ascending.
fn software_limits(scenario: &Scenario, axis: usize) -> [i32; 2] {
    let (scale, offset_m) = (scenario.scale(axis), scenario.profile(axis).homing.limit_offset_m());
    let mut ends = scenario.mechanism.strokes.of_axis(axis).map(|end_m| scale.increments(end_m - offset_m));
    ends.sort_unstable();
    ends
}

/// 60C2h for a cycle: with the profile's exponent where that has one.
fn period(scenario: &Scenario, profile: &DriveProfile) -> Result<(i64, i64), PlantError> {
    let fixed = profile.object(ObjectKey(ObjectAddress::new(0x60C2, 2))).value;
    let Some(exponent) = fixed else {
        let (value, exponent) = interpolation_period(scenario.period_ns());
        return Ok((value.into(), exponent.into()));
    };
    let unit_ns =
        u32::try_from(exponent + 9).ok().and_then(|digits| 10u64.checked_pow(digits)).unwrap_or(SECOND_NS);
    if !scenario.period_ns().is_multiple_of(unit_ns) {
        let reason =
            format!("the drive counts its cycle in 10^{exponent} s (drive_profile '{}')", profile.kind);
        return Err(PlantError::Scenario(format!("rate_hz = {}: {reason}", scenario.rate_hz)));
    }
    Ok(((scenario.period_ns() / unit_ns) as i64, exponent))
}

/// The event timer of a drive's RPDO: a stall of the machine that neither heartbeat nor commands make a fault trips no
/// drive.
fn rpdo_timeout_ms(scenario: &Scenario) -> u16 {
    let can = &scenario.can;
    let commands_ms = u64::from(can.command_timeout_cycles) * scenario.period_ns() / MILLISECOND_NS;
    let longest_ms = u16::try_from(commands_ms).unwrap_or(u16::MAX).max(can.heartbeat_consumer_ms);
    can.rpdo_timeout_ms.unwrap_or(longest_ms)
}

/// COB-ID without the bit for remote requests, which the master does not send.
pub(crate) const COB_ID_BITS: u32 = !CobId::NO_REMOTE_REQUEST;
/// Communication parameters of the other PDOs with identifiers of CiA 301. Many drives send them as delivered, but the
/// plan of the bus does not include them.
pub(crate) const OTHER_PDOS: [u16; 6] = [0x1401, 0x1402, 0x1403, 0x1801, 0x1802, 0x1803];

/// A value of the identity: the bits of `mask` must be equal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WantedIdentity {
    /// Its address.
    pub object: ObjectAddress,
    /// Bits that count.
    pub mask: u32,
    /// The value.
    pub value: u32,
}

impl WantedIdentity {
    const fn new(index: u16, subindex: u8, mask: u32, value: u32) -> Self {
        Self { object: ObjectAddress::new(index, subindex), mask, value }
    }
}

/// A PDO as the rig exchanges it: sent or taken with every SYNC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WantedPdo {
    /// Index of its communication parameter; that of its mapping is 200h higher.
    pub communication: u16,
    /// Its COB-ID.
    pub cob_id: u32,
    /// The mapped objects: index, sub-index, bits.
    pub mapping: PdoMapping,
}

/// The identity of a drive with this profile.
fn identity(profile: &DriveProfile) -> [WantedIdentity; 4] {
    let identity = &profile.identity;
    [
        WantedIdentity::new(0x1000, 0, u32::MAX, identity.device_type),
        WantedIdentity::new(0x1018, 1, u32::MAX, identity.vendor_id),
        WantedIdentity::new(0x1018, 2, identity.product_mask, identity.product_code),
        WantedIdentity::new(0x1018, 3, identity.revision_mask, identity.revision),
    ]
}

/// The PDOs of a node with this profile.
fn pdos(profile: &DriveProfile, node: NodeId) -> [WantedPdo; 2] {
    let pdo = |communication, cob: Cob, mapping| {
        let cob_id = CanId::from(cob).number();
        WantedPdo { communication, cob_id, mapping }
    };
    [pdo(0x1400, Cob::Rpdo1(node), profile.pdos.rpdo1()), pdo(0x1800, Cob::Tpdo1(node), profile.pdos.tpdo1())]
}

impl WantedPdo {
    /// Every object of the PDO with the bits that count and their value, in the order in which the master compares them.
    pub fn entries(&self) -> impl Iterator<Item = WantedIdentity> {
        let Self { communication, cob_id, .. } = *self;
        let mapping = self.mapping.entries();
        let entry = WantedIdentity::new;
        let head = [
            entry(communication, 1, COB_ID_BITS, cob_id),
            entry(communication, 2, u32::MAX, u32::from(EVERY_SYNC)),
            entry(communication + 0x200, 0, u32::MAX, mapping.len() as u32),
        ];
        let mapped = (1..).zip(mapping);
        head.into_iter()
            .chain(mapped.map(move |(place, &object)| entry(communication + 0x200, place, u32::MAX, object)))
    }
}

#[cfg(test)]
mod drive_tests {
    use std::path::Path;

    use masseter_can::canopen::ObjectAddress;
    use masseter_scenario::ObjectRule;

    use super::{OFFSETS, *};

    fn wanted(text: &str, axis: usize) -> Result<WantedDrive, PlantError> {
        let scenario = Scenario::parse(Path::new("robot.toml"), text).unwrap();
        scenario.validate().unwrap();
        WantedDrive::of_axis(&scenario, axis, NodeId::new(1).unwrap())
    }

    fn find(wanted: &WantedDrive, index: u16, subindex: u8) -> Option<WantedObject> {
        wanted.objects.iter().find(|wanted| wanted.object == ObjectAddress::new(index, subindex)).copied()
    }

    /// The drive that takes 10⁷ as rpm/s gets 10 m/s² in rpm/s: with 3 mm a turn 200 000.
    #[test]
    fn a_profile_decides_units_limits_and_objects() {
        let epos4 = "[[drive_profile]]\nkind = 'epos4'\nunits = { lead_m = 0.003 }";
        let wanted = wanted(epos4, 3).unwrap();
        let value = |index, subindex| find(&wanted, index, subindex).map(|wanted| wanted.value);
        assert_eq!(value(0x6085, 0), Some(200_000));
        assert_eq!(
            (value(0x6066, 0), value(0x60C2, 1), value(0x60C2, 2)),
            (Some(0), Some(1), Some(-3i32 as u32))
        );
        assert_eq!(find(&wanted, 0x60AA, 0).unwrap().rule, ObjectRule::Expect);
        assert_eq!(wanted.identity[3].mask, 0xFFFF_0000);
        assert_eq!((wanted.home.object, wanted.home.value), (ObjectAddress::new(0x30B0, 0), 0));
    }

    #[test]
    fn what_a_drive_cannot_take_is_refused_with_the_key_that_decides_it() {
        for (text, refusal) in [
            (
                "objects.6066h = { highest = 0 }",
                "drives.leg.following_error_timeout_ms: object 6066h:00h would be 20",
            ),
            (
                "objects.6085h = { lowest = 20_000_000 }",
                "drives.leg.quick_stop_deceleration_m_s2: object 6085h",
            ),
            ("objects.3000h = { value = 1 }", "drive_profile.objects.3000h: enter bytes"),
            ("objects.'60C2h:02' = { value = -2 }", "rate_hz = 1000: the drive counts its cycle in 10^-2 s"),
        ] {
            let error = wanted(&format!("[[drive_profile]]\n{text}"), 4).unwrap_err().to_string();
            assert!(error.starts_with(refusal), "{error}");
        }
    }

    #[test]
    fn an_absent_object_is_left_and_an_optional_one_may_be_refused() {
        let text =
            "[[drive_profile]]\nobjects.6007h = { rule = 'absent' }\nobjects.6065h = { rule = 'optional' }";
        let wanted = wanted(text, 0).unwrap();
        assert_eq!(find(&wanted, 0x6007, 0), None);
        assert_eq!(find(&wanted, 0x6065, 0).unwrap().rule, ObjectRule::Optional);
        assert_eq!(find(&wanted, 0x1400, 5).unwrap().rule, ObjectRule::Optional);
    }

    /// A drive keeps the last force of process data that no longer carry it.
    #[test]
    fn offsets_are_0_unless_they_are_process_data() {
        let offset = |text: &str, index| {
            let wanted = wanted(&format!("[[drive_profile]]\n{text}"), 3).unwrap();
            find(&wanted, index, 0).map(|wanted| (wanted.value, wanted.bytes, wanted.rule))
        };
        assert_eq!(offset("", 0x60B2), Some((0, 2, ObjectRule::Optional)));
        assert_eq!(offset("", 0x60B1), None, "no process data of the rig carry it");
        assert_eq!(offset("objects.60B2h = { rule = 'absent' }", 0x60B2), None);
        for kind in ["kind = 'epos4'\nunits = { lead_m = 0.003 }", "kind = 'n5'"] {
            for (index, bytes) in OFFSETS {
                assert_eq!(offset(kind, index), Some((0, bytes, ObjectRule::Optional)), "{kind}");
            }
        }
        let mapped = "kind = 'n5'\npdos.rpdo1 = ['6040h', '607Ah', '60B2h']";
        assert_eq!(offset(mapped, 0x60B2), None);
        assert!(offset(mapped, 0x60B1).is_some());
        assert_eq!(offset("objects.60B2h = { value = 5 }", 0x60B2), Some((5, 2, ObjectRule::Write)));
    }

    /// A leg of 0.2 m at home whose limits count from there, and the same on a drive that counts the other way.
    #[test]
    fn software_limits_count_from_home_and_ascend_on_a_reversed_axis() {
        let limits = |text: &str| {
            let wanted = wanted(&format!("[[drive_profile]]\n{text}"), 3).unwrap();
            let limit = |subindex| find(&wanted, 0x607D, subindex).unwrap().value as i32;
            ([limit(1), limit(2)], wanted.home.value as i32)
        };
        let ([low, high], _) = limits("");
        let moved = [low - 200_000, high - 200_000];
        assert_eq!(limits("homing.home_position_m = 0.2"), (moved, -200_000));
        assert_eq!(
            limits("homing = { home_position_m = 0.2, limits_from_home = false, home_sign = 1 }"),
            ([low, high], 200_000)
        );
        let back = moved.map(|end: i32| -end);
        assert_eq!(limits("homing.home_position_m = 0.2\nreversed = ['l1']"), ([back[1], back[0]], 200_000));
    }
}

#[cfg(test)]
mod known_tests {
    use super::*;

    #[test]
    fn process_data_may_be_silent_as_long_as_commands_or_the_heartbeat() {
        let timeout_ms = |rate_hz, configured| {
            let mut scenario = Scenario { rate_hz, ..Scenario::default() };
            scenario.can.rpdo_timeout_ms = configured;
            rpdo_timeout_ms(&scenario)
        };
        assert_eq!(timeout_ms(100, None), 200, "20 cycles");
        assert_eq!(timeout_ms(1000, None), Scenario::default().can.heartbeat_consumer_ms);
        assert_eq!(timeout_ms(1000, Some(0)), 0);
    }
}
