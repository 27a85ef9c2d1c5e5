//! Values: numbers in the notations of CiA 306, numbers that follow from the node id, and texts.

use super::data_type::DataType;
use super::error::{DcfError, Problem};
use super::ini::Field;
use crate::canopen::NodeId;

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
    /// The integer that it is for that node; none for texts and floating-point numbers.
    pub fn number(&self, node: NodeId) -> Option<i128> {
        match self {
            Self::Number(number) => Some(*number),
            Self::OfNode(base) => Some(base + i128::from(node.get())),
            Self::Real(_) | Self::Text(_) => None,
        }
    }

    /// Reads a value of a data type.
    pub(super) fn read(key: &str, field: Field<'_>, data_type: DataType) -> Result<Self, DcfError> {
        let Some((lowest, highest)) = data_type.range() else {
            if data_type.is_real()
                && let Ok(real) = field.text.parse()
            {
                return Ok(Self::Real(real));
            }
            return Ok(Self::Text(field.text.to_owned()));
        };
        let no_number = || Problem::NoNumber { key: key.to_owned(), text: field.text.to_owned() };
        let text = field.text.to_ascii_uppercase();
        if let Some((before, after)) = text.split_once(NODE_ID) {
            let base = beside_node_id(before.trim(), after.trim());
            return base.map(Self::OfNode).ok_or_else(|| no_number().at(field.line));
        }
        let mut number = integer(field.text).ok_or_else(|| no_number().at(field.line))?;
        // A signed number may be written by its bits.
        let modulus = highest - lowest + 1;
        if lowest < 0 && has_radix(field.text) && number > highest && number < modulus {
            number -= modulus;
        }
        if number < lowest || number > highest {
            let (key, text) = (key.to_owned(), field.text.to_owned());
            return Err(Problem::OutOfRange { key, text, lowest, highest }.at(field.line));
        }
        Ok(Self::Number(number))
    }
}

/// A number of at most `highest` that no entry holds, such as a data type.
pub(super) fn plain(key: &str, field: Field<'_>, highest: u16) -> Result<u16, DcfError> {
    let (key, text) = (key.to_owned(), field.text.to_owned());
    let Some(number) = integer(field.text) else {
        return Err(Problem::NoNumber { key, text }.at(field.line));
    };
    let fitting = u16::try_from(number).ok().filter(|&number| number <= highest);
    let out = Problem::OutOfRange { key, text, lowest: 0, highest: highest.into() };
    fitting.ok_or_else(|| out.at(field.line))
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

/// Whether it is written in hexadecimal or octal.
fn has_radix(text: &str) -> bool {
    text.starts_with('0')
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
