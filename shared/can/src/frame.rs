//! Data frames of classical CAN, valid by construction.
//!
//! Remote frames are not represented. [`ErrorReport`](super::ErrorReport) represents an error frame.

use std::fmt;

use super::frame_error::FrameError;
use super::id::CanId;

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
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
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
        bytes.get_mut(..length).ok_or(FrameError::DataLength { length })?.copy_from_slice(data);
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
            return Err(FrameError::DataLength { length });
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

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Frame({self})")
    }
}

#[cfg(test)]
pub(super) mod strategies {
    use super::super::id::strategies::any_id;
    use super::*;
    use proptest::prelude::*;

    /// Also of the runs of equal bits that are stuffed most.
    pub(crate) fn any_frame() -> impl Strategy<Value = Frame> {
        let byte = prop_oneof![Just(0_u8), Just(0xFF), any::<u8>()];
        (any_id(), prop::collection::vec(byte, 0..=Frame::MAX_DATA))
            .prop_map(|(id, data)| Frame::new(id, &data).unwrap())
    }
}

#[cfg(test)]
mod tests {
    use super::strategies::any_frame;
    use super::*;
    use proptest::prelude::*;

    fn id() -> CanId {
        CanId::standard(0x123).unwrap()
    }

    #[test]
    fn a_frame_carries_at_most_eight_bytes() {
        for length in 0..=9 {
            let frame = Frame::new(id(), &vec![1; length]).map(|frame| frame.data().len());
            assert_eq!(frame, if length <= 8 { Ok(length) } else { Err(FrameError::DataLength { length }) });
        }
        assert_eq!(
            FrameError::DataLength { length: 9 }.to_string(),
            "9 data bytes: a classical frame carries at most 8"
        );
    }

    #[test]
    fn bytes_behind_the_length_are_no_data() {
        for length in 0..=9 {
            let frame = Frame::of_padded(id(), length, [0xA5; 8]);
            let expected = if length <= 8 {
                Frame::new(id(), &vec![0xA5; length])
            } else {
                Err(FrameError::DataLength { length })
            };
            assert_eq!(frame, expected);
        }
    }

    #[test]
    fn frames_show_as_in_a_candump_log() {
        assert_eq!(Frame::fixed(id(), [0x11, 0x22]).to_string(), "123#1122");
        assert_eq!(Frame::fixed(CanId::extended(0x123).unwrap(), []).to_string(), "00000123#");
    }

    proptest! {
        #[test]
        fn a_frame_keeps_what_it_was_made_of(frame in any_frame()) {
            prop_assert_eq!(Frame::new(frame.id(), frame.data()), Ok(frame));
        }
    }
}
