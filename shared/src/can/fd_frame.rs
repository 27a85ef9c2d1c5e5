//! CAN FD data frames of up to 64 bytes, valid by construction.
//!
//! Value, length and log form only: the bus trait carries frames of up to 8 bytes, in FD format too
//! ([`FrameFormat`]), which is all that the rig's process data need.

use std::fmt;

use super::frame::{CanId, Frame, FrameFormat};
use super::wire::{FrameBits, fd_bits};

/// Lengths that an FD frame may have; their index is the data length code.
const LENGTHS: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// A length that no FD frame has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{length} data bytes: an FD frame carries 0 to 8, 12, 16, 20, 24, 32, 48 or 64")]
pub struct FdLengthError {
    /// Bytes asked for.
    pub length: usize,
}

/// Whether the data phase goes at the data bit rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum FdFormat {
    /// All at the nominal bit rate.
    OneRate,
    /// BRS is set.
    BitRateSwitch,
}

/// An FD frame.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct FdFrame {
    id: CanId,
    format: FdFormat,
    length_code: u8,
    /// Bytes beyond the length are zero, so that equal frames are equal values.
    bytes: [u8; Self::MAX_DATA],
}

impl FdFrame {
    /// Bytes an FD frame carries at most.
    pub const MAX_DATA: usize = 64;

    /// A frame of that identifier and data.
    ///
    /// # Errors
    /// [`FdLengthError`] for lengths that have no data length code.
    pub fn new(id: CanId, format: FdFormat, data: &[u8]) -> Result<Self, FdLengthError> {
        let length = data.len();
        let code = LENGTHS.iter().position(|&allowed| usize::from(allowed) == length);
        let length_code = code.ok_or(FdLengthError { length })? as u8;
        let mut bytes = [0; Self::MAX_DATA];
        bytes[..length].copy_from_slice(data);
        Ok(Self { id, format, length_code, bytes })
    }

    /// A frame of the next length that holds the data, filled up with zeros.
    ///
    /// # Panics
    /// With more than 64 bytes.
    #[cfg(test)]
    pub(super) fn padded(id: CanId, format: FdFormat, data: &[u8]) -> Self {
        let length = LENGTHS.iter().find(|&&allowed| usize::from(allowed) >= data.len()).unwrap();
        let mut bytes = data.to_vec();
        bytes.resize(usize::from(*length), 0);
        Self::new(id, format, &bytes).unwrap()
    }

    /// The identifier.
    pub const fn id(&self) -> CanId {
        self.id
    }

    /// The format.
    pub const fn format(&self) -> FdFormat {
        self.format
    }

    /// The data bytes.
    pub fn data(&self) -> &[u8] {
        &self.bytes[..usize::from(LENGTHS[usize::from(self.length_code)])]
    }

    /// Exact length on the wire, interframe space included.
    pub fn bits(&self) -> FrameBits {
        fd_bits(self.id, self.format == FdFormat::BitRateSwitch, self.length_code, self.data())
    }
}

impl TryFrom<&Frame> for FdFrame {
    type Error = FrameFormat;

    /// The same frame where it is in FD format; else its format.
    fn try_from(frame: &Frame) -> Result<Self, FrameFormat> {
        let format = match frame.format() {
            FrameFormat::Classical => return Err(FrameFormat::Classical),
            FrameFormat::Fd => FdFormat::OneRate,
            FrameFormat::FdBitRateSwitch => FdFormat::BitRateSwitch,
        };
        Ok(Self::new(frame.id(), format, frame.data()).expect("0 to 8 bytes are FD lengths"))
    }
}

impl fmt::Display for FdFrame {
    /// As candump logs it: `123##1112233`, the first digit being the flags (1 for BRS).
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}##{}", self.id, u8::from(self.format == FdFormat::BitRateSwitch))?;
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

impl fmt::Debug for FdFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "FdFrame({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_lengths_with_a_code_can_be_built() {
        let id = CanId::standard(0x123).unwrap();
        for length in 0..=65 {
            let result = FdFrame::new(id, FdFormat::OneRate, &vec![1; length]);
            if LENGTHS.contains(&(length as u8)) {
                assert_eq!(result.unwrap().data().len(), length);
            } else {
                assert_eq!(result, Err(FdLengthError { length }));
            }
        }
    }

    #[test]
    fn frames_show_as_in_a_candump_log() {
        let id = CanId::standard(0x123).unwrap();
        let frame = Frame::fixed(id, [0x11, 0x22]).in_format(FrameFormat::FdBitRateSwitch);
        assert_eq!(FdFrame::try_from(&frame).unwrap().to_string(), "123##11122");
        assert_eq!(frame.to_string(), "123##11122");
        assert_eq!(frame.in_format(FrameFormat::Fd).to_string(), "123##01122");
    }
}
