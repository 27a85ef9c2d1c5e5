//! The part of an object's value that a single SDO message carries.

/// Bytes of every SDO message.
pub(super) const LENGTH: usize = 8;
/// "Size indicated", in initiate messages.
pub(super) const SIZED: u8 = 1 << 0;
/// "Expedited transfer", in initiate messages.
pub(super) const EXPEDITED: u8 = 1 << 1;

/// The value in an expedited message: 1 to 4 bytes. Without a size in the message there are 4 bytes, and the receiver
/// must know how many of them are the value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Expedited {
    /// Bytes beyond `length` are zero.
    pub(super) bytes: [u8; Self::MAX],
    length: u8,
    is_sized: bool,
}

impl Expedited {
    /// The most bytes the message carries.
    pub const MAX: usize = 4;

    /// A value of that many bytes; `None` with none or more than 4.
    pub fn new(data: &[u8]) -> Option<Self> {
        let mut bytes = [0; Self::MAX];
        bytes.get_mut(..data.len()).filter(|_| !data.is_empty())?.copy_from_slice(data);
        Some(Self { bytes, length: data.len() as u8, is_sized: true })
    }

    /// Four bytes without a size.
    pub const fn of_unknown_size(bytes: [u8; Self::MAX]) -> Self {
        Self { bytes, length: Self::MAX as u8, is_sized: false }
    }

    /// The bytes; all four when the message has no size.
    pub fn data(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }

    /// Whether the message has a size.
    pub const fn is_sized(&self) -> bool {
        self.is_sized
    }

    pub(super) fn from_flags(flags: u8, bytes: [u8; Self::MAX]) -> Self {
        if flags & SIZED == 0 {
            return Self::of_unknown_size(bytes);
        }
        let unused = usize::from(flags >> 2 & 0b11);
        Self::new(&bytes[..Self::MAX - unused]).expect("two bits leave 1 to 4 bytes")
    }

    pub(super) const fn flags(self) -> u8 {
        let unused = Self::MAX as u8 - self.length;
        EXPEDITED | if self.is_sized { SIZED | unused << 2 } else { 0 }
    }
}

/// The data in a segment: 0 to 7 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    /// Bytes beyond `length` are zero.
    pub(super) bytes: [u8; Self::MAX],
    length: u8,
}

impl Segment {
    /// The most bytes the message carries.
    pub const MAX: usize = 7;

    /// A segment of that data; `None` with more than 7 bytes.
    pub fn new(data: &[u8]) -> Option<Self> {
        let mut bytes = [0; Self::MAX];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(Self { bytes, length: data.len() as u8 })
    }

    /// The data.
    pub fn data(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }

    pub(super) fn from_message([command, bytes @ ..]: [u8; LENGTH]) -> Self {
        let unused = usize::from(command >> 1 & 0b111);
        Self::new(&bytes[..Self::MAX - unused]).expect("three bits leave 0 to 7 bytes")
    }

    pub(super) const fn flags(self) -> u8 {
        (Self::MAX as u8 - self.length) << 1
    }
}
