//! The judge of a run: its figures, computed from its messages in one pass, and the verdict on them.
//!
//! [`Analysis`] takes the messages and returns [`Figures`]; [`Verdict`] judges them. Nothing here reads or writes a file:
//! see the crates `masseter-recording` and `masseter-report`.

mod analysis;
mod bite_estimate;
mod breach;
mod check;
mod checks;
mod condyles;
mod declared_faults;
mod events;
mod figures;
mod intervals;
mod jaw_cycles;
mod loads;
mod longest_cycles;
mod lost_cycles;
mod measured;
mod messages;
mod next_step;
mod outcome;
mod over_time;
mod overruns;
mod played;
mod poses;
mod pressure;
mod recorded;
mod reference;
pub mod requirements;
mod response;
mod series;
mod shortfall;
mod shown;
pub mod signals;
mod skips;
mod standstill;
mod statistic;
mod stop_cause;
mod timing;
mod tracking;
mod verdict;
mod watch;

pub use analysis::Analysis;
pub use bite_estimate::BiteEstimateFigures;
pub use breach::{Breach, PathBreach};
pub use check::{Check, CheckFigures, CheckResult};
pub use checks::whose_motion;
pub use declared_faults::{Detection, FaultFigures};
pub use events::{Code, EventRecord};
pub use figures::Figures;
pub use jaw_cycles::{
    BorderStep, COURSE_POINTS, Course, CoursePoint, CycleQuantity, JawCycle, JawCycleFigures, JawCycleGroup,
    JawCycleKind, JawSide, LeftOut, QUANTITIES, Quantity, closed_incisal_m, incisal_m, mean_course,
};
pub use loads::{AxisFigures, ContactFigures, ToothFigures, ToothLoads};
pub use longest_cycles::{KernelCounts, WorstCycle, hop_names};
pub use lost_cycles::{Outage, ReadingFigures};
pub use measured::{IntervalFigures, Seconds, resolution_ns};
pub use messages::{ParameterFigures, SequenceCheck, SignalFigures, TopicFigures};
pub use next_step::NextStep;
pub use outcome::missing_part;
pub use over_time::OverTime;
pub use overruns::{LoopCounts, Overrun, OverrunCause};
pub use played::{MotionFigures, StoppedBy};
pub use poses::MOVING;
pub use pressure::{Bearing, PressedTooth, Pressure};
pub use recorded::{RecordedError, RecordedFigures, RecordedWatch};
pub use reference::Disorder;
pub use response::{BusResponse, ResponseFigures};
pub use series::{Band, Curve};
pub use skips::{OverrunAttribution, SkipFigures};
pub use standstill::StandstillFigures;
pub use statistic::{Statistic, student_t};
pub use timing::{Timing, TimingWord};
pub use tracking::{PoseErrors, PoseSource, TrackingFigures, TrackingSample, UndisturbedFigures};
pub use verdict::Verdict;
pub use watch::{UnknownRequirement, Watch};
