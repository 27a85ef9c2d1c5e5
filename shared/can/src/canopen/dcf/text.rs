//! The text of a description: sections and keys with their lines, and the values of CiA 306. Values are texts,
//! numbers, and numbers that follow from the node id. A crate for INI files would lose the lines.

use std::collections::HashMap;
use std::fmt::{self, Display, Formatter};

use crate::canopen::NodeId;

/// The longest line, bytes. CiA 306 has 255 characters; values of type DOMAIN are longer.
const LONGEST_LINE: usize = 1 << 16;

/// A section and its keys. Names match without regard to case.
#[derive(Debug)]
pub(super) struct Section<'a> {
    pub(super) name: &'a str,
    pub(super) line: usize,
    keys: HashMap<String, Field<'a>>,
}

/// A key with its value, as written.
#[derive(Debug, Clone, Copy)]
pub(super) struct Field<'a> {
    pub(super) key: &'a str,
    pub(super) text: &'a str,
    pub(super) line: usize,
}

impl<'a> Section<'a> {
    /// All sections of a text, in its order.
    pub(super) fn read_all(text: &'a str) -> Result<Vec<Self>, DcfError> {
        let mut sections: Vec<Self> = Vec::new();
        let mut first_lines = HashMap::new();
        let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
        for (line, content) in (1..).zip(text.lines().map(str::trim)) {
            let refuse = |problem| Err(DcfError { line, problem });
            if content.is_empty() || content.starts_with([';', '#']) {
                continue;
            }
            if content.len() > LONGEST_LINE {
                let length = content.len();
                return refuse(format!(
                    "a line of {length} bytes; at most {LONGEST_LINE} are possible, so shorten the line"
                ));
            }
            if let Some(name) = content.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
                let name = name.trim();
                if let Some(first) = first_lines.insert(name.to_ascii_lowercase(), line) {
                    return refuse(format!(
                        "[{name}] occurs twice, first in line {first}; remove one of them"
                    ));
                }
                sections.push(Self { name, line, keys: HashMap::new() });
                continue;
            }
            let Some((key, text)) = content.split_once('=') else {
                let remedy = "start a comment with a semicolon";
                return refuse(format!("{content:?} is neither [section] nor key=value; {remedy}"));
            };
            let (key, text) = (key.trim(), text.trim());
            let Some(section) = sections.last_mut() else {
                return refuse(format!("{key} is before the first [section]"));
            };
            let former = section.keys.insert(key.to_ascii_lowercase(), Field { key, text, line });
            if let Some(Field { line: first, .. }) = former {
                let remedy = "remove one of them";
                return refuse(format!("{key} occurs twice in its section, first in line {first}; {remedy}"));
            }
        }
        Ok(sections)
    }

    /// The value of a key; none for an absent or empty key.
    pub(super) fn get(&self, key: &str) -> Option<Field<'a>> {
        self.keys.get(&key.to_ascii_lowercase()).copied().filter(|field| !field.text.is_empty())
    }

    /// The number of a key that is no value of an entry, such as an object type; none for an absent or empty key.
    pub(super) fn number(&self, key: &str, highest: u16) -> Result<Option<u16>, DcfError> {
        self.get(key).map(|field| field.number(highest)).transpose()
    }

    /// The numbers of a list, whose keys count from 1.
    pub(super) fn numbered(&self, highest: u16) -> Result<Vec<u16>, DcfError> {
        let items = self.keys.values().filter(|field| field.key.bytes().all(|digit| digit.is_ascii_digit()));
        let mut items = items.map(|field| field.number(highest)).collect::<Result<Vec<_>, _>>()?;
        items.sort_unstable();
        Ok(items)
    }

    /// The value of a key that the section needs.
    pub(super) fn require(&self, key: &str) -> Result<Field<'a>, DcfError> {
        self.get(key).ok_or_else(|| self.refused(format!("[{}] has no {key}; add it", self.name)))
    }

    /// The error for a wrong section.
    pub(super) fn refused(&self, problem: String) -> DcfError {
        DcfError { line: self.line, problem }
    }
}

impl Field<'_> {
    /// A number of at most `highest`.
    pub(super) fn number(self, highest: u16) -> Result<u16, DcfError> {
        let number = integer(self.text).ok_or_else(|| self.no_number())?;
        Ok(self.within(number, (0, highest.into()))? as u16)
    }

    /// The error for a wrong value.
    pub(super) fn refused(self, reason: &str) -> DcfError {
        DcfError { line: self.line, problem: format!("{}={} is {reason}", self.key, self.text) }
    }

    fn no_number(self) -> DcfError {
        self.refused("no number; write decimal, 0x hexadecimal, 0 octal or $NODEID+number")
    }

    fn within(self, number: i128, (lowest, highest): (i128, i128)) -> Result<i128, DcfError> {
        let is_within = (lowest..=highest).contains(&number);
        if is_within { Ok(number) } else { Err(self.refused(&format!("not within {lowest} to {highest}"))) }
    }
}

const NODE_ID: &str = "$NODEID";

/// A value of an entry, or one of its limits.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// An integer.
    Number(i128),
    /// `$NODEID+number`.
    OfNode(i128),
    /// A floating-point number.
    Real(f64),
    /// A text, or any value of a type without numbers.
    Text(String),
}

impl Value {
    /// The integer of the value for that node; none for texts and floating-point numbers.
    pub fn number(&self, node: NodeId) -> Option<i128> {
        match self {
            Self::Number(number) => Some(*number),
            Self::OfNode(base) => Some(base + i128::from(node.get())),
            Self::Real(_) | Self::Text(_) => None,
        }
    }

    /// Reads a value of a data type.
    pub(super) fn read(field: Field<'_>, data_type: DataType) -> Result<Self, DcfError> {
        let Some((lowest, highest)) = data_type.range() else {
            let real = field.text.parse().ok().filter(|_| data_type.is_real());
            return Ok(real.map_or_else(|| Self::Text(field.text.to_owned()), Self::Real));
        };
        let text = field.text.to_ascii_uppercase();
        if let Some((before, after)) = text.split_once(NODE_ID) {
            let base = beside_node_id(before.trim(), after.trim());
            return base.map(Self::OfNode).ok_or_else(|| field.no_number());
        }
        let mut number = integer(field.text).ok_or_else(|| field.no_number())?;
        // A signed number may be written by its bits, in hexadecimal or octal.
        let modulus = highest - lowest + 1;
        if lowest < 0 && field.text.starts_with('0') && number > highest && number < modulus {
            number -= modulus;
        }
        field.within(number, (lowest, highest)).map(Self::Number)
    }
}

/// The number beside `$NODEID`, on either side of the plus.
fn beside_node_id(before: &str, after: &str) -> Option<i128> {
    match (before, after) {
        ("", "") => Some(0),
        ("", after) => integer(after.strip_prefix('+')?.trim()),
        (before, "") => integer(before.strip_suffix('+')?.trim()),
        _ => None,
    }
}

fn integer(text: &str) -> Option<i128> {
    let (sign, digits) = text.strip_prefix('-').map_or((1, text), |digits| (-1, digits));
    let (radix, digits) = match digits.as_bytes() {
        [b'0', b'x' | b'X', ..] => (16, &digits[2..]),
        [b'0', _, ..] => (8, &digits[1..]),
        _ => (10, digits),
    };
    // The parser itself would take a second sign.
    let number = digits.starts_with(|digit: char| digit.is_digit(radix)).then_some(digits)?;
    i128::from_str_radix(number, radix).ok().map(|number| sign * number)
}

/// The data types with their names and bits; 0 for any number of bits.
#[rustfmt::skip]
const TYPES: [(u16, &str, u32); 25] = [
    (0x01, "BOOLEAN", 8), (0x02, "INTEGER8", 8), (0x03, "INTEGER16", 16), (0x04, "INTEGER32", 32),
    (0x05, "UNSIGNED8", 8), (0x06, "UNSIGNED16", 16), (0x07, "UNSIGNED32", 32), (0x08, "REAL32", 32),
    (0x09, "VISIBLE_STRING", 0), (0x0A, "OCTET_STRING", 0), (0x0B, "UNICODE_STRING", 0), (0x0C, "TIME_OF_DAY", 48),
    (0x0D, "TIME_DIFFERENCE", 48), (0x0F, "DOMAIN", 0), (0x10, "INTEGER24", 24), (0x11, "REAL64", 64),
    (0x12, "INTEGER40", 40), (0x13, "INTEGER48", 48), (0x14, "INTEGER56", 56), (0x15, "INTEGER64", 64),
    (0x16, "UNSIGNED24", 24), (0x18, "UNSIGNED40", 40), (0x19, "UNSIGNED48", 48), (0x1A, "UNSIGNED56", 56),
    (0x1B, "UNSIGNED64", 64),
];

/// Data type by its index in the object dictionary (CiA 301, table 44).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DataType(pub u16);

impl DataType {
    /// `UNSIGNED8`, as every sub-index 0 is.
    pub const U8: Self = Self(0x5);
    /// Bytes of any number.
    pub const DOMAIN: Self = Self(0xF);

    /// Bits of a value; none for a type of any length and for unknown types.
    pub fn bits(self) -> Option<u32> {
        self.named().map(|(_, _, bits)| *bits).filter(|&bits| bits > 0)
    }

    /// Whether values are integers that may be negative.
    pub fn is_signed(self) -> bool {
        self.named().is_some_and(|(_, name, _)| name.starts_with("INTEGER"))
    }

    /// Whether values are floating-point numbers.
    pub fn is_real(self) -> bool {
        self.named().is_some_and(|(_, name, _)| name.starts_with("REAL"))
    }

    fn named(self) -> Option<&'static (u16, &'static str, u32)> {
        TYPES.iter().find(|(index, ..)| *index == self.0)
    }

    /// The integers that the type holds; none for a type of no integers.
    fn range(self) -> Option<(i128, i128)> {
        let bits = self.bits().filter(|_| !self.is_real())?;
        let count = 1_i128 << bits;
        Some(if self.is_signed() { (-count / 2, count / 2 - 1) } else { (0, count - 1) })
    }
}

/// As CiA 301 names it: `UNSIGNED32`.
impl Display for DataType {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.named() {
            Some((_, name, _)) => f.write_str(name),
            None => write!(f, "data type {:04X}h", self.0),
        }
    }
}

/// A line that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct DcfError {
    /// Number of the line, from 1.
    pub line: usize,
    /// The error and its remedy, for the author of the file.
    pub problem: String,
}
