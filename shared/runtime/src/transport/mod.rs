//! Transport of messages: iceoryx2 publish–subscribe, one service for each topic, one domain for each run.
//!
//! Publishers write readings, commands and states directly into the loaned sample, and copy truth, events and the
//! frames of a cycle there once. No publisher waits for a subscriber: a slow subscriber loses its oldest messages and
//! sees the gap in the sequence numbers. Two rigs share no topic, because each [`Domain`] has names of its own. After a
//! failed connection iceoryx2 continues; a port of this module refuses to.
//!
//! # Examples
//! ```
//! use masseter_runtime::clock;
//! use masseter_runtime::messages::Event;
//! use masseter_runtime::transport::{Node, ScratchDomain};
//!
//! let domain = ScratchDomain::claim("doc-transport")?;
//! let node = Node::join(&domain)?;
//! let subscriber = node.subscriber::<Event>()?;
//! let mut publisher = node.publisher::<Event>()?;
//! publisher.publish_by(clock::now_ns, |event| event.cycle = 7)?;
//! let event = subscriber.receive()?.expect("the event has arrived");
//! assert_eq!((event.seq, event.cycle), (1, 7));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod domain;
mod frames;
mod runtime;
mod signals;

use std::sync::atomic::{AtomicU32, Ordering};
use std::{borrow::Borrow, fmt::Debug, ops::Deref, sync::Arc, time::Duration};

use iceoryx2::config::Config;
use iceoryx2::node::{Node as IceoryxNode, NodeBuilder};
use iceoryx2::port::backpressure_strategy::BackpressureStrategy;
use iceoryx2::port::publisher::Publisher as IceoryxPublisher;
use iceoryx2::port::subscriber::Subscriber as IceoryxSubscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{DegradationAction, DegradationFn};
use iceoryx2::prelude::{IceoryxSend, LogLevel, SemanticString, SignalHandlingMode, ipc, set_log_level};
use iceoryx2::sample::Sample;
use iceoryx2::service::builder::publish_subscribe::Builder;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use iceoryx2::service::port_factory::publisher::PortFactoryPublisher;
use iceoryx2::service::port_factory::subscriber::PortFactorySubscriber;

use crate::messages::{
    Command, Contact, Event, LAYOUT_VERSION, Machine, Message, Parameters, Reading, Signals, State, Truth,
};
use crate::realtime::Waiter;

pub use domain::{Domain, DomainLock, ScratchDomain, Swept};
pub use frames::{FramePublisher, FrameSubscriber};
pub use runtime::{DomainError, secret};
pub use signals::{SignalReceiver, SignalSender};

/// Most publishers of a topic: every process may publish events.
const MAX_PUBLISHERS: usize = 4;
/// Most subscribers of a topic: the counterpart, the recorder, and two observers. The port reserves and locks shared
/// memory for all of them.
const MAX_SUBSCRIBERS: usize = 4;
/// Messages that a subscriber of the newest message keeps.
const KEPT_FOR_THE_NEWEST: usize = 4;
/// Most messages that a subscriber holds at once. During a search for a newer message these are the present message,
/// the newest found so far, and the next.
const MAX_HELD: usize = 3;
/// Longest wait for another process that makes the same part of the domain: that process may be stopped for a moment,
/// or starved. Shorter than the time limit for the end of a process.
const CREATION_TIMEOUT: Duration = Duration::from_secs(3);

/// The reason for a failed port.
#[derive(Debug, thiserror::Error)]
#[error("iceoryx2: {action} failed ({reason}); {help}", help = remedy(reason))]
pub struct TransportError {
    action: String,
    reason: String,
}

/// The remedy for common refusals.
fn remedy(reason: &str) -> &'static str {
    if reason.contains("Permission") {
        "another user has made a file of this name in /dev/shm; start the rig again"
    } else if reason.contains("NotFound") {
        "no rig of this name runs"
    } else if reason.contains("Incompatible") {
        "a process of another version uses this topic; stop it"
    } else if reason.contains("ConnectionsRefused") {
        "/dev/shm is full, or too little memory may be locked ('masseter doctor'), or too few files opened ('ulimit -n')"
    } else {
        "'masseter clean' removes what killed runs left behind"
    }
}

/// Formats the error outside of the hot path: formatting code within the hot path makes a round trip a tenth slower.
fn failed<E: Debug>(verb: &'static str, what: &str) -> impl FnOnce(E) -> TransportError {
    #[cold]
    fn error(verb: &str, what: &str, cause: &dyn Debug) -> TransportError {
        TransportError { action: format!("{verb} '{what}'"), reason: format!("{cause:?}") }
    }
    move |cause| error(verb, what, &cause)
}

/// Refuses a message of another version: the sender may be another program.
fn check_version<M: Message>(message: &M) -> Result<(), TransportError> {
    match message.version() {
        LAYOUT_VERSION => Ok(()),
        version => {
            let reason = format_args!("IncompatibleVersion({version}, this program has {LAYOUT_VERSION})");
            Err(failed("receiving", M::TOPIC)(reason))
        }
    }
}

/// A process's access to a domain.
#[derive(Debug)]
pub struct Node {
    node: IceoryxNode<ipc::Service>,
    domain: Domain,
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
        config.global.creation_timeout = CREATION_TIMEOUT;
        config.global.set_root_path(&root.map_err(failed("joining domain", id))?);
        let builder = NodeBuilder::new().config(&config).signal_handling_mode(SignalHandlingMode::Disabled);
        let node = builder.create().map_err(failed("joining domain", id))?;
        domain.make_private().map_err(failed("joining domain", id))?;
        Ok(Self { node, domain: domain.clone() })
    }

    pub(crate) fn domain(&self) -> &Domain {
        &self.domain
    }

    /// The iceoryx2 node beneath, for measurements against bare iceoryx2.
    pub fn iceoryx(&self) -> &IceoryxNode<ipc::Service> {
        &self.node
    }

    /// The service of `M`'s topic, before its opening, for messages or slices of them.
    fn topic<M: Message, P: Debug + IceoryxSend + ?Sized>(
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

    /// A publisher of a topic.
    pub fn publisher<M: Topic>(&self) -> Result<Publisher<M>, TransportError> {
        M::publisher(self)
    }

    /// A subscriber of a topic that keeps up to [`Message::DEPTH`] messages.
    pub fn subscriber<M: Topic>(&self) -> Result<Subscriber<M>, TransportError> {
        M::subscriber(self, M::DEPTH)
    }

    /// A subscriber for the newest message only. Its queue is short: entries of a long queue are not in the cache, and
    /// old messages have no use after a stall.
    pub fn newest_subscriber<M: Topic>(&self) -> Result<Subscriber<M>, TransportError> {
        M::subscriber(self, KEPT_FOR_THE_NEWEST)
    }
}

/// A message with ports compiled in this crate, once for all crates. The ports of iceoryx2 are generic, so each crate
/// with ports of its own compiles them again (notes/realtime-log.md#the-first-build).
pub trait Topic: Message {
    /// As [`Node::publisher`].
    ///
    /// # Errors
    /// When the port cannot be made.
    fn publisher(node: &Node) -> Result<Publisher<Self>, TransportError>;

    /// A subscriber that keeps this many messages.
    ///
    /// # Errors
    /// When the port cannot be made.
    fn subscriber(node: &Node, buffer: usize) -> Result<Subscriber<Self>, TransportError>;
}

macro_rules! topics {
    ($($message:ident)+) => {$(
        impl Topic for $message {
            fn publisher(node: &Node) -> Result<Publisher<Self>, TransportError> {
                let outlet = Outlet::create(service::<Self>(node)?.publisher_builder(), Self::TOPIC)?;
                Ok(Publisher { port: Box::new(outlet), sent: 0 })
            }

            fn subscriber(node: &Node, buffer: usize) -> Result<Subscriber<Self>, TransportError> {
                let service = service::<Self>(node)?;
                let builder = service.subscriber_builder().buffer_size(buffer);
                Ok(Subscriber { port: Box::new(Inlet::create(builder, Self::TOPIC)?) })
            }
        }
    )+};
}

topics!(Command Reading State Signals Parameters Truth Contact Machine Event);

fn service<M: Message>(node: &Node) -> Result<PortFactory<ipc::Service, M, ()>, TransportError> {
    node.topic::<M, M>(M::DEPTH)?.open_or_create().map_err(failed("opening topic", M::TOPIC))
}

/// A port that connects to the ports of other processes.
trait Connecting: Debug {
    /// Makes the connections to the present ports.
    fn connect(&self) -> Result<(), TransportError>;
}

/// A port of iceoryx2, and the number of its failed connections. iceoryx2 continues without these connections, and
/// reports them in its log only.
#[derive(Debug)]
struct Port<T> {
    inner: T,
    topic: &'static str,
    refused: Arc<AtomicU32>,
}

/// A port that publishes messages, or slices of them.
type Outlet<P> = Port<IceoryxPublisher<ipc::Service, P, ()>>;
/// A port that receives messages, or slices of them.
type Inlet<P> = Port<IceoryxSubscriber<ipc::Service, P, ()>>;

/// The counter of refused connections, for a port's builder.
fn counter(refused: &Arc<AtomicU32>) -> impl DegradationFn + use<> {
    let refused = Arc::clone(refused);
    move |_, _| {
        refused.fetch_add(1, Ordering::Relaxed);
        DegradationAction::Warn
    }
}

impl<P: IceoryxSend + Debug + ?Sized + 'static> Outlet<P> {
    fn create(
        builder: PortFactoryPublisher<'_, ipc::Service, P, ()>,
        topic: &'static str,
    ) -> Result<Self, TransportError> {
        let refused = Arc::default();
        let builder = builder.backpressure_strategy(BackpressureStrategy::DiscardData);
        let port = builder.set_degradation_handler(counter(&refused)).create();
        Ok(Self { inner: port.map_err(failed("publishing", topic))?, topic, refused })
    }
}

impl<P: IceoryxSend + Debug + ?Sized + 'static> Inlet<P> {
    fn create(
        builder: PortFactorySubscriber<'_, ipc::Service, P, ()>,
        topic: &'static str,
    ) -> Result<Self, TransportError> {
        let refused = Arc::default();
        let port = builder.set_degradation_handler(counter(&refused)).create();
        Ok(Self { inner: port.map_err(failed("subscribing to", topic))?, topic, refused })
    }
}

impl<T> Port<T> {
    /// Refuses a port with missing connections. Such connections leave no gap in any sequence, so a receiver must
    /// check.
    fn require_all_connections(&self) -> Result<(), TransportError> {
        match self.refused.load(Ordering::Relaxed) {
            0 => Ok(()),
            count => Err(failed("connecting", self.topic)(format_args!("ConnectionsRefused({count})"))),
        }
    }
}

impl<T: UpdateConnections + Debug> Connecting for Port<T> {
    fn connect(&self) -> Result<(), TransportError> {
        self.inner.update_connections().map_err(failed("connecting", self.topic))?;
        self.require_all_connections()
    }
}

/// The port of a publisher.
trait Outgoing<M>: Connecting {
    /// Lets `write` fill the next message in shared memory, and sends the message.
    fn send(&self, write: &mut dyn FnMut(&mut M)) -> Result<(), TransportError>;
    fn warm_up(&self) -> Result<(), TransportError>;
}

impl<M: Message> Outgoing<M> for Outlet<M> {
    fn send(&self, write: &mut dyn FnMut(&mut M)) -> Result<(), TransportError> {
        let mut sample = self.inner.loan().map_err(failed("loaning", M::TOPIC))?;
        write(sample.payload_mut());
        sample.send().map_err(failed("sending", M::TOPIC))?;
        Ok(())
    }

    fn warm_up(&self) -> Result<(), TransportError> {
        drop(self.inner.loan().map_err(failed("loaning", M::TOPIC))?);
        Ok(())
    }
}

/// Publishes one message type and numbers its messages.
#[doc(alias("writer", "data writer"))]
#[derive(Debug)]
pub struct Publisher<M: Message> {
    port: Box<dyn Outgoing<M>>,
    sent: u64,
}

impl<M: Message> Publisher<M> {
    /// Connects to the present subscribers. Otherwise the first message makes the connections, which create and map
    /// files.
    pub fn connect(&self) -> Result<(), TransportError> {
        self.port.connect()
    }

    /// Lets `fill` write the message into shared memory, then stamps it with the time of a clock and publishes it.
    pub fn publish_by(
        &mut self,
        now_ns: impl FnOnce() -> u64,
        fill: impl FnOnce(&mut M),
    ) -> Result<(), TransportError> {
        let (mut given, sent) = (Some((now_ns, fill)), &mut self.sent);
        self.port.send(&mut |message| {
            let (now_ns, fill) = given.take().expect("a port writes a message once");
            fill(message);
            *sent += 1;
            message.stamp(*sent, now_ns());
        })
    }

    /// Touches the memory of the next message. So the first message of the loop costs no page fault, and later messages
    /// find the memory in the caches.
    pub fn warm_up(&self) -> Result<(), TransportError> {
        self.port.warm_up()
    }
}

/// The port of a subscriber.
trait Incoming<M: Message>: Connecting {
    /// The oldest waiting message.
    fn next(&self) -> Result<Option<ReceivedMessage<M>>, TransportError>;
    /// Messages that the port keeps.
    fn buffer(&self) -> usize;
}

impl<M: Message> Incoming<M> for Inlet<M> {
    fn next(&self) -> Result<Option<ReceivedMessage<M>>, TransportError> {
        let sample = self.inner.receive().map_err(failed("receiving", M::TOPIC))?;
        self.require_all_connections()?;
        Ok(sample.map(ReceivedMessage))
    }

    fn buffer(&self) -> usize {
        self.inner.buffer_size()
    }
}

/// Receives one message type, oldest first.
#[doc(alias("reader", "data reader"))]
#[derive(Debug)]
pub struct Subscriber<M: Message> {
    port: Box<dyn Incoming<M>>,
}

/// A message in shared memory.
#[derive(Debug)]
pub struct ReceivedMessage<M: Message>(Sample<ipc::Service, M, ()>);

impl<M: Message> ReceivedMessage<M> {
    /// The message, if the version is right.
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

impl<M: Message> Subscriber<M> {
    /// Connects to the present publishers. Otherwise the first call of `receive` does so, as in [`Publisher::connect`].
    pub fn connect(&self) -> Result<(), TransportError> {
        self.port.connect()
    }

    /// The oldest waiting message; never waits. Refuses after a failed connection to a publisher, because its messages
    /// are missing.
    pub fn receive(&self) -> Result<Option<ReceivedMessage<M>>, TransportError> {
        self.port.next()?.map(ReceivedMessage::checked).transpose()
    }

    /// The first message that `is_awaited`, or the newest message at `deadline_ns`. Polls without a sleep, for waits of
    /// microseconds. The caller checks the version of the message.
    pub fn latest_by(
        &self,
        deadline_ns: u64,
        waiter: &mut Waiter,
        is_awaited: impl Fn(&M) -> bool,
    ) -> Result<Option<ReceivedMessage<M>>, TransportError> {
        let (mut newest, buffer) = (None, self.port.buffer());
        let mut spin = waiter.spin();
        loop {
            for _ in 0..=buffer {
                let Some(message) = self.port.next()? else { break };
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
mod tests;
