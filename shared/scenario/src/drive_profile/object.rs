//! Single objects of a profile, with their limits: the master writes, compares or leaves an object. The objects stand
//! in the profile, or in a device configuration file.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};
use std::path::Path;
use std::str::FromStr;

use masseter_can::canopen::ObjectAddress;
use masseter_can::canopen::dcf::{Dcf, Entry, Value};
use serde::{Deserialize, Serialize};

use crate::error::{Checked, ScenarioError, read_limited};

/// Size of the largest file, bytes.
const MOST_BYTES: u64 = 4 << 20;
/// Communication and mapping parameters of PDOs.
const PDOS: std::ops::Range<u16> = 0x1400..0x1C00;
/// Objects of the master's table that drives may lack. A file without such an object makes the object absent.
const MAY_LACK: [ObjectAddress; 7] = [
    ObjectAddress::new(0x1400, 5),
    ObjectAddress::new(0x6007, 0),
    ObjectAddress::new(0x605A, 0),
    ObjectAddress::new(0x6065, 0),
    ObjectAddress::new(0x6066, 0),
    ObjectAddress::new(0x607C, 0),
    ObjectAddress::new(0x6085, 0),
];

/// The master's handling of an object.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ObjectRule {
    /// It writes the object.
    #[default]
    Write,
    /// It reads the object, whose value must be right.
    Expect,
    /// It writes the object if the drive has one and accepts the value.
    Optional,
    /// It leaves the object: the drive has none.
    Absent,
}

/// One object of a profile.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectConfig {
    /// What the master does with it.
    pub rule: ObjectRule,
    /// The value in the drive's unit; that of the scenario when absent.
    pub value: Option<i64>,
    /// The least value that the drive takes.
    pub lowest: Option<i64>,
    /// The greatest value that the drive takes.
    pub highest: Option<i64>,
    /// Bytes of the value, 1 to 4; needed with `value` for objects that the rig does not know.
    pub bytes: Option<u8>,
}

impl ObjectConfig {
    /// Whether the drive accepts that value.
    pub fn takes(&self, value: i64) -> bool {
        self.lowest.is_none_or(|lowest| value >= lowest)
            && self.highest.is_none_or(|highest| value <= highest)
    }

    pub(super) fn validate(&self, key: ObjectKey) -> Checked {
        let is_ordered = self.lowest.zip(self.highest).is_none_or(|(lowest, highest)| lowest <= highest);
        let need = match self {
            _ if !is_ordered => "lowest must not be above highest",
            _ if !self.value.is_none_or(|value| self.takes(value)) => {
                "value must be within lowest and highest"
            }
            _ if !self.bytes.is_none_or(|bytes| matches!(bytes, 1 | 2 | 4)) => "bytes must be 1, 2 or 4",
            _ => return Ok(()),
        };
        Err(ScenarioError::bad("drive_profile.objects", &key, need))
    }
}

/// The address of an object in a profile: `6066h`, `60C2h:02`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ObjectKey(pub ObjectAddress);

/// A text that is no address of an object.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is no object; write four hexadecimal digits as in 6066h, or with a sub-index as in 60C2h:02")]
pub struct ObjectKeyError(String);

impl FromStr for ObjectKey {
    type Err = ObjectKeyError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (index, subindex) = text.split_once(':').unwrap_or((text, "0"));
        let index = index.strip_suffix(['h', 'H']).unwrap_or(index);
        let subindex = subindex.strip_suffix(['h', 'H']).unwrap_or(subindex);
        let number = |digits: &str| u16::from_str_radix(digits, 16).ok().filter(|_| !digits.starts_with('+'));
        let address = number(index).filter(|_| index.len() == 4).zip(number(subindex));
        address
            .and_then(|(index, subindex)| Some(Self(ObjectAddress::new(index, u8::try_from(subindex).ok()?))))
            .ok_or_else(|| ObjectKeyError(text.to_owned()))
    }
}

impl Display for ObjectKey {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let ObjectAddress { index, subindex } = self.0;
        if subindex == 0 { write!(f, "{index:04X}h") } else { write!(f, "{index:04X}h:{subindex:02X}") }
    }
}

impl TryFrom<String> for ObjectKey {
    type Error = ObjectKeyError;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.parse()
    }
}

impl From<ObjectKey> for String {
    fn from(key: ObjectKey) -> Self {
        key.to_string()
    }
}

/// Adds the objects of a device configuration file (CiA 306). Objects of the profile itself stay unchanged. PDO
/// parameters and values that depend on the node id stay those of the rig.
pub(super) fn add_dcf_objects(objects: &mut BTreeMap<ObjectKey, ObjectConfig>, path: &Path) -> Checked {
    let dcf = Dcf::parse(&read_limited(path, MOST_BYTES)?).map_err(|error| ScenarioError::Malformed {
        place: format!("{}:{}", path.display(), error.line),
        reason: error.problem,
    })?;
    for (address, object) in objects_of(&dcf) {
        objects.entry(ObjectKey(address)).or_insert(object);
    }
    Ok(())
}

fn objects_of(dcf: &Dcf) -> impl Iterator<Item = (ObjectAddress, ObjectConfig)> {
    let absent = MAY_LACK.into_iter().filter(|address| dcf.entry(*address).is_none());
    let absent =
        absent.map(|address| (address, ObjectConfig { rule: ObjectRule::Absent, ..Default::default() }));
    absent.chain(dcf.entries().filter_map(|entry| Some((entry.address, object_of(entry)?))))
}

/// The rule for an entry of a file; none where the file has nothing for the master.
fn object_of(entry: &Entry) -> Option<ObjectConfig> {
    let address = entry.address;
    let bytes = entry.data_type.bits().filter(|bits| matches!(bits, 8 | 16 | 32))? / 8;
    if entry.data_type.is_real() || !entry.access.is_readable() {
        return None;
    }
    let (value, limits) = (entry.parameter.as_ref().and_then(plain_number), [&entry.lowest, &entry.highest]);
    let [lowest, highest] = limits.map(|limit| limit.as_ref().and_then(plain_number));
    // The master compares a read-only 60C2h:02 with its value in the file, and never writes that object.
    let is_fixed = !entry.access.is_writable();
    let fixed =
        entry.value().and_then(plain_number).filter(|_| is_fixed && address == ObjectAddress::new(0x60C2, 2));
    let value = value.or(fixed).filter(|_| !PDOS.contains(&address.index) && address.index != 0x1018);
    if value.is_none() && lowest.is_none() && highest.is_none() {
        return None;
    }
    let rule = if address == ObjectAddress::new(0x1400, 5) {
        ObjectRule::Optional
    } else if is_fixed {
        ObjectRule::Expect
    } else {
        ObjectRule::Write
    };
    Some(ObjectConfig { rule, value, lowest, highest, bytes: Some(bytes as u8) })
}

/// A number that does not depend on the node id.
fn plain_number(value: &Value) -> Option<i64> {
    match value {
        Value::Number(number) => i64::try_from(*number).ok(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_reads_as_it_is_written() {
        for (text, index, subindex) in
            [("6066h", 0x6066, 0), ("60C2h:02", 0x60C2, 2), ("1018h:0A", 0x1018, 10)]
        {
            let key: ObjectKey = text.parse().unwrap();
            assert_eq!(key, ObjectKey(ObjectAddress::new(index, subindex)));
            assert_eq!(key.to_string(), text);
        }
        assert_eq!("60c2:2h".parse(), "60C2h:02".parse::<ObjectKey>());
        for text in ["", "606h", "60666h", "6066h:100", "+066h", "6066h:", "x066h"] {
            assert!(text.parse::<ObjectKey>().is_err(), "{text}");
        }
    }

    const FILE: &str = "
[1017]\nParameterName=Heartbeat\nDataType=0x6\nAccessType=rw\nDefaultValue=0\n
[6007]\nParameterName=Abort\nDataType=0x3\nAccessType=rw\nParameterValue=2\n
[6065]\nParameterName=Window\nDataType=0x7\nAccessType=rw\nParameterValue=1500\nLowLimit=1\nHighLimit=9000\n
[6066]\nParameterName=Time\nDataType=0x6\nAccessType=rw\nLowLimit=0\nHighLimit=0\n
[60C2]\nParameterName=Period\nObjectType=0x9\nSubNumber=3\n
[60C2sub0]\nParameterName=Highest\nDataType=0x5\nAccessType=const\nDefaultValue=2\n
[60C2sub1]\nParameterName=Value\nDataType=0x5\nAccessType=rw\nHighLimit=100\n
[60C2sub2]\nParameterName=Exponent\nDataType=0x2\nAccessType=ro\nDefaultValue=-3\n
[1800]\nParameterName=PDO\nObjectType=0x9\nSubNumber=2\n
[1800sub0]\nParameterName=Highest\nDataType=0x5\nAccessType=const\nDefaultValue=2\n
[1800sub1]\nParameterName=COB-ID\nDataType=0x7\nAccessType=rw\nParameterValue=$NODEID+0x180\n
";

    #[test]
    fn a_file_gives_values_limits_and_what_the_drive_lacks() {
        let objects: BTreeMap<_, _> = objects_of(&Dcf::parse(FILE).unwrap())
            .map(|(address, object)| (ObjectKey(address), object))
            .collect();
        let object = |key: &str| objects.get(&key.parse().unwrap()).copied();
        let window = ObjectConfig {
            rule: ObjectRule::Write,
            value: Some(1500),
            lowest: Some(1),
            highest: Some(9000),
            bytes: Some(4),
        };
        assert_eq!(object("6065h"), Some(window));
        let fixed = object("60C2h:02").unwrap();
        assert_eq!((fixed.rule, fixed.value), (ObjectRule::Expect, Some(-3)));
        let time = object("6066h").unwrap();
        assert_eq!((time.value, time.highest), (None, Some(0)));
        for lacking in ["605Ah", "607Ch", "6085h"] {
            assert_eq!(object(lacking).unwrap().rule, ObjectRule::Absent, "{lacking}");
        }
        assert_eq!((object("1800h:01"), object("1017h")), (None, None), "the rig's own, and nothing said");
    }

    #[test]
    fn objects_of_the_profile_stay_and_a_bad_file_is_refused_with_its_line() {
        let path = std::env::temp_dir().join(format!("masseter-{}.dcf", std::process::id()));
        std::fs::write(&path, FILE).unwrap();
        let own = ObjectConfig { value: Some(7), ..ObjectConfig::default() };
        let mut objects = BTreeMap::from([("6065h".parse().unwrap(), own)]);
        add_dcf_objects(&mut objects, &path).unwrap();
        assert_eq!((objects[&"6065h".parse().unwrap()], objects.len() > 5), (own, true));
        std::fs::write(&path, "[6065]\nParameterName=W\nDataType=seven\n").unwrap();
        let error = add_dcf_objects(&mut objects, &path).unwrap_err().to_string();
        std::fs::remove_file(&path).unwrap();
        assert!(error.contains(".dcf:3: "), "{error}");
        assert!(add_dcf_objects(&mut objects, &path).is_err(), "a file that is not there");
    }
}
