//! Data frames of classical CAN and their identifiers, valid by construction.
//!
//! Remote frames are not represented. [`ErrorReport`](crate::ErrorReport) represents an error frame.

use std::fmt;

const STANDARD_MAX: u32 = 0x7FF;
const EXTENDED_MAX: u32 = 0x1FFF_FFFF;
const EXTENSION_BITS: u32 = 18;
const EXTENSION_MASK: u32 = (1 << EXTENSION_BITS) - 1;
const IDE: u32 = 1 << EXTENSION_BITS;
const EXTENDED_FLAG: u32 = 1 << 31;

/// A frame identifier: 11 bits (standard) or 29 bits (extended).
///
/// The order is that of bus arbitration (ISO 11898-1): the smaller identifier wins.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub struct CanId {
    /// The arbitration field on the wire, without RTR: 11 bits of base, IDE, 18 bits of extension. Dominant is 0, so a
    /// comparison of these numbers is an arbitration.
    arbitration: u32,
}

impl CanId {
    /// An 11-bit identifier.
    ///
    /// # Errors
    /// [`FrameError::StandardId`] above 7FFh.
    pub const fn standard(id: u16) -> Result<Self, FrameError> {
        let id = id as u32;
        if id > STANDARD_MAX {
            return Err(FrameError::StandardId(id));
        }
        Ok(Self { arbitration: id << (EXTENSION_BITS + 1) })
    }

    /// A 29-bit identifier.
    ///
    /// # Errors
    /// [`FrameError::ExtendedId`] above 1FFFFFFFh.
    pub const fn extended(id: u32) -> Result<Self, FrameError> {
        if id > EXTENDED_MAX {
            return Err(FrameError::ExtendedId(id));
        }
        let base = id >> EXTENSION_BITS;
        Ok(Self { arbitration: base << (EXTENSION_BITS + 1) | IDE | id & EXTENSION_MASK })
    }

    /// From the form of `SocketCAN`: bit 31 is set for a 29-bit identifier.
    ///
    /// # Errors
    /// [`FrameError`] for a number that is too large, also for one with the flags of remote and error frames (bits 30
    /// and 29).
    pub const fn from_flagged(flagged: u32) -> Result<Self, FrameError> {
        match flagged {
            ..=STANDARD_MAX => Self::standard(flagged as u16),
            EXTENDED_FLAG.. => Self::extended(flagged & !EXTENDED_FLAG),
            _ => Err(FrameError::StandardId(flagged)),
        }
    }

    /// The number of the identifier, with bit 31 set for 29 bits.
    pub const fn flagged(self) -> u32 {
        if self.is_extended() { self.number() | EXTENDED_FLAG } else { self.number() }
    }

    /// Whether the identifier has 29 bits.
    pub const fn is_extended(self) -> bool {
        self.arbitration & IDE != 0
    }

    /// The identifier's number, 11 or 29 bits.
    pub const fn number(self) -> u32 {
        if self.is_extended() { self.base() << EXTENSION_BITS | self.extension() } else { self.base() }
    }

    /// The first 11 bits on the wire.
    pub(crate) const fn base(self) -> u32 {
        self.arbitration >> (EXTENSION_BITS + 1)
    }

    /// The last 18 bits of a 29-bit identifier.
    pub(crate) const fn extension(self) -> u32 {
        self.arbitration & EXTENSION_MASK
    }
}

impl fmt::Display for CanId {
    /// The form of candump: 3 hexadecimal digits, or 8 for a 29-bit identifier.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = if self.is_extended() { 8 } else { 3 };
        write!(f, "{:0digits$X}", self.number())
    }
}

impl fmt::Debug for CanId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CanId({self})")
    }
}

/// An identifier or a frame that CAN cannot carry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// More than 11 bits in a standard identifier.
    #[error("identifier {0:X}h does not fit into 11 bits (at most 7FFh)")]
    StandardId(u32),
    /// More than 29 bits in an extended identifier.
    #[error("identifier {0:X}h does not fit into 29 bits (at most 1FFFFFFFh)")]
    ExtendedId(u32),
    /// More data than a classical frame carries.
    #[error("{0} data bytes: a classical frame carries at most 8")]
    DataLength(usize),
}

/// A data frame.
///
/// # Examples
/// ```
/// use masseter_can::{CanId, Frame};
///
/// let id = CanId::standard(0x181)?;
/// let frame = Frame::new(id, &[0x37, 0x02])?;
/// assert_eq!(frame.to_string(), "181#3702");
/// assert!(Frame::new(id, &[0; 9]).is_err(), "a frame carries at most 8 bytes");
/// # Ok::<(), masseter_can::FrameError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct Frame {
    id: CanId,
    length: u8,
    /// Bytes beyond `length` are zero, so that equal frames are equal values.
    bytes: [u8; Frame::MAX_DATA],
}

impl Frame {
    /// Bytes a frame carries at most.
    pub const MAX_DATA: usize = 8;

    /// A frame of that identifier and data.
    ///
    /// # Errors
    /// [`FrameError::DataLength`] with more than 8 bytes.
    pub fn new(id: CanId, data: &[u8]) -> Result<Self, FrameError> {
        let mut bytes = [0; Self::MAX_DATA];
        let length = data.len();
        bytes.get_mut(..length).ok_or(FrameError::DataLength(length))?.copy_from_slice(data);
        Ok(Self { id, length: length as u8, bytes })
    }

    /// A frame whose length the compiler checks.
    pub fn fixed<const N: usize>(id: CanId, data: [u8; N]) -> Self {
        const { assert!(N <= Self::MAX_DATA, "a frame carries at most 8 bytes") };
        let mut bytes = [0; Self::MAX_DATA];
        bytes[..N].copy_from_slice(&data);
        Self { id, length: N as u8, bytes }
    }

    /// The identifier.
    pub const fn id(&self) -> CanId {
        self.id
    }

    /// The data bytes.
    pub fn data(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }

    /// A frame with the first `length` bytes as data.
    ///
    /// # Errors
    /// [`FrameError::DataLength`] with more than 8 bytes.
    pub fn of_padded(id: CanId, length: usize, bytes: [u8; Self::MAX_DATA]) -> Result<Self, FrameError> {
        if length > Self::MAX_DATA {
            return Err(FrameError::DataLength(length));
        }
        let used = u64::MAX.unbounded_shr(8 * (Self::MAX_DATA - length) as u32);
        Ok(Self { id, length: length as u8, bytes: (u64::from_le_bytes(bytes) & used).to_le_bytes() })
    }

    /// The bytes of the longest frame; bytes beyond the data are zero.
    pub const fn padded(&self) -> &[u8; Self::MAX_DATA] {
        &self.bytes
    }
}

impl fmt::Display for Frame {
    /// The form of candump logs: `123#11223344`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}#", self.id)?;
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

/// The number of hexadecimal digits. `from_str_radix` alone accepts a sign.
pub(crate) fn read_hex(digits: &str) -> Option<u64> {
    let is_plain = digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    is_plain.then(|| u64::from_str_radix(digits, 16).ok()).flatten()
}

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Frame({self})")
    }
}

#[cfg(test)]
pub(crate) mod tests;
