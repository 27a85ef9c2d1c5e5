//! What a wire counted.

/// Traffic of a wire since it was made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Frames that arrived.
    pub frames: u64,
    /// Their bits on the wire, interframe space included.
    pub bits: u64,
    /// How long they occupied the bus, interframe space included, ns.
    pub busy_ns: u64,
    /// Longest time from queueing to arrival, ns.
    pub response_max_ns: u64,
    /// Sum of the times from queueing to arrival, ns.
    pub response_total_ns: u64,
    /// Arbitrations in which several ports sent the same identifier.
    pub collisions: u64,
}

impl Statistics {
    /// Share of a time that the bus was busy, 0 to 1.
    pub fn load(&self, elapsed_ns: u64) -> f64 {
        self.busy_ns as f64 / elapsed_ns as f64
    }

    /// Mean time from queueing to arrival, ns; `None` before the first frame.
    pub fn response_mean_ns(&self) -> Option<f64> {
        (self.frames > 0).then(|| self.response_total_ns as f64 / self.frames as f64)
    }

    pub(super) fn count(&mut self, bits: u32, busy_ns: u64, response_ns: u64) {
        self.frames += 1;
        self.bits += u64::from(bits);
        self.busy_ns += busy_ns;
        self.response_max_ns = self.response_max_ns.max(response_ns);
        self.response_total_ns += response_ns;
    }
}
