//! How messages travel: iceoryx2 publish–subscribe, one service a topic, one domain a run.
//!
//! Readings, commands and states are built in the loaned sample. What was sampled earlier is copied there once: the truth,
//! events, and the frames of a cycle in batches.
//! Nothing here ever waits for a subscriber: one that falls behind loses its oldest messages, and sees the gap in the
//! sequence numbers. Two rigs never meet, because each [`Domain`] has names of its own.

mod batches;
mod domain;
mod ports;

pub use batches::{BatchInlet, BatchOutlet, ReceivedBatch};
pub use domain::{Claim, Domain, DomainError, ScratchDomain};
pub use ports::{Inlet, Node, Outlet, Received, TransportError};
