//! Frames that a node transmits at one instant, in their order.

use masseter_can::Frame;

/// Boot-up or heartbeat, four TPDOs, an SDO answer and emergencies.
const CAPACITY: usize = 12;

/// The frames.
#[derive(Debug, Clone, Default)]
pub(super) struct Outbox {
    frames: [Option<Frame>; CAPACITY],
    first: usize,
    count: usize,
}

impl Outbox {
    /// Adds a frame. Without room the frame is lost, as in a node whose transmit queue is full.
    pub(super) fn add(&mut self, frame: Frame) {
        if self.count == 0 {
            self.first = 0;
        }
        if self.count < CAPACITY {
            self.frames[(self.first + self.count) % CAPACITY] = Some(frame);
            self.count += 1;
        }
    }

    /// Takes the oldest frame.
    pub(super) fn take(&mut self) -> Option<Frame> {
        // Most calls find no frame: they write nothing.
        if self.count == 0 {
            return None;
        }
        let frame = self.frames[self.first].take()?;
        (self.first, self.count) = ((self.first + 1) % CAPACITY, self.count - 1);
        Some(frame)
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::CanId;

    use super::*;

    #[test]
    fn frames_leave_in_their_order_and_the_last_ones_have_no_room() {
        let frame = |number: u8| Frame::fixed(CanId::standard(1).unwrap(), [number]);
        let mut outbox = Outbox::default();
        for round in 0..3 {
            (0..20).for_each(|number| outbox.add(frame(number)));
            let left: Vec<_> = std::iter::from_fn(|| outbox.take()).collect();
            assert_eq!(left, (0..CAPACITY as u8).map(frame).collect::<Vec<_>>(), "round {round}");
        }
    }
}
