//! The frames of the buses: many small messages a cycle, so several travel in one sample.
//!
//! The messages of a sample share the cost of sending and receiving it. Each message keeps a number of its own.

use iceoryx2::{prelude::ipc, sample::Sample};
use masseter_domain::{BATCH, Inlet, Node, Outlet, TransportError, failed, frame_inlet, frame_outlet};

use super::{Connecting, check_version};
use crate::messages::{FrameTap, Message};

/// Publishes frames and numbers them.
#[derive(Debug)]
pub struct FramePublisher {
    port: Outlet<[FrameTap]>,
    sent: u64,
}

/// Receives frames, oldest first. Keeps up to [`Message::DEPTH`] frames, fewer with batches that are not full.
#[derive(Debug)]
pub struct FrameSubscriber(Inlet<[FrameTap]>);

/// Several frames in shared memory.
type Batch = Sample<ipc::Service, [FrameTap], ()>;

/// Sends this many frames, each of which `next` makes. Not generic, for the reason of [`Topic`](super::Topic).
fn send(
    outlet: &Outlet<[FrameTap]>,
    count: usize,
    next: &mut dyn FnMut() -> FrameTap,
) -> Result<(), TransportError> {
    let sample = outlet.loan_slice_uninit(count).map_err(failed("loaning", FrameTap::TOPIC))?;
    sample.write_from_fn(|_| next()).send().map_err(failed("sending", FrameTap::TOPIC))?;
    Ok(())
}

impl FramePublisher {
    /// A publisher of the topic of frames.
    pub fn open(node: &Node) -> Result<Self, TransportError> {
        Ok(Self { port: frame_outlet(node)?, sent: 0 })
    }

    /// The number of samples for this many frames.
    pub fn samples(frames: usize) -> usize {
        frames.div_ceil(BATCH)
    }

    /// Connects to the present subscribers, as [`Publisher::connect`](super::Publisher::connect).
    pub fn connect(&self) -> Result<(), TransportError> {
        self.port.connect()
    }

    /// Writes the frames into shared memory, stamps them with the time of a clock, and publishes them in their order.
    pub fn publish_by(
        &mut self,
        now_ns: impl Fn() -> u64,
        frames: impl IntoIterator<Item = FrameTap, IntoIter: ExactSizeIterator>,
    ) -> Result<(), TransportError> {
        let mut frames = frames.into_iter();
        while frames.len() > 0 {
            let (published_ns, sent) = (now_ns(), &mut self.sent);
            send(&self.port, frames.len().min(BATCH), &mut || {
                let mut frame = frames.next().expect("a batch has no more than there are");
                *sent += 1;
                frame.stamp(*sent, published_ns);
                frame
            })?;
        }
        Ok(())
    }

    /// Touches the memory of the next batch, as the `warm_up` of a publisher of single messages.
    pub fn warm_up(&self) -> Result<(), TransportError> {
        let sample = self.port.loan_slice_uninit(BATCH).map_err(failed("loaning", FrameTap::TOPIC))?;
        drop(sample.write_from_fn(|_| FrameTap::default()));
        Ok(())
    }
}

impl FrameSubscriber {
    /// A subscriber of the topic of frames.
    pub fn open(node: &Node) -> Result<Self, TransportError> {
        frame_inlet(node).map(Self)
    }

    /// The oldest waiting batch; never waits. Refuses after a failed connection to a publisher, because its frames are
    /// missing.
    pub fn receive(&self) -> Result<Option<Batch>, TransportError> {
        let batch = self.0.receive().map_err(failed("receiving", FrameTap::TOPIC))?;
        self.0.require_all_connections()?;
        batch.iter().flat_map(|frames| frames.iter()).try_for_each(check_version)?;
        Ok(batch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock;
    use crate::transport::ScratchDomain;

    #[test]
    fn messages_arrive_in_order_however_many_come_at_once() {
        let domain = ScratchDomain::claim("test-batches").unwrap();
        let node = Node::join(&domain).unwrap();
        let subscriber = FrameSubscriber::open(&node).unwrap();
        let mut publisher = FramePublisher::open(&node).unwrap();
        let mut sent = 0;
        for count in [0, 1, BATCH, BATCH + 1, 5 * BATCH, 3] {
            let frames: Vec<_> =
                (0..count).map(|id| FrameTap { id: id as u32, ..FrameTap::default() }).collect();
            publisher.publish_by(clock::now_ns, frames).unwrap();
            let mut received = Vec::new();
            while let Some(batch) = subscriber.receive().unwrap() {
                received.extend(batch.iter().map(|frame| (frame.seq, frame.id)));
            }
            let expected: Vec<_> = (0..count as u32).map(|id| (sent + 1 + u64::from(id), id)).collect();
            assert_eq!(received, expected);
            sent += count as u64;
        }
    }

    #[test]
    fn a_slow_subscriber_loses_the_oldest_and_sees_the_gap() {
        let domain = ScratchDomain::claim("test-behind").unwrap();
        let node = Node::join(&domain).unwrap();
        let subscriber = FrameSubscriber::open(&node).unwrap();
        let mut publisher = FramePublisher::open(&node).unwrap();
        let frames = [FrameTap::default(); BATCH];
        for _ in 0..FrameTap::DEPTH / BATCH + 2 {
            publisher.publish_by(clock::now_ns, frames).unwrap();
        }
        let oldest = subscriber.receive().unwrap().unwrap();
        assert_eq!(oldest[0].seq, 2 * BATCH as u64 + 1);
    }
}
