//! The frames of the buses: many small messages a cycle, so several travel in one sample.
//!
//! The messages of a sample share the cost of sending and receiving it. Each message keeps a number of its own.

use iceoryx2::prelude::{AllocationStrategy, ipc};
use iceoryx2::{sample::Sample, service::port_factory::publish_subscribe::PortFactory};

use super::{Connecting, Inlet, Node, Outlet, TransportError, check_version, failed};
use crate::messages::{FrameTap, Message};

/// Most messages in a sample: the messages of a cycle of six drives.
const BATCH: usize = 16;

/// Publishes frames and numbers them.
#[derive(Debug)]
pub struct FramePublisher {
    port: Box<dyn Outgoing>,
    sent: u64,
}

/// Receives frames, oldest first. Keeps up to [`Message::DEPTH`] frames, fewer with batches that are not full.
#[derive(Debug)]
pub struct FrameSubscriber(Box<dyn Incoming>);

/// Several frames in shared memory.
type Batch = Sample<ipc::Service, [FrameTap], ()>;

/// The port of a publisher, behind a pointer for the reason of [`Topic`](super::Topic).
trait Outgoing: Connecting {
    /// Sends this many frames: `next` makes each in shared memory, `stamp` completes the batch.
    fn send(
        &self,
        count: usize,
        next: &mut dyn FnMut() -> FrameTap,
        stamp: &mut dyn FnMut(&mut [FrameTap]),
    ) -> Result<(), TransportError>;
    fn warm_up(&self) -> Result<(), TransportError>;
}

/// The port of a subscriber.
trait Incoming: Connecting {
    fn next(&self) -> Result<Option<Batch>, TransportError>;
}

impl Outgoing for Outlet<[FrameTap]> {
    fn send(
        &self,
        count: usize,
        next: &mut dyn FnMut() -> FrameTap,
        stamp: &mut dyn FnMut(&mut [FrameTap]),
    ) -> Result<(), TransportError> {
        let sample = self.inner.loan_slice_uninit(count).map_err(failed("loaning", FrameTap::TOPIC))?;
        let mut sample = sample.write_from_fn(|_| next());
        stamp(sample.payload_mut());
        sample.send().map_err(failed("sending", FrameTap::TOPIC))?;
        Ok(())
    }

    fn warm_up(&self) -> Result<(), TransportError> {
        let sample = self.inner.loan_slice_uninit(BATCH).map_err(failed("loaning", FrameTap::TOPIC))?;
        drop(sample.write_from_fn(|_| FrameTap::default()));
        Ok(())
    }
}

impl Incoming for Inlet<[FrameTap]> {
    fn next(&self) -> Result<Option<Batch>, TransportError> {
        let sample = self.inner.receive().map_err(failed("receiving", FrameTap::TOPIC))?;
        self.require_all_connections()?;
        sample.iter().flat_map(|sample| sample.iter()).try_for_each(check_version)?;
        Ok(sample)
    }
}

fn service(node: &Node) -> Result<PortFactory<ipc::Service, [FrameTap], ()>, TransportError> {
    let builder = node.topic::<FrameTap, [FrameTap]>(FrameTap::DEPTH / BATCH)?;
    builder.open_or_create().map_err(failed("opening topic", FrameTap::TOPIC))
}

impl FramePublisher {
    /// A publisher of the topic of frames.
    pub fn open(node: &Node) -> Result<Self, TransportError> {
        let service = service(node)?;
        let builder = service.publisher_builder().initial_max_slice_len(BATCH);
        let outlet =
            Outlet::create(builder.allocation_strategy(AllocationStrategy::Static), FrameTap::TOPIC)?;
        Ok(Self { port: Box::new(outlet), sent: 0 })
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
            let (count, sent) = (frames.len().min(BATCH), &mut self.sent);
            let mut next = || frames.next().expect("`count` is at most its length");
            self.port.send(count, &mut next, &mut |batch| {
                let published_ns = now_ns();
                for frame in batch {
                    *sent += 1;
                    frame.stamp(*sent, published_ns);
                }
            })?;
        }
        Ok(())
    }

    /// Touches the memory of the next batch, as the `warm_up` of a publisher of single messages.
    pub fn warm_up(&self) -> Result<(), TransportError> {
        self.port.warm_up()
    }
}

impl FrameSubscriber {
    /// A subscriber of the topic of frames.
    pub fn open(node: &Node) -> Result<Self, TransportError> {
        let service = service(node)?;
        Ok(Self(Box::new(Inlet::create(service.subscriber_builder(), FrameTap::TOPIC)?)))
    }

    /// The oldest waiting batch; never waits. Refuses after a failed connection to a publisher, because its frames are
    /// missing.
    pub fn receive(&self) -> Result<Option<Batch>, TransportError> {
        self.0.next()
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
