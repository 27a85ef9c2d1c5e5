//! The longest response times of the buses' messages.

use serde::Serialize;

/// The longest response time of a message.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ResponseFigures {
    /// Index of the bus.
    pub bus: usize,
    /// Its name in the plan; `other` for all messages that are in no plan: SDO, NMT, emergencies.
    pub message: String,
    /// Frames whose time of queueing is known.
    pub frames: u64,
    /// Longest time from being queued to the end of the frame; none without such frames, ns.
    pub max_ns: Option<u64>,
    /// The bound by the plan, or by the closest queueing if messages were queued closer together than planned; none
    /// where there is no bound, and in a run without bounds, ns.
    pub bound_ns: Option<u64>,
}

impl ResponseFigures {
    /// Whether a frame took longer than the bound.
    pub fn exceeds(&self) -> bool {
        self.max_ns.zip(self.bound_ns).is_some_and(|(max_ns, bound_ns)| max_ns > bound_ns)
    }

    /// Share of the bound that was used.
    pub fn share(&self) -> Option<f64> {
        self.max_ns.zip(self.bound_ns).map(|(max_ns, bound_ns)| max_ns as f64 / bound_ns as f64)
    }
}

/// Response times of all buses.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct BusResponse {
    /// The messages of each bus, the most urgent first.
    pub messages: Vec<ResponseFigures>,
    /// Frames queued off their times by a stall, and those beside them, which are not judged.
    pub off_time_frames: u64,
    /// Why there are no bounds for this run; none where there are.
    pub unbounded: Option<String>,
}

impl BusResponse {
    /// Messages that took longer than their bound.
    pub fn exceeding(&self) -> impl Iterator<Item = &ResponseFigures> {
        self.messages.iter().filter(|message| message.exceeds())
    }

    /// The message that used most of its bound.
    pub fn tightest(&self) -> Option<&ResponseFigures> {
        let shares = self.messages.iter().filter_map(|message| Some((message, message.share()?)));
        shares.max_by(|(_, one), (_, other)| one.total_cmp(other)).map(|(message, _)| message)
    }
}
