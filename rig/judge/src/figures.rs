//! What a run comes to: its figures.
//!
//! They judge nothing: that is for the checks.

use masseter_model::geometry::AXES;
use masseter_recording::Damage;
use masseter_runtime::messages::codes::{Cause, ControllerState};
use serde::Serialize;

use crate::events::{Code, EventRecord, first_report};
use crate::loads::{AxisFigures, ContactFigures};
use crate::lost_cycles::{Outage, ReadingFigures};
use crate::messages::{ParameterFigures, SignalFigures, TopicFigures};
use crate::played::{MotionFigures, StoppedBy};
use crate::skips::{OverrunAttribution, SkipFigures};
use crate::tracking::{TrackingFigures, TrackingSample};
use crate::{
    bite_estimate::BiteEstimateFigures, breach::PathBreach, declared_faults::FaultFigures,
    jaw_cycles::JawCycleFigures, longest_cycles::WorstCycle, measured::IntervalFigures, over_time::OverTime,
    overruns::Overrun, recorded::RecordedFigures, reference::Disorder, requirements::RequirementFigures,
    response::BusResponse, standstill::StandstillFigures,
};

/// The figures of a run. As JSON: `figures` of `summary.json`.
#[derive(Debug, Clone, Default, Serialize)]
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
    /// Stretches of work that cost deadlines, with what the kernel counted of the loop's thread: the longest, the loops' own first.
    pub overruns: Vec<Overrun>,
    /// Rig or machine as the cause of the other overlong stretches of work; `None` if no such stretch cost a deadline.
    pub overrun_attribution: Option<OverrunAttribution>,
    /// The last state of the controller's sequence; none without a single state message.
    pub final_state: Option<Code<ControllerState>>,
    /// When the controller first stated a safe stop, or the readings first showed a stop of drives or master, ns of the run's clock.
    #[serde(skip)]
    pub stop_without_event_ns: Option<u64>,
    /// What is out of order in the controller's states, and when that was, ns of the run's clock; no time of a motion that never began.
    #[serde(skip)]
    pub disorder: Option<(Disorder, Option<u64>)>,
    /// What stopped the drives, whatever the controller reports; `None` if nothing did.
    pub stopped_by: Option<StoppedBy>,
    /// For how long all drives were enabled, s.
    pub enabled_s: f64,
    /// Whether the controller's motion began, by its states: then it is the end that may be overdue.
    #[serde(skip)]
    pub has_begun: bool,
    /// For how long of it the controller was in the state `running`, s.
    #[serde(skip)]
    pub running_s: f64,
    /// The played part of the scenario's motion.
    pub motion: MotionFigures,
    /// How far the mechanism moved after its stops.
    pub standstill: StandstillFigures,
    /// When the controller had ended in order, ns of the run's clock. What begins later is no part of the test.
    #[serde(skip)]
    pub ended_ns: Option<u64>,
    /// The last cycle that both loops ran, ns of the run's clock: a process that died may have begun the next.
    #[serde(skip)]
    pub last_cycle_ns: u64,
    /// Deadlines missed just before a stop by controller, master or drives; none without one.
    pub outage: Option<Outage>,
    /// Distance of the platform from its desired pose, while the motion played.
    pub tracking: TrackingFigures,
    /// When the jaw first left its path beyond a limit.
    #[serde(skip)]
    pub path_breach: PathBreach,
    /// Distance of the jaw from the rows of a recorded motion; none of a generated one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recorded: Option<RecordedFigures>,
    /// The scenario's faults, in their order.
    pub faults: Vec<FaultFigures>,
    /// The scenario's requirements, in their order, then the events that it expects.
    pub requirements: Vec<RequirementFigures>,
    /// The controller's signals.
    pub signals: Vec<SignalFigures>,
    /// The controller's parameters.
    pub parameters: Vec<ParameterFigures>,
    /// The greatest vertical force of food and upper teeth on the emulated jaw, N; `None` if the jaws cannot touch,
    /// and on the robot.
    pub bite_force_max_n: Option<f64>,
    /// The controller's estimate of this force beside the true one; `None` without an estimate, and on the robot.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bite_estimate: Option<BiteEstimateFigures>,
    /// What the lower teeth bore; `None` if the jaws cannot touch, and on the robot.
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
    /// Frames on each bus; `None` if the scenario leaves them out.
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
    /// The platform from the first easing to the last hold, or to the standstill of a safe stop, as often as a screen shows; more
    /// rarely in a long run. From the stop on, its desired pose is the last one.
    #[serde(skip)]
    pub track: Vec<TrackingSample>,
    /// Wake-ups, axes and buses over time, for plots.
    #[serde(skip)]
    pub over_time: OverTime,
}

impl Figures {
    /// Messages that were published and not recorded.
    pub fn missing_messages(&self) -> u64 {
        self.topics.iter().map(|topic| topic.missing).sum()
    }

    /// Whether the motion was to end early: by the operator, the scenario, or the controller itself.
    pub(crate) fn was_stopped_by_request(&self) -> bool {
        self.events.iter().any(|event| event.cause == Cause::StopRequested)
    }

    /// The first fault that anybody reports of what stopped the rig.
    pub fn first_fault(&self) -> Option<&EventRecord> {
        first_report(&self.events, self.stop_without_event_ns, |_| true)
    }

    /// When the rig began to stop: a safe stop, or one by request. A program stops without an event.
    pub(crate) fn stopped_ns(&self) -> Option<u64> {
        let is_stop = |event: &&EventRecord| event.begins_stop() || event.cause == Cause::StopRequested;
        let stops = self.events.iter().filter(is_stop);
        stops.map(|event| event.time_ns).min().or(self.stop_without_event_ns)
    }

    /// Until when a fault or stimulus acts on the motion: a safe stop begins, or the drives are switched off after a stop by
    /// request, which lets the motion come to rest before.
    pub(crate) fn last_act_ns(&self) -> Option<u64> {
        let is_requested = self.was_stopped_by_request();
        let is_end = |event: &&EventRecord| {
            event.begins_stop() || (is_requested && event.enters(ControllerState::Disabling))
        };
        let ends = self.events.iter().filter(is_end);
        ends.map(|event| event.time_ns).min().or(self.stop_without_event_ns)
    }
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::Event;
    use masseter_runtime::messages::codes::{EventKind, Source};

    use super::*;

    fn event(time_ns: u64, kind: EventKind, cause: Cause, to: ControllerState) -> EventRecord {
        let states = (ControllerState::Running.code(), to.code());
        let event = Event::new(Source::Controller, kind, cause);
        EventRecord::from(&Event { time_ns, from: states.0, to: states.1, ..event })
    }

    /// After a stop by request the motion comes to rest, and what acts meanwhile acts on the motion.
    #[test]
    fn entries_act_until_a_safe_stop_or_until_the_drives_are_switched_off() {
        let request = event(100, EventKind::Notice, Cause::StopRequested, ControllerState::Running);
        let holding = event(200, EventKind::Transition, Cause::Sequence, ControllerState::Holding);
        let disabling = event(300, EventKind::Transition, Cause::Sequence, ControllerState::Disabling);
        let safe_stop = event(150, EventKind::Fault, Cause::MasterFault, ControllerState::SafeStop);
        for (what, events, quiet_ns, expected) in [
            ("the end of a whole motion is no stop", vec![&holding, &disabling], None, None),
            ("a request", vec![&request, &holding, &disabling], None, Some(300)),
            ("a safe stop after a request", vec![&request, &safe_stop], None, Some(150)),
            ("a program switches off", vec![], Some(50), Some(50)),
        ] {
            let events = events.into_iter().cloned().collect();
            let figures = Figures { events, stop_without_event_ns: quiet_ns, ..Figures::default() };
            assert_eq!(figures.last_act_ns(), expected, "{what}");
        }
    }
}
