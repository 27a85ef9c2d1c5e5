//! Data frames, valid by construction: classical ones of up to 8 bytes and FD ones of up to 64.
//!
//! Remote frames are not represented. [`ErrorReport`](super::ErrorReport) represents an error frame.

use std::fmt;

use super::frame_error::FrameError;
use super::id::CanId;

/// Lengths that an FD frame may have; their index is the data length code.
const FD_LENGTHS: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// The format of a frame on the wire.
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

impl FrameFormat {
    /// Whether the format is one of the FD formats.
    pub const fn is_fd(self) -> bool {
        !matches!(self, Self::Classical)
    }

    /// Refuses data lengths that the format does not have.
    pub fn check(self, length: usize) -> Result<(), FrameError> {
        let has_code = FD_LENGTHS.iter().any(|&allowed| usize::from(allowed) == length);
        match self.is_fd() {
            false if length > Frame::MAX_CLASSICAL_DATA => Err(FrameError::DataLength { length }),
            true if !has_code => Err(FrameError::FdDataLength { length }),
            _ => Ok(()),
        }
    }
}

/// A data frame.
///
/// # Examples
/// ```
/// use masseter_can::{CanId, Frame, FrameFormat};
///
/// let id = CanId::standard(0x181)?;
/// let classical = Frame::new(id, &[0x37, 0x02])?;
/// assert_eq!(classical.to_string(), "181#3702");
/// let fd = Frame::with_format(id, FrameFormat::FdBitRateSwitch, &[0; 64])?;
/// assert_eq!(fd.data().len(), 64);
/// assert!(Frame::new(id, &[0; 9]).is_err(), "a classical frame carries at most 8 bytes");
/// # Ok::<(), masseter_can::FrameError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Frame {
    id: CanId,
    length: u8,
    format: FrameFormat,
    /// Bytes beyond `length` are zero, so that equal frames are equal values.
    bytes: [u8; Frame::MAX_DATA],
}

impl Frame {
    /// Bytes a frame carries at most, in FD format.
    pub const MAX_DATA: usize = 64;
    /// Bytes a classical frame carries at most.
    pub const MAX_CLASSICAL_DATA: usize = 8;

    /// A classical frame of that identifier and data.
    ///
    /// # Errors
    /// [`FrameError::DataLength`] with more than 8 bytes.
    pub fn new(id: CanId, data: &[u8]) -> Result<Self, FrameError> {
        Self::with_format(id, FrameFormat::Classical, data)
    }

    /// A classical frame whose length the compiler checks.
    pub fn fixed<const N: usize>(id: CanId, data: [u8; N]) -> Self {
        const { assert!(N <= Self::MAX_CLASSICAL_DATA, "a classical frame carries at most 8 bytes") };
        Self::with_valid_length(id, FrameFormat::Classical, &data)
    }

    /// A frame of that identifier, format and data.
    ///
    /// # Errors
    /// [`FrameError::DataLength`] and [`FrameError::FdDataLength`] for lengths that the format does not have.
    pub fn with_format(id: CanId, format: FrameFormat, data: &[u8]) -> Result<Self, FrameError> {
        format.check(data.len())?;
        Ok(Self::with_valid_length(id, format, data))
    }

    fn with_valid_length(id: CanId, format: FrameFormat, data: &[u8]) -> Self {
        let mut bytes = [0; Self::MAX_DATA];
        bytes[..data.len()].copy_from_slice(data);
        Self { id, length: data.len() as u8, format, bytes }
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

    /// A classical frame in that format, as a port in FD format sends it; an FD frame unchanged.
    #[must_use]
    pub const fn promoted(self, format: FrameFormat) -> Self {
        if self.format.is_fd() { self } else { Self { format, ..self } }
    }

    /// The data length code.
    pub(super) fn length_code(&self) -> u8 {
        let code = FD_LENGTHS.iter().position(|&length| length == self.length);
        code.expect("a valid length") as u8
    }

    /// The bytes of the longest frame; bytes beyond the data are zero.
    pub const fn padded(&self) -> &[u8; Self::MAX_DATA] {
        &self.bytes
    }
}

impl fmt::Display for Frame {
    /// The form of candump logs: `123#11223344`, or in FD format `123##111223344`, the first digit being the flags (1
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
    use super::super::id::strategies::any_id;
    use super::*;
    use proptest::prelude::*;

    /// Of every format and every length it may have.
    pub(crate) fn any_frame() -> impl Strategy<Value = Frame> {
        prop_oneof![any_classical_frame(), any_fd_frame()]
    }

    pub(crate) fn any_classical_frame() -> impl Strategy<Value = Frame> {
        (any_id(), prop::collection::vec(any::<u8>(), 0..=Frame::MAX_CLASSICAL_DATA))
            .prop_map(|(id, data)| Frame::new(id, &data).unwrap())
    }

    /// Also of the runs of equal bits that are stuffed most.
    pub(crate) fn any_fd_frame() -> impl Strategy<Value = Frame> {
        let byte = prop_oneof![Just(0_u8), Just(0xFF), any::<u8>()];
        let data = (prop::sample::select(&FD_LENGTHS[..]), prop::array::uniform32(byte))
            .prop_map(|(length, bytes)| bytes.repeat(2)[..usize::from(length)].to_vec());
        let format = prop_oneof![Just(FrameFormat::Fd), Just(FrameFormat::FdBitRateSwitch)];
        (any_id(), format, data).prop_map(|(id, format, data)| Frame::with_format(id, format, &data).unwrap())
    }
}

#[cfg(test)]
mod tests {
    use super::strategies::{any_classical_frame, any_frame};
    use super::*;
    use proptest::prelude::*;

    fn id() -> CanId {
        CanId::standard(0x123).unwrap()
    }

    #[test]
    fn lengths_are_those_of_the_format() {
        for length in 0..=65 {
            let data = vec![1; length];
            let classical = Frame::new(id(), &data).map(|frame| frame.data().len());
            let expected = if length <= 8 { Ok(length) } else { Err(FrameError::DataLength { length }) };
            assert_eq!(classical, expected);
            let fd = Frame::with_format(id(), FrameFormat::Fd, &data).map(|frame| frame.data().len());
            let is_fd_length = FD_LENGTHS.contains(&(length as u8));
            assert_eq!(fd, if is_fd_length { Ok(length) } else { Err(FrameError::FdDataLength { length }) });
        }
        assert_eq!(
            FrameError::DataLength { length: 9 }.to_string(),
            "9 data bytes: a classical frame carries at most 8"
        );
    }

    #[test]
    fn frames_show_as_in_a_candump_log() {
        assert_eq!(Frame::fixed(id(), [0x11, 0x22]).to_string(), "123#1122");
        assert_eq!(Frame::fixed(CanId::extended(0x123).unwrap(), []).to_string(), "00000123#");
        let frame = Frame::fixed(id(), [0x11, 0x22]);
        assert_eq!(frame.promoted(FrameFormat::FdBitRateSwitch).to_string(), "123##11122");
        assert_eq!(frame.promoted(FrameFormat::Fd).to_string(), "123##01122");
    }

    proptest! {
        #[test]
        fn a_frame_keeps_what_it_was_made_of(frame in any_frame()) {
            prop_assert_eq!(Frame::with_format(frame.id(), frame.format(), frame.data()), Ok(frame));
        }

        #[test]
        fn only_classical_frames_are_promoted(classical in any_classical_frame(), frame in any_frame()) {
            let promoted = classical.promoted(FrameFormat::Fd);
            prop_assert_eq!((promoted.format(), promoted.data()), (FrameFormat::Fd, classical.data()));
            if frame.format().is_fd() {
                prop_assert_eq!(frame.promoted(FrameFormat::Classical), frame);
            }
        }
    }
}
