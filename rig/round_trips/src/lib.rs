//! Round trips of a number between two processes that poll: over the rig's transport, over bare iceoryx2, over a Unix socket,
//! and on one cache line.
//!
//! A crate of its own, fully optimised like the transport that it measures. The processes are started by `masseter bench ipc`.

mod channel;
mod durations;
mod exchange;
mod socket;
mod thread;
mod topics;

pub use channel::Channel;
pub use durations::{Durations, no_durations, record};
pub use exchange::{Ends, answer, on_a_cache_line, round_trips};
pub use thread::{on_core, realtime_on};
