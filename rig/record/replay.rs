//! The replay: the recorded readings of a run go through a controller of this build, and its answers are compared
//! with the recorded ones.
//!
//! The loop is open: a different command reaches no robot, so the readings stay those of the run.

use std::collections::VecDeque;

use masseter_recording::{Columns, Reader, Recorded, definitions, manifest_of};
use masseter_report::divergence::{Compared, Comparison, Differences, Side};
use masseter_runtime::control::{Controller, Duties, run_cycle, set_parameters};
use masseter_runtime::injection::Operator;
use masseter_runtime::messages::{Event, State};
use masseter_runtime::named::NamedValues;
use masseter_runtime::realtime::{Account, Wake};
use masseter_runtime::schedule::CycleSchedule;
use masseter_virtual_time::{Log, LoggedPorts, Sink};

use super::recorded_run::{Deliveries, RecordedRun, ReplayError};
use crate::prelude::*;
use crate::run::request::{ControllerKind, name_of};

/// What a replay came to.
#[derive(Debug, serde::Serialize)]
pub(crate) struct Replayed {
    /// The controller that answered.
    pub(crate) controller: String,
    /// The clock of the run.
    pub(crate) clock: String,
    pub(crate) cycles: u64,
    open_loop: bool,
    /// Between the recording and the replay.
    #[serde(flatten)]
    pub(crate) differences: Differences,
    /// The build that recorded the run.
    #[serde(skip)]
    pub(crate) recorded_by: String,
}

/// Replays the run in a folder, by its controller unless another one is named, with changes to keys of the scenario.
pub(crate) fn replay(run: &Path, kind: Option<ControllerKind>, set: &[String]) -> anyhow::Result<Replayed> {
    let folder = RunFolder::open(run)?;
    let path = folder.manifest();
    let manifest = manifest_of(&folder).with_context(|| path.display().to_string())?;
    let recorded_kind = ControllerKind::of_manifest(manifest.controller.as_deref());
    let recorded_kind =
        recorded_kind.ok_or_else(|| ReplayError::ForeignController(manifest.controller.clone()))?;
    let kind = kind.unwrap_or(recorded_kind);
    let scenario = scenario_with(Some(&folder.scenario()), set)?;
    let name = || folder.recording().display().to_string();
    let run = RecordedRun::read(&mut Reader::open(&folder.recording()).with_context(name)?, &manifest)
        .with_context(name)?;
    let mut replay = Replay::new(&scenario, kind, &manifest, run)?;
    let mut reader = Reader::open(&folder.recording())?;
    while let Some(message) = reader.next_message()? {
        replay.follow(&message)?;
    }
    let (cycles, differences) = replay.into_differences()?;
    let Manifest { clock, masseter: recorded_by, .. } = manifest;
    Ok(Replayed { controller: name_of(&kind), clock, cycles, open_loop: true, differences, recorded_by })
}

/// A controller that gets the readings of a recorded run.
struct Replay {
    controller: Box<dyn Controller>,
    duties: Duties,
    log: Log<Answers>,
    run: RecordedRun,
    deliveries: Deliveries,
    /// States whose cycles have not been replayed.
    waiting: VecDeque<State>,
    cycles: u64,
}

/// What the controller answers is the second side of the comparison.
struct Answers(Comparison);

impl Sink for Answers {
    fn take(&mut self, message: &Recorded, _: u64) {
        self.0.take(Side::B, message);
    }

    fn has_failed(&self) -> bool {
        false
    }
}

impl Replay {
    fn new(
        scenario: &Scenario,
        kind: ControllerKind,
        manifest: &Manifest,
        run: RecordedRun,
    ) -> anyhow::Result<Self> {
        let mut controller = masseter_controller::process::for_scenario(scenario, kind.builder())?;
        let named = NamedValues::new(controller.declared(), &scenario.parameters).context("[parameters]")?;
        set_parameters(&mut *controller, &named);
        let declared = named.settings().declared();
        let channels = definitions(declared);
        let own = Columns::of_topics(channels.iter().map(|(_, channel)| channel));
        let first = &run.first_state;
        let since_first_sync_ns =
            CycleSchedule::new(scenario)?.controller_at_ns + (first.cycle - 1) * scenario.period_ns();
        let operator = Operator::new(scenario, declared, first.due_ns.saturating_sub(since_first_sync_ns))?;
        let compared =
            if manifest.is_in_real_time() { Compared::WithoutStamps } else { Compared::Everything };
        Ok(Self {
            controller,
            duties: Duties { named, operator },
            log: Log::new(Answers(Comparison::new(compared, [run.columns.clone(), own]))),
            run,
            deliveries: Deliveries::default(),
            waiting: VecDeque::new(),
            cycles: 0,
        })
    }

    /// Reads the next message of the recording, and replays the cycles of which everything is known.
    fn follow(&mut self, message: &Recorded) -> Result<(), ReplayError> {
        match message {
            Recorded::Reading(reading) => self.deliveries.push(reading),
            _ if self.run.is_answer(message) => {
                self.log.sink.0.take(Side::A, message);
                if let Recorded::State(state) = message {
                    self.waiting.push_back(*state);
                }
            }
            _ => {}
        }
        while let Some(state) = self.waiting.front().copied()
            && self.deliveries.know_all_until(state.received_ns)
        {
            self.waiting.pop_front();
            self.replay_cycle(&state)?;
        }
        Ok(())
    }

    /// Replays the remaining cycles; returns how many there were, and what differs.
    fn into_differences(mut self) -> Result<(u64, Differences), ReplayError> {
        while let Some(state) = self.waiting.pop_front() {
            self.replay_cycle(&state)?;
        }
        Ok((self.cycles, self.log.sink.0.finish()))
    }

    fn replay_cycle(&mut self, state: &State) -> Result<(), ReplayError> {
        let Self { controller, duties, log, run, deliveries, .. } = self;
        while let Some(event) = run.intervention_in(state.cycle) {
            intervene(&event, &mut **controller, duties, run);
        }
        let reading = deliveries.received_in(state)?;
        let times_ns = [state.received_ns, state.solved_ns, state.commanded_ns];
        let Ok(()) = run_cycle(
            &mut **controller,
            duties,
            &mut LoggedPorts::new(log, times_ns, reading.as_ref()),
            &wake_of(state),
        );
        self.cycles += 1;
        Ok(())
    }
}

/// Repeats what somebody did to the controller during the run. What the operator of the scenario does is done twice,
/// which changes nothing.
fn intervene(event: &Event, controller: &mut dyn Controller, duties: &Duties, run: &RecordedRun) {
    if event.cause == masseter_runtime::messages::codes::Cause::StopRequested.code() {
        controller.request_stop();
    } else if let Some(name) = run.parameter(event.object as usize) {
        // Another controller may have no such parameter.
        let _ = duties.named.settings().set(name, event.value);
    }
}

/// The wake-up that a state holds.
fn wake_of(state: &State) -> Wake {
    Wake {
        cycle: state.cycle,
        due_ns: state.due_ns,
        woke_ns: state.woke_ns,
        skipped: state.skipped_cycles,
        account: Account {
            stalled_ns: state.stalled_ns,
            spun_ns: state.spun_ns,
            worked_ns: state.worked_ns,
            overlong_ns: state.overlong_ns,
        },
    }
}
