//! Topics with many small messages a cycle: several messages travel in one sample.
//!
//! The messages of a sample share the cost of sending and receiving it. Each message keeps a number of its own.

use std::ops::Deref;

use iceoryx2::port::backpressure_strategy::BackpressureStrategy;
use iceoryx2::port::publisher::Publisher as IceoryxPublisher;
use iceoryx2::port::subscriber::Subscriber as IceoryxSubscriber;
use iceoryx2::prelude::{AllocationStrategy, ipc};
use iceoryx2::sample::Sample;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::ports::{Node, Refused, TransportError, check_version, failed};
use crate::clock;
use crate::messages::Message;

/// Most messages in a sample: those of a cycle of six drives.
const BATCH: usize = 16;

impl Node {
    fn batch_service<M: Message>(&self) -> Result<PortFactory<ipc::Service, [M], ()>, TransportError> {
        let builder = self.topic::<M, [M]>(M::DEPTH / BATCH)?;
        builder.open_or_create().map_err(failed("opening topic", M::TOPIC))
    }

    /// A publisher of batches.
    pub fn batch_publisher<M: Message>(&self) -> Result<BatchPublisher<M>, TransportError> {
        let refused = Refused::default();
        let publisher = self
            .batch_service::<M>()?
            .publisher_builder()
            .initial_max_slice_len(BATCH)
            .allocation_strategy(AllocationStrategy::Static)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .set_degradation_handler(refused.counter())
            .create()
            .map_err(failed("publishing", M::TOPIC))?;
        Ok(BatchPublisher { publisher, refused, sent: 0 })
    }

    /// A subscriber of batches; it keeps up to [`Message::DEPTH`] messages, less
    /// where batches are not full.
    pub fn batch_subscriber<M: Message>(&self) -> Result<BatchSubscriber<M>, TransportError> {
        let refused = Refused::default();
        let subscriber = self
            .batch_service::<M>()?
            .subscriber_builder()
            .set_degradation_handler(refused.counter())
            .create()
            .map_err(failed("subscribing to", M::TOPIC))?;
        Ok(BatchSubscriber { subscriber, refused })
    }
}

/// Publishes one message type in batches and numbers its messages.
#[doc(alias = "writer")]
#[derive(Debug)]
pub struct BatchPublisher<M: Message> {
    publisher: IceoryxPublisher<ipc::Service, [M], ()>,
    refused: Refused,
    sent: u64,
}

impl<M: Message> BatchPublisher<M> {
    /// Writes the messages into shared memory, stamps and publishes them in their order.
    pub fn publish(
        &mut self,
        messages: impl IntoIterator<Item = M, IntoIter: ExactSizeIterator>,
    ) -> Result<(), TransportError> {
        let mut messages = messages.into_iter();
        while messages.len() > 0 {
            let count = messages.len().min(BATCH);
            let sample = self.publisher.loan_slice_uninit(count).map_err(failed("loaning", M::TOPIC))?;
            let mut sample = sample.write_from_fn(|_| messages.next().expect("as many as it says"));
            let published_ns = clock::now_ns();
            for message in sample.payload_mut() {
                self.sent += 1;
                message.stamp(self.sent, published_ns);
            }
            sample.send().map_err(failed("sending", M::TOPIC))?;
        }
        Ok(())
    }

    /// Connects to the subscribers that are there by now, as [`Publisher::connect`](super::Publisher::connect).
    pub fn connect(&self) -> Result<(), TransportError> {
        self.refused.connect(&self.publisher, M::TOPIC)
    }

    /// Touches the memory of the next batch, as [`Publisher::warm_up`](super::Publisher::warm_up).
    pub fn warm_up(&self) -> Result<(), TransportError> {
        let sample = self.publisher.loan_slice_uninit(BATCH).map_err(failed("loaning", M::TOPIC))?;
        drop(sample.write_from_fn(|_| M::default()));
        Ok(())
    }
}

/// Receives one message type in batches, oldest first.
#[doc(alias = "reader")]
#[derive(Debug)]
pub struct BatchSubscriber<M: Message> {
    subscriber: IceoryxSubscriber<ipc::Service, [M], ()>,
    refused: Refused,
}

/// Messages in shared memory.
#[derive(Debug)]
pub struct ReceivedBatch<M: Message>(Sample<ipc::Service, [M], ()>);

impl<M: Message> Deref for ReceivedBatch<M> {
    type Target = [M];

    fn deref(&self) -> &[M] {
        &self.0
    }
}

impl<M: Message> BatchSubscriber<M> {
    /// The oldest batch not yet received, as [`Subscriber::receive`](super::Subscriber::receive).
    pub fn receive(&self) -> Result<Option<ReceivedBatch<M>>, TransportError> {
        let sample = self.subscriber.receive().map_err(failed("receiving", M::TOPIC))?;
        self.refused.check(M::TOPIC)?;
        let Some(sample) = sample else { return Ok(None) };
        sample.iter().try_for_each(check_version)?;
        Ok(Some(ReceivedBatch(sample)))
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
        let subscriber = node.batch_subscriber::<FrameTap>().unwrap();
        let mut publisher = node.batch_publisher::<FrameTap>().unwrap();
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
        let subscriber = node.batch_subscriber::<FrameTap>().unwrap();
        let mut publisher = node.batch_publisher::<FrameTap>().unwrap();
        let frames = [FrameTap::default(); BATCH];
        for _ in 0..FrameTap::DEPTH / BATCH + 2 {
            publisher.publish(frames).unwrap();
        }
        let oldest = subscriber.receive().unwrap().unwrap();
        assert_eq!(oldest[0].seq, 2 * BATCH as u64 + 1);
    }
}
