//! Identifiers and data frames of up to 8 bytes, valid by construction.
//!
//! Remote frames are not represented: the rig neither sends nor accepts them. What stands for an error frame is
//! [`ErrorReport`](super::ErrorReport), and longer FD frames are [`FdFrame`](super::FdFrame).

use std::fmt;

const STANDARD_MAX: u32 = 0x7FF;
const EXTENDED_MAX: u32 = 0x1FFF_FFFF;
const EXTENSION_BITS: u32 = 18;
const EXTENSION_MASK: u32 = (1 << EXTENSION_BITS) - 1;
const IDE: u32 = 1 << EXTENSION_BITS;
const EXTENDED_FLAG: u32 = 1 << 31;

/// An identifier or a frame that classical CAN cannot carry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// More than 11 bits in a standard identifier.
    #[error("identifier {id:X}h does not fit into 11 bits (at most 7FFh)")]
    StandardId {
        /// The identifier asked for.
        id: u32,
    },
    /// More than 29 bits in an extended identifier.
    #[error("identifier {id:X}h does not fit into 29 bits (at most 1FFFFFFFh)")]
    ExtendedId {
        /// The identifier asked for.
        id: u32,
    },
    /// More data than a classical frame carries.
    #[error("{length} data bytes: a classical frame carries at most 8")]
    DataLength {
        /// Bytes asked for.
        length: usize,
    },
}

/// A frame identifier: 11 bits (standard) or 29 bits (extended).
///
/// The order is that of bus arbitration (ISO 11898-1): the smaller identifier wins.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct CanId {
    /// The arbitration field as it goes over the wire, without RTR: 11 bits of base, IDE, 18 bits of
    /// extension. Dominant is 0, so comparing these numbers is arbitrating.
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
            return Err(FrameError::StandardId { id });
        }
        Ok(Self { arbitration: id << (EXTENSION_BITS + 1) })
    }

    /// A 29-bit identifier.
    ///
    /// # Errors
    /// [`FrameError::ExtendedId`] above 1FFFFFFFh.
    pub const fn extended(id: u32) -> Result<Self, FrameError> {
        if id > EXTENDED_MAX {
            return Err(FrameError::ExtendedId { id });
        }
        let base = id >> EXTENSION_BITS;
        Ok(Self { arbitration: base << (EXTENSION_BITS + 1) | IDE | id & EXTENSION_MASK })
    }

    /// From the form in which `SocketCAN` and [`FrameTap`](crate::messages::FrameTap) keep it: bit 31 set
    /// for a 29-bit identifier.
    ///
    /// # Errors
    /// [`FrameError`] where the number is too large; also the flags of remote and error frames
    /// (bits 30 and 29) make it so.
    pub const fn from_flagged(flagged: u32) -> Result<Self, FrameError> {
        if flagged & EXTENDED_FLAG != 0 {
            return Self::extended(flagged & !EXTENDED_FLAG);
        }
        if flagged > STANDARD_MAX {
            return Err(FrameError::StandardId { id: flagged });
        }
        Self::standard(flagged as u16)
    }

    /// The identifier with bit 31 set for a 29-bit one.
    pub const fn flagged(self) -> u32 {
        if self.is_extended() { self.number() | EXTENDED_FLAG } else { self.number() }
    }

    /// Whether it has 29 bits.
    pub const fn is_extended(self) -> bool {
        self.arbitration & IDE != 0
    }

    /// The identifier's number, 11 or 29 bits.
    pub const fn number(self) -> u32 {
        if self.is_extended() { self.base() << EXTENSION_BITS | self.extension() } else { self.base() }
    }

    /// The first 11 bits on the wire.
    pub(super) const fn base(self) -> u32 {
        self.arbitration >> (EXTENSION_BITS + 1)
    }

    /// The last 18 bits of a 29-bit identifier.
    pub(super) const fn extension(self) -> u32 {
        self.arbitration & EXTENSION_MASK
    }
}

impl fmt::Display for CanId {
    /// As candump writes it: 3 hexadecimal digits, or 8 for a 29-bit identifier.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_extended() {
            write!(f, "{:08X}", self.number())
        } else {
            write!(f, "{:03X}", self.number())
        }
    }
}

impl fmt::Debug for CanId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "CanId({self})")
    }
}

/// In which form a frame goes over the wire.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum FrameFormat {
    /// Classical CAN.
    #[default]
    Classical,
    /// CAN FD at one bit rate.
    Fd,
    /// CAN FD whose data phase goes at the data bit rate.
    FdBitRateSwitch,
}

/// A data frame of 0 to 8 bytes, in whichever format.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Frame {
    id: CanId,
    length: u8,
    format: FrameFormat,
    /// Bytes beyond `length` are zero, so that equal frames are equal values.
    bytes: [u8; Frame::MAX_DATA],
}

impl Frame {
    /// Bytes a classical frame carries at most.
    pub const MAX_DATA: usize = 8;

    /// A classical frame of that identifier and data.
    ///
    /// # Errors
    /// [`FrameError::DataLength`] with more than 8 bytes.
    pub fn new(id: CanId, data: &[u8]) -> Result<Self, FrameError> {
        let mut bytes = [0; Self::MAX_DATA];
        let used = bytes.get_mut(..data.len()).ok_or(FrameError::DataLength { length: data.len() })?;
        used.copy_from_slice(data);
        Ok(Self { id, length: data.len() as u8, format: FrameFormat::Classical, bytes })
    }

    /// A classical frame whose length is known when compiling, which then cannot be wrong.
    pub fn fixed<const N: usize>(id: CanId, data: [u8; N]) -> Self {
        const { assert!(N <= Self::MAX_DATA, "a classical frame carries at most 8 bytes") };
        let mut bytes = [0; Self::MAX_DATA];
        bytes[..N].copy_from_slice(&data);
        Self { id, length: N as u8, format: FrameFormat::Classical, bytes }
    }

    /// The identifier.
    pub const fn id(&self) -> CanId {
        self.id
    }

    /// The data bytes.
    pub fn data(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }

    /// The format.
    pub const fn format(&self) -> FrameFormat {
        self.format
    }

    /// The same frame in that format.
    #[must_use]
    pub const fn in_format(self, format: FrameFormat) -> Self {
        Self { format, ..self }
    }

    /// All eight bytes, zero beyond the data.
    pub(super) const fn padded(&self) -> [u8; Self::MAX_DATA] {
        self.bytes
    }
}

impl fmt::Display for Frame {
    /// As candump logs it: `123#11223344`, or in FD format `123##111223344`, the first digit being the flags (1
    /// for BRS).
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = match self.format {
            FrameFormat::Classical => "#",
            FrameFormat::Fd => "##0",
            FrameFormat::FdBitRateSwitch => "##1",
        };
        write!(f, "{}{mark}", self.id)?;
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Frame({self})")
    }
}

#[cfg(test)]
pub(super) mod strategies {
    use super::*;
    use proptest::prelude::*;

    pub(crate) fn any_id() -> impl Strategy<Value = CanId> {
        prop_oneof![
            (0..=STANDARD_MAX as u16).prop_map(|id| CanId::standard(id).unwrap()),
            (0..=EXTENDED_MAX).prop_map(|id| CanId::extended(id).unwrap()),
        ]
    }

    pub(crate) fn any_frame() -> impl Strategy<Value = Frame> {
        (any_id(), prop::collection::vec(any::<u8>(), 0..=Frame::MAX_DATA))
            .prop_map(|(id, data)| Frame::new(id, &data).unwrap())
    }

    pub(crate) fn any_format() -> impl Strategy<Value = FrameFormat> {
        prop_oneof![Just(FrameFormat::Classical), Just(FrameFormat::Fd), Just(FrameFormat::FdBitRateSwitch),]
    }
}

#[cfg(test)]
mod tests {
    use super::strategies::{any_frame, any_id};
    use super::*;
    use proptest::prelude::*;

    fn standard(id: u16) -> CanId {
        CanId::standard(id).unwrap()
    }

    fn extended(id: u32) -> CanId {
        CanId::extended(id).unwrap()
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_value() {
        assert_eq!(CanId::standard(0x800), Err(FrameError::StandardId { id: 0x800 }));
        assert_eq!(CanId::extended(0x2000_0000), Err(FrameError::ExtendedId { id: 0x2000_0000 }));
        assert_eq!(Frame::new(standard(1), &[0; 9]), Err(FrameError::DataLength { length: 9 }));
        assert_eq!(
            FrameError::DataLength { length: 9 }.to_string(),
            "9 data bytes: a classical frame carries at most 8"
        );
    }

    #[test]
    fn flags_of_remote_and_error_frames_are_refused() {
        for flags in [1 << 30, 1 << 29, 1 << 31 | 1 << 30, 1 << 31 | 1 << 29] {
            assert!(CanId::from_flagged(flags | 0x123).is_err());
        }
    }

    #[test]
    fn order_is_that_of_arbitration() {
        assert!(standard(0x080) < standard(0x181));
        assert!(
            standard(0x100) < extended(0x100 << 18),
            "equal base: the standard frame wins by its IDE bit"
        );
        assert!(extended(0x0FF << 18 | EXTENSION_MASK) < standard(0x100), "the base decides first");
        assert!(extended(0x100 << 18) < extended(0x100 << 18 | 1));
    }

    #[test]
    fn frames_show_as_in_a_candump_log() {
        assert_eq!(Frame::fixed(standard(0x123), [0x11, 0x22]).to_string(), "123#1122");
        assert_eq!(Frame::fixed(extended(0x123), []).to_string(), "00000123#");
    }

    proptest! {
        #[test]
        fn an_identifier_survives_its_flagged_form(id in any_id()) {
            prop_assert_eq!(CanId::from_flagged(id.flagged()), Ok(id));
        }

        #[test]
        fn a_frame_keeps_what_it_was_made_of(frame in any_frame()) {
            prop_assert_eq!(Frame::new(frame.id(), frame.data()), Ok(frame));
        }
    }
}
