//! Single objects of a profile, with their limits: the master writes, compares or leaves an object.

use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

use masseter_can::canopen::ObjectAddress;
use serde::{Deserialize, Serialize};

use crate::can::MASTER_NODE;
use crate::error::{Checked, ScenarioError};

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
    /// Whether the drive's node id is added to `value`.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub plus_node_id: bool,
}

/// The controlword, which the master alone sends.
const CONTROLWORD: u16 = 0x6040;
/// Objects with values that may follow from the node id: those of the communication.
pub(super) const OF_NODE: std::ops::Range<u16> = 0x1000..0x2000;

impl ObjectConfig {
    /// Whether the drive accepts that value.
    pub fn takes(&self, value: i64) -> bool {
        self.lowest.is_none_or(|lowest| value >= lowest)
            && self.highest.is_none_or(|highest| value <= highest)
    }

    /// The same for the drive of a node: the value no longer depends on the node id.
    #[must_use]
    pub fn at_node(self, node: u8) -> Self {
        let node = if self.plus_node_id { i64::from(node) } else { 0 };
        Self { value: self.value.map(|value| value + node), plus_node_id: false, ..self }
    }

    /// Whether a value, and the largest node id where it is added, fits into the object's bytes, with or without a sign.
    fn fits(&self, value: i64) -> bool {
        let bits = 8 * u32::from(self.bytes.unwrap_or(4));
        let node = if self.plus_node_id { i64::from(MASTER_NODE.get()) } else { 0 };
        (-(1 << (bits - 1))..(1 << bits) - node).contains(&value)
    }

    pub(super) fn validate(&self, key: ObjectKey) -> Checked {
        let is_ordered = self.lowest.zip(self.highest).is_none_or(|(lowest, highest)| lowest <= highest);
        let need = match self {
            _ if !is_ordered => "lowest must not be above highest",
            _ if self.plus_node_id && !OF_NODE.contains(&key.0.index) => {
                "plus_node_id is for objects 1000h to 1FFFh"
            }
            _ if !self.plus_node_id && !self.value.is_none_or(|value| self.takes(value)) => {
                "value must be within lowest and highest"
            }
            _ if !self.bytes.is_none_or(|bytes| matches!(bytes, 1..=4)) => "bytes must be 1 to 4",
            _ if self.plus_node_id && self.value.is_none() => "plus_node_id needs a value",
            _ if key.0.index == CONTROLWORD && self.value.is_some() => {
                "the controlword has no value of its own"
            }
            _ if !self.value.is_none_or(|value| self.fits(value)) => "value does not fit into its bytes",
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

    #[test]
    fn a_value_that_no_drive_can_hold_is_refused() {
        let of = |value, bytes, plus_node_id| ObjectConfig {
            value,
            bytes,
            plus_node_id,
            ..ObjectConfig::default()
        };
        let cases = [
            ("2000h", of(Some(300), Some(1), false), "does not fit"),
            ("2000h", of(Some(-129), Some(1), false), "does not fit"),
            ("1014h", of(Some(i64::MAX), None, true), "does not fit"),
            ("1014h", of(Some(0xFFFF_FFFF), Some(4), true), "does not fit"),
            ("1014h", of(None, Some(4), true), "plus_node_id needs a value"),
            ("6040h", of(Some(15), Some(2), false), "the controlword has no value of its own"),
        ];
        for (key, object, reason) in cases {
            let refusal = object.validate(key.parse().unwrap()).unwrap_err().to_string();
            assert!(refusal.contains(reason), "{key}: {refusal}");
        }
        for (value, bytes) in [(255, Some(1)), (-128, Some(1)), (0xFFFF_FFFF, None), (-1, None)] {
            of(Some(value), bytes, false).validate("2000h".parse().unwrap()).unwrap();
        }
    }
}
