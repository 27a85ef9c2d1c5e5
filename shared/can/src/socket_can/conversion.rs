//! Conversion of frames to and from the kernel's form.

use socketcan::id::FdFlags;
use socketcan::{
    CanAnyFrame, CanDataFrame, CanFdFrame, EmbeddedFrame, ExtendedId, Frame as _, Id, StandardId,
};

use crate::frame::{Frame, FrameFormat};
use crate::id::CanId;

/// The kernel's form of a frame.
pub(super) fn to_kernel(frame: &Frame) -> CanAnyFrame {
    let (id, data) = (to_kernel_id(frame.id()), frame.data());
    let flags = match frame.format() {
        FrameFormat::Classical => {
            let classical = CanDataFrame::new(id, data).expect("a classical frame of at most 8 bytes");
            return CanAnyFrame::Normal(classical);
        }
        FrameFormat::Fd => FdFlags::empty(),
        FrameFormat::FdBitRateSwitch => FdFlags::BRS,
    };
    CanAnyFrame::Fd(CanFdFrame::with_flags(id, data, flags).expect("an FD frame of at most 64 bytes"))
}

fn to_kernel_id(id: CanId) -> Id {
    let number = id.number();
    let id = if id.is_extended() {
        ExtendedId::new(number).map(Id::Extended)
    } else {
        StandardId::new(number as u16).map(Id::Standard)
    };
    id.expect("an identifier of 11 or 29 bits")
}

/// The frame of the kernel's classical form; `None` for a frame that CAN does not have.
pub(super) fn from_data(frame: &CanDataFrame) -> Option<Frame> {
    Frame::new(CanId::from_flagged(frame.id_word()).ok()?, frame.data()).ok()
}

/// The frame of the kernel's FD form; `None` for a frame that CAN does not have.
pub(super) fn from_fd(frame: &CanFdFrame) -> Option<Frame> {
    let format = if frame.is_brs() { FrameFormat::FdBitRateSwitch } else { FrameFormat::Fd };
    Frame::with_format(CanId::from_flagged(frame.id_word()).ok()?, format, frame.data()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::strategies::any_frame;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_frame_survives_the_form_of_the_kernel(frame in any_frame()) {
            let back = match to_kernel(&frame) {
                CanAnyFrame::Normal(data) => from_data(&data),
                CanAnyFrame::Fd(fd) => from_fd(&fd),
                CanAnyFrame::Remote(_) | CanAnyFrame::Error(_) => None,
            };
            prop_assert_eq!(back, Some(frame));
        }
    }
}
