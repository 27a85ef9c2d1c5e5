//! Data types by their numbers, with the lengths and ranges of their values.

/// Data type by its index in the object dictionary (CiA 301, table 44).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DataType(pub u16);

impl DataType {
    /// A text.
    pub const TEXT: Self = Self(0x9);
    /// `UNSIGNED8`, as every sub-index 0 is.
    pub const U8: Self = Self(0x5);
    /// Bytes of any number.
    pub const DOMAIN: Self = Self(0xF);

    /// Bits of a value; none for a type of any length and for unknown types.
    pub const fn bits(self) -> Option<u32> {
        Some(match self.0 {
            0x1 | 0x2 | 0x5 => 8,
            0x3 | 0x6 => 16,
            0x10 | 0x16 => 24,
            0x4 | 0x7 | 0x8 => 32,
            0x12 | 0x18 => 40,
            0x13 | 0x19 | 0xC | 0xD => 48,
            0x14 | 0x1A => 56,
            0x11 | 0x15 | 0x1B => 64,
            _ => return None,
        })
    }

    /// Whether values are integers that may be negative.
    pub const fn is_signed(self) -> bool {
        matches!(self.0, 0x2..=0x4 | 0x10 | 0x12..=0x15)
    }

    /// Whether values are floating-point numbers.
    pub const fn is_real(self) -> bool {
        matches!(self.0, 0x8 | 0x11)
    }

    /// The integers that the type holds; none for a type of no integers.
    pub(super) fn range(self) -> Option<(i128, i128)> {
        let bits = self.bits().filter(|_| !self.is_real())?;
        let count = 1_i128 << bits;
        Some(if self.is_signed() { (-count / 2, count / 2 - 1) } else { (0, count - 1) })
    }
}
