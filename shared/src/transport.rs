//! How messages travel: iceoryx2 publish–subscribe, one service a topic, one domain a run.
//!
//! A message is built in the loaned sample and never copied; those of the bus, many a cycle, are copied there in batches.
//! Nothing here ever waits for a subscriber: one that falls behind loses its oldest messages, and sees the gap in the
//! sequence numbers. Two rigs never meet, because each [`Domain`] has names of its own.

mod batches;
mod domain;
mod ports;

pub use batches::{BatchInlet, BatchOutlet, ReceivedBatch};
pub use domain::{Domain, DomainError};
pub use ports::{Inlet, Node, Outlet, Received, TransportError};
