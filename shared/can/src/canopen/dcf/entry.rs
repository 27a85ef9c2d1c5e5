//! An entry of the object dictionary as a description has it.

use super::data_type::DataType;
use super::error::{DcfError, Problem};
use super::ini::Section;
use super::value::{Value, plain};
use crate::canopen::{NodeId, ObjectAddress};

/// `ObjectType` of a domain.
const DOMAIN_OBJECT: u16 = 0x2;

/// Who may access an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Access {
    /// Nobody changes it, not even the device.
    Constant,
    /// Clients may read it.
    ReadOnly,
    /// Clients may write it.
    WriteOnly,
    /// Clients may read and write it.
    ReadWrite,
    /// As [`ReadWrite`](Self::ReadWrite), and a TPDO may carry it.
    ReadWriteTpdo,
    /// As [`ReadWrite`](Self::ReadWrite), and an RPDO may carry it.
    ReadWriteRpdo,
}

/// An entry.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Index and sub-index.
    pub address: ObjectAddress,
    /// `ParameterName`.
    pub name: String,
    /// `DataType`.
    pub data_type: DataType,
    /// `AccessType`.
    pub access: Access,
    /// `DefaultValue`: the value as delivered.
    pub default: Option<Value>,
    /// `ParameterValue`: the value that a DCF gives the device.
    pub parameter: Option<Value>,
    /// `LowLimit`.
    pub lowest: Option<Value>,
    /// `HighLimit`.
    pub highest: Option<Value>,
    /// `PDOMapping`.
    pub is_mappable: bool,
    /// Line of its section.
    pub line: usize,
}

impl Access {
    /// Whether a client may read the entry.
    pub const fn is_readable(self) -> bool {
        !matches!(self, Self::WriteOnly)
    }

    /// Whether a client may write the entry.
    pub const fn is_writable(self) -> bool {
        !matches!(self, Self::Constant | Self::ReadOnly)
    }
}

impl Entry {
    /// The value of the device: that of the configuration, else that as delivered.
    pub const fn value(&self) -> Option<&Value> {
        match &self.parameter {
            Some(value) => Some(value),
            None => self.default.as_ref(),
        }
    }

    /// The bytes of a value on the bus, little endian. None where the type and the value do not fit.
    pub fn encode(&self, value: &Value, node: NodeId) -> Option<Vec<u8>> {
        let bytes = self.data_type.bits().map(|bits| bits as usize / 8);
        match (value, bytes) {
            (Value::Real(real), Some(4)) => Some((*real as f32).to_le_bytes().to_vec()),
            (Value::Real(real), _) => Some(real.to_le_bytes().to_vec()),
            (Value::Text(text), None) => Some(text.as_bytes().to_vec()),
            (value, Some(bytes)) => Some(value.number(node)?.to_le_bytes()[..bytes].to_vec()),
            (Value::Number(_) | Value::OfNode(_), None) => None,
        }
    }

    /// Reads the section of an entry.
    pub(super) fn read(section: &Section<'_>, address: ObjectAddress) -> Result<Self, DcfError> {
        let kind = section.get("ObjectType").map(|field| plain("ObjectType", field, 0xFF)).transpose()?;
        // CiA 306 lets a domain leave out what is the same for all of them.
        let may_omit = |key| kind == Some(DOMAIN_OBJECT) && section.get(key).is_none();
        let data_type = if may_omit("DataType") {
            DataType::DOMAIN
        } else {
            DataType(plain("DataType", section.require("DataType")?, u16::MAX)?)
        };
        let access = if may_omit("AccessType") {
            Access::ReadWrite
        } else {
            let field = section.require("AccessType")?;
            access(field.text).map_err(|problem| problem.at(field.line))?
        };
        let value = |key| section.get(key).map(|field| Value::read(key, field, data_type)).transpose();
        let mapping = section.get("PDOMapping").map(|field| plain("PDOMapping", field, 1)).transpose()?;
        Ok(Self {
            address,
            name: section.require("ParameterName")?.text.to_owned(),
            data_type,
            access,
            default: value("DefaultValue")?,
            parameter: value("ParameterValue")?,
            lowest: value("LowLimit")?,
            highest: value("HighLimit")?,
            is_mappable: mapping == Some(1),
            line: section.line,
        })
    }
}

fn access(text: &str) -> Result<Access, Problem> {
    Ok(match text.to_ascii_lowercase().as_str() {
        "const" => Access::Constant,
        "ro" => Access::ReadOnly,
        "wo" => Access::WriteOnly,
        "rw" => Access::ReadWrite,
        "rwr" => Access::ReadWriteTpdo,
        "rww" => Access::ReadWriteRpdo,
        _ => return Err(Problem::UnknownAccess { text: text.to_owned() }),
    })
}
