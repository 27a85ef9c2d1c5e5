//! One pass over the messages of a run.

use masseter_recording::{Damage, ProcessFault, Recorded};
use masseter_runtime::messages::codes::{Cause, ControllerState, EventKind, Source};
use masseter_runtime::messages::tap::{self, TapError};
use masseter_runtime::messages::{Event, FrameTap, Message, Reading, State, Truth};
use masseter_runtime::named::Declared;
use masseter_scenario::{FaultKindConfig, FaultLayer, Scenario};

use crate::attribution::OverrunAttribution;
use crate::axes::AxisWatch;
use crate::code::Code;
use crate::contact::ContactWatch;
use crate::declared_faults::FaultWatch;
use crate::digest::Digest;
use crate::disturbance::Disturbance;
use crate::events::EventRecord;
use crate::figures::Figures;
use crate::freshness::Freshness;
use crate::named::NamedWatch;
use crate::outage::OutageWatch;
use crate::played::PlayedWatch;
use crate::requirements::Requirements;
use crate::response::Responses;
use crate::scenario_stalls::ScenarioStalls;
use crate::sequence::SequenceCheck;
use crate::shown::Shown;
use crate::skips::{Counters, Skips};
use crate::stop::StopWatch;
use crate::tracking::{PathSample, PoseSource, Tracking};

/// Computes the [`Figures`] of a run from its messages, in their order in the recording.
///
/// It holds no more than a fixed amount of memory, beside one histogram per second of the run and the run's events.
/// [Without a report](Self::without_report) there are no histograms: beside about 1 MB it holds 8 bytes per second of
/// the motion, the run's events, and the frames since the last SYNC of each bus.
///
/// ```
/// use masseter_analysis::Analysis;
/// use masseter_recording::Recorded;
/// use masseter_scenario::{FaultKindConfig, FaultLayer, Scenario};
/// use masseter_runtime::messages::State;
/// use masseter_runtime::named::Declared;
///
/// let mut analysis = Analysis::new(&Scenario::default(), &Declared::default());
/// for cycle in 1..=3 {
///     analysis.take(&Recorded::State(State { seq: cycle, cycle, ..State::default() }))?;
/// }
/// let figures = analysis.finish(false, &[]);
/// assert_eq!((figures.cycles, figures.missing_messages()), (3, 0));
/// # Ok::<(), masseter_runtime::messages::tap::TapError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Analysis {
    period_ns: u64,
    declared: Declared,
    named: NamedWatch,
    /// None where nothing is shown.
    shown: Option<Box<Shown>>,
    /// None but in a dry run.
    axes: Option<AxisWatch>,
    tracking: Tracking,
    faults: FaultWatch,
    fault_kinds: Vec<FaultKindConfig>,
    stalls: ScenarioStalls,
    sequence: SequenceCheck,
    /// None where the scenario leaves the frames out.
    frames: Option<Vec<u64>>,
    events: Vec<EventRecord>,
    responses: Responses,
    cycles: u64,
    freshness: Freshness,
    disturbance: Disturbance,
    digest: Digest,
    first_sample_ns: Option<u64>,
    last_sample_ns: u64,
    controller_skips: Skips,
    plant_skips: Skips,
    outage: OutageWatch,
    final_state: Option<Code<ControllerState>>,
    stop: StopWatch,
    played: PlayedWatch,
    bite_force_max_n: Option<f64>,
    contact: ContactWatch,
    /// None where the scenario requires nothing.
    requirements: Option<Requirements>,
}

impl Analysis {
    /// For a run of this scenario, which was accepted when the run began, with what its controller declared.
    pub fn new(scenario: &Scenario, declared: &Declared) -> Self {
        let is_emulated = scenario.can.is_virtual();
        let period_ns = scenario.period_ns();
        let requirements = Requirements::new(scenario, declared);
        Self {
            period_ns,
            declared: declared.clone(),
            named: NamedWatch::new(declared),
            shown: Some(Box::new(Shown::new(scenario))),
            axes: scenario.dry.is_on.then(|| AxisWatch::new(scenario)),
            tracking: Tracking::new(
                if is_emulated { PoseSource::Truth } else { PoseSource::Estimate },
                scenario.jaw.reference_point_m,
            ),
            faults: FaultWatch::new(scenario.faults.len()),
            fault_kinds: scenario.faults.iter().map(|fault| fault.kind).collect(),
            stalls: ScenarioStalls::default(),
            sequence: SequenceCheck::default(),
            frames: scenario.recording.frames.then(Vec::new),
            events: Vec::new(),
            responses: Responses::for_scenario(scenario),
            cycles: 0,
            freshness: Freshness::default(),
            disturbance: Disturbance::default(),
            digest: Digest::default(),
            first_sample_ns: None,
            last_sample_ns: 0,
            controller_skips: Skips::default(),
            plant_skips: Skips::default(),
            outage: OutageWatch::default(),
            final_state: None,
            stop: StopWatch::default(),
            played: PlayedWatch::new(scenario, declared),
            // The robot has no sensor for this force.
            bite_force_max_n: scenario.has_contact().then_some(0.0),
            contact: ContactWatch::default(),
            requirements: (!requirements.is_empty()).then_some(requirements),
        }
    }

    /// The same for a run that is judged and not shown: no intervals, longest cycles, or curves.
    #[must_use]
    pub fn without_report(scenario: &Scenario, declared: &Declared) -> Self {
        Self { shown: None, ..Self::new(scenario, declared) }
    }

    /// The same for messages that come while the run goes on. A clone that [finishes](Self::finish) gives the figures
    /// so far.
    #[must_use]
    pub fn while_running(scenario: &Scenario, declared: &Declared) -> Self {
        let requirements = Requirements::while_running(scenario, declared);
        Self {
            requirements: (!requirements.is_empty()).then_some(requirements),
            ..Self::new(scenario, declared)
        }
    }

    /// Takes the next message.
    ///
    /// # Errors
    /// When a message on topic `frame` holds no CAN frame.
    pub fn take(&mut self, message: &Recorded) -> Result<(), TapError> {
        // What no recording has is in no figure: a run has the same ones with and without a recording.
        if self.frames.is_none() && matches!(message, Recorded::Frame(_)) {
            return Ok(());
        }
        self.sequence.take(message);
        self.digest.take(message);
        if let Some(requirements) = &mut self.requirements {
            requirements.take(message);
        }
        match message {
            Recorded::Command(command) => {
                self.shown.iter_mut().for_each(|shown| shown.command(command));
                self.axes.iter_mut().for_each(|axes| axes.command(command));
            }
            Recorded::Reading(reading) => self.reading(reading),
            Recorded::State(state) => self.state(state),
            Recorded::Truth(truth) => self.truth(truth),
            Recorded::Contact(contact) => {
                let since_ns = self.shown.as_mut().map(|shown| shown.over_time.since(contact.sampled_ns));
                self.contact.take(contact, since_ns);
            }
            Recorded::Frame(frame) => self.frame(frame)?,
            Recorded::Signals(message) => {
                self.named.signals(message);
                self.shown.iter_mut().for_each(|shown| shown.signals(message));
            }
            Recorded::Parameters(message) => self.named.parameters(message),
            Recorded::Event(event) => {
                self.played.event(event);
                self.event(EventRecord::of_run(event, &self.declared));
            }
            Recorded::Machine(machine) => {
                self.shown.iter_mut().for_each(|shown| shown.longest_cycles.machine(machine));
            }
        }
        Ok(())
    }

    /// Takes a fault that the supervisor carried out on a process. Call this before [`take`](Self::take).
    pub fn process_fault(&mut self, fault: &ProcessFault) {
        let kind = fault.number.checked_sub(1).and_then(|place| self.fault_kinds.get(place));
        let Some(kind) = kind else { return };
        self.stalls.add(*kind, fault);
        // The plant reports the others itself.
        if kind.layer() != FaultLayer::Process {
            return;
        }
        self.faults.strike(fault.number, fault.struck_ns);
        if let Some(requirements) = &mut self.requirements {
            let ends = [(Cause::FaultInjected, Some(fault.struck_ns)), (Cause::FaultEnded, fault.ended_ns)];
            for (cause, time_ns) in ends {
                let Some(time_ns) = time_ns else { continue };
                let event = Event::new(Source::Scenario, EventKind::Notice, cause);
                let value = fault.number as f64;
                requirements.event(&EventRecord::from(&Event { time_ns, value, ..event }));
            }
        }
    }

    fn reading(&mut self, reading: &Reading) {
        let is_of_scenario = self.stalls.reading(reading);
        let skipped = self.plant_skips.take(&Counters::from(reading), self.period_ns, is_of_scenario);
        self.shown.iter_mut().for_each(|shown| shown.reading(reading, skipped));
        self.axes.iter_mut().for_each(|axes| axes.reading(reading));
        self.outage.reading(reading, is_of_scenario);
        if self.stop.reading(reading) {
            self.tracking.stop(reading.cycle);
        }
        self.first_sample_ns.get_or_insert(reading.sampled_ns);
        self.last_sample_ns = reading.sampled_ns;
    }

    fn state(&mut self, state: &State) {
        let is_fresh = self.freshness.take(state);
        let (is_of_scenario, is_path_of_scenario) = self.stalls.state(state);
        let skipped = self.controller_skips.take(&Counters::from(state), self.period_ns, is_of_scenario);
        self.shown.iter_mut().for_each(|shown| shown.state(state, is_fresh, skipped));
        self.outage.state(state, is_of_scenario);
        let is_disturbed = self.disturbance.take(state, is_fresh, is_path_of_scenario);
        if let Some(requirements) = self.requirements.as_mut().filter(|_| is_disturbed) {
            requirements.disturb(state.cycle);
        }
        self.tracking.state(state, is_fresh, is_disturbed).into_iter().for_each(|sample| self.path(sample));
        self.cycles = self.cycles.max(state.seq);
        self.final_state = Some(state.controller_state.into());
        self.stop.state(state);
        self.played.state(state);
    }

    fn truth(&mut self, truth: &Truth) {
        self.tracking.truth(truth).into_iter().flatten().for_each(|sample| self.path(sample));
        self.bite_force_max_n = self.bite_force_max_n.map(|most_n| most_n.max(truth.bite_force_n));
        self.shown.iter_mut().for_each(|shown| shown.truth(truth));
    }

    fn path(&mut self, sample: PathSample) {
        self.shown.iter_mut().for_each(|shown| shown.over_time.path(&sample));
        self.faults.sample(sample);
    }

    fn event(&mut self, event: EventRecord) {
        self.faults.event(&event);
        self.stop.event(&event);
        if let Some(requirements) = &mut self.requirements {
            requirements.event(&event);
        }
        self.events.push(event);
    }

    fn frame(&mut self, tap: &FrameTap) -> Result<(), TapError> {
        let bus = tap::bus_of(tap)?;
        let tapped = tap::decode(tap)?;
        let Some(frames) = &mut self.frames else { return Ok(()) };
        if bus >= frames.len() {
            frames.resize(bus + 1, 0);
        }
        frames[bus] += u64::from(tapped.frame().is_some());
        self.shown.iter_mut().for_each(|shown| shown.frame(tap, bus, &tapped));
        self.responses.frame(tap, bus, &tapped);
        Ok(())
    }

    /// The figures of all messages so far. `cut_short` and `damage` are what the recording itself lacks, as its
    /// [`Reader`](masseter_recording::Reader) found them.
    pub fn finish(mut self, cut_short: bool, damage: &[Damage]) -> Figures {
        let (tracking, track) = self.tracking.finish();
        let duration_ns =
            self.last_sample_ns.saturating_sub(self.first_sample_ns.unwrap_or(self.last_sample_ns));
        let topics = self.sequence.finish();
        let missing_frames =
            topics.iter().find(|topic| topic.topic == FrameTap::TOPIC).map_or(0, |topic| topic.missing);
        let (signals, parameters) = self.named.finish();
        let (stopped_by, enabled_cycles) = self.stop.finish();
        let (reached_s, motion_departure) = self.played.finish();
        let enabled_s = enabled_cycles as f64 * self.period_ns as f64 / 1e9;
        let (intervals, worst_cycles, over_time, jaw_cycles) =
            self.shown.map_or_else(Default::default, |shown| {
                let Shown { intervals, longest_cycles, over_time, jaw_cycles, .. } = *shown;
                let over_time = over_time.finish(self.declared.signals.len());
                (intervals.finish(), longest_cycles.finish(), over_time, jaw_cycles.finish())
            });
        self.events.sort_by_key(|event| event.time_ns);
        Figures {
            digest: self.digest.finish(),
            cycles: self.cycles,
            duration_s: duration_ns as f64 / 1e9,
            overrun_attribution: OverrunAttribution::new(&[&self.controller_skips, &self.plant_skips]),
            controller_skips: self.controller_skips.figures,
            plant_skips: self.plant_skips.figures,
            readings: self.freshness.figures,
            final_state: self.final_state,
            stopped_by,
            enabled_s,
            motion_reached_s: reached_s.map(|reached_s| reached_s.min(enabled_s)),
            motion_departure,
            outage: self.outage.finish(self.period_ns),
            tracking,
            faults: self.faults.finish(),
            requirements: self.requirements.map(Requirements::finish).unwrap_or_default(),
            signals,
            parameters,
            bite_force_max_n: self.bite_force_max_n,
            contact: self.contact.finish(),
            jaw_cycles,
            worst_cycles,
            intervals,
            topics,
            frames: self.frames,
            bus_response: self.responses.finish(missing_frames),
            events: self.events,
            cut_short,
            damage: damage.to_vec(),
            axes: self.axes.map(AxisWatch::finish).unwrap_or_default(),
            track,
            over_time,
        }
    }
}
