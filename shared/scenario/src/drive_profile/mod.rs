//! What the master expects of a kind of drive: `[[drive_profile]]`.
//!
//! A profile is data: identity, units, objects, storing, brake and homing. Nothing here talks to a drive. What an
//! emulated drive takes from its profile is in the plant.

mod dcf;
mod homing;
mod identity;
mod kind;
mod object;
mod pdos;
mod scale;
mod units;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use masseter_model::geometry::{AXES, AXIS_NAMES};

use super::error::ScenarioError;
use super::need::{require_not_negative, require_positive};

pub use homing::HomingConfig;
pub use identity::IdentityConfig;
pub(super) use kind::over_kinds;
pub use object::{ObjectConfig, ObjectKey, ObjectRule};
pub use pdos::PdosConfig;
pub use scale::AxisScale;
pub use units::{AccelerationUnit, INCREMENTS, UnitsConfig, VelocityUnit};

/// The profile of axes that no `[[drive_profile]]` names.
static EMULATED: LazyLock<DriveProfile> = LazyLock::new(DriveProfile::default);

section! {
    /// One kind of drive, and the axes that have such a drive.
    pub struct DriveProfile {
        /// The kind whose values the other keys replace: `emulated`, `epos4` or `n5`.
        pub kind: String = "emulated".to_owned(),
        /// Where the values come from.
        pub source: String = "the emulated drives".to_owned(),
        /// The axes with this drive: d1 to l3.
        pub axes: Vec<String> = AXIS_NAMES.map(str::to_owned).to_vec(),
        /// The axes whose 6064h falls where d or l grows.
        pub reversed: Vec<String> = Vec::new(),
        /// A device configuration file, whose `ParameterValue`s and limits become `objects`. Relative to the scenario.
        pub dcf: Option<PathBuf> = None,
        /// What the drive reports of itself.
        pub identity: IdentityConfig = IdentityConfig::EMULATED,
        /// What the drive's numbers count.
        pub units: UnitsConfig = UnitsConfig::default(),
        /// What the process data carry.
        pub pdos: PdosConfig = PdosConfig::default(),
        /// Single objects, such as `"6066h" = { rule = "absent" }`.
        pub objects: BTreeMap<ObjectKey, ObjectConfig> = BTreeMap::new(),
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
        /// Sub-index of 1010h that stores all.
        pub subindex: u8 = 1,
        /// How long storing may take, ms.
        pub timeout_ms: u32 = 10_000,
    }
}

section! {
    /// The brake that the drive operates.
    #[derive(Copy)]
    pub struct BrakeConfig {
        /// From "operation enabled" to the moment when the axis may move, s.
        pub open_s: f64 = 0.0,
        /// From the end of "operation enabled" to the moment when the brake holds, s.
        pub close_s: f64 = 0.0,
    }
}

impl DriveProfile {
    /// The profile of an axis: of the emulated drives where no profile names the axis.
    pub fn of_axis(profiles: &[Self], axis: usize) -> &Self {
        let named = |profile: &&Self| profile.axes.iter().any(|name| name == AXIS_NAMES[axis]);
        profiles.iter().find(named).unwrap_or(&EMULATED)
    }

    /// Replaces `dcf`, whose path is relative to a folder, by the objects of its file.
    pub(super) fn read_dcf(&mut self, folder: &Path) -> Result<(), ScenarioError> {
        self.dcf.take().map_or(Ok(()), |path| dcf::add_objects(&mut self.objects, &folder.join(path)))
    }

    /// What the profile says of an object; nothing in particular when absent.
    pub fn object(&self, key: ObjectKey) -> ObjectConfig {
        self.objects.get(&key).copied().unwrap_or_default()
    }

    /// Whether 6064h of an axis falls where d or l grows.
    pub fn is_reversed(&self, axis: usize) -> bool {
        self.reversed.iter().any(|name| name == AXIS_NAMES[axis])
    }

    /// Checks all profiles.
    pub(super) fn validate_all(profiles: &[Self]) -> Result<(), ScenarioError> {
        let mut taken = [false; AXES];
        for (number, profile) in profiles.iter().enumerate() {
            profile.validate(&mut taken).map_err(|error| error.of_entry(number))?;
        }
        Ok(())
    }

    fn validate(&self, taken: &mut [bool; AXES]) -> Result<(), ScenarioError> {
        for (key, names) in [("drive_profile.axes", &self.axes), ("drive_profile.reversed", &self.reversed)] {
            if let Some(name) = names.iter().find(|name| !AXIS_NAMES.contains(&name.as_str())) {
                let need = format!("name axes: {}", AXIS_NAMES.join(", "));
                return Err(ScenarioError::bad(key, &format!("'{name}'"), need));
            }
        }
        for (axis, name) in AXIS_NAMES.iter().enumerate() {
            if self.axes.iter().any(|named| named == name) && std::mem::replace(&mut taken[axis], true) {
                let need = "give each axis one profile";
                return Err(ScenarioError::bad("drive_profile.axes", &format!("'{name}'"), need));
            }
        }
        for (key, object) in &self.objects {
            object.validate(*key)?;
        }
        self.pdos.validate()?;
        self.units.validate()?;
        self.homing.validate()?;
        let BrakeConfig { open_s, close_s } = self.brake;
        require_not_negative(&[
            ("drive_profile.brake.open_s", open_s),
            ("drive_profile.brake.close_s", close_s),
        ])?;
        require_positive(&[("drive_profile.store.timeout_ms", f64::from(self.store.timeout_ms))])
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::canopen::ObjectAddress;

    use super::*;
    use crate::Scenario;

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
