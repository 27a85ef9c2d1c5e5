//! The master's expectations of a kind of drive: `[[drive_profile]]`.
//!
//! A profile is data: identity, units, objects, storing, brake and homing. This module sends nothing to a drive. The emulated
//! drive's use of its profile is in the plant.

mod dcf;
mod object;

use std::path::{Path, PathBuf};
use std::{collections::BTreeMap, sync::LazyLock};

use masseter_can::{PdoMapping, PdoMappingError, canopen::ObjectAddress};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use serde::{Deserialize, Deserializer, Serialize, de::Error};

use super::error::{Checked, ScenarioError, ranges_of, require, require_axes, require_each};
use super::merge::Given;
use crate::{CanConfig, wording::listed};

pub use dcf::DcfRead;
pub use object::{ObjectConfig, ObjectKey, ObjectRule};

/// The kinds with their profiles.
const KINDS: [(&str, &str); 3] =
    [("emulated", ""), ("epos4", include_str!("kinds/epos4.toml")), ("n5", include_str!("kinds/n5.toml"))];
/// The profile of axes without a `[[drive_profile]]`.
static EMULATED: LazyLock<DriveProfile> = LazyLock::new(DriveProfile::default);

section! {
    /// One kind of drive, and the axes that have such a drive.
    pub struct DriveProfile {
        /// The profile whose values the other keys replace.
        pub kind: String = "emulated".to_owned(),
        /// Where the values come from.
        pub source: String = "the emulated drives".to_owned(),
        /// The axes with this drive.
        pub axes: Vec<String> = AXIS_NAMES.map(str::to_owned).to_vec() => "each axis in one profile",
        /// The axes whose 6064h falls where d or l grows.
        pub reversed: Vec<String> = Vec::new() => "axes",
        /// A device configuration file (CiA 306), relative to the scenario: its `ParameterValue`s and limits become
        /// `objects`.
        pub dcf: Option<PathBuf> = None => "path",
        /// What the file of `dcf` says beside its objects.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub dcf_read: Option<DcfRead> = None,
        /// What the drive reports of itself.
        pub identity: IdentityConfig = IdentityConfig::default(),
        /// What the drive's numbers count.
        pub units: UnitsConfig = UnitsConfig::default(),
        /// What the process data carry.
        pub pdos: PdosConfig = PdosConfig::default(),
        /// Single objects, such as `"6066h" = { rule = "absent" }`.
        pub objects: BTreeMap<ObjectKey, ObjectConfig> = BTreeMap::new() => "see below",
        /// How the drive stores its objects.
        pub store: StoreConfig = StoreConfig::default(),
        /// The brake.
        pub brake: BrakeConfig = BrakeConfig::default(),
        /// Homing.
        pub homing: HomingConfig = HomingConfig::default(),
    }
}

section! {
    /// Storing in the drive's non-volatile memory (1010h).
    #[derive(Copy, Eq)]
    pub struct StoreConfig {
        /// The sub-index of 1010h that stores everything.
        pub subindex: u8 = 1,
        /// How long storing may take.
        pub timeout_ms: u32 = 10_000 => Positive,
    }
}

section! {
    /// The brake that the drive operates.
    #[derive(Copy)]
    pub struct BrakeConfig {
        /// From "operation enabled" until the axis may move.
        pub open_s: f64 = 0.0 => NotNegative,
        /// From the end of "operation enabled" until the brake holds.
        pub close_s: f64 = 0.0 => NotNegative,
    }
}

impl DriveProfile {
    /// The profile of an axis; without one, that of the emulated drives.
    pub fn of_axis(profiles: &[Self], axis: usize) -> &Self {
        let named = |profile: &&Self| profile.axes.iter().any(|name| name == AXIS_NAMES[axis]);
        profiles.iter().find(named).unwrap_or(&EMULATED)
    }

    /// Replaces `dcf`, a path relative to a folder, by the objects of its file.
    pub(super) fn read_dcf(&mut self, folder: &Path) -> Checked {
        if let Some(path) = self.dcf.take() {
            self.dcf_read =
                Some(DcfRead::of_file(&folder.join(path), self.homing.home_object, &mut self.objects)?);
        }
        Ok(())
    }

    /// What the rig does not take from the file of `dcf`, in one line; `None` if it takes everything.
    pub fn dcf_warning(&self) -> Option<String> {
        self.dcf_read.as_ref()?.warning()
    }

    /// The profile's entry for an object; the default without one.
    pub fn object(&self, key: ObjectKey) -> ObjectConfig {
        self.objects.get(&key).copied().unwrap_or_default()
    }

    /// Whether 6064h of an axis falls where d or l grows.
    pub fn is_reversed(&self, axis: usize) -> bool {
        self.reversed.iter().any(|name| name == AXIS_NAMES[axis])
    }

    /// Checks all profiles.
    pub(super) fn validate_all(profiles: &[Self], can: &CanConfig) -> Checked {
        let mut taken = [false; AXES];
        require_each(profiles, |profile| profile.validate(&mut taken, can))
    }

    fn validate(&self, taken: &mut [bool; AXES], can: &CanConfig) -> Checked {
        require_axes("drive_profile.axes", &self.axes)?;
        require_axes("drive_profile.reversed", &self.reversed)?;
        for (axis, name) in AXIS_NAMES.iter().enumerate() {
            let is_twice =
                self.axes.iter().any(|named| named == name) && std::mem::replace(&mut taken[axis], true);
            let name = format!("'{name}'");
            require(!is_twice, "drive_profile.axes", &name, "give each axis one profile")?;
        }
        self.objects.iter().try_for_each(|(key, object)| object.validate(*key))?;
        self.dcf_read.as_ref().map_or(Ok(()), |read| read.validate(&self.axes, can))?;
        self.pdos.validate()?;
        self.units.validate()?;
        self.homing.validate()?;
        self.brake.check_ranges(ranges_of("drive_profile.brake"))?;
        self.store.check_ranges(ranges_of("drive_profile.store"))
    }
}

/// Reads profiles. The values of a table replace the values of its kind.
pub(super) fn over_kinds<'de, D: Deserializer<'de>>(list: D) -> Result<Vec<DriveProfile>, D::Error> {
    let tables = Vec::<Given>::deserialize(list)?;
    tables.into_iter().map(|table| table.over(&KINDS).map_err(D::Error::custom)).collect()
}

section! {
    /// The identity that the master checks before it writes to a drive. The default is that of the emulated drives, servo
    /// drives of CiA 402; the number of their vendor is not registered with CiA.
    #[derive(Copy, Eq)]
    pub struct IdentityConfig {
        /// Device type (object 1000).
        pub device_type: u32 = 0x0002_0192,
        /// Vendor (object 1018:01).
        pub vendor_id: u32 = 0x004D_5354,
        /// Product (object 1018:02).
        pub product_code: u32 = 0x0000_0402,
        /// The bits of the product code that must be equal.
        pub product_mask: u32 = u32::MAX,
        /// Revision (object 1018:03).
        pub revision: u32 = 0x0001_0000,
        /// The bits of the revision that must be equal.
        pub revision_mask: u32 = u32::MAX,
    }
}

/// Unit of the drive's velocities (6081h, 6099h).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VelocityUnit {
    /// Increments of 6064h a second.
    #[default]
    IncrementsS,
    /// Tenths of an increment a second.
    #[serde(rename = "0.1_increments_s")]
    TenthIncrementsS,
    /// Turns of the motor a minute.
    Rpm,
}

/// Unit of the drive's accelerations (6083h to 6085h, 609Ah).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AccelerationUnit {
    /// Increments of 6064h a second squared.
    #[default]
    IncrementsS2,
    /// Turns of the motor a minute, per second.
    #[serde(rename = "rpm_s")]
    RpmPerS,
}

/// Increments in 60A8h (CiA 303-2: prefix, numerator, denominator).
pub const INCREMENTS: u32 = 0x00B5_0000;

impl VelocityUnit {
    /// The unit in 60A9h (CiA 303-2: prefix, numerator, denominator).
    pub const fn code(self) -> u32 {
        match self {
            Self::IncrementsS => 0x00B5_0300,
            Self::TenthIncrementsS => 0xFFB5_0300,
            Self::Rpm => 0x00B4_4700,
        }
    }
}

impl AccelerationUnit {
    /// Every unit.
    pub const ALL: [Self; 2] = [Self::IncrementsS2, Self::RpmPerS];

    /// The unit in 60AAh (CiA 303-2: prefix, numerator, denominator).
    pub const fn code(self) -> u32 {
        match self {
            Self::IncrementsS2 => 0x00B5_5700,
            Self::RpmPerS => 0x00C0_0300,
        }
    }
}

section! {
    /// What the drive's numbers count. Positions are always increments of 6064h.
    #[derive(Copy)]
    pub struct UnitsConfig {
        /// Unit of velocities: 6081h and 6099h (60A9h).
        pub velocity: VelocityUnit = VelocityUnit::default(),
        /// Unit of accelerations: 6083h to 6085h and 609Ah (60AAh).
        pub acceleration: AccelerationUnit = AccelerationUnit::default(),
        /// Turns of the motor for one of the screw (6091h).
        pub gear_ratio: f64 = 1.0 => Positive,
        /// Travel of the axis for one turn of the screw (6092h); needed where the drive counts turns.
        pub lead_m: Option<f64> = None => Positive,
    }
}

impl UnitsConfig {
    /// Travel of the axis for a turn of the motor, m; none without a lead.
    pub fn travel_per_turn_m(&self) -> Option<f64> {
        Some(self.lead_m? / self.gear_ratio)
    }

    fn validate(&self) -> Checked {
        self.check_ranges(ranges_of("drive_profile.units"))?;
        let counts_turns =
            self.velocity == VelocityUnit::Rpm || self.acceleration == AccelerationUnit::RpmPerS;
        let need = "enter the travel of a turn of the screw: the drive counts turns of the motor";
        let is_known = self.lead_m.is_some() || !counts_turns;
        require(is_known, "drive_profile.units.lead_m", &"none", need)
    }
}

section! {
    /// The objects of the process data in their order. RPDO1 may also carry the torque offset (60B2h).
    pub struct PdosConfig {
        /// Objects of RPDO1: controlword, target position, torque offset.
        pub rpdo1: Vec<ObjectKey> = object_keys(&PdoMapping::RPDO1) => "6040h and 607Ah; 60B2h too",
        /// Objects of TPDO1: statusword, position, torque.
        pub tpdo1: Vec<ObjectKey> = object_keys(&PdoMapping::TPDO1) => "these three",
    }
}

fn object_keys(mapping: &PdoMapping) -> Vec<ObjectKey> {
    mapping.entries().iter().map(|entry| ObjectKey(ObjectAddress::new((entry >> 16) as u16, 0))).collect()
}

type Constructor = fn(&[ObjectAddress]) -> Result<PdoMapping, PdoMappingError>;

fn mapping_of(keys: &[ObjectKey], of: Constructor) -> Result<PdoMapping, PdoMappingError> {
    of(&keys.iter().map(|&ObjectKey(object)| object).collect::<Vec<_>>())
}

impl PdosConfig {
    /// The mapping of RPDO1; the usual mapping for invalid objects.
    pub fn rpdo1(&self) -> PdoMapping {
        mapping_of(&self.rpdo1, PdoMapping::rpdo1).unwrap_or(PdoMapping::RPDO1)
    }

    /// The mapping of TPDO1; the usual mapping for invalid objects.
    pub fn tpdo1(&self) -> PdoMapping {
        mapping_of(&self.tpdo1, PdoMapping::tpdo1).unwrap_or(PdoMapping::TPDO1)
    }

    fn validate(&self) -> Checked {
        let places: [(_, _, Constructor); 2] = [
            ("drive_profile.pdos.rpdo1", &self.rpdo1, PdoMapping::rpdo1),
            ("drive_profile.pdos.tpdo1", &self.tpdo1, PdoMapping::tpdo1),
        ];
        for (key, objects, of) in places {
            mapping_of(objects, of).map_err(|error| ScenarioError::bad(key, &listed(objects), error))?;
        }
        Ok(())
    }
}

section! {
    /// How a drive finds its zero, and what 6064h must show there.
    #[derive(Copy)]
    pub struct HomingConfig {
        /// Homing method (6098h).
        pub method: i8 = 37,
        /// Whether the encoder keeps its position without power: then the drive is compared and not moved.
        pub absolute: bool = true,
        /// d or l at the home position; absent where the drive's own zero is right.
        pub home_position_m: Option<f64> = None,
        /// The object that sets 6064h at home.
        pub home_object: ObjectKey = ObjectKey(ObjectAddress::new(0x607C, 0)),
        /// Its sign: by the standard 6064h becomes minus the offset.
        pub home_sign: i8 = -1 => "-1 or 1",
        /// Whether the software limits (607Dh) count from home; otherwise from the zero of 6064h.
        pub limits_from_home: bool = true,
        /// Speed of the search for the switch (6099h:01).
        pub speed_m_s: f64 = 0.02 => Positive,
        /// Speed of the search for the zero (6099h:02).
        pub zero_speed_m_s: f64 = 0.004 => Positive,
        /// Acceleration (609Ah).
        pub acceleration_m_s2: f64 = 0.5 => Positive,
        /// How far a second homing may be from the first.
        pub tolerance_m: f64 = 5e-5 => Positive,
    }
}

impl HomingConfig {
    /// Value of `home_object` in increments, at that many metres an increment.
    pub fn home_increments(&self, increment_m: f64) -> i32 {
        let home_m = self.home_position_m.unwrap_or(0.0);
        (f64::from(self.home_sign) * home_m / increment_m).round() as i32
    }

    /// Offset that the drive subtracts from software limits (607Dh), m.
    pub fn limit_offset_m(&self) -> f64 {
        self.home_position_m.filter(|_| self.limits_from_home).unwrap_or(0.0)
    }

    fn validate(&self) -> Checked {
        self.check_ranges(ranges_of("drive_profile.homing"))?;
        let need = "use -1 (6064h becomes minus the offset) or 1";
        require(matches!(self.home_sign, -1 | 1), "drive_profile.homing.home_sign", &self.home_sign, need)?;
        let is_number = self.home_position_m.is_none_or(f64::is_finite);
        require(is_number, "drive_profile.homing.home_position_m", &f64::NAN, "use a finite number")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scenario;
    use crate::merge::over_kind;

    #[test]
    fn every_kind_has_its_own_name_and_a_source() {
        for (name, _) in KINDS {
            let table = format!("kind = '{name}'\nunits.lead_m = 0.005").parse().unwrap();
            let profile: DriveProfile = over_kind(&KINDS, table).unwrap();
            assert_eq!(profile.kind, name);
            assert!(!profile.source.is_empty());
            DriveProfile::validate_all(&[profile], &CanConfig::default()).unwrap();
        }
    }

    fn read(text: &str) -> Scenario {
        Scenario::parse(std::path::Path::new("robot.toml"), text).unwrap()
    }

    #[test]
    fn an_axis_without_a_profile_is_an_emulated_drive() {
        let scenario = read("[[drive_profile]]\nkind = 'epos4'\naxes = ['l1', 'l2']\nreversed = ['l2']");
        let kinds = std::array::from_fn::<_, AXES, _>(|axis| scenario.profile(axis).kind.as_str());
        assert_eq!(kinds, ["emulated", "emulated", "emulated", "epos4", "epos4", "emulated"]);
        assert_eq!([3, 4].map(|axis| scenario.profile(axis).is_reversed(axis)), [false, true]);
    }

    #[test]
    fn a_key_replaces_a_value_of_the_kind_and_leaves_the_others() {
        let scenario = read(
            "[[drive_profile]]\nkind = 'epos4'\nobjects.6065h = { rule = 'expect', value = 7 }\nunits.lead_m = 0.002\n\
             identity.revision = 3",
        );
        let profile = scenario.profile(0);
        let object = |index| profile.object(ObjectKey(ObjectAddress::new(index, 0)));
        assert_eq!((object(0x6065).rule, object(0x6065).value), (ObjectRule::Expect, Some(7)));
        assert_eq!((object(0x6066).highest, object(0x607C).rule), (Some(0), ObjectRule::Absent));
        assert_eq!((profile.identity.vendor_id, profile.identity.revision), (0xFB, 3));
        assert_eq!(profile.units.acceleration, AccelerationUnit::RpmPerS);
        let again = read(&scenario.to_toml());
        assert_eq!(
            again.drive_profile, scenario.drive_profile,
            "a resolved scenario reads as it was written"
        );
    }

    #[test]
    fn a_profile_that_cannot_be_used_is_refused() {
        for (text, refusal) in [
            ("axes = ['l4']", "drive_profile.axes = 'l4': name axes"),
            ("reversed = ['x']", "drive_profile.reversed = 'x': name axes"),
            ("units.acceleration = 'rpm_s'", "drive_profile.units.lead_m"),
            ("pdos.rpdo1 = ['6040h']", "drive_profile.pdos.rpdo1 = 6040h: the master needs object 607Ah:00h"),
            (
                "pdos.tpdo1 = ['6041h', '6064h', '606Ch']",
                "drive_profile.pdos.tpdo1 = 6041h, 6064h, 606Ch: the master",
            ),
            ("objects.6066h = { lowest = 2, highest = 1 }", "drive_profile.objects = 6066h"),
            ("objects.6066h = { value = 2, highest = 1 }", "drive_profile.objects = 6066h"),
            ("axes = ['l1']\n[[drive_profile]]\naxes = ['l1']", "drive_profile.axes = 'l1': give each axis"),
            ("homing.speed_m_s = 0.0", "drive_profile.homing.speed_m_s = 0"),
            ("store.timeout_ms = 0", "drive_profile.store.timeout_ms = 0"),
        ] {
            let error = read(&format!("[[drive_profile]]\n{text}")).validate().unwrap_err().to_string();
            assert!(error.starts_with(refusal), "{error}");
        }
        let path = std::path::Path::new("robot.toml");
        for (text, refusal) in [
            ("kind = 'epos5'", "no kind 'epos5'"),
            ("objects.66h = {}", "'66h'"),
            ("unit = 3", "unknown key 'unit'"),
        ] {
            let error = Scenario::parse(path, &format!("[[drive_profile]]\n{text}")).unwrap_err().to_string();
            assert!(error.contains(refusal), "{error}");
        }
    }
}
