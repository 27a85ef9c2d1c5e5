//! Frames as the `frame` topic carries them: what a tap on a bus saw.

use super::bus::Received;
use super::frame::{CanId, Frame, FrameError};
use crate::messages::FrameTap;

/// The message for a frame seen on the bus of that index; its header is stamped when it is published.
pub fn encode(bus: u16, received: &Received) -> FrameTap {
    let frame = received.frame;
    FrameTap {
        time_ns: received.time_ns,
        id: frame.id().flagged(),
        bus,
        length: frame.data().len() as u16,
        data: frame.padded(),
        ..FrameTap::default()
    }
}

/// The frame in a message.
///
/// # Errors
/// [`FrameError`] where identifier or length are those of no frame.
pub fn decode(tap: &FrameTap) -> Result<Received, FrameError> {
    let length = usize::from(tap.length);
    let data = tap.data.get(..length).ok_or(FrameError::DataLength { length })?;
    let frame = Frame::new(CanId::from_flagged(tap.id)?, data)?;
    Ok(Received { frame, time_ns: tap.time_ns })
}

#[cfg(test)]
mod tests {
    use super::super::frame::strategies::any_frame;
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_is_no_frame_is_refused() {
        let tap = FrameTap { length: 9, ..Default::default() };
        assert_eq!(decode(&tap), Err(FrameError::DataLength { length: 9 }));
        let tap = FrameTap { id: 0x800, ..Default::default() };
        assert_eq!(decode(&tap), Err(FrameError::StandardId { id: 0x800 }));
    }

    proptest! {
        #[test]
        fn every_frame_survives(frame in any_frame(), time_ns: u64, bus: u16) {
            let received = Received { frame, time_ns };
            prop_assert_eq!(decode(&encode(bus, &received)), Ok(received));
        }
    }
}
