//! The figures of a run, computed from its messages in one pass: latencies, tracking, losses, events.
//!
//! [`Analysis`] takes the messages and returns [`Figures`]. It reads no file, writes none, and judges nothing: see the
//! crates `masseter-recording` and `masseter-report`.

mod analysis;
mod answer;
mod attribution;
mod axes;
mod bus_response;
mod by_cycle;
mod code;
mod contact;
mod declared_faults;
mod digest;
mod disturbance;
mod events;
mod figures;
mod freshness;
mod hops;
mod intervals;
mod jaw_cycles;
mod kernel_counts;
mod longest_cycles;
mod measured;
mod named;
mod noise;
mod outage;
mod over_time;
mod played;
mod pose_errors;
pub mod requirements;
mod response;
mod scenario_stalls;
mod sequence;
mod series;
mod shown;
pub mod signals;
mod skips;
mod smoothing;
mod stop;
mod tracking;

pub use analysis::Analysis;
pub use attribution::OverrunAttribution;
pub use axes::AxisFigures;
pub use bus_response::{BusResponse, ResponseFigures};
pub use code::Code;
pub use contact::{ContactFigures, ToothFigures, ToothLoads};
pub use declared_faults::{Detection, FaultFigures};
pub use events::EventRecord;
pub use figures::Figures;
pub use freshness::ReadingFigures;
pub use hops::hop_names;
pub use jaw_cycles::{COURSE_POINTS, CoursePoint, JawCycle, JawCycleFigures, Statistic};
pub use kernel_counts::KernelCounts;
pub use longest_cycles::WorstCycle;
pub use measured::{IntervalFigures, Seconds, resolution_ns};
pub use named::{ParameterFigures, SignalFigures};
pub use outage::Outage;
pub use over_time::OverTime;
pub use played::Departure;
pub use pose_errors::PoseErrors;
pub use sequence::{SequenceCheck, TopicFigures};
pub use series::Curve;
pub use skips::SkipFigures;
pub use stop::StoppedBy;
pub use tracking::{MOVING, PoseSource, Track, TrackingFigures, TrackingSample, UndisturbedFigures};
