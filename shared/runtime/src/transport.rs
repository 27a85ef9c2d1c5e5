//! Transport of messages: iceoryx2 publish–subscribe, one service for each topic, one domain for each run.
//!
//! Readings, commands and states are written directly into the loaned sample. Truth, events and the frames of a cycle are
//! copied there once. No publisher waits for a subscriber: a slow subscriber loses its oldest messages and sees the gap in
//! the sequence numbers. Two rigs share no topic, because each [`Domain`] has names of its own.
//!
//! # Examples
//! ```
//! use masseter_runtime::messages::Event;
//! use masseter_runtime::transport::{Node, ScratchDomain};
//!
//! let domain = ScratchDomain::claim("doc-transport")?;
//! let node = Node::join(&domain)?;
//! let subscriber = node.subscriber::<Event>()?;
//! let mut publisher = node.publisher::<Event>()?;
//! publisher.publish(|event| event.cycle = 7)?;
//! let event = subscriber.receive()?.expect("the event has arrived");
//! assert_eq!((event.seq, event.cycle), (1, 7));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod domain;
mod error;
mod frames;
mod ports;
mod runtime;
mod signals;

pub use domain::{Domain, DomainLock, ScratchDomain, Swept};
pub use error::{DomainError, TransportError};
pub use frames::{FramePublisher, FrameSubscriber};
pub use ports::{Node, Publisher, ReceivedMessage, Subscriber, Topic};
pub use runtime::secret;
pub use signals::{SignalReceiver, SignalSender};
