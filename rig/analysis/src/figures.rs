//! The figures of a run: everything that a run is reported and judged by.

use masseter_model::geometry::AXES;
use masseter_recording::Damage;
use masseter_runtime::messages::codes::ControllerState;
use serde::Serialize;

use crate::attribution::OverrunAttribution;
use crate::axes::AxisFigures;
use crate::bus_response::BusResponse;
use crate::code::Code;
use crate::contact::ContactFigures;
use crate::declared_faults::FaultFigures;
use crate::events::EventRecord;
use crate::freshness::ReadingFigures;
use crate::jaw_cycles::JawCycleFigures;
use crate::longest_cycles::WorstCycle;
use crate::measured::IntervalFigures;
use crate::named::{ParameterFigures, SignalFigures};
use crate::outage::Outage;
use crate::over_time::OverTime;
use crate::played::Departure;
use crate::requirements::RequirementFigures;
use crate::sequence::TopicFigures;
use crate::skips::SkipFigures;
use crate::stop::StoppedBy;
use crate::tracking::{Track, TrackingFigures};

/// The figures of a run. As JSON: `figures` of `summary.json`.
#[derive(Debug, Clone, Serialize)]
pub struct Figures {
    /// A short number for targets, positions and states by cycle: equal where two runs did the same.
    pub digest: String,
    /// Cycles that the controller ran.
    pub cycles: u64,
    /// From the first to the last reading, s.
    pub duration_s: f64,
    /// Deadlines that the controller skipped after overruns.
    pub controller_skips: SkipFigures,
    /// Deadlines that the plant skipped after overruns.
    pub plant_skips: SkipFigures,
    /// Which readings the controller's cycles used.
    pub readings: ReadingFigures,
    /// Rig or machine as the cause of the overlong stretches of work; none where no such stretch cost a deadline.
    pub overrun_attribution: Option<OverrunAttribution>,
    /// The last state of the controller's sequence; none without a single state message.
    pub final_state: Option<Code<ControllerState>>,
    /// What stopped the drives, whatever the controller reports; none where nothing did.
    pub stopped_by: Option<StoppedBy>,
    /// For how long all drives were enabled, s.
    pub enabled_s: f64,
    /// How far the motion came, s of its own time: what the controller stated, as far as the drives were enabled so long and
    /// that time did not jump, vanish, or pass unseen; none where it stated none.
    pub motion_reached_s: Option<f64>,
    /// How far the stated desired poses are from the scenario's motion; none where they need not be it: in an own motion,
    /// with force control, and from where the amplitude is set.
    pub motion_departure: Option<Departure>,
    /// Deadlines missed just before a safe stop; none without one.
    pub outage: Option<Outage>,
    /// Distance of the platform from its desired pose, while the motion played.
    pub tracking: TrackingFigures,
    /// The scenario's faults, in their order.
    pub faults: Vec<FaultFigures>,
    /// The scenario's requirements, in their order, then the events that it expects.
    pub requirements: Vec<RequirementFigures>,
    /// The controller's signals.
    pub signals: Vec<SignalFigures>,
    /// The controller's parameters.
    pub parameters: Vec<ParameterFigures>,
    /// The greatest vertical force of food and upper teeth on the emulated jaw, N; none where the jaws cannot touch,
    /// and on the robot.
    pub bite_force_max_n: Option<f64>,
    /// What the lower teeth bore; none where the jaws cannot touch, and on the robot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact: Option<ContactFigures>,
    /// Cycles of the jaw; none without a report.
    pub jaw_cycles: JawCycleFigures,
    /// Measured intervals.
    pub intervals: Vec<IntervalFigures>,
    /// The longest cycles, each with the hop furthest above its median.
    pub worst_cycles: Vec<WorstCycle>,
    /// Messages and losses of each topic.
    pub topics: Vec<TopicFigures>,
    /// Frames on each bus; none where the scenario leaves them out.
    pub frames: Option<Vec<u64>>,
    /// Response times of the buses' messages, beside their bounds.
    pub bus_response: BusResponse,
    /// Events in the order of their times.
    pub events: Vec<EventRecord>,
    /// Whether the recording lacks its end.
    pub cut_short: bool,
    /// Stretches of the recording that cannot be read.
    pub damage: Vec<Damage>,
    /// How each drive met the demands while the motion played; zeros but in a dry run.
    #[serde(skip)]
    pub axes: [AxisFigures; AXES],
    /// Tracking over time, for plots.
    #[serde(skip)]
    pub track: Track,
    /// Wake-ups, axes and buses over time, for plots.
    #[serde(skip)]
    pub over_time: OverTime,
}

impl Figures {
    /// Deadlines that the two processes skipped, and those of them that the machine caused: it stalled while they
    /// waited, or may have stalled while they worked.
    pub fn skipped(&self) -> (u64, u64) {
        let (controller, plant) = (&self.controller_skips, &self.plant_skips);
        let is_machine = self.overrun_attribution.is_some_and(|overruns| overruns.may_be_the_machine());
        let while_working = if is_machine { controller.while_working + plant.while_working } else { 0 };
        (controller.skipped + plant.skipped, controller.by_machine + plant.by_machine + while_working)
    }

    /// Messages that were published and not recorded.
    pub fn missing_messages(&self) -> u64 {
        self.topics.iter().map(|topic| topic.missing).sum()
    }
}
