//! What two streams of messages can have in common, by their clocks.

use masseter_recording::Topic;

/// Which fields two streams can have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compared {
    /// All, in simulated time.
    Everything,
    /// All but the number and the time of publication: a replay of a run in real time.
    WithoutStamps,
    /// Neither numbers nor times, nor the frames: two runs, at least one of them in real time.
    WithoutTimes,
}

impl Compared {
    pub(super) fn has_topic(self, topic: Topic) -> bool {
        topic != Topic::Machine && (self != Self::WithoutTimes || topic != Topic::Frame)
    }

    pub(super) fn has_field(self, field: &str) -> bool {
        match self {
            Self::Everything => true,
            Self::WithoutStamps => !["seq", "published_ns"].contains(&field),
            Self::WithoutTimes => field != "seq" && !field.ends_with("_ns"),
        }
    }

    /// What is left out, in words; empty for nothing.
    pub(super) fn left_out(self) -> &'static str {
        match self {
            Self::Everything => "",
            Self::WithoutStamps => "not compared, since the clock was real: number and time of publication",
            Self::WithoutTimes => "not compared, since a clock was real: times, numbers of messages, frames",
        }
    }
}
