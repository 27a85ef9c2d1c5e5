//! Frame identifiers, valid by construction and ordered as the bus arbitrates.

use std::fmt;

use super::frame_error::FrameError;

const STANDARD_MAX: u32 = 0x7FF;
const EXTENDED_MAX: u32 = 0x1FFF_FFFF;
const EXTENSION_BITS: u32 = 18;
const EXTENSION_MASK: u32 = (1 << EXTENSION_BITS) - 1;
const IDE: u32 = 1 << EXTENSION_BITS;
const EXTENDED_FLAG: u32 = 1 << 31;

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

    /// From the form of `SocketCAN`: bit 31 is set for a 29-bit identifier.
    ///
    /// # Errors
    /// [`FrameError`] where the number is too large. The flags of remote and error frames (bits 30 and 29) are
    /// refused in this way too.
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
    /// The form of candump: 3 hexadecimal digits, or 8 for a 29-bit identifier.
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
}

#[cfg(test)]
mod tests {
    use super::strategies::any_id;
    use super::*;
    use proptest::prelude::*;

    fn standard(id: u16) -> CanId {
        CanId::standard(id).unwrap()
    }

    fn extended(id: u32) -> CanId {
        CanId::extended(id).unwrap()
    }

    #[test]
    fn an_identifier_that_is_too_large_is_refused_with_its_value() {
        assert_eq!(CanId::standard(0x800), Err(FrameError::StandardId { id: 0x800 }));
        assert_eq!(CanId::extended(0x2000_0000), Err(FrameError::ExtendedId { id: 0x2000_0000 }));
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

    proptest! {
        #[test]
        fn an_identifier_survives_its_flagged_form(id in any_id()) {
            prop_assert_eq!(CanId::from_flagged(id.flagged()), Ok(id));
        }
    }
}
