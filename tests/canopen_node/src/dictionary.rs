//! The object dictionary: values with the access, length and limits that a description gives them.

use std::collections::BTreeMap;

use masseter_can::canopen::NodeId;
use masseter_can::canopen::dcf::{self, Dcf};

use crate::abort::Abort;

/// Index and sub-index.
pub(crate) type Address = (u16, u8);

#[derive(Debug, Clone)]
struct Entry {
    description: dcf::Entry,
    /// Little endian.
    value: Vec<u8>,
    delivered: Vec<u8>,
    lowest: Option<i128>,
    highest: Option<i128>,
}

/// All objects of the node.
#[derive(Debug, Clone)]
pub(crate) struct Dictionary(BTreeMap<Address, Entry>);

impl Dictionary {
    /// Every value as the description has it; 0 or an empty text where it has none.
    pub(crate) fn new(dcf: &Dcf, node: NodeId) -> Self {
        let entry = |description: &dcf::Entry| {
            let zero = || vec![0; size(description).unwrap_or(0)];
            let value = description.value().and_then(|value| encode(description, value, node));
            let value = value.unwrap_or_else(zero);
            let number = |limit: &Option<dcf::Value>| limit.as_ref().and_then(|limit| limit.number(node));
            let (lowest, highest) = (number(&description.lowest), number(&description.highest));
            let delivered = value.clone();
            Entry { description: description.clone(), value, delivered, lowest, highest }
        };
        let addressed = |description: &dcf::Entry| {
            ((description.address.index, description.address.subindex), entry(description))
        };
        Self(dcf.entries().map(addressed).collect())
    }

    /// Whether the entry exists.
    pub(crate) fn has(&self, address: Address) -> bool {
        self.0.contains_key(&address)
    }

    /// The entries of an object that have values of their own.
    pub(crate) fn subindices(&self, index: u16) -> impl Iterator<Item = u8> {
        self.0.range((index, 1)..=(index, u8::MAX)).map(|((_, subindex), _)| *subindex)
    }

    /// The entry's value; 0 where there is none.
    pub(crate) fn number(&self, address: Address) -> i64 {
        self.0.get(&address).map_or(0, |entry| number(&entry.description, &entry.value))
    }

    /// The bytes of a value that the device shows; none where it has no such entry.
    pub(crate) fn bytes(&self, address: Address) -> Option<&[u8]> {
        self.0.get(&address).map(|entry| entry.value.as_slice())
    }

    /// Sets a value of the device's own; nothing where it has no such entry.
    pub(crate) fn put(&mut self, address: Address, number: i64) {
        self.set(address, &number.to_le_bytes());
    }

    /// Takes as many bytes as the entry has.
    pub(crate) fn set(&mut self, address: Address, bytes: &[u8]) {
        if let Some(entry) = self.0.get_mut(&address) {
            let length = size(&entry.description).unwrap_or(bytes.len());
            entry.value.clear();
            entry.value.extend_from_slice(&bytes[..length]);
        }
    }

    /// The value for a client.
    pub(crate) fn read(&self, address: Address) -> Result<&[u8], Abort> {
        let entry = self.find(address)?;
        if entry.description.access.is_readable() { Ok(&entry.value) } else { Err(Abort::WRITE_ONLY) }
    }

    /// The number that a client may write. Without a size in the request the entry's own counts.
    pub(crate) fn writable(&self, address: Address, bytes: &[u8], is_sized: bool) -> Result<i64, Abort> {
        let entry = self.find(address)?;
        if !entry.description.access.is_writable() {
            return Err(Abort::READ_ONLY);
        }
        let length = size(&entry.description).unwrap_or(bytes.len());
        if bytes.len() < length {
            return Err(Abort::TOO_SHORT);
        }
        if is_sized && bytes.len() > length {
            return Err(Abort::TOO_LONG);
        }
        let number = number(&entry.description, &bytes[..length]);
        if entry.highest.is_some_and(|highest| i128::from(number) > highest) {
            return Err(Abort::TOO_HIGH);
        }
        if entry.lowest.is_some_and(|lowest| i128::from(number) < lowest) {
            return Err(Abort::TOO_LOW);
        }
        Ok(number)
    }

    /// Bits of the entry if a PDO of that direction may carry it.
    pub(crate) fn mappable_bits(&self, address: Address, is_received: bool) -> Option<u32> {
        let description = &self.0.get(&address)?.description;
        let access = description.access;
        let is_carried = match access {
            dcf::Access::ReadWriteTpdo => !is_received,
            dcf::Access::ReadWriteRpdo => is_received,
            _ if is_received => access.is_writable(),
            _ => access.is_readable(),
        };
        description.data_type.bits().filter(|_| description.is_mappable && is_carried)
    }

    /// Entries that clients may write, with their values.
    pub(crate) fn settable(&self) -> impl Iterator<Item = (Address, &[u8])> {
        let settable = self.0.iter().filter(|(_, entry)| entry.description.access.is_writable());
        settable.map(|(address, entry)| (*address, entry.value.as_slice()))
    }

    /// Values as delivered, from that index up to the other.
    pub(crate) fn reset(&mut self, first: u16, last: u16) {
        for entry in self.0.range_mut((first, 0)..=(last, u8::MAX)).map(|(_, entry)| entry) {
            entry.value.clone_from(&entry.delivered);
        }
    }

    fn find(&self, address: Address) -> Result<&Entry, Abort> {
        let has_object = || self.0.range((address.0, 0)..=(address.0, u8::MAX)).next().is_some();
        let missing = || if has_object() { Abort::NO_SUBINDEX } else { Abort::NO_OBJECT };
        self.0.get(&address).ok_or_else(missing)
    }
}

/// Bytes of every value; none for texts.
fn size(description: &dcf::Entry) -> Option<usize> {
    description.data_type.bits().map(|bits| bits as usize / 8)
}

fn number(description: &dcf::Entry, bytes: &[u8]) -> i64 {
    let is_negative = description.data_type.is_signed() && bytes.last().is_some_and(|last| last & 0x80 != 0);
    let start = if is_negative { -1 } else { 0 };
    bytes.iter().take(8).rfold(start, |number, byte| number << 8 | i64::from(*byte))
}

/// The bytes of a value on the bus, little endian. None where the type and the value do not fit.
fn encode(description: &dcf::Entry, value: &dcf::Value, node: NodeId) -> Option<Vec<u8>> {
    match (value, size(description)) {
        (dcf::Value::Real(real), Some(4)) => Some((*real as f32).to_le_bytes().to_vec()),
        (dcf::Value::Real(real), _) => Some(real.to_le_bytes().to_vec()),
        (dcf::Value::Text(text), None) => Some(text.as_bytes().to_vec()),
        (value, Some(bytes)) => Some(value.number(node)?.to_le_bytes()[..bytes].to_vec()),
        (dcf::Value::Number(_) | dcf::Value::OfNode(_), None) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_has_the_bytes_that_the_bus_carries() {
        let bytes = |data_type: &str, text: &str| {
            let entry =
                format!("ParameterName=Some\nAccessType=rw\nDataType={data_type}\nDefaultValue={text}");
            let dcf = Dcf::parse(&format!("[2000]\n{entry}")).unwrap();
            let entry = dcf.entries().next().unwrap();
            encode(entry, entry.value().unwrap(), NodeId::new(5).unwrap()).unwrap()
        };
        assert_eq!(bytes("7", "$NODEID+0x180"), [0x85, 1, 0, 0]);
        assert_eq!(bytes("2", "-3"), [0xFD]);
        assert_eq!(bytes("9", "Kiefer"), b"Kiefer");
        assert_eq!(bytes("8", "1.0"), [0, 0, 0x80, 0x3F]);
    }
}
