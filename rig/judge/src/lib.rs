//! The figures of a run, computed from its messages in one pass: latencies, tracking, losses, events.
//!
//! [`Analysis`] takes the messages and returns [`Figures`]. It reads no file, writes none, and judges nothing: see the
//! crates `masseter-recording` and `masseter-report`.

mod analysis;
mod declared_faults;
mod events;
mod intervals;
mod jaw_cycles;
mod longest_cycles;
mod lost_cycles;
mod measured;
mod messages;
mod over_time;
mod played;
pub mod requirements;
mod response;
mod series;
pub mod signals;
mod skips;
mod tracking;

pub use analysis::{Analysis, Figures};
pub use declared_faults::{Detection, FaultFigures};
pub use events::{Code, EventRecord};
pub use jaw_cycles::{COURSE_POINTS, CoursePoint, JawCycle, JawCycleFigures, Statistic};
pub use longest_cycles::{KernelCounts, WorstCycle, hop_names};
pub use lost_cycles::{Outage, ReadingFigures};
pub use measured::{IntervalFigures, Seconds, resolution_ns};
pub use messages::{ParameterFigures, SequenceCheck, SignalFigures, TopicFigures};
pub use over_time::{AxisFigures, ContactFigures, OverTime, ToothFigures, ToothLoads};
pub use played::{Departure, StoppedBy};
pub use response::{BusResponse, ResponseFigures};
pub use series::Curve;
pub use skips::{OverrunAttribution, SkipFigures};
pub use tracking::{
    MOVING, PoseErrors, PoseSource, Track, TrackingFigures, TrackingSample, UndisturbedFigures,
};
