//! The configuration of a simulated wire.

use crate::frame::FrameFormat;
use crate::wire::Rates;

/// What a wire is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WireConfig {
    /// Bit rates.
    pub rates: Rates,
    /// The format in which every port sends.
    pub format: FrameFormat,
    /// Ports, one a node.
    pub ports: usize,
    /// Frames a port may have waiting for transmission.
    pub transmit_capacity: usize,
    /// Frames a port may have received and not fetched; the tap's queue is as long for each port.
    pub receive_capacity: usize,
    /// How long after bus-off a port restarts by itself, ns; `None` when it waits to be restarted.
    pub restart_after_ns: Option<u64>,
}
