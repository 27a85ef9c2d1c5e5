//! Frames that a node transmits at one instant, in their order.

use std::collections::VecDeque;

use masseter_can::Frame;

/// Boot-up or heartbeat, four TPDOs, an SDO answer and emergencies.
const CAPACITY: usize = 12;

/// The frames.
#[derive(Debug, Clone)]
pub(super) struct Outbox(VecDeque<Frame>);

impl Outbox {
    /// No frames, with room for the most.
    pub(super) fn new() -> Self {
        Self(VecDeque::with_capacity(CAPACITY))
    }

    /// Adds a frame. Without room the frame is lost, as in a node whose transmit queue is full.
    pub(super) fn add(&mut self, frame: Frame) {
        if self.0.len() < CAPACITY {
            self.0.push_back(frame);
        }
    }

    /// Discards every frame: the node has lost its supply.
    pub(super) fn clear(&mut self) {
        self.0.clear();
    }

    /// Takes the oldest frame.
    pub(super) fn take(&mut self) -> Option<Frame> {
        self.0.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::CanId;

    use super::*;

    #[test]
    fn frames_leave_in_their_order_and_the_last_ones_have_no_room() {
        let frame = |number: u8| Frame::fixed(CanId::standard(1).unwrap(), [number]);
        let mut outbox = Outbox::new();
        for round in 0..3 {
            (0..20).for_each(|number| outbox.add(frame(number)));
            let left: Vec<_> = std::iter::from_fn(|| outbox.take()).collect();
            assert_eq!(left, (0..CAPACITY as u8).map(frame).collect::<Vec<_>>(), "round {round}");
        }
    }
}
