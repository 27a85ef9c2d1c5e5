//! The numbers in a message, by the ROS 2 message definition in the recording. So recordings of other versions work
//! too. The definition's comments give units and meanings.
//!
//! A definition may hold numbers, arrays of fixed length, and one byte sequence at its end. Other definitions, and those
//! of messages longer than any of the rig's, are refused.

use std::{collections::BTreeMap, fmt};

use masseter_runtime::messages::{FrameTap, Message};
use mcap::Channel;

use crate::{encoding::FrameBatch, topic::Topic};

/// A primitive type of the definition language.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Unsigned(usize),
    Signed(usize),
    Float(usize),
}

impl Kind {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "bool" | "uint8" | "byte" | "char" => Self::Unsigned(1),
            "uint16" => Self::Unsigned(2),
            "uint32" => Self::Unsigned(4),
            "uint64" => Self::Unsigned(8),
            "int8" => Self::Signed(1),
            "int16" => Self::Signed(2),
            "int32" => Self::Signed(4),
            "int64" => Self::Signed(8),
            "float32" => Self::Float(4),
            "float64" => Self::Float(8),
            _ => return None,
        })
    }

    fn size(self) -> usize {
        let (Self::Unsigned(size) | Self::Signed(size) | Self::Float(size)) = self;
        size
    }

    /// The little-endian number at the beginning of `bytes`.
    fn number(self, bytes: &[u8]) -> Number {
        let mut wide = [0; 8];
        wide[..self.size()].copy_from_slice(&bytes[..self.size()]);
        let unsigned = u64::from_le_bytes(wide);
        let unused = 64 - 8 * self.size() as u32;
        match self {
            Self::Unsigned(_) => Number::Whole(unsigned.into()),
            Self::Signed(_) => Number::Whole(((unsigned << unused).cast_signed() >> unused).into()),
            Self::Float(4) => Number::Real(f32::from_bits(unsigned as u32).into()),
            Self::Float(_) => Number::Real(f64::from_bits(unsigned)),
        }
    }
}

/// A number of a message. As text it has as many digits as give the same number again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// An integer.
    Whole(i128),
    /// A float.
    Real(f64),
}

impl Number {
    /// The number as a whole one; a fraction is cut off.
    pub fn to_i64(self) -> i64 {
        match self {
            Self::Whole(value) => value as i64,
            Self::Real(value) => value as i64,
        }
    }

    /// The number as a float.
    pub fn to_f64(self) -> f64 {
        match self {
            Self::Whole(value) => value as f64,
            Self::Real(value) => value,
        }
    }
}

impl fmt::Display for Number {
    fn fmt(&self, text: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Whole(value) => value.fmt(text),
            Self::Real(value) => masseter_scenario::wording::shortest(*value).fmt(text),
        }
    }
}

/// Most bytes of a message, and so most columns. No message of the rig is longer.
const MAX_MESSAGE_BYTES: usize = u16::MAX as usize;

/// The length before a byte sequence.
const LENGTH: Kind = Kind::Unsigned(4);

/// Whether the type of a field is a byte sequence, with or without a bound.
fn is_byte_sequence(kind: &str) -> bool {
    kind.strip_prefix("uint8[").is_some_and(|bound| bound == "]" || bound.starts_with("<="))
}

/// A field of numbers: one, or an array of them. Fields of one name and place are equal, whatever is said of them.
#[derive(Debug, Clone)]
pub struct Field {
    name: String,
    kind: Kind,
    /// Byte offset behind the CDR header.
    offset: usize,
    /// None for a single number.
    elements: Option<usize>,
    /// What the definition says of it.
    pub description: Description,
}

impl PartialEq for Field {
    fn eq(&self, other: &Self) -> bool {
        let place = |field: &Self| (field.kind, field.offset, field.elements);
        self.name == other.name && place(self) == place(other)
    }
}

impl Field {
    /// Its name, which ends with the unit.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether it is an array.
    pub fn is_array(&self) -> bool {
        self.elements.is_some()
    }

    /// Whether its numbers have no fractions.
    pub fn is_integer(&self) -> bool {
        !matches!(self.kind, Kind::Float(_))
    }

    /// Its bytes in the body of a message.
    pub fn bytes<'a>(&self, body: &'a [u8]) -> &'a [u8] {
        &body[self.offset..][..self.kind.size() * self.elements.unwrap_or(1)]
    }

    /// Its numbers in the body of a message.
    pub fn numbers(&self, body: &[u8]) -> impl Iterator<Item = Number> {
        self.bytes(body).chunks_exact(self.kind.size()).map(|bytes| self.kind.number(bytes))
    }

    /// The names of its columns.
    pub fn columns(&self) -> impl Iterator<Item = String> {
        let name =
            |element| if self.is_array() { format!("{}_{element}", self.name) } else { self.name.clone() };
        (0..self.elements.unwrap_or(1)).map(name)
    }
}

/// The table of a message definition.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    fields: Vec<Field>,
    /// Bytes of the fields.
    bytes: usize,
    /// The byte sequence at the end, a column in hexadecimal digits.
    tail: Option<Field>,
}

impl Columns {
    /// Parses a definition; none if it does not fit a table.
    pub fn from_definition(definition: &str) -> Option<Self> {
        let mut table = Self { fields: Vec::new(), bytes: 0, tail: None };
        for line in definition.lines() {
            let (field, comment) = line.split_once('#').unwrap_or((line, ""));
            if !field.trim().is_empty() {
                table.add_field(field.trim(), Description::parse(comment.trim()))?;
            }
        }
        Some(table)
    }

    /// The tables of the rig's topics among these channels.
    pub fn of_topics<'a>(channels: impl Iterator<Item = &'a Channel<'static>>) -> BTreeMap<Topic, Self> {
        let table = |channel: &Channel| {
            if channel.topic == FrameBatch::TOPIC {
                return Some((Topic::Frame, Self::from_definition(&FrameTap::definition())?));
            }
            let definition = str::from_utf8(&channel.schema.as_ref()?.data).ok()?;
            Some((Topic::named(&channel.topic)?, Self::from_definition(definition)?))
        };
        channels.filter_map(table).collect()
    }

    fn add_field(&mut self, line: &str, description: Description) -> Option<()> {
        let (kind, name) = line.split_once(char::is_whitespace)?;
        let name = name.trim().to_owned();
        if self.tail.is_some() {
            return None;
        }
        if is_byte_sequence(kind) {
            self.bytes = self.bytes.next_multiple_of(LENGTH.size()) + LENGTH.size();
            let (kind, offset) = (Kind::Unsigned(1), self.bytes);
            self.tail = Some(Field { name, kind, offset, elements: None, description });
            return Some(());
        }
        let (kind, elements) = match kind.split_once('[') {
            Some((kind, length)) => (kind, Some(length.strip_suffix(']')?.parse::<usize>().ok()?)),
            None => (kind, None),
        };
        let kind = Kind::named(kind)?;
        // CDR aligns each primitive to its own size.
        self.bytes = self.bytes.next_multiple_of(kind.size());
        if elements.unwrap_or(1) > MAX_MESSAGE_BYTES.saturating_sub(self.bytes) / kind.size() {
            return None;
        }
        self.fields.push(Field { name, kind, offset: self.bytes, elements, description });
        self.bytes += kind.size() * elements.unwrap_or(1);
        Some(())
    }

    /// The fields of numbers.
    pub fn fields(&self) -> &[Field] {
        &self.fields
    }

    /// The byte sequence at the end, if there is one.
    pub fn tail(&self) -> Option<&Field> {
        self.tail.as_ref()
    }

    /// The fields and the byte sequence of a message; none if its length differs from the definition's.
    pub fn split<'a>(&self, body: &'a [u8]) -> Option<(&'a [u8], &'a [u8])> {
        let (fixed, tail) = body.split_at_checked(self.bytes)?;
        let fits = match self.tail {
            Some(_) => fixed.ends_with(&(tail.len() as u32).to_le_bytes()),
            None => tail.is_empty(),
        };
        fits.then_some((fixed, tail))
    }
}

/// What a comment says of a field: `[unit] Meaning. 0 = one_name, 1 = other_name`, of which each part may be missing.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Description {
    /// The unit of its values; empty where they have none.
    pub unit: String,
    /// What it is.
    pub meaning: String,
    /// The names of its values by their numbers; empty where it is no enumeration.
    pub codes: BTreeMap<u64, String>,
}

impl Description {
    fn parse(comment: &str) -> Self {
        let unit = comment.strip_prefix('[').and_then(|rest| rest.split_once("] "));
        let (unit, text) = unit.unwrap_or(("", comment));
        let listed = text.rsplit_once(". ").and_then(|(meaning, list)| Some((meaning, codes(list)?)));
        match listed {
            Some((meaning, codes)) => Self { unit: unit.to_owned(), meaning: format!("{meaning}."), codes },
            None => Self { unit: unit.to_owned(), meaning: text.to_owned(), codes: BTreeMap::new() },
        }
    }
}

/// The names of `0 = one_name, 1 = other_name`.
fn codes(list: &str) -> Option<BTreeMap<u64, String>> {
    let code = |part: &str| {
        let (number, name) = part.split_once(" = ")?;
        Some((number.parse().ok()?, name.to_owned()))
    };
    list.split(", ").map(code).collect()
}

#[cfg(test)]
mod tests {
    use data_encoding::HEXUPPER;
    use masseter_runtime::messages::codes::{Cause, DriveState};
    use masseter_runtime::messages::{CanData, Event, FrameTap, Message, Reading};

    use super::*;

    fn line(columns: &Columns, body: &[u8]) -> Option<String> {
        let (fixed, tail) = columns.split(body)?;
        let numbers = columns.fields().iter().flat_map(|field| field.numbers(fixed));
        let tail = columns.tail().map(|_| HEXUPPER.encode(tail));
        Some(numbers.map(|number| number.to_string()).chain(tail).collect::<Vec<_>>().join(","))
    }

    fn names(columns: &Columns) -> Vec<String> {
        columns
            .fields()
            .iter()
            .flat_map(Field::columns)
            .chain(columns.tail().map(|tail| tail.name.clone()))
            .collect()
    }

    #[test]
    fn a_message_of_the_rig_becomes_a_row() {
        let columns = Columns::from_definition(&FrameTap::schema()).unwrap();
        let names = names(&columns).join(",");
        assert_eq!(names, "seq,published_ns,version,time_ns,queued_ns,id,bus,flags,data");
        for length in 0..3 {
            let data = CanData::new(&[0xAA; 3][..length]);
            let frame = FrameTap { seq: 3, id: 0x181, bus: 1, data, ..Default::default() };
            let row = "3,0,0,0,0,385,1,0,".to_owned() + &"AA".repeat(length);
            assert_eq!(line(&columns, frame.body()), Some(row));
            assert_eq!(line(&columns, &frame.body()[..frame.body().len() - 1]), None);
            assert_eq!(line(&columns, &[frame.body(), &[0]].concat()), None);
        }
        assert_eq!(Columns::from_definition(&Reading::schema()).unwrap().bytes, size_of::<Reading>());
    }

    #[test]
    fn signs_fractions_and_alignment_are_kept() {
        let columns =
            Columns::from_definition("int8 a # sign\n\nfloat32 b\nint16[2] c\nfloat64 d\n").unwrap();
        let mut body = vec![0xff, 0, 0, 0];
        body.extend(0.5f32.to_le_bytes());
        body.extend((-2i16).to_le_bytes());
        body.extend(300i16.to_le_bytes());
        body.extend([0; 4]);
        body.extend((-0.1f64).to_le_bytes());
        assert_eq!(names(&columns), ["a", "b", "c_0", "c_1", "d"]);
        assert_eq!(line(&columns, &body).as_deref(), Some("-1,0.5,-2,300,-0.1"));
    }

    #[test]
    fn definitions_that_fit_no_table_are_refused() {
        for definition in [
            "string name",
            "float64[] values",
            "uint8[] data\nuint8 more",
            "geometry_msgs/Pose pose",
            "uint8",
            // More than any message holds, alone or together.
            "uint8[99999999999] a",
            "float64[18446744073709551615] a",
            "uint8[40000] a\nuint8[40000] b",
        ] {
            assert_eq!(Columns::from_definition(definition), None, "{definition}");
        }
        assert_eq!(line(&Columns::from_definition("uint64 a").unwrap(), &[0; 7]), None);
    }

    fn descriptions(definition: &str) -> BTreeMap<String, Description> {
        let Columns { fields, tail, .. } = Columns::from_definition(definition).unwrap();
        fields.into_iter().chain(tail).map(|field| (field.name, field.description)).collect()
    }

    #[test]
    fn the_table_of_messages_is_found_again_in_its_comments() {
        let reading = descriptions(&Reading::definition());
        assert_eq!(reading.len(), Reading::fields().len());
        assert_eq!(reading["position_m"].unit, "m");
        assert_eq!(reading["position_m"].meaning, "Encoder positions d₁ d₂ d₃ l₁ l₂ l₃, m.");
        assert_eq!(reading["drive_state"].codes[&u64::from(DriveState::Fault.code())], "fault");
        assert!(reading["cycle"].codes.is_empty() && reading["cycle"].unit.is_empty());
        assert_eq!(descriptions(&Event::definition())["cause"].codes.len(), Cause::ALL.len());
    }

    #[test]
    fn parts_of_a_comment_may_be_missing() {
        let found = descriptions("# Any message.\nfloat64 gain  # [1/s] Gain\nuint8 bare\n");
        let gain = Description { unit: "1/s".into(), meaning: "Gain".into(), codes: BTreeMap::new() };
        assert_eq!((&found["gain"], &found["bare"]), (&gain, &Description::default()));
    }
}
