//! Objects and entries of the table: type, access, mapping, initial value and limits.

use masseter_can::canopen::{AbortCode, ObjectAddress};

/// Data type of an entry, with its index in the object dictionary (CiA 301, table 44).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum DataType {
    I8 = 0x02,
    I16 = 0x03,
    I32 = 0x04,
    U8 = 0x05,
    U16 = 0x06,
    U32 = 0x07,
    /// A constant text (VISIBLE_STRING).
    Text = 0x09,
}

impl DataType {
    /// Bytes of a value; 0 for a text, whose length is its own.
    pub(crate) const fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 => 4,
            Self::Text => 0,
        }
    }

    /// Whether values may be negative.
    pub(crate) const fn is_signed(self) -> bool {
        matches!(self, Self::I8 | Self::I16 | Self::I32)
    }

    /// The number that the lowest bytes of a memory word mean.
    pub(crate) const fn number(self, word: u32) -> i64 {
        match self {
            Self::I8 => word as i8 as i64,
            Self::I16 => word as i16 as i64,
            Self::I32 => word as i32 as i64,
            Self::U8 => word as u8 as i64,
            Self::U16 => word as u16 as i64,
            Self::U32 | Self::Text => word as i64,
        }
    }
}

/// Who may change an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Access {
    /// Nobody: it never changes.
    Constant,
    /// The drive alone.
    ReadOnly,
    /// Any client.
    ReadWrite,
}

/// Which PDOs an entry may be mapped to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mapping {
    Never,
    /// PDOs that the drive transmits.
    Tpdo,
    /// PDOs of both directions.
    Any,
}

/// The value that an entry has after power-on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Initial {
    /// This one.
    Value(i64),
    /// This one plus the node id.
    OfNode(u32),
    /// One that follows from the scenario.
    Configured,
    /// This text.
    Text(&'static str),
}

/// An entry of an object.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Entry {
    pub(crate) address: ObjectAddress,
    pub(crate) name: &'static str,
    pub(crate) kind: DataType,
    pub(crate) access: Access,
    pub(crate) mapping: Mapping,
    pub(crate) initial: Initial,
    /// Lowest and highest value that may be written; `None` where the type alone limits it.
    pub(crate) limits: Option<(i64, i64)>,
}

impl Entry {
    /// An entry that is neither mapped nor limited.
    pub(super) const fn new(
        (index, subindex): (u16, u8),
        name: &'static str,
        kind: DataType,
        access: Access,
        initial: Initial,
    ) -> Self {
        let address = ObjectAddress::new(index, subindex);
        Self { address, name, kind, access, mapping: Mapping::Never, initial, limits: None }
    }

    pub(super) const fn mapped(mut self, mapping: Mapping) -> Self {
        self.mapping = mapping;
        self
    }

    pub(super) const fn within(mut self, lowest: i64, highest: i64) -> Self {
        self.limits = Some((lowest, highest));
        self
    }

    /// Whether a client may write the entry.
    ///
    /// # Errors
    /// [`AbortCode::READ_ONLY`].
    pub(crate) fn check_access(&self) -> Result<(), AbortCode> {
        if self.access == Access::ReadWrite { Ok(()) } else { Err(AbortCode::READ_ONLY) }
    }

    /// The word that a client may write.
    ///
    /// # Errors
    /// The abort code for a wrong length, a value out of range, or an entry that clients may not write.
    pub(crate) fn writable(&self, data: &[u8], is_sized: bool) -> Result<u32, AbortCode> {
        self.check_access()?;
        let bytes = self.kind.bytes();
        if is_sized && data.len() > bytes {
            return Err(AbortCode::TOO_LONG);
        }
        let mut word = [0; 4];
        word[..bytes].copy_from_slice(data.get(..bytes).ok_or(AbortCode::TOO_SHORT)?);
        let word = u32::from_le_bytes(word);
        self.check_limits(word)?;
        Ok(word)
    }

    /// Whether a value keeps to the limits.
    ///
    /// # Errors
    /// [`AbortCode::TOO_HIGH`], [`AbortCode::TOO_LOW`].
    pub(crate) fn check_limits(&self, word: u32) -> Result<(), AbortCode> {
        let value = self.kind.number(word);
        match self.limits {
            Some((_, highest)) if value > highest => Err(AbortCode::TOO_HIGH),
            Some((lowest, _)) if value < lowest => Err(AbortCode::TOO_LOW),
            _ => Ok(()),
        }
    }
}

/// How an object is made of entries (CiA 301, table 42).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    Var,
    Array,
    Record,
}

/// An object with its entries, sub-indices ascending.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Object {
    pub(crate) name: &'static str,
    pub(crate) shape: Shape,
    pub(crate) entries: &'static [Entry],
}

impl Object {
    /// Its index.
    pub(crate) const fn index(&self) -> u16 {
        self.entries[0].address.index
    }
}

/// An entry of a mapping parameter: index, sub-index and length in bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct MappingEntry(pub(crate) u32);

impl MappingEntry {
    /// The mapped object.
    pub(crate) const fn object(self) -> ObjectAddress {
        ObjectAddress::new((self.0 >> 16) as u16, (self.0 >> 8) as u8)
    }

    /// Its length in bits.
    pub(crate) const fn bits(self) -> usize {
        (self.0 & 0xFF) as usize
    }
}
