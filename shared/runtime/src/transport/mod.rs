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
//! use masseter_runtime::transport::{Node, Publisher, ScratchDomain, Subscriber};
//!
//! let domain = ScratchDomain::claim("doc-transport")?;
//! let node = Node::join(&domain)?;
//! let subscriber = Subscriber::<Event>::open(&node)?;
//! let mut publisher = Publisher::<Event>::open(&node)?;
//! publisher.publish_by(clock::now_ns, |event| event.cycle = 7)?;
//! let event = subscriber.receive()?.expect("the event has arrived");
//! assert_eq!((event.seq, event.cycle), (1, 7));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod frames;
mod signals;

use std::{borrow::Borrow, fmt::Debug, ops::Deref};

use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::ipc;
use iceoryx2::sample::Sample;
use masseter_domain::{Inlet, Opened, Outlet, Port, failed};

use crate::messages::{
    Command, Contact, Event, LAYOUT_VERSION, Machine, Message, Parameters, Reading, Signals, State, Truth,
};
use crate::realtime::Waiter;

pub use frames::{FramePublisher, FrameSubscriber};
pub use masseter_domain::{
    Domain, DomainError, DomainLock, Node, ScratchDomain, Swept, TransportError, secret,
};
pub use signals::{SignalReceiver, SignalSender};

/// Messages that a subscriber of the newest message keeps.
const KEPT_FOR_THE_NEWEST: usize = 4;

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

/// A message whose exchange is compiled in this crate, once for all crates. The ports of iceoryx2 are generic, so each
/// crate with ports of its own compiles them again (notes/realtime-log.md#the-first-build).
pub trait Topic: Opened {
    /// As [`Publisher::open`].
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
                Ok(Publisher { port: Box::new(Self::outlet(node)?), sent: 0 })
            }

            fn subscriber(node: &Node, buffer: usize) -> Result<Subscriber<Self>, TransportError> {
                Ok(Subscriber { port: Box::new(Self::inlet(node, buffer)?) })
            }
        }
    )+};
}

topics!(Command Reading State Signals Parameters Truth Contact Machine Event);

/// A port that connects to the ports of other processes.
trait Connecting: Debug {
    /// Makes the connections to the present ports.
    fn connect(&self) -> Result<(), TransportError>;
}

impl<T: UpdateConnections + Debug> Connecting for Port<T> {
    fn connect(&self) -> Result<(), TransportError> {
        self.update_connections().map_err(failed("connecting", self.topic()))?;
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
        let mut sample = self.loan().map_err(failed("loaning", M::TOPIC))?;
        write(sample.payload_mut());
        sample.send().map_err(failed("sending", M::TOPIC))?;
        Ok(())
    }

    fn warm_up(&self) -> Result<(), TransportError> {
        drop(self.loan().map_err(failed("loaning", M::TOPIC))?);
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

impl<M: Topic> Publisher<M> {
    /// A publisher of the topic.
    ///
    /// # Errors
    /// When the port cannot be made.
    pub fn open(node: &Node) -> Result<Self, TransportError> {
        M::publisher(node)
    }
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
        let sample = self.receive().map_err(failed("receiving", M::TOPIC))?;
        self.require_all_connections()?;
        Ok(sample.map(ReceivedMessage))
    }

    fn buffer(&self) -> usize {
        self.buffer_size()
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

impl<M: Topic> Subscriber<M> {
    /// A subscriber of the topic that keeps up to [`Message::DEPTH`] messages.
    ///
    /// # Errors
    /// When the port cannot be made.
    pub fn open(node: &Node) -> Result<Self, TransportError> {
        M::subscriber(node, M::DEPTH)
    }

    /// A subscriber for the newest message only. Its queue is short: entries of a long queue are not in the cache, and
    /// old messages have no use after a stall.
    ///
    /// # Errors
    /// When the port cannot be made.
    pub fn of_newest(node: &Node) -> Result<Self, TransportError> {
        M::subscriber(node, KEPT_FOR_THE_NEWEST)
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
