//! One pass over the messages of a run, and the figures that it gives.
//!
//! Figures that no verdict depends on are in [`Shown`](crate::shown::Shown): a run without a report does without them.

use masseter_recording::{Damage, ProcessFault, Recorded, RunUsage};
use masseter_runtime::messages::codes::{Cause, ControllerState, EventKind, Source};
use masseter_runtime::messages::tap::{self, TapError};
use masseter_runtime::messages::{Event, FrameTap, Message, Reading, State};
use masseter_runtime::named::{Declared, PlayedMotion};
use masseter_scenario::{ChecksConfig, FaultKindConfig, Scenario};

use crate::events::{Code, EventRecord};
use crate::lost_cycles::{Disturbance, Freshness, OutageWatch, ScenarioStalls};
use crate::messages::{Digest, ParameterFigures, SequenceCheck, SignalFigures};
use crate::played::{MotionFigures, PlayedWatch, StopWatch};
use crate::signals::{Pace, Sample, Timeline};
use crate::skips::{Counters, OverrunAttribution, Skips, longest_overruns};
use crate::tracking::{PoseSource, Tracking};
use crate::{
    bite_estimate::BiteEstimateWatch, declared_faults::FaultWatch, figures::Figures, loads::AxisWatch,
    overruns::LoopSamples, poses::is_running, recorded::RecordedWatch, requirements::Requirements,
    response::Responses, shown::Shown, standstill::StandstillWatch,
};

/// Computes the [`Figures`] of a run from its messages, in their order in the recording.
///
/// It holds no more than a fixed amount of memory, beside one histogram per second of the run and the run's events.
/// [Without a report](Self::without_report) there are no histograms: beside about 1 MB it holds 8 bytes per second of
/// the motion, the run's events, and the frames since the last SYNC of each bus.
///
/// ```
/// use masseter_judge::Analysis;
/// use masseter_recording::Recorded;
/// use masseter_scenario::Scenario;
/// use masseter_runtime::messages::State;
/// use masseter_runtime::named::{Declared, PlayedMotion};
///
/// let mut analysis = Analysis::new(&Scenario::default(), &Declared::default());
/// for cycle in 1..=3 {
///     analysis.take(&Recorded::State(State { seq: cycle, cycle, ..State::default() }))?;
/// }
/// let figures = analysis.finish(false, &[]);
/// assert_eq!((figures.cycles, figures.missing_messages()), (3, 0));
/// # Ok::<(), masseter_runtime::messages::tap::TapError>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct Analysis {
    period_ns: u64,
    declared: Declared,
    interfaces: Vec<String>,
    /// The cycles in the order of time.
    timeline: Timeline,
    /// `None` if nothing is shown.
    shown: Option<Box<Shown>>,
    /// None but in a dry run.
    axes: Option<AxisWatch>,
    tracking: Tracking,
    limits: ChecksConfig,
    faults: FaultWatch,
    fault_kinds: Vec<FaultKindConfig>,
    stalls: ScenarioStalls,
    sequence: SequenceCheck,
    responses: Responses,
    freshness: Freshness,
    disturbance: Disturbance,
    digest: Digest,
    first_sample_ns: Option<u64>,
    last_sample_ns: u64,
    /// The deadline of the controller's last cycle, ns.
    last_due_ns: u64,
    controller_skips: Skips,
    plant_skips: Skips,
    outage: OutageWatch,
    stop: StopWatch,
    standstill: StandstillWatch,
    played: PlayedWatch,
    /// None where the scenario plays no recording.
    recorded: Option<RecordedWatch>,
    /// None where the force is not estimated, or has no truth.
    bite_estimate: Option<BiteEstimateWatch>,
    /// `None` if the scenario requires nothing.
    requirements: Option<Requirements>,
    /// What needs no collector.
    figures: Figures,
}

impl Analysis {
    /// For a run of this scenario, which was accepted when the run began, with what its controller declared.
    pub fn new(scenario: &Scenario, declared: &Declared) -> Self {
        Self::at_pace(scenario, declared, Pace::Recorded)
    }

    /// The same for a run that is judged and not shown: no intervals, longest cycles, or curves. Its messages come in the order of
    /// time.
    #[must_use]
    pub fn without_report(scenario: &Scenario, declared: &Declared) -> Self {
        Self { shown: None, ..Self::at_pace(scenario, declared, Pace::InOrder) }
    }

    /// The same for messages that come while the run goes on. A clone that [finishes](Self::finish) gives the figures
    /// so far.
    #[must_use]
    pub fn while_running(scenario: &Scenario, declared: &Declared) -> Self {
        Self::at_pace(scenario, declared, Pace::Live)
    }

    fn at_pace(scenario: &Scenario, declared: &Declared, pace: Pace) -> Self {
        let is_emulated = scenario.can.is_virtual();
        let period_ns = scenario.period_ns();
        let requirements = Requirements::new(scenario, declared);
        Self {
            period_ns,
            declared: declared.clone(),
            interfaces: scenario.can.interfaces.clone(),
            timeline: Timeline::new(scenario, declared, pace),
            shown: Some(Box::new(Shown::new(scenario, declared.signals.len()))),
            axes: scenario.dry.is_on.then(|| AxisWatch::new(scenario)),
            tracking: Tracking::new(
                if is_emulated { PoseSource::Truth } else { PoseSource::Estimate },
                scenario.jaw.reference_point_m,
            ),
            limits: scenario.checks,
            faults: FaultWatch::new(scenario.faults.len(), scenario.checks),
            fault_kinds: scenario.faults.iter().map(|fault| fault.kind).collect(),
            responses: Responses::for_scenario(scenario),
            standstill: StandstillWatch::new(scenario),
            played: PlayedWatch::new(scenario),
            recorded: (declared.motion == PlayedMotion::Scenario)
                .then(|| RecordedWatch::of_scenario(scenario))
                .flatten(),
            bite_estimate: is_emulated.then(|| BiteEstimateWatch::new(declared)).flatten(),
            requirements: (!requirements.is_empty()).then_some(requirements),
            figures: Figures {
                signals: declared.signals.iter().map(SignalFigures::new).collect(),
                parameters: declared.parameters.iter().map(ParameterFigures::new).collect(),
                frames: scenario.recording.frames.then(Vec::new),
                // The robot has no sensor for this force.
                bite_force_max_n: scenario.has_contact().then_some(0.0),
                ..Figures::default()
            },
            ..Self::default()
        }
    }

    /// Takes the next message.
    ///
    /// # Errors
    /// When a message on topic `frame` holds no CAN frame.
    pub fn take(&mut self, message: &Recorded) -> Result<(), TapError> {
        // What no recording has is in no figure: a run has the same ones with and without a recording.
        if self.figures.frames.is_none() && matches!(message, Recorded::Frame(_)) {
            return Ok(());
        }
        self.sequence.take(message);
        self.digest.add_message(message);
        if let Some(sample) = self.timeline.take(message) {
            self.judge_sample(&sample);
        }
        match message {
            Recorded::Command(command) => {
                self.shown.iter_mut().for_each(|shown| shown.apply_command(command));
            }
            Recorded::Reading(reading) => self.apply_reading(reading),
            Recorded::State(state) => self.apply_state(state),
            Recorded::Truth(truth) => {
                let most_n = self.figures.bite_force_max_n.iter_mut();
                most_n.for_each(|most_n| *most_n = most_n.max(truth.bite_force_n));
                self.shown.iter_mut().for_each(|shown| shown.apply_truth(truth));
            }
            Recorded::Contact(contact) => {
                let since_ns = self.shown.as_mut().map(|shown| shown.over_time.since(contact.sampled_ns));
                self.figures.contact.get_or_insert_default().add_contact(contact, since_ns);
            }
            Recorded::Frame(frame) => self.apply_frame(frame)?,
            Recorded::Signals(message) => {
                SignalFigures::add_all(&mut self.figures.signals, message);
                self.shown.iter_mut().for_each(|shown| shown.over_time.apply_signals(message));
            }
            Recorded::Parameters(message) => {
                ParameterFigures::add_all(&mut self.figures.parameters, message);
            }
            Recorded::Event(event) => {
                self.apply_event(EventRecord::of_run(event, &self.declared, &self.interfaces));
            }
            Recorded::Machine(machine) => {
                self.shown.iter_mut().for_each(|shown| shown.longest_cycles.apply_machine(machine));
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
        if !kind.is_of_process() {
            return;
        }
        self.faults.strike(fault.number, fault.struck_ns);
        let ends = [(Cause::FaultInjected, Some(fault.struck_ns)), (Cause::FaultEnded, fault.ended_ns)];
        for (cause, time_ns) in ends {
            let Some(time_ns) = time_ns else { continue };
            let event = Event::new(Source::Scenario, EventKind::Notice, cause);
            let value = fault.number as f64;
            self.timeline.event(&EventRecord::from(&Event { time_ns, value, ..event }));
        }
    }

    /// Takes what the supervisor sampled of the loops' threads. Call this before [`take`](Self::take).
    pub fn loop_samples(&mut self, usage: &RunUsage) {
        self.controller_skips.samples = LoopSamples::of(usage, "controller");
        self.plant_skips.samples = LoopSamples::of(usage, "plant");
    }

    fn apply_reading(&mut self, reading: &Reading) {
        let is_of_scenario = self.stalls.apply_reading(reading);
        let skipped = self.plant_skips.account(&Counters::from(reading), self.period_ns, is_of_scenario);
        self.shown.iter_mut().for_each(|shown| shown.apply_reading(reading, skipped));
        self.outage.apply_reading(reading, is_of_scenario);
        if self.stop.apply_reading(reading) {
            self.tracking.stop(reading.cycle);
            self.outage.stop(reading.woke_ns);
            self.figures.stop_without_event_ns.get_or_insert(reading.sampled_ns);
        }
        self.first_sample_ns.get_or_insert(reading.sampled_ns);
        self.last_sample_ns = reading.sampled_ns;
    }

    fn apply_state(&mut self, state: &State) {
        let is_fresh = self.freshness.is_first_use(state);
        let (is_of_scenario, is_path_of_scenario) = self.stalls.apply_state(state);
        let skipped = self.controller_skips.account(&Counters::from(state), self.period_ns, is_of_scenario);
        self.shown.iter_mut().for_each(|shown| shown.apply_state(state, is_fresh, skipped));
        self.outage.apply_state(state, is_of_scenario);
        if self.disturbance.may_act_in(state, is_fresh, is_path_of_scenario) {
            self.timeline.disturb(state.cycle);
        }
        self.figures.cycles = self.figures.cycles.max(state.seq);
        self.figures.final_state = Some(state.controller_state.into());
        self.figures.has_begun |= state.controller_state >= ControllerState::Running.code();
        if state.controller_state == ControllerState::SafeStop.code() {
            self.figures.stop_without_event_ns.get_or_insert(state.due_ns);
        }
        self.last_due_ns = state.due_ns;
        self.stop.apply_state(state);
    }

    /// Takes the next cycle in the order of time.
    fn judge_sample(&mut self, sample: &Sample) {
        let messages = &sample.messages;
        self.standstill.add_sample(sample);
        if let Some(path) = self.tracking.add_sample(sample) {
            let speed = self.timeline.reference.speed(messages.progress_s);
            self.shown.iter_mut().for_each(|shown| shown.apply_path(&path, messages, speed));
            self.faults.apply_sample(&path);
            self.figures.path_breach.take(&path, is_running(messages.controller_state), &self.limits);
            if let (Some(recorded), Some(used)) = (&mut self.recorded, &messages.solution) {
                let is_counted = is_running(messages.controller_state) && used.motion_time_s >= 0.0;
                if let Some(actual) = path.actual.filter(|_| is_counted) {
                    recorded.add(used.motion_time_s, &actual);
                }
            }
            if let Some(lag_s) = messages.lag_s {
                self.played.add_sample(lag_s, messages.progress_s, &path);
            }
        }
        if let Some(reading) = &messages.reading {
            // Simulated time has no account of the loops, and no cycles that the machine lost.
            let is_excused = messages.is_disturbed && self.controller_skips.figures.worked_ns > 0;
            self.played.add_reading(reading, messages.controller_state, is_excused);
        }
        self.axes.iter_mut().for_each(|axes| axes.add_cycle(messages));
        self.bite_estimate.iter_mut().for_each(|estimate| estimate.add(messages));
        self.requirements.iter_mut().for_each(|requirements| requirements.judge_sample(sample));
    }

    fn apply_event(&mut self, event: EventRecord) {
        self.faults.apply_event(&event);
        self.stop.apply_event(&event);
        self.timeline.event(&event);
        self.figures.events.push(event);
    }

    fn apply_frame(&mut self, tap: &FrameTap) -> Result<(), TapError> {
        let bus = tap::bus_of(tap)?;
        let tapped = tap::decode(tap)?;
        let Some(frames) = &mut self.figures.frames else { return Ok(()) };
        if bus >= frames.len() {
            frames.resize(bus + 1, 0);
        }
        frames[bus] += u64::from(tapped.frame().is_some());
        self.shown.iter_mut().for_each(|shown| shown.over_time.apply_frame(tap.time_ns, bus, &tapped));
        self.responses.apply_frame(tap, bus, &tapped);
        Ok(())
    }

    /// The figures of all messages so far. `cut_short` and `damage` are what the recording itself lacks, as its
    /// [`Reader`](masseter_recording::Reader) found them.
    pub fn finish(mut self, cut_short: bool, damage: &[Damage]) -> Figures {
        while let Some(sample) = self.timeline.finish() {
            self.judge_sample(&sample);
        }
        let reference = &self.timeline.reference;
        let rest_m = reference.rest(|from, to| self.played.distance_m(from, to));
        let (rest_s, lag_causes_ms) = (reference.rest_s(), reference.lag_causes_ms());
        let disorder = reference.disorder();
        let (tracking, track) = self.tracking.into_figures();
        let duration_ns =
            self.last_sample_ns.saturating_sub(self.first_sample_ns.unwrap_or(self.last_sample_ns));
        let topics = self.sequence.finish();
        let missing_frames =
            topics.iter().find(|topic| topic.topic == FrameTap::TOPIC).map_or(0, |topic| topic.missing);
        let running_s = self.played.running_cycles() as f64 * self.period_ns as f64 / 1e9;
        let (stopped_by, enabled_cycles) = self.stop.into_figures();
        let enabled_s = enabled_cycles as f64 * self.period_ns as f64 / 1e9;
        if let Some(shown) = self.shown {
            shown.add_to(&mut self.figures);
        }
        self.figures.events.sort_by_key(|event| event.time_ns);
        let overruns = longest_overruns([&mut self.controller_skips, &mut self.plant_skips]);
        let is_over = |state: &Code<ControllerState>| {
            *state == ControllerState::Finished || *state == ControllerState::SafeStop
        };
        let ended_ns = self.figures.final_state.filter(is_over).map(|_| self.last_due_ns + self.period_ns);
        Figures {
            ended_ns,
            last_cycle_ns: self.last_due_ns.min(self.last_sample_ns),
            disorder,
            digest: self.digest.in_hex(),
            duration_s: duration_ns as f64 / 1e9,
            overrun_attribution: OverrunAttribution::new(&[&self.controller_skips, &self.plant_skips]),
            controller_skips: self.controller_skips.figures,
            plant_skips: self.plant_skips.figures,
            overruns,
            readings: self.freshness.figures,
            stopped_by,
            enabled_s,
            running_s,
            motion: MotionFigures { rest_s, lag_causes_ms, ..self.played.into_figures(rest_m) },
            standstill: self.standstill.into_figures(),
            outage: self.outage.outage(self.period_ns),
            tracking,
            recorded: self.recorded.and_then(RecordedWatch::into_figures),
            faults: self.faults.into_figures(ended_ns),
            requirements: self.requirements.map(Requirements::into_figures).unwrap_or_default(),
            bite_estimate: self.bite_estimate.and_then(BiteEstimateWatch::into_figures),
            topics,
            bus_response: self.responses.into_figures(missing_frames),
            cut_short,
            damage: damage.to_vec(),
            axes: self.axes.map(|axes| axes.figures).unwrap_or_default(),
            track,
            ..self.figures
        }
    }
}
