//! The ports of a process: the node in the run's domain, and the opened topics.

use std::fmt::Debug;
use std::sync::atomic::{AtomicU32, Ordering};
use std::{ops::Deref, sync::Arc, time::Duration};

use iceoryx2::config::Config;
use iceoryx2::node::{Node as IceoryxNode, NodeBuilder};
use iceoryx2::port::backpressure_strategy::BackpressureStrategy;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::{DegradationAction, DegradationFn};
use iceoryx2::prelude::{
    AllocationStrategy, IceoryxSend, LogLevel, SemanticString, SignalHandlingMode, ipc, set_log_level,
};
use iceoryx2::service::builder::publish_subscribe::Builder;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use iceoryx2::service::port_factory::publisher::PortFactoryPublisher;
use iceoryx2::service::port_factory::subscriber::PortFactorySubscriber;
use masseter_messages::{
    Command, Contact, Event, FrameTap, Machine, Message, Parameters, Reading, Signals, State, Truth,
};

use crate::domain::Domain;

/// Most publishers of a topic: every process may publish events.
const MAX_PUBLISHERS: usize = 4;
/// Most subscribers of a topic: the counterpart, the recorder, and two observers. The port reserves and locks shared
/// memory for all of them.
const MAX_SUBSCRIBERS: usize = 4;
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

/// The error of an action on a topic, for `map_err`. The text is formatted outside of the hot path: formatting code
/// within the hot path makes a round trip a tenth slower.
pub fn failed<E: Debug>(verb: &'static str, what: &str) -> impl FnOnce(E) -> TransportError {
    #[cold]
    fn error(verb: &str, what: &str, cause: &dyn Debug) -> TransportError {
        TransportError { action: format!("{verb} '{what}'"), reason: format!("{cause:?}") }
    }
    move |cause| error(verb, what, &cause)
}

/// A process's access to a domain.
#[derive(Debug)]
pub struct Node {
    node: IceoryxNode<ipc::Service>,
    domain: Domain,
}

impl Node {
    /// Joins the domain. iceoryx2 installs no signal handlers.
    ///
    /// # Errors
    /// For a domain without a claim, and when iceoryx2 cannot make its files.
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

    /// The domain.
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// The iceoryx2 node beneath, for measurements against bare iceoryx2.
    pub fn iceoryx(&self) -> &IceoryxNode<ipc::Service> {
        &self.node
    }

    /// The service of `M`'s topic, before its opening, for messages or slices of them.
    ///
    /// # Errors
    /// For a name that iceoryx2 refuses.
    pub fn topic<M: Message, P: Debug + IceoryxSend + ?Sized>(
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
}

/// A message whose topic is opened in this crate, once for all crates.
pub trait Opened: Message {
    /// The port that publishes on the topic.
    ///
    /// # Errors
    /// When the port cannot be made.
    fn outlet(node: &Node) -> Result<Outlet<Self>, TransportError>;

    /// A port that receives from the topic, and keeps this many messages.
    ///
    /// # Errors
    /// When the port cannot be made.
    fn inlet(node: &Node, buffer: usize) -> Result<Inlet<Self>, TransportError>;
}

macro_rules! topics {
    ($($message:ident)+) => {$(
        impl Opened for $message {
            fn outlet(node: &Node) -> Result<Outlet<Self>, TransportError> {
                Outlet::create(service::<Self>(node)?.publisher_builder(), Self::TOPIC)
            }

            fn inlet(node: &Node, buffer: usize) -> Result<Inlet<Self>, TransportError> {
                Inlet::create(service::<Self>(node)?.subscriber_builder().buffer_size(buffer), Self::TOPIC)
            }
        }
    )+};
}

topics!(Command Reading State Signals Parameters Truth Contact Machine Event);

fn service<M: Message>(node: &Node) -> Result<PortFactory<ipc::Service, M, ()>, TransportError> {
    node.topic::<M, M>(M::DEPTH)?.open_or_create().map_err(failed("opening topic", M::TOPIC))
}

/// Most frames in a sample: the frames of a cycle of six drives.
pub const BATCH: usize = 16;

fn frame_service(node: &Node) -> Result<PortFactory<ipc::Service, [FrameTap], ()>, TransportError> {
    let builder = node.topic::<FrameTap, [FrameTap]>(FrameTap::DEPTH / BATCH)?;
    builder.open_or_create().map_err(failed("opening topic", FrameTap::TOPIC))
}

/// The port that publishes batches of frames.
///
/// # Errors
/// When the port cannot be made.
pub fn frame_outlet(node: &Node) -> Result<Outlet<[FrameTap]>, TransportError> {
    let service = frame_service(node)?;
    let builder = service.publisher_builder().initial_max_slice_len(BATCH);
    Outlet::create(builder.allocation_strategy(AllocationStrategy::Static), FrameTap::TOPIC)
}

/// A port that receives batches of frames.
///
/// # Errors
/// When the port cannot be made.
pub fn frame_inlet(node: &Node) -> Result<Inlet<[FrameTap]>, TransportError> {
    Inlet::create(frame_service(node)?.subscriber_builder(), FrameTap::TOPIC)
}

/// A port of iceoryx2, and the number of its failed connections. iceoryx2 continues without these connections, and
/// reports them in its log only.
#[derive(Debug)]
pub struct Port<T> {
    inner: T,
    topic: &'static str,
    refused: Arc<AtomicU32>,
}

/// A port that publishes messages, or slices of them.
pub type Outlet<P> = Port<Publisher<ipc::Service, P, ()>>;
/// A port that receives messages, or slices of them.
pub type Inlet<P> = Port<Subscriber<ipc::Service, P, ()>>;

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
    /// The topic.
    #[inline]
    pub fn topic(&self) -> &'static str {
        self.topic
    }

    /// Refuses a port with missing connections. Such connections leave no gap in any sequence, so a receiver must
    /// check.
    ///
    /// # Errors
    /// After a refused connection.
    #[inline]
    pub fn require_all_connections(&self) -> Result<(), TransportError> {
        match self.refused.load(Ordering::Relaxed) {
            0 => Ok(()),
            count => Err(failed("connecting", self.topic)(format_args!("ConnectionsRefused({count})"))),
        }
    }
}

impl<T> Deref for Port<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.inner
    }
}

#[cfg(test)]
mod tests;
