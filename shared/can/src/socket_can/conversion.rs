//! Conversion of frames to and from the kernel's form.

use socketcan::{CanDataFrame, EmbeddedFrame, ExtendedId, Frame as _, Id, StandardId};

use crate::frame::Frame;
use crate::id::CanId;

/// The kernel's form of a frame.
pub(super) fn to_kernel(frame: &Frame) -> CanDataFrame {
    CanDataFrame::new(to_kernel_id(frame.id()), frame.data()).expect("a frame of at most 8 bytes")
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

/// The frame of the kernel's form; `None` for a frame that CAN does not have.
pub(super) fn from_kernel(frame: &CanDataFrame) -> Option<Frame> {
    Frame::new(CanId::from_flagged(frame.id_word()).ok()?, frame.data()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::strategies::any_frame;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_frame_survives_the_form_of_the_kernel(frame in any_frame()) {
            prop_assert_eq!(from_kernel(&to_kernel(&frame)), Some(frame));
        }
    }
}
