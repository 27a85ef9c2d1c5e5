//! Topics of many small messages a cycle: several travel in one sample, each still a message of its own.
//!
//! What a sample costs, to send and to receive, is shared by the messages in it.

use std::ops::Deref;

use iceoryx2::port::backpressure_strategy::BackpressureStrategy;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{AllocationStrategy, ipc};
use iceoryx2::sample::Sample;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::ports::{Node, Refused, TransportError, check_version, failed};
use crate::clock;
use crate::messages::Message;

/// Messages that a sample holds at most: those that a cycle of six drives gives.
const BATCH: usize = 16;

impl Node {
    fn batch_service<M: Message>(&self) -> Result<PortFactory<ipc::Service, [M], ()>, TransportError> {
        let builder = self.topic::<M, [M]>(M::DEPTH / BATCH)?;
        builder.open_or_create().map_err(failed("opening topic", M::TOPIC))
    }

    /// The publishing end of a topic that travels in batches.
    pub fn batch_outlet<M: Message>(&self) -> Result<BatchOutlet<M>, TransportError> {
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
        Ok(BatchOutlet { publisher, refused, sent: 0 })
    }

    /// The receiving end of a topic that travels in batches; it keeps up to [`Message::DEPTH`] messages, less
    /// where batches are not full.
    pub fn batch_inlet<M: Message>(&self) -> Result<BatchInlet<M>, TransportError> {
        let refused = Refused::default();
        let subscriber = self
            .batch_service::<M>()?
            .subscriber_builder()
            .set_degradation_handler(refused.counter())
            .create()
            .map_err(failed("subscribing to", M::TOPIC))?;
        Ok(BatchInlet { subscriber, refused })
    }
}

/// Publishes one message type in batches and numbers its messages.
#[derive(Debug)]
pub struct BatchOutlet<M: Message> {
    publisher: Publisher<ipc::Service, [M], ()>,
    refused: Refused,
    sent: u64,
}

impl<M: Message> BatchOutlet<M> {
    /// Makes the messages where subscribers will read them, stamps and publishes them, in their order.
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

    /// Connects to the subscribers that are there by now, as [`Outlet::connect`](super::Outlet::connect).
    pub fn connect(&self) -> Result<(), TransportError> {
        self.refused.connect(&self.publisher, M::TOPIC)
    }

    /// Touches the memory of the next batch: so the first one of the loop costs no page fault, and a later one finds it
    /// in the caches.
    pub fn warm_up(&self) -> Result<(), TransportError> {
        let sample = self.publisher.loan_slice_uninit(BATCH).map_err(failed("loaning", M::TOPIC))?;
        drop(sample.write_from_fn(|_| M::default()));
        Ok(())
    }
}

/// Receives one message type in batches, oldest first.
#[derive(Debug)]
pub struct BatchInlet<M: Message> {
    subscriber: Subscriber<ipc::Service, [M], ()>,
    refused: Refused,
}

/// Messages still lying in shared memory.
#[derive(Debug)]
pub struct ReceivedBatch<M: Message>(Sample<ipc::Service, [M], ()>);

impl<M: Message> Deref for ReceivedBatch<M> {
    type Target = [M];

    fn deref(&self) -> &[M] {
        &self.0
    }
}

impl<M: Message> BatchInlet<M> {
    /// The oldest batch not yet received, as [`Inlet::receive`](super::Inlet::receive).
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
        let inlet = node.batch_inlet::<FrameTap>().unwrap();
        let mut outlet = node.batch_outlet::<FrameTap>().unwrap();
        let mut sent = 0;
        for count in [0, 1, BATCH, BATCH + 1, 5 * BATCH, 3] {
            let frames: Vec<_> =
                (0..count).map(|id| FrameTap { id: id as u32, ..FrameTap::default() }).collect();
            outlet.publish(frames).unwrap();
            let mut received = Vec::new();
            while let Some(batch) = inlet.receive().unwrap() {
                received.extend(batch.iter().map(|frame| (frame.seq, frame.id)));
            }
            let expected: Vec<_> = (0..count as u32).map(|id| (sent + 1 + u64::from(id), id)).collect();
            assert_eq!(received, expected);
            sent += count as u64;
        }
    }

    #[test]
    fn who_falls_behind_loses_the_oldest_and_sees_the_gap() {
        let domain = ScratchDomain::claim("test-behind").unwrap();
        let node = Node::join(&domain).unwrap();
        let inlet = node.batch_inlet::<FrameTap>().unwrap();
        let mut outlet = node.batch_outlet::<FrameTap>().unwrap();
        let frames = [FrameTap::default(); BATCH];
        for _ in 0..FrameTap::DEPTH / BATCH + 2 {
            outlet.publish(frames).unwrap();
        }
        let oldest = inlet.receive().unwrap().unwrap();
        assert_eq!(oldest[0].seq, 2 * BATCH as u64 + 1);
    }
}
