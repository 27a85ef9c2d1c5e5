//! The objects that the rig needs in a drive, from scenario and profile, in one form for boot, inspection and
//! configuration.
//!
//! This module sends nothing to a drive.

#[cfg(test)]
mod tests;

use masseter_can::canopen::{AbortCode, Cob, CobId, NodeId, ObjectAddress};
use masseter_can::{CanId, EVERY_SYNC, PdoMapping, cia402::interpolation_period};
use masseter_model::geometry::LEGS;
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_scenario::{
    AccelerationUnit, DriveProfile, MASTER_NODE, ObjectConfig, ObjectKey, ObjectRule, Scenario,
};

use serde::{Deserialize, Serialize};

use crate::error::PlantError;

/// The wanted state of a drive.
#[derive(Debug, Clone, PartialEq)]
pub struct WantedDrive {
    /// Device type and identity.
    pub identity: [WantedIdentity; 4],
    /// The two PDOs of the process data, then the PDOs that must be off.
    pub pdos: Vec<PdoSetting>,
    /// The object that sets 6064h at home, with its value; 0 for the drive's own zero.
    pub home: Setting,
    /// Length of an increment of 6064h, m.
    pub increment_m: f64,
    /// Unit of the drive's accelerations (60AAh).
    pub acceleration_unit: AccelerationUnit,
    /// The objects to write or to compare, in the order of the writes.
    pub objects: Vec<Setting>,
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

fn home(scenario: &Scenario, axis: usize) -> Setting {
    let (profile, object) = (scenario.profile(axis), scenario.profile(axis).homing.home_object);
    let value = profile.homing.home_increments(scenario.scale(axis).increment_m) as u32;
    let (rule, key) = (profile.object(object).rule, "drive_profile.homing.home_position_m".to_owned());
    Setting { object, value, bytes: 4, rule, key }
}

/// One object, wanted or found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Setting {
    /// Its address.
    pub object: ObjectKey,
    /// Its value, as the lowest bytes in the drive's order.
    pub value: u32,
    /// Bytes of the value.
    pub bytes: usize,
    /// Whether it is written or compared; never [`ObjectRule::Absent`].
    pub rule: ObjectRule,
    /// The key of the scenario that decides the value.
    pub key: String,
}

impl Setting {
    /// Whether a value has the same lowest bytes.
    pub fn is_shown_by(&self, found: u32) -> bool {
        (self.value ^ found) & value_bits(self.bytes) == 0
    }
}

/// The bits of a value of that many bytes.
pub const fn value_bits(bytes: usize) -> u32 {
    u32::MAX >> (32 - 8 * bytes)
}

/// One PDO, wanted or found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PdoSetting {
    /// Index of its communication parameter; that of its mapping is 200h higher.
    pub communication: u16,
    /// Its COB-ID. Without [`layout`](Self::layout) only its validity counts.
    pub cob_id: u32,
    /// Content and timing; `None` if they do not matter.
    pub layout: Option<PdoLayout>,
}

/// Content and timing of a PDO.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PdoLayout {
    /// Transmission type.
    pub transmission: u32,
    /// Inhibit time; none for RPDOs and for drives without one.
    pub inhibit: Option<u32>,
    /// Event timer of a TPDO, like `inhibit`.
    pub event: Option<u32>,
    /// The mapped objects: index, sub-index, bits.
    pub mapping: Vec<u32>,
}

impl PdoSetting {
    /// A PDO that does not exist.
    const fn off(communication: u16) -> Self {
        Self { communication, cob_id: CobId(0).invalidated().0, layout: None }
    }

    /// Address of a part of the communication parameter.
    pub const fn part(&self, subindex: u8) -> ObjectAddress {
        ObjectAddress::new(self.communication, subindex)
    }

    /// Address of a part of the mapping.
    pub const fn mapped(&self, place: u8) -> ObjectAddress {
        ObjectAddress::new(self.communication + 0x200, place)
    }

    /// Whether it is sent by the drive.
    pub const fn is_transmitted(&self) -> bool {
        self.communication >= 0x1800
    }

    /// Whether an object is one of its timers, which not every drive has.
    pub fn is_timer(&self, object: ObjectAddress) -> bool {
        object.index == self.communication && object.subindex > 2
    }

    /// Whether a COB-ID is right: the number counts for a PDO that exists.
    pub fn has_cob_id(&self, found: u32) -> bool {
        if CobId(self.cob_id).is_valid() {
            (self.cob_id ^ found) & COB_ID_BITS == 0
        } else {
            !CobId(found).is_valid()
        }
    }

    /// The parts but the COB-ID with their values.
    pub fn parts(&self) -> Vec<(ObjectAddress, u32)> {
        let Some(PdoLayout { transmission, inhibit, event, mapping }) = &self.layout else {
            return Vec::new();
        };
        let timers = [(3, *inhibit), (5, *event)];
        let timers = timers.into_iter().filter_map(|(part, value)| Some((self.part(part), value?)));
        let mapped = (1..).zip(mapping).map(|(place, &object)| (self.mapped(place), object));
        [(self.part(2), *transmission), (self.mapped(0), mapping.len() as u32)]
            .into_iter()
            .chain(timers)
            .chain(mapped)
            .collect()
    }

    /// The master's comparisons, in this order: COB-ID, transmission type and mapping of a PDO that must exist.
    pub fn compared(&self) -> impl Iterator<Item = WantedIdentity> {
        let cob_id = WantedIdentity { object: self.part(1), mask: COB_ID_BITS, value: self.cob_id };
        let parts = self.parts().into_iter().filter(move |(object, _)| !self.is_timer(*object));
        let parts = parts.map(|(object, value)| WantedIdentity { object, mask: u32::MAX, value });
        self.layout.iter().map(move |_| cob_id).chain(parts)
    }
}

/// Whether the acknowledgement alone proves the write of an object that a drive refuses to show with this code. There
/// is no other proof for a write-only object.
pub fn is_write_only(code: AbortCode) -> bool {
    code == AbortCode::WRITE_ONLY
}

/// Objects that do not show the written value, with the proof of the write instead.
const SHOWN_ELSEWHERE: [(u16, &str); 4] = [
    (0x1010, "a signature starts the saving, and a reset shows what was saved"),
    (0x1011, "as 1010h"),
    (0x6040, "a command, whose effect the statusword (6041h) shows"),
    (0x6060, "drives after DSP 402 2.0 do not show it; 6061h shows the mode"),
];

/// The bits of an object that must equal the written bits; none for another proof of the write.
pub fn shown_bits(object: ObjectAddress, value: u32, bytes: usize) -> Option<u32> {
    let is_cob_id = matches!(object.index, 0x1400..0x1600 | 0x1800..0x1A00) && object.subindex == 1;
    match SHOWN_ELSEWHERE.iter().find(|(index, _)| *index == object.index) {
        Some(_) => None,
        // The number of a PDO that does not exist has no meaning.
        None if is_cob_id && !CobId(value).is_valid() => Some(CobId::NOT_VALID),
        // A drive decides itself whether it answers remote requests, which nobody sends.
        None if is_cob_id => Some(COB_ID_BITS),
        None => Some(value_bits(bytes)),
    }
}

/// Offsets of position, velocity and torque, with the bytes of each. A drive keeps the last value of its process data.
pub const OFFSETS: [(u16, usize); 3] = [(0x60B0, 4), (0x60B1, 4), TORQUE_OFFSET];
/// The only offset that process data of the rig may carry.
const TORQUE_OFFSET: (u16, usize) = (0x60B2, 2);

/// Whether a drive with an object may keep another value. An offset moves or loads the axis: a drive may lack the
/// object, but not keep another value.
pub fn may_keep(rule: ObjectRule, object: ObjectAddress) -> bool {
    rule == ObjectRule::Optional && OFFSETS.iter().all(|(index, _)| *index != object.index)
}

/// The objects with the scenario's values, or with the profile's own value where the profile has one. The profile's
/// further objects come last.
fn objects(scenario: &Scenario, axis: usize) -> Result<Vec<Setting>, PlantError> {
    let profile = scenario.profile(axis);
    let mut wanted = Vec::new();
    for (index, subindex, value, bytes, key) in known_objects(scenario, axis)? {
        let object = ObjectKey(ObjectAddress::new(index, subindex));
        wanted.extend(setting(scenario, axis, object, Some((value, bytes)), key)?);
    }
    wanted.extend(offsets(profile));
    for &object in profile.objects.keys() {
        if !wanted.iter().any(|known: &Setting| known.object == object) {
            wanted.extend(setting(scenario, axis, object, None, "drive_profile.objects")?);
        }
    }
    Ok(wanted)
}

/// The setting of an object, of which the rig may know value and bytes; none where the profile leaves the object.
fn setting(
    scenario: &Scenario,
    axis: usize,
    object: ObjectKey,
    known: Option<(i64, usize)>,
    key: &str,
) -> Result<Option<Setting>, PlantError> {
    let (profile, node) = (scenario.profile(axis), scenario.can.node_ids[axis]);
    let config = in_this_run(profile.object(object).at_node(node), object.0, scenario)?;
    let value = config.value.or(known.map(|(value, _)| value));
    let Some(value) = value.filter(|_| config.rule != ObjectRule::Absent) else { return Ok(None) };
    let Some(bytes) = known.map(|(_, bytes)| bytes).or(config.bytes.map(usize::from)) else {
        let reason = "enter bytes = 1 to 4: the rig does not know the object";
        return Err(PlantError::Scenario(format!("drive_profile.objects.{object}: {reason}")));
    };
    if !config.takes(value) {
        return Err(beyond(profile, key, object.0, value, &config));
    }
    let is_optional = may_lack(object.0, scenario) && config == ObjectConfig::default();
    let rule = if is_optional { ObjectRule::Optional } else { config.rule };
    Ok(Some(Setting { object, value: value as u32, bytes, rule, key: key.to_owned() }))
}

/// Offsets outside the process data: 0, instead of the last value of other process data. The torque offset of an
/// earlier run acts in every drive with the object; the other offsets are those of the profile.
fn offsets(profile: &DriveProfile) -> impl Iterator<Item = Setting> + '_ {
    let mapping = profile.pdos.rpdo1();
    OFFSETS.into_iter().filter_map(move |(index, bytes)| {
        let object = ObjectKey(ObjectAddress::new(index, 0));
        let may_lack = ObjectConfig { rule: ObjectRule::Optional, ..ObjectConfig::default() };
        let named = profile.objects.get(&object).copied();
        let of_every_profile = ((index, bytes) == TORQUE_OFFSET).then_some(may_lack);
        let ObjectConfig { rule, value, .. } = named.or(of_every_profile)?;
        let is_mapped = mapping.entries().iter().any(|entry| entry >> 16 == u32::from(index));
        let is_left = is_mapped || rule == ObjectRule::Absent;
        let (value, key) = (value.unwrap_or(0) as u32, "drive_profile.objects".to_owned());
        (!is_left).then_some(Setting { object, value, bytes, rule, key })
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

/// The profile's rule for an object, in a dry run with less force. Refuses a rule that prevents the reduced force.
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
/// heartbeat and master supervise these drives too. A step of the commissioning that was killed may have left another fault reaction
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
    let force_share = scenario.max_force_n(axis) / drive.rated_force_n;
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

/// The event timer of a drive's RPDO, ms; 0 for never. A stall that is no fault by heartbeat or commands trips no drive.
pub fn rpdo_timeout_ms(scenario: &Scenario) -> u16 {
    let can = &scenario.can;
    let commands_ms = u64::from(can.command_timeout_cycles) * scenario.period_ns() / MILLISECOND_NS;
    let longest_ms = u16::try_from(commands_ms).unwrap_or(u16::MAX).max(can.heartbeat_consumer_ms);
    can.rpdo_timeout_ms.unwrap_or(longest_ms)
}

/// COB-ID without the bit for remote requests, which the master does not send.
pub const COB_ID_BITS: u32 = !CobId::NO_REMOTE_REQUEST;
/// Communication parameters of the other PDOs with identifiers of CiA 301. Many drives send them as delivered, but the
/// plan of the bus does not include them.
const OTHER_PDOS: [u16; 6] = [0x1401, 0x1402, 0x1403, 0x1801, 0x1802, 0x1803];

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
    pub(crate) const fn new(index: u16, subindex: u8, mask: u32, value: u32) -> Self {
        Self { object: ObjectAddress::new(index, subindex), mask, value }
    }
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

/// The PDOs of a node with this profile: two are sent or taken with every SYNC, the others are off.
fn pdos(profile: &DriveProfile, node: NodeId) -> Vec<PdoSetting> {
    let pdo = |communication, cob: Cob, mapping: PdoMapping, timer| {
        let (transmission, mapping) = (EVERY_SYNC.into(), mapping.entries().to_vec());
        let layout = Some(PdoLayout { transmission, inhibit: timer, event: timer, mapping });
        PdoSetting { communication, cob_id: CanId::from(cob).number(), layout }
    };
    let rpdo1 = pdo(0x1400, Cob::Rpdo1(node), profile.pdos.rpdo1(), None);
    let tpdo1 = pdo(0x1800, Cob::Tpdo1(node), profile.pdos.tpdo1(), Some(0));
    [rpdo1, tpdo1].into_iter().chain(OTHER_PDOS.map(PdoSetting::off)).collect()
}
