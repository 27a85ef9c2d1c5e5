//! A whole description: its sections brought into the order of addresses.

use std::collections::{BTreeMap, HashMap};

use super::data_type::DataType;
use super::entry::{Access, Entry};
use super::error::{DcfError, Problem};
use super::ini::Section;
use super::value::{Value, plain};
use crate::canopen::ObjectAddress;

const VARIABLES: [u16; 4] = [0x2, 0x5, 0x6, 0x7];
const COLLECTIONS: [u16; 2] = [0x8, 0x9];

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
    /// In the order of addresses.
    entries: BTreeMap<(u16, u8), Entry>,
    node_id: Option<u8>,
}

impl Dcf {
    /// Reads a description.
    ///
    /// # Errors
    /// [`DcfError`] with the first line that cannot be read.
    pub fn parse(text: &str) -> Result<Self, DcfError> {
        let sections = Section::read_all(text)?;
        let by_name: HashMap<_, _> =
            sections.iter().map(|section| (section.name.to_ascii_lowercase(), section)).collect();
        let mut dcf = Self::default();
        for section in &sections {
            if let Some(index) = index(section.name) {
                dcf.add_object(index, section, &by_name)?;
            } else if let Some((index, subindex)) = sub_index(section.name) {
                if !by_name.contains_key(&format!("{index:04x}")) {
                    return Err(Problem::NoObject { index, subindex }.at(section.line));
                }
                dcf.add(Entry::read(section, ObjectAddress::new(index, subindex))?);
            }
        }
        // The name of this section has one m in CiA 306.
        let node_id = by_name.get("devicecomissioning").and_then(|section| section.get("NodeID"));
        dcf.node_id = node_id.map(|field| plain("NodeID", field, 0xFF)).transpose()?.map(|id| id as u8);
        Ok(dcf)
    }

    /// All entries, in the order of addresses.
    pub fn entries(&self) -> impl ExactSizeIterator<Item = &Entry> {
        self.entries.values()
    }

    /// The entry of that address.
    pub fn entry(&self, address: ObjectAddress) -> Option<&Entry> {
        self.entries.get(&(address.index, address.subindex))
    }

    /// Whether the device has an object of that index.
    pub fn has_object(&self, index: u16) -> bool {
        self.entries.range((index, 0)..=(index, u8::MAX)).next().is_some()
    }

    /// The node id that a DCF gives the device; 255 where the device has none.
    pub const fn node_id(&self) -> Option<u8> {
        self.node_id
    }

    fn add(&mut self, entry: Entry) {
        self.entries.insert((entry.address.index, entry.address.subindex), entry);
    }

    /// Adds an object without sub-indices, or the entries of a compact array. Others have sections of their own.
    fn add_object(
        &mut self,
        index: u16,
        section: &Section<'_>,
        by_name: &HashMap<String, &Section<'_>>,
    ) -> Result<(), DcfError> {
        let kind = section.get("ObjectType").map(|field| plain("ObjectType", field, 0xFF)).transpose()?;
        let kind = kind.unwrap_or(0x7);
        if VARIABLES.contains(&kind) {
            self.add(Entry::read(section, ObjectAddress::new(index, 0))?);
        } else if !COLLECTIONS.contains(&kind) {
            return Err(Problem::UnknownObjectType { code: kind as u8 }.at(section.line));
        } else if let Some(field) = section.get("CompactSubObj")
            && let count @ 1.. = plain("CompactSubObj", field, 0xFE)?
        {
            let part = |suffix| by_name.get(&format!("{index:04x}{suffix}")).copied();
            self.add_compact(section, index, count as u8, part("name"), part("value"))?;
        }
        Ok(())
    }

    /// The entries of an array that is described once for all of them.
    fn add_compact(
        &mut self,
        section: &Section<'_>,
        index: u16,
        count: u8,
        names: Option<&Section<'_>>,
        values: Option<&Section<'_>>,
    ) -> Result<(), DcfError> {
        let common = Entry::read(section, ObjectAddress::new(index, 0))?;
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
            let value = value.map(|field| Value::read(&key, field, common.data_type)).transpose()?;
            self.add(Entry {
                address: ObjectAddress::new(index, subindex),
                name: name.unwrap_or_else(|| format!("{}{key}", common.name)),
                default: value.or_else(|| common.default.clone()),
                ..common.clone()
            });
        }
        Ok(())
    }
}

/// The index in the name of an object's section.
fn index(name: &str) -> Option<u16> {
    (name.len() == 4).then(|| hexadecimal(name)).flatten()
}

/// Index and sub-index in the name of an entry's section.
fn sub_index(name: &str) -> Option<(u16, u8)> {
    let name = name.to_ascii_lowercase();
    let (object, subindex) = name.split_once("sub")?;
    Some((index(object)?, u8::try_from(hexadecimal(subindex)?).ok()?))
}

fn hexadecimal(digits: &str) -> Option<u16> {
    // The parser itself would take a sign.
    let is_plain = digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    is_plain.then(|| u16::from_str_radix(digits, 16).ok()).flatten()
}
