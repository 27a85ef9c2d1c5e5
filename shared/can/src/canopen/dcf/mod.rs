//! Device descriptions: electronic data sheets (EDS) and device configuration files (DCF) in the format of CiA 306-1.
//!
//! [`Dcf::parse`] reads the entries of the object dictionary with their types, access, limits and values, and the node
//! that a configuration is for. The parser skips the sections on the file, its device, bit rates and dummy mapping. The
//! caller converts texts of other code pages to UTF-8: `String::from_utf8_lossy` changes names alone.
//!
//! Time and memory grow with the length of the text alone: lines and compact arrays have an upper limit.

use std::collections::{BTreeMap, HashMap};

use super::ObjectAddress;
use crate::frame::read_hex;

#[cfg(test)]
mod tests;
mod text;

pub use text::{DataType, DcfError, Value};
use text::{Field, Section};

/// A description of a device.
///
/// # Examples
/// ```
/// use masseter_can::canopen::ObjectAddress;
/// use masseter_can::canopen::dcf::{Dcf, Value};
///
/// let dcf = Dcf::parse("[6065]\nParameterName=Window\nDataType=0x7\nAccessType=rw\nDefaultValue=2000\n")?;
/// let window = dcf.entry(ObjectAddress::new(0x6065, 0)).expect("it is there");
/// assert_eq!(window.value(), Some(&Value::Number(2000)));
///
/// let error = Dcf::parse("[6065]\nParameterName=Window\nDataType=seven\n").unwrap_err();
/// assert_eq!(error.line, 3);
/// # Ok::<(), masseter_can::canopen::dcf::DcfError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Dcf {
    /// The node and the bit rate that the file is for.
    pub commissioning: Commissioning,
    /// Objects in the lists of the file without a section: the file is cut short, or its lists are wrong.
    pub undescribed: Vec<u16>,
    /// Objects that modules of a modular device add, by sections such as `[M1SubExt6200]`: they are not among the entries.
    pub of_modules: Vec<u16>,
    entries: BTreeMap<ObjectAddress, Entry>,
}

/// Names of the section that CiA 306 calls `DeviceComissioning`; many tools mend the spelling.
const COMMISSIONING: [&str; 2] = ["devicecomissioning", "devicecommissioning"];

/// The lists of the objects that a file describes.
const LISTS: [&str; 3] = ["mandatoryobjects", "optionalobjects", "manufacturerobjects"];
/// Most bytes for the entries of compact arrays: 1000 arrays of 254 entries. A short text describes all of these.
const MOST_COMPACT_BYTES: usize = 64 << 20;
/// Keys that entries alone have.
const OF_ENTRY: [&str; 3] = ["DataType", "AccessType", "ParameterValue"];

/// The node and the bit rate that a configuration is for; `None` if the file has none, or 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Commissioning {
    /// `NodeID`.
    pub node_id: Option<u16>,
    /// `Baudrate`, kbit/s.
    pub baudrate_kbit_s: Option<u16>,
}

impl Commissioning {
    fn read(section: &Section<'_>) -> Result<Self, DcfError> {
        let named = |key| section.number(key, u16::MAX).map(|number| number.filter(|&number| number > 0));
        Ok(Self { node_id: named("NodeID")?, baudrate_kbit_s: named("Baudrate")? })
    }
}

impl Dcf {
    /// Reads a description.
    ///
    /// # Errors
    /// [`DcfError`] with the first line in error.
    pub fn parse(text: &str) -> Result<Self, DcfError> {
        let sections = Section::read_all(text)?;
        let by_name: HashMap<_, _> =
            sections.iter().map(|section| (section.name.to_ascii_lowercase(), section)).collect();
        let (mut dcf, mut room) = (Self::default(), MOST_COMPACT_BYTES);
        for section in COMMISSIONING.iter().filter_map(|name| by_name.get(*name)) {
            let Commissioning { node_id, baudrate_kbit_s } = Commissioning::read(section)?;
            dcf.commissioning.node_id = dcf.commissioning.node_id.or(node_id);
            dcf.commissioning.baudrate_kbit_s = dcf.commissioning.baudrate_kbit_s.or(baudrate_kbit_s);
        }
        for list in LISTS.iter().filter_map(|name| by_name.get(*name)) {
            let listed = list.numbered(u16::MAX)?;
            dcf.undescribed
                .extend(listed.into_iter().filter(|index| !by_name.contains_key(&format!("{index:04x}"))));
        }
        for section in &sections {
            if let Some(index) = index(section.name) {
                dcf.add_object(index, section, &by_name, &mut room)?;
            } else if let Some((index, subindex)) = sub_index(section.name) {
                if !by_name.contains_key(&format!("{index:04x}")) {
                    let of = format!("[{index:04X}sub{subindex:X}] has no section [{index:04X}]");
                    return Err(section.refused(format!("{of} of its object; add it")));
                }
                dcf.add(Entry::read(section, ObjectAddress::new(index, subindex))?);
            } else if let Some(index) = of_module(section.name) {
                dcf.of_modules.push(index);
            } else if !is_beside_entries(section.name)
                && OF_ENTRY.iter().any(|key| section.get(key).is_some())
            {
                let need = "name an entry by four hexadecimal digits, such as [6065] or [60C2sub1]";
                return Err(section.refused(format!("[{}] is the name of no entry; {need}", section.name)));
            }
        }
        dcf.of_modules.sort_unstable();
        dcf.of_modules.dedup();
        Ok(dcf)
    }

    /// All entries, in the order of addresses.
    pub fn entries(&self) -> impl ExactSizeIterator<Item = &Entry> {
        self.entries.values()
    }

    /// The entry at the address.
    pub fn entry(&self, address: ObjectAddress) -> Option<&Entry> {
        self.entries.get(&address)
    }

    fn add(&mut self, entry: Entry) {
        self.entries.insert(entry.address, entry);
    }

    /// Adds an object without sub-indices, or the entries of a compact array. Others have sections of their own.
    fn add_object(
        &mut self,
        index: u16,
        section: &Section<'_>,
        by_name: &HashMap<String, &Section<'_>>,
        room: &mut usize,
    ) -> Result<(), DcfError> {
        match section.number("ObjectType", 0xFF)?.unwrap_or(0x7) {
            DOMAIN_OBJECT | 0x5..=0x7 => self.add(Entry::read(section, ObjectAddress::new(index, 0))?),
            0x8 | 0x9 => {
                if let Some(count @ 1..) = section.number("CompactSubObj", 0xFE)? {
                    self.add_compact(index, count as u8, section, by_name, room)?;
                }
            }
            kind => {
                let known = "2 (domain), 5, 6, 7 (variable), 8 (array), 9 (record)";
                return Err(section.refused(format!("ObjectType={kind:#X} is not one of {known}")));
            }
        }
        Ok(())
    }

    /// The entries of an array with one description for all.
    fn add_compact(
        &mut self,
        index: u16,
        count: u8,
        section: &Section<'_>,
        by_name: &HashMap<String, &Section<'_>>,
        room: &mut usize,
    ) -> Result<(), DcfError> {
        let part = |suffix| by_name.get(&format!("{index:04x}{suffix}"));
        let (names, values) = (part("name"), part("value"));
        let common = Entry::read(section, ObjectAddress::new(index, 0))?;
        *room = room.checked_sub(usize::from(count) * common.bytes()).ok_or_else(|| {
            let most =
                format!("{} MiB with its compact arrays up to [{index:04X}]", MOST_COMPACT_BYTES >> 20);
            section.refused(format!("the description needs more than {most}; lower CompactSubObj"))
        })?;
        self.add(Entry {
            name: "Highest sub-index supported".to_owned(),
            data_type: DataType::U8,
            access: Access::ReadOnly,
            default: Some(Value::Number(count.into())),
            parameter: None,
            lowest: None,
            highest: None,
            is_mappable: false,
            ..common.clone()
        });
        for subindex in 1..=count {
            let key = subindex.to_string();
            let name = names.and_then(|names| names.get(&key)).map(|field| field.text.to_owned());
            let value = values.and_then(|values| values.get(&key));
            let value = value.map(|field| Value::read(field, common.data_type)).transpose()?;
            self.add(Entry {
                address: ObjectAddress::new(index, subindex),
                name: name.unwrap_or_else(|| format!("{}{key}", common.name)),
                parameter: value.or_else(|| common.parameter.clone()),
                ..common.clone()
            });
        }
        Ok(())
    }
}

/// Whether a section belongs to a module of a modular device, such as `[M1SubExt6200]`, or to a compact array.
fn is_beside_entries(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    let is_of_module = |rest: &str| rest.starts_with(|digit: char| digit.is_ascii_digit());
    let is_of_array = ["name", "value"].iter().any(|part| name.ends_with(part));
    is_of_array || name.strip_prefix('m').is_some_and(is_of_module)
}

/// The index in the name of an object's section.
fn index(name: &str) -> Option<u16> {
    u16::try_from(read_hex(name)?).ok().filter(|_| name.len() == 4)
}

/// Index and sub-index in the name of an entry's section.
fn sub_index(name: &str) -> Option<(u16, u8)> {
    let name = name.to_ascii_lowercase();
    let (object, subindex) = name.split_once("sub")?;
    Some((index(object)?, u8::try_from(read_hex(subindex)?).ok()?))
}

/// The index in the name of a section by which a module extends or adds an object.
fn of_module(name: &str) -> Option<u16> {
    let name = name.to_ascii_lowercase();
    let rest = name.strip_prefix('m')?.trim_start_matches(|digit: char| digit.is_ascii_digit());
    index(rest.strip_prefix("subext").or(rest.strip_prefix("fixed"))?.get(..4)?)
}

/// `ObjectType` of a domain.
const DOMAIN_OBJECT: u16 = 0x2;

/// Who may access an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Access {
    /// A constant, also for the device.
    Constant,
    /// Clients may read the entry.
    ReadOnly,
    /// Clients may write the entry.
    WriteOnly,
    /// Clients may read and write the entry.
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
    /// `DefaultValue`: the value of a new device.
    pub default: Option<Value>,
    /// `ParameterValue`: the configured value of a DCF.
    pub parameter: Option<Value>,
    /// `LowLimit`.
    pub lowest: Option<Value>,
    /// `HighLimit`.
    pub highest: Option<Value>,
    /// `PDOMapping`.
    pub is_mappable: bool,
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
    /// The configured value, else the value of a new device.
    pub fn value(&self) -> Option<&Value> {
        self.parameter.as_ref().or(self.default.as_ref())
    }

    /// Bytes that the entry takes in memory.
    fn bytes(&self) -> usize {
        let values = [&self.default, &self.parameter, &self.lowest, &self.highest];
        let texts = values.into_iter().flatten().map(|value| match value {
            Value::Text(text) => text.len(),
            Value::Number(_) | Value::OfNode(_) | Value::Real(_) => 0,
        });
        size_of::<Self>() + self.name.len() + texts.sum::<usize>()
    }

    /// Reads the section of an entry.
    fn read(section: &Section<'_>, address: ObjectAddress) -> Result<Self, DcfError> {
        let kind = section.number("ObjectType", 0xFF)?;
        // By CiA 306 a domain may omit the keys whose values are the same for all domains.
        let may_omit = |key| kind == Some(DOMAIN_OBJECT) && section.get(key).is_none();
        let data_type = if may_omit("DataType") {
            DataType::DOMAIN
        } else {
            DataType(section.require("DataType")?.number(u16::MAX)?)
        };
        let access = if may_omit("AccessType") {
            Access::ReadWrite
        } else {
            access_type(section.require("AccessType")?)?
        };
        let value = |key| section.get(key).map(|field| Value::read(field, data_type)).transpose();
        let is_mappable = section.number("PDOMapping", 1)? == Some(1);
        Ok(Self {
            address,
            name: section.require("ParameterName")?.text.to_owned(),
            data_type,
            access,
            default: value("DefaultValue")?,
            parameter: value("ParameterValue")?,
            lowest: value("LowLimit")?,
            highest: value("HighLimit")?,
            is_mappable,
        })
    }
}

fn access_type(field: Field<'_>) -> Result<Access, DcfError> {
    Ok(match field.text.to_ascii_lowercase().as_str() {
        "const" => Access::Constant,
        "ro" => Access::ReadOnly,
        "wo" => Access::WriteOnly,
        "rw" => Access::ReadWrite,
        "rwr" => Access::ReadWriteTpdo,
        "rww" => Access::ReadWriteRpdo,
        _ => return Err(field.refused("not one of ro, wo, rw, rwr, rww, const")),
    })
}
