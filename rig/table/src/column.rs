//! Columns of a table and their cells.

use std::io::{self, Read, Write};

use serde::{Deserialize, Serialize};

/// The values of a column; none where a row has none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Values {
    /// Real numbers.
    Numbers(Vec<Option<f64>>),
    /// Whole numbers.
    Whole(Vec<Option<i64>>),
    /// Texts.
    Words(Vec<Option<String>>),
    /// True or false.
    Truths(Vec<Option<bool>>),
}

/// The value of one row in a column of its kind.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// A real number.
    Number(Option<f64>),
    /// A whole number.
    Whole(Option<i64>),
    /// A text.
    Word(Option<String>),
}

impl Values {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len(),
            Self::Whole(values) => values.len(),
            Self::Words(values) => values.len(),
            Self::Truths(values) => values.len(),
        }
    }

    fn push(&mut self, cell: Cell) {
        match (self, cell) {
            (Self::Numbers(values), Cell::Number(value)) => values.push(value),
            (Self::Whole(values), Cell::Whole(value)) => values.push(value),
            (Self::Words(values), Cell::Word(value)) => values.push(value),
            (_, cell) => panic!("{cell:?} does not fit its column"),
        }
    }

    fn clear(&mut self) {
        match self {
            Self::Numbers(values) => values.clear(),
            Self::Whole(values) => values.clear(),
            Self::Words(values) => values.clear(),
            Self::Truths(values) => values.clear(),
        }
    }

    /// The value of a row as text with as many digits as give the same number again; empty where there is none.
    pub(crate) fn text(&self, row: usize) -> String {
        fn text(value: Option<&impl ToString>) -> String {
            value.map(ToString::to_string).unwrap_or_default()
        }
        match self {
            Self::Numbers(values) => text(values[row].as_ref()),
            Self::Whole(values) => text(values[row].as_ref()),
            Self::Words(values) => text(values[row].as_ref()),
            Self::Truths(values) => text(values[row].as_ref()),
        }
    }

    /// Writes the values so that [`Self::receive`] reads them bit by bit: a byte that says whether there is a value, then the
    /// value, little-endian; a text after its length.
    pub(crate) fn send(&self, to: &mut impl Write) -> io::Result<()> {
        match self {
            Self::Numbers(values) => send(values, to, |value, to| to.write_all(&value.to_le_bytes())),
            Self::Whole(values) => send(values, to, |value, to| to.write_all(&value.to_le_bytes())),
            Self::Words(values) => send(values, to, |value, to| {
                to.write_all(&(value.len() as u64).to_le_bytes())?;
                to.write_all(value.as_bytes())
            }),
            Self::Truths(values) => send(values, to, |value, to| to.write_all(&[u8::from(*value)])),
        }
    }

    /// Adds so many values of what [`Self::send`] wrote.
    pub(crate) fn receive(&mut self, count: u64, from: &mut impl Read) -> io::Result<()> {
        match self {
            Self::Numbers(values) => {
                receive(values, count, from, |from| Ok(f64::from_le_bytes(bytes(from)?)))
            }
            Self::Whole(values) => receive(values, count, from, |from| Ok(i64::from_le_bytes(bytes(from)?))),
            Self::Words(values) => receive(values, count, from, |from| {
                let length = u64::from_le_bytes(bytes(from)?);
                let mut text = String::new();
                from.take(length).read_to_string(&mut text)?;
                if text.len() as u64 != length {
                    return Err(io::ErrorKind::UnexpectedEof.into());
                }
                Ok(text)
            }),
            Self::Truths(values) => receive(values, count, from, |from| Ok(bytes(from)? == [1])),
        }
    }

    /// The kind of values in words.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Numbers(_) => "number",
            Self::Whole(_) => "whole number",
            Self::Words(_) => "text",
            Self::Truths(_) => "true or false",
        }
    }
}

/// A column.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Column {
    pub(crate) name: String,
    pub(crate) unit: String,
    pub(crate) about: String,
    pub(crate) values: Values,
}

impl Column {
    /// A column; the unit is empty where the values have none.
    pub fn new(name: &str, unit: &str, about: &str, values: Values) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), about: about.to_owned(), values }
    }

    pub(crate) fn push(&mut self, cell: Cell) {
        self.values.push(cell);
    }

    pub(crate) fn clear(&mut self) {
        self.values.clear();
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The unit of its values; empty where they have none.
    pub fn unit(&self) -> &str {
        &self.unit
    }

    /// What its values are.
    pub fn about(&self) -> &str {
        &self.about
    }

    /// Its values.
    pub fn values(&self) -> &Values {
        &self.values
    }
}

fn send<T, W: Write>(
    values: &[Option<T>],
    to: &mut W,
    write: impl Fn(&T, &mut W) -> io::Result<()>,
) -> io::Result<()> {
    for value in values {
        to.write_all(&[u8::from(value.is_some())])?;
        value.as_ref().map_or(Ok(()), |value| write(value, to))?;
    }
    Ok(())
}

fn receive<T, R: Read>(
    values: &mut Vec<Option<T>>,
    count: u64,
    from: &mut R,
    read: impl Fn(&mut R) -> io::Result<T>,
) -> io::Result<()> {
    for _ in 0..count {
        let is_there = bytes(from)? == [1];
        values.push(is_there.then(|| read(from)).transpose()?);
    }
    Ok(())
}

/// The next bytes, as many as the type has.
pub(crate) fn bytes<const COUNT: usize>(from: &mut impl Read) -> io::Result<[u8; COUNT]> {
    let mut bytes = [0; COUNT];
    from.read_exact(&mut bytes)?;
    Ok(bytes)
}
