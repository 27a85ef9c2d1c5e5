//! A simulated wire: bit-exact frame times, arbitration, errors and fault confinement, bounded queues, all in
//! virtual time.
//!
//! A frame takes the time of its exact stuffed length. Whenever the bus gets idle, the lowest identifier
//! among all ports' most urgent frames wins. Every other port and the tap receive the frame when its last
//! end-of-frame bit is over, which is its time stamp; three bits of interframe space later the bus is
//! idle again.
//!
//! # Errors
//! A frame that is disturbed ends where the disturbance is: an error flag (6 bits, 12 where error active
//! nodes echo it), 8 bits of delimiter, 3 of intermission; then the transmitter takes part in the next
//! arbitration with the same frame. A missing acknowledgement is such a disturbance. Two ports that send different
//! frames of one identifier disturb each other where the frames first differ; equal frames pass as one. Each
//! port counts errors by the rules of ISO 11898-1, becomes error passive and leaves the bus; a passive
//! transmitter pauses for 8 bits. A port off the bus discards its queue. After a restart it comes back with 128
//! times 11 recessive bits. The restart follows after [`restart_after_ns`](WireConfig::restart_after_ns), as with
//! `ip link … restart-ms`.
//!
//! # Time
//! The wire moves in [`advance`](VirtualWire::advance) only. All frames queued at or before an instant take
//! part in the arbitration of that instant, in whatever order they were queued: the frame that starts at
//! `t` is settled once the wire advances beyond `t`. A frame queued for a time before the one already
//! advanced to counts as queued at that time. Faults of nodes take effect between frames.
//!
//! # What is not modelled
//! - Errors that only some nodes see, and overload frames.
//! - The traffic of a disconnected node on its end of the wire.

mod completion;
mod confinement;
mod nodes;
mod port;
mod queue;
mod transmission;
mod wire;

#[cfg(test)]
mod tests;

pub use nodes::WireConfig;
pub use port::Port;
pub use wire::VirtualWire;
