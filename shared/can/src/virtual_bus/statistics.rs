//! Counters of a wire.

/// Traffic and errors of a wire since it was made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Frames that ports took for transmission.
    pub queued: u64,
    /// Frames that arrived, repetitions counted.
    pub frames: u64,
    /// How long frames and error frames occupied the bus, interframe space included, ns.
    pub busy_ns: u64,
    /// Longest time from queueing to arrival, ns.
    pub response_max_ns: u64,
    /// Sum of the times from queueing to arrival, ns.
    pub response_total_ns: u64,
    /// Arbitrations in which several ports sent the same identifier.
    pub collisions: u64,
    /// Error frames.
    pub error_frames: u64,
    /// Error frames for want of an acknowledgement.
    pub unacknowledged: u64,
    /// Repetitions of frames by their transmitters.
    pub retransmissions: u64,
    /// Controllers that went off the bus.
    pub bus_offs: u64,
    /// Frames that these controllers discarded.
    pub abandoned: u64,
}

impl Statistics {
    /// Share of a time that the bus was busy, 0 to 1.
    pub fn load(&self, elapsed_ns: u64) -> f64 {
        self.busy_ns as f64 / elapsed_ns as f64
    }

    pub(super) fn count_frame(&mut self, response_ns: u64) {
        self.frames += 1;
        self.response_max_ns = self.response_max_ns.max(response_ns);
        self.response_total_ns += response_ns;
    }
}
