//! Topics with many small messages a cycle: several messages travel in one sample.
//!
//! The messages of a sample share the cost of sending and receiving it. Each message keeps a number of its own.

use iceoryx2::prelude::{AllocationStrategy, ipc};
use iceoryx2::sample::Sample;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::error::{TransportError, check_version, failed};
use super::ports::{Node, Publisher, Subscriber};
use crate::clock;
use crate::messages::Message;

/// Most messages in a sample: those of a cycle of six drives.
const BATCH: usize = 16;

/// Publishes batches of one message type and numbers the messages.
#[derive(Debug)]
pub struct BatchPublisher<M: Message>(Publisher<[M]>);

/// Receives batches, oldest first. It keeps up to [`Message::DEPTH`] messages, less where batches are not full.
#[derive(Debug)]
pub struct BatchSubscriber<M: Message>(Subscriber<[M]>);

fn service<M: Message>(node: &Node) -> Result<PortFactory<ipc::Service, [M], ()>, TransportError> {
    let builder = node.topic::<M, [M]>(M::DEPTH / BATCH)?;
    builder.open_or_create().map_err(failed("opening topic", M::TOPIC))
}

impl<M: Message> BatchPublisher<M> {
    /// A publisher of the type's topic.
    pub fn open(node: &Node) -> Result<Self, TransportError> {
        let service = service(node)?;
        let builder = service.publisher_builder().initial_max_slice_len(BATCH);
        Publisher::create(builder.allocation_strategy(AllocationStrategy::Static)).map(Self)
    }

    /// The number of samples in which so many messages travel.
    pub fn samples(messages: usize) -> usize {
        messages.div_ceil(BATCH)
    }

    /// Connects to the subscribers that are there by now, as [`Publisher::connect`].
    pub fn connect(&self) -> Result<(), TransportError> {
        self.0.connect()
    }

    /// Writes the messages into shared memory, stamps and publishes them in their order.
    pub fn publish(
        &mut self,
        messages: impl IntoIterator<Item = M, IntoIter: ExactSizeIterator>,
    ) -> Result<(), TransportError> {
        self.publish_by(clock::now_ns, messages)
    }

    /// The same with the time of another clock in the stamps.
    pub fn publish_by(
        &mut self,
        now_ns: impl Fn() -> u64,
        messages: impl IntoIterator<Item = M, IntoIter: ExactSizeIterator>,
    ) -> Result<(), TransportError> {
        let mut messages = messages.into_iter();
        while messages.len() > 0 {
            let count = messages.len().min(BATCH);
            let sample = self.0.port.loan_slice_uninit(count).map_err(failed("loaning", M::TOPIC))?;
            let mut sample =
                sample.write_from_fn(|_| messages.next().expect("`count` is at most its length"));
            let published_ns = now_ns();
            for message in sample.payload_mut() {
                self.0.sent += 1;
                message.stamp(self.0.sent, published_ns);
            }
            sample.send().map_err(failed("sending", M::TOPIC))?;
        }
        Ok(())
    }

    /// Touches the memory of the next batch, as the `warm_up` of a publisher of single messages.
    pub fn warm_up(&self) -> Result<(), TransportError> {
        let sample = self.0.port.loan_slice_uninit(BATCH).map_err(failed("loaning", M::TOPIC))?;
        drop(sample.write_from_fn(|_| M::default()));
        Ok(())
    }
}

impl<M: Message> BatchSubscriber<M> {
    /// A subscriber of the type's topic.
    pub fn open(node: &Node) -> Result<Self, TransportError> {
        Subscriber::create(service(node)?.subscriber_builder()).map(Self)
    }

    /// The oldest batch not yet received; never waits. Refused when a connection to a publisher failed, since its messages
    /// would be missing.
    pub fn receive(&self) -> Result<Option<Sample<ipc::Service, [M], ()>>, TransportError> {
        let sample = self.0.port.receive().map_err(failed("receiving", M::TOPIC))?;
        self.0.refused.check(M::TOPIC)?;
        sample.iter().flat_map(|sample| sample.iter()).try_for_each(check_version)?;
        Ok(sample)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::FrameTap;
    use crate::transport::ScratchDomain;

    #[test]
    fn messages_arrive_in_order_however_many_come_at_once() {
        let domain = ScratchDomain::claim("test-batches").unwrap();
        let node = Node::join(&domain).unwrap();
        let subscriber = BatchSubscriber::<FrameTap>::open(&node).unwrap();
        let mut publisher = BatchPublisher::<FrameTap>::open(&node).unwrap();
        let mut sent = 0;
        for count in [0, 1, BATCH, BATCH + 1, 5 * BATCH, 3] {
            let frames: Vec<_> =
                (0..count).map(|id| FrameTap { id: id as u32, ..FrameTap::default() }).collect();
            publisher.publish(frames).unwrap();
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
        let subscriber = BatchSubscriber::<FrameTap>::open(&node).unwrap();
        let mut publisher = BatchPublisher::<FrameTap>::open(&node).unwrap();
        let frames = [FrameTap::default(); BATCH];
        for _ in 0..FrameTap::DEPTH / BATCH + 2 {
            publisher.publish(frames).unwrap();
        }
        let oldest = subscriber.receive().unwrap().unwrap();
        assert_eq!(oldest[0].seq, 2 * BATCH as u64 + 1);
    }
}
