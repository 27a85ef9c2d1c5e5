//! Messages as CSV rows, by the ROS 2 message definition in the recording; so recordings of other versions work too.
//!
//! A definition may hold numbers, arrays of fixed length, and one byte sequence at its end. Other definitions, and those
//! of messages longer than any of the rig's, are refused.

use data_encoding::HEXUPPER;

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

    /// The little-endian value at the beginning of `bytes`.
    fn text(self, bytes: &[u8]) -> String {
        let mut wide = [0; 8];
        wide[..self.size()].copy_from_slice(&bytes[..self.size()]);
        let unsigned = u64::from_le_bytes(wide);
        let unused = 64 - 8 * self.size() as u32;
        match self {
            Self::Unsigned(_) => unsigned.to_string(),
            Self::Signed(_) => ((unsigned << unused).cast_signed() >> unused).to_string(),
            Self::Float(4) => f32::from_bits(unsigned as u32).to_string(),
            Self::Float(_) => f64::from_bits(unsigned).to_string(),
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

/// A column: a field, or an element of an array.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Column {
    name: String,
    kind: Kind,
    /// Byte offset behind the CDR header.
    offset: usize,
}

/// The table of a message definition.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Columns {
    fixed: Vec<Column>,
    /// Bytes of the fixed columns.
    bytes: usize,
    /// Name of the byte sequence at the end, a column in hexadecimal digits.
    tail: Option<String>,
}

impl Columns {
    /// Parses a definition; none if it does not fit a table.
    pub(super) fn from_definition(definition: &str) -> Option<Self> {
        let mut table = Self { fixed: Vec::new(), bytes: 0, tail: None };
        for line in definition.lines().map(|line| line.split('#').next().unwrap_or_default().trim()) {
            if !line.is_empty() {
                table.add_field(line)?;
            }
        }
        Some(table)
    }

    fn add_field(&mut self, line: &str) -> Option<()> {
        let (kind, name) = line.split_once(char::is_whitespace)?;
        let name = name.trim();
        if self.tail.is_some() {
            return None;
        }
        if is_byte_sequence(kind) {
            self.bytes = self.bytes.next_multiple_of(LENGTH.size()) + LENGTH.size();
            self.tail = Some(name.to_owned());
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
        for element in 0..elements.unwrap_or(1) {
            let name = if elements.is_some() { format!("{name}_{element}") } else { name.to_owned() };
            self.fixed.push(Column { name, kind, offset: self.bytes });
            self.bytes += kind.size();
        }
        Some(())
    }

    /// The names of the columns.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.fixed.iter().map(|column| &column.name).chain(&self.tail).map(String::as_str)
    }

    /// The values of a message; none if its length differs from the definition's.
    pub(super) fn values(&self, body: &[u8]) -> Option<impl Iterator<Item = String>> {
        let (fixed, tail) = body.split_at_checked(self.bytes)?;
        let fits = match self.tail {
            Some(_) => fixed.ends_with(&(tail.len() as u32).to_le_bytes()),
            None => tail.is_empty(),
        };
        let values = self.fixed.iter().map(|column| column.kind.text(&body[column.offset..]));
        fits.then(|| values.chain(self.tail.iter().map(|_| HEXUPPER.encode(tail))))
    }
}

#[cfg(test)]
mod tests {
    use masseter_shared::messages::{CanData, FrameTap, Message, Reading};

    use super::*;

    fn line(columns: &Columns, body: &[u8]) -> Option<String> {
        Some(columns.values(body)?.collect::<Vec<_>>().join(","))
    }

    #[test]
    fn a_message_of_the_rig_becomes_a_row() {
        let columns = Columns::from_definition(&FrameTap::schema()).unwrap();
        let names = columns.names().collect::<Vec<_>>().join(",");
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
        assert_eq!(columns.names().collect::<Vec<_>>(), ["a", "b", "c_0", "c_1", "d"]);
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
}
