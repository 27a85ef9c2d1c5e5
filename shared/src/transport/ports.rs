//! Typed ports of the topics.

use std::borrow::Borrow;
use std::fmt::Debug;
use std::ops::Deref;

use iceoryx2::config::Config;
use iceoryx2::node::{Node as IceoryxNode, NodeBuilder};
use iceoryx2::port::backpressure_strategy::BackpressureStrategy;
use iceoryx2::port::publisher::Publisher as IceoryxPublisher;
use iceoryx2::port::subscriber::Subscriber as IceoryxSubscriber;
use iceoryx2::prelude::{IceoryxSend, LogLevel, SemanticString, SignalHandlingMode, ipc, set_log_level};
use iceoryx2::sample::Sample;
use iceoryx2::service::builder::publish_subscribe::Builder;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use iceoryx2::service::port_factory::publisher::PortFactoryPublisher;
use iceoryx2::service::port_factory::subscriber::PortFactorySubscriber;

use super::Domain;
use super::error::{Refused, TransportError, check_version, failed};
use crate::clock;
use crate::messages::Message;
use crate::realtime::Waiter;

/// Publishers a topic may have: every process may publish events.
const MAX_PUBLISHERS: usize = 4;
/// Subscribers a topic may have: the counterpart, the recorder, and two observers. Shared memory is
/// reserved, and locked, for all of them.
const MAX_SUBSCRIBERS: usize = 4;
/// Messages that a subscriber of the newest message keeps.
const KEPT_FOR_THE_NEWEST: usize = 4;
/// Messages a subscriber may hold at once: while it looks for a newer one than it has, it holds the one
/// it has, the newest found so far, and the next.
const MAX_HELD: usize = 3;

/// A process's access to a domain.
#[derive(Debug)]
pub struct Node {
    node: IceoryxNode<ipc::Service>,
}

impl Node {
    /// Joins the domain. iceoryx2 installs no signal handlers.
    pub fn join(domain: &Domain) -> Result<Self, TransportError> {
        set_log_level(LogLevel::Fatal);
        let id = domain.id();
        let mut config = Config::default();
        let prefix = domain.prefix().map_err(failed("joining domain", id))?;
        config.global.prefix = prefix.as_str().try_into().map_err(failed("joining domain", id))?;
        let root = iceoryx2::prelude::Path::new(domain.root().as_os_str().as_encoded_bytes());
        config.global.set_root_path(&root.map_err(failed("joining domain", id))?);
        let builder = NodeBuilder::new().config(&config).signal_handling_mode(SignalHandlingMode::Disabled);
        let node = builder.create().map_err(failed("joining domain", id))?;
        domain.make_private().map_err(failed("joining domain", id))?;
        Ok(Self { node })
    }

    /// The iceoryx2 node beneath, for measurements against bare iceoryx2.
    pub fn iceoryx(&self) -> &IceoryxNode<ipc::Service> {
        &self.node
    }

    /// The service of `M`'s topic, to be opened; it carries messages, or slices of them.
    pub(super) fn topic<M: Message, P: Debug + IceoryxSend + ?Sized>(
        &self,
        depth: usize,
    ) -> Result<Builder<P, (), ipc::Service>, TransportError> {
        let name = M::TOPIC.try_into().map_err(failed("opening topic", M::TOPIC))?;
        let builder = self.node.service_builder(&name).publish_subscribe();
        Ok(builder
            .enable_safe_overflow(true)
            .max_publishers(MAX_PUBLISHERS)
            .max_subscribers(MAX_SUBSCRIBERS)
            .subscriber_max_buffer_size(depth)
            .subscriber_max_borrowed_samples(MAX_HELD))
    }

    fn service<M: Message>(&self) -> Result<PortFactory<ipc::Service, M, ()>, TransportError> {
        self.topic::<M, M>(M::DEPTH)?.open_or_create().map_err(failed("opening topic", M::TOPIC))
    }

    /// A publisher of a topic.
    pub fn publisher<M: Message>(&self) -> Result<Publisher<M>, TransportError> {
        Publisher::create(self.service::<M>()?.publisher_builder())
    }

    /// A subscriber of a topic that keeps up to [`Message::DEPTH`] messages.
    pub fn subscriber<M: Message>(&self) -> Result<Subscriber<M>, TransportError> {
        Subscriber::create(self.service::<M>()?.subscriber_builder())
    }

    /// A subscriber for the newest message only. Its queue is short: entries of a long queue are not in the cache, and old
    /// messages are of no use after a stall.
    pub fn newest_subscriber<M: Message>(&self) -> Result<Subscriber<M>, TransportError> {
        Subscriber::create(self.service::<M>()?.subscriber_builder().buffer_size(KEPT_FOR_THE_NEWEST))
    }
}

/// The contents of a sample: one message, or a slice of several.
pub trait Payload: IceoryxSend + Debug + 'static {
    /// The topic of the messages.
    const TOPIC: &'static str;
}

impl<M: Message> Payload for M {
    const TOPIC: &'static str = M::TOPIC;
}

impl<M: Message> Payload for [M] {
    const TOPIC: &'static str = M::TOPIC;
}

/// Publishes one message type and numbers its messages.
#[doc(alias("writer", "data writer"))]
#[derive(Debug)]
pub struct Publisher<P: Payload + ?Sized> {
    pub(super) port: IceoryxPublisher<ipc::Service, P, ()>,
    refused: Refused,
    pub(super) sent: u64,
}

impl<P: Payload + ?Sized> Publisher<P> {
    pub(super) fn create(
        builder: PortFactoryPublisher<'_, ipc::Service, P, ()>,
    ) -> Result<Self, TransportError> {
        let refused = Refused::default();
        let port = builder
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .set_degradation_handler(refused.counter())
            .create()
            .map_err(failed("publishing", P::TOPIC))?;
        Ok(Self { port, refused, sent: 0 })
    }

    /// Connects to the subscribers that are there by now. Otherwise the first message makes the connections, which create
    /// and map files.
    pub fn connect(&self) -> Result<(), TransportError> {
        self.refused.connect(&self.port, P::TOPIC)
    }
}

impl<M: Message> Publisher<M> {
    /// Lets `fill` write the message into shared memory, then stamps and publishes the message.
    pub fn publish(&mut self, fill: impl FnOnce(&mut M)) -> Result<(), TransportError> {
        let mut sample = self.port.loan().map_err(failed("loaning", M::TOPIC))?;
        let message = sample.payload_mut();
        fill(message);
        self.sent += 1;
        message.stamp(self.sent, clock::now_ns());
        sample.send().map_err(failed("sending", M::TOPIC))?;
        Ok(())
    }

    /// Touches the memory of the next message: the first message of the loop then costs no page fault, and later ones find
    /// the memory in the caches.
    pub fn warm_up(&self) -> Result<(), TransportError> {
        drop(self.port.loan().map_err(failed("loaning", M::TOPIC))?);
        Ok(())
    }
}

/// Receives one message type, oldest first.
#[doc(alias("reader", "data reader"))]
#[derive(Debug)]
pub struct Subscriber<P: Payload + ?Sized> {
    pub(super) port: IceoryxSubscriber<ipc::Service, P, ()>,
    pub(super) refused: Refused,
}

/// A message in shared memory.
#[derive(Debug)]
pub struct ReceivedMessage<M: Message>(Sample<ipc::Service, M, ()>);

impl<M: Message> ReceivedMessage<M> {
    /// The message, unless it has another version.
    ///
    /// # Errors
    /// For another version.
    pub fn checked(self) -> Result<Self, TransportError> {
        check_version(&*self.0).map(|()| self)
    }
}

impl<M: Message> Deref for ReceivedMessage<M> {
    type Target = M;

    fn deref(&self) -> &M {
        &self.0
    }
}

impl<M: Message> Borrow<M> for ReceivedMessage<M> {
    fn borrow(&self) -> &M {
        self
    }
}

impl<P: Payload + ?Sized> Subscriber<P> {
    pub(super) fn create(
        builder: PortFactorySubscriber<'_, ipc::Service, P, ()>,
    ) -> Result<Self, TransportError> {
        let refused = Refused::default();
        let builder = builder.set_degradation_handler(refused.counter());
        let port = builder.create().map_err(failed("subscribing to", P::TOPIC))?;
        Ok(Self { port, refused })
    }

    /// Connects to the publishers that exist by now; otherwise the first call of `receive` does, as in
    /// [`Publisher::connect`].
    pub fn connect(&self) -> Result<(), TransportError> {
        self.refused.connect(&self.port, P::TOPIC)
    }
}

impl<M: Message> Subscriber<M> {
    /// The oldest message not yet received; never waits. Refused when a connection to a publisher failed, since its messages
    /// would be missing.
    pub fn receive(&self) -> Result<Option<ReceivedMessage<M>>, TransportError> {
        self.take()?.map(ReceivedMessage::checked).transpose()
    }

    fn take(&self) -> Result<Option<ReceivedMessage<M>>, TransportError> {
        let sample = self.port.receive().map_err(failed("receiving", M::TOPIC))?;
        self.refused.check(M::TOPIC)?;
        Ok(sample.map(ReceivedMessage))
    }

    /// The first message that `is_awaited`, or the newest there is when `deadline_ns` has passed. Polls without
    /// sleeping: for waits of microseconds. The version of the message is the caller's to check.
    pub fn latest_by(
        &self,
        deadline_ns: u64,
        waiter: &mut Waiter,
        is_awaited: impl Fn(&M) -> bool,
    ) -> Result<Option<ReceivedMessage<M>>, TransportError> {
        let mut newest = None;
        let mut spin = waiter.spin();
        loop {
            for _ in 0..=self.port.buffer_size() {
                let Some(message) = self.take()? else { break };
                let is_here = is_awaited(&message);
                newest = Some(message);
                if is_here {
                    return Ok(newest);
                }
            }
            if spin.now_ns() >= deadline_ns {
                return Ok(newest);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::PermissionsExt;
    use std::path::{Path, PathBuf};

    use iceoryx2::prelude::ZeroCopySend;

    use super::*;
    use crate::messages::{Event, FrameTap};
    use crate::transport::{BatchPublisher, BatchSubscriber, ScratchDomain, runtime};

    /// Every file below a folder.
    fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() {
                files_below(&path, found);
            } else {
                found.push(path);
            }
        }
    }

    #[test]
    fn no_other_user_may_touch_a_file_of_a_domain_and_every_path_leaves_room_for_a_session_folder() {
        let domain = ScratchDomain::claim("test-of-the-longest-name").unwrap();
        let node = Node::join(&domain).unwrap();
        let _subscriber = BatchSubscriber::<FrameTap>::open(&node).unwrap();
        let publisher = BatchPublisher::<FrameTap>::open(&node).unwrap();
        publisher.connect().unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        assert_eq!(mode(domain.root()), 0o700);
        assert_eq!(mode(domain.root().parent().unwrap()), 0o700);

        let prefix = domain.prefix().unwrap();
        let shared = fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap());
        let shared: Vec<_> =
            shared.filter(|file| file.file_name().to_string_lossy().starts_with(&prefix)).collect();
        assert!(shared.len() > 3, "{shared:?}");
        for file in shared {
            assert_eq!(mode(&file.path()), 0o600, "{file:?}");
        }
        let mut files = Vec::new();
        files_below(domain.root(), &mut files);
        assert!(!files.is_empty());
        let room = 255 - runtime::LONGEST_SESSION_FOLDER - "/masseter/".len() - 32 - 1;
        // The name may have 32 bytes, the user's id 10 digits, the node's number 39.
        let longer = (32 - domain.id().len()) + 9 + 15;
        for file in files {
            let beside_the_id = file.strip_prefix(domain.root()).unwrap().as_os_str().len();
            assert!(beside_the_id + longer <= room, "{file:?}");
        }
    }

    #[test]
    fn the_newest_message_is_found_among_many_and_while_one_is_held() {
        let domain = ScratchDomain::claim("test-ports").unwrap();
        let node = Node::join(&domain).unwrap();
        let subscriber = node.subscriber::<Event>().unwrap();
        let mut publisher = node.publisher::<Event>().unwrap();
        let mut waiter = Waiter::new(1_000_000);
        for round in 1..=3 {
            for cycle in 0..5 {
                publisher.publish(|event| event.cycle = round * 10 + cycle).unwrap();
            }
            let held = subscriber.receive().unwrap().unwrap();
            assert_eq!(held.cycle, round * 10);
            let newest = subscriber.latest_by(0, &mut waiter, |event| event.cycle > 1000).unwrap().unwrap();
            assert_eq!((newest.cycle, newest.seq), (round * 10 + 4, round * 5));
            assert!(subscriber.receive().unwrap().is_none());
        }
    }

    #[test]
    fn a_subscriber_of_the_newest_message_keeps_few_old_ones() {
        let domain = ScratchDomain::claim("test-newest").unwrap();
        let node = Node::join(&domain).unwrap();
        let subscriber = node.newest_subscriber::<Event>().unwrap();
        let mut publisher = node.publisher::<Event>().unwrap();
        (1..=100).for_each(|cycle| publisher.publish(|event| event.cycle = cycle).unwrap());
        let received =
            std::iter::from_fn(|| subscriber.receive().unwrap()).map(|event| (event.cycle, event.seq));
        assert!(received.eq((97..=100).map(|cycle| (cycle, cycle))));
    }

    #[test]
    fn messages_after_the_awaited_one_are_kept_for_the_next_wait() {
        let domain = ScratchDomain::claim("test-awaited").unwrap();
        let node = Node::join(&domain).unwrap();
        let subscriber = node.subscriber::<Event>().unwrap();
        let mut publisher = node.publisher::<Event>().unwrap();
        for cycle in 1..=5 {
            publisher.publish(|event| event.cycle = cycle).unwrap();
        }
        let mut waiter = Waiter::new(1_000_000);
        let deadline_ns = clock::now_ns() + 1_000_000_000;
        let mut wait = |cycle| {
            let found = subscriber.latest_by(deadline_ns, &mut waiter, |event| event.cycle >= cycle).unwrap();
            found.map(|event| event.cycle)
        };
        assert_eq!([3, 4, 2].map(&mut wait), [Some(3), Some(4), Some(5)]);
    }

    /// Each look of a wait may find messages while the newest of the last look is still held.
    #[test]
    fn a_wait_that_keeps_finding_messages_never_holds_too_many() {
        let domain = ScratchDomain::claim("test-wait").unwrap();
        let node = Node::join(&domain).unwrap();
        let subscriber = node.subscriber::<Event>().unwrap();
        let mut publisher = node.publisher::<Event>().unwrap();
        let deadline_ns = clock::now_ns() + 1_000_000_000;
        let mut waiter = Waiter::new(1_000_000);
        publisher.publish(|event| event.cycle = 1).unwrap();
        let publisher = std::cell::RefCell::new(publisher);
        let newest = subscriber.latest_by(deadline_ns, &mut waiter, |event| {
            let next = event.cycle + 1;
            publisher.borrow_mut().publish(|event| event.cycle = next).unwrap();
            publisher.borrow_mut().publish(|event| event.cycle = next + 1).unwrap();
            event.cycle >= 9
        });
        assert_eq!(newest.unwrap().unwrap().cycle, 9);
    }

    /// A sender of another version with the same layout.
    #[test]
    fn a_message_of_another_version_is_refused() {
        let domain = ScratchDomain::claim("test-version").unwrap();
        let node = Node::join(&domain).unwrap();
        let subscriber = node.subscriber::<Event>().unwrap();
        let publisher = node.publisher::<Event>().unwrap();
        let mut sample = publisher.port.loan().unwrap();
        sample.payload_mut().stamp(1, 1);
        sample.payload_mut().version += 1;
        sample.send().unwrap();
        let error = subscriber.receive().unwrap_err().to_string();
        assert!(error.contains("IncompatibleVersion(8") && error.contains("another version"), "{error}");
    }

    /// Reads like an event, but for the name of its layout.
    #[repr(C)]
    #[derive(Debug, Clone, Copy, ZeroCopySend)]
    #[type_name("masseter/Event/0000000000000000")]
    struct OtherLayout([u64; size_of::<Event>() / 8]);

    #[test]
    fn a_topic_of_another_layout_is_not_opened() {
        let domain = ScratchDomain::claim("test-layout").unwrap();
        let node = Node::join(&domain).unwrap();
        let _publisher = node.publisher::<Event>().unwrap();
        let other = node.topic::<Event, OtherLayout>(Event::DEPTH).unwrap().open_or_create();
        let error = format!("{:?}", other.unwrap_err());
        assert!(error.contains("Incompatible"), "{error}");
    }
}
