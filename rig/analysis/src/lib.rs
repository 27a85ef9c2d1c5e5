//! What a recording says of its run, in one pass: latencies, tracking, losses, events; and the same
//! as files for other tools.
//!
//! Nothing is judged here; see the crate `masseter-report`.

mod answer;
mod blame;
mod bus_response;
mod coded;
mod cycle_path;
mod events;
mod exports;
mod freshness;
pub mod hlog;
mod hops;
mod interval;
mod intervals;
mod join;
mod kernel_counts;
mod longest_cycles;
mod measured;
mod noise;
mod outage;
mod over_time;
mod response;
mod sequence;
mod series;
mod skips;
mod stalls;
mod tracking;

use std::path::PathBuf;

use masseter_shared::config::Scenario;
use masseter_shared::messages::codes::ControllerState;
use masseter_shared::messages::{Command, Event, FrameTap, Message, Reading, State, Truth};
use serde::Serialize;

pub use blame::Suspicion;
pub use bus_response::{BusResponse, ResponseFigures};
pub use coded::Coded;
use events::EventLog;
pub use events::EventRecord;
pub use exports::CandumpLogs;
use freshness::Freshness;
pub use freshness::ReadingFigures;
pub use hops::Hop;
use intervals::Intervals;
pub use kernel_counts::KernelCounts;
use longest_cycles::LongestCycles;
pub use longest_cycles::WorstCycle;
use masseter_recording::RunFolder;
use masseter_recording::{Damage, ReadError, Reader, Recorded};
pub use measured::IntervalFigures;
pub use measured::resolution_ns;
pub use outage::Outage;
use outage::OutageWatch;
use over_time::Watch;
pub use over_time::{Curve, OverTime};
use response::Responses;
pub use sequence::SequenceCheck;
pub use sequence::TopicFigures;
pub use skips::SkipFigures;
use skips::{Counters, Skips};
use tracking::Tracking;
pub use tracking::{Accumulator, MOVING};
pub use tracking::{Reference, Track, TrackingFigures, TrackingSample};

/// Takes what is not wanted as a file.
pub(crate) const NOWHERE: &str = "/dev/null";

/// Why a run could not be analysed.
#[derive(Debug, thiserror::Error)]
pub enum AnalysisError {
    /// The recording.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A message on topic `frame` that holds no CAN frame.
    #[error("the recording holds a frame that is none: {0}")]
    Frame(#[from] masseter_shared::messages::tap::TapError),
    /// One of the files made from it.
    #[error("cannot write {}: {error}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        #[source]
        error: std::io::Error,
    },
}

/// Everything a run is reported and judged by.
#[derive(Debug, Clone, Serialize)]
pub struct Figures {
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
    /// Stretches of work that cost deadlines, beside the machine's known stalls; none without any.
    pub suspicion: Option<Suspicion>,
    /// Where the controller's sequence ended; none without a single state message.
    pub final_state: Option<Coded<ControllerState>>,
    /// Deadlines missed just before a safe stop; none without one.
    pub outage: Option<Outage>,
    /// Distance of the platform from where it should be, while the motion played.
    pub tracking: TrackingFigures,
    /// The greatest force with which the emulated jaw bit on food, N; none without food, and on the robot.
    pub bite_force_max_n: Option<f64>,
    /// Measured intervals.
    pub intervals: Vec<IntervalFigures>,
    /// The cycles that took longest, with the hop to blame.
    pub worst_cycles: Vec<WorstCycle>,
    /// Messages and losses of each topic.
    pub topics: Vec<TopicFigures>,
    /// Frames on each bus.
    pub frames: Vec<u64>,
    /// Response times of the buses' messages, beside their bounds.
    pub bus_response: BusResponse,
    /// What happened, in order.
    pub events: Vec<EventRecord>,
    /// Whether the recording ends in the middle of a record.
    pub cut_short: bool,
    /// Stretches of the recording that cannot be read.
    pub damage: Vec<Damage>,
    /// Tracking over time, for plots.
    #[serde(skip)]
    pub track: Track,
    /// The run along its time, for plots.
    #[serde(skip)]
    pub over_time: OverTime,
}

impl Figures {
    /// Deadlines that the two processes skipped, and those of them that the machine is to blame for:
    /// because it stood still while they waited, or may as well have while they worked.
    pub fn skipped(&self) -> (u64, u64) {
        let (controller, plant) = (&self.controller_skips, &self.plant_skips);
        let is_machine = self.suspicion.is_some_and(|suspicion| suspicion.may_be_the_machine());
        let while_working = if is_machine { controller.while_working + plant.while_working } else { 0 };
        (controller.skipped + plant.skipped, controller.by_machine + plant.by_machine + while_working)
    }

    /// Skipped deadlines whose cause the recording does not tell.
    pub fn skipped_of_unknown_cause(&self) -> u64 {
        self.controller_skips.unknown_cause + self.plant_skips.unknown_cause
    }

    /// Whether the machine is to blame for every deadline that was skipped.
    pub fn only_the_machine(&self) -> bool {
        let (skipped, by_machine) = self.skipped();
        by_machine == skipped
    }

    /// Messages that were published and not recorded.
    pub fn missing_messages(&self) -> u64 {
        self.topics.iter().map(|topic| topic.missing).sum()
    }
}

/// Reads the run's recording, writes `hist/`, `can*.log` and `events.jsonl` beside it, and returns
/// the figures.
pub fn analyse(folder: &RunFolder, scenario: &Scenario) -> Result<Figures, AnalysisError> {
    read(folder, Some(folder), scenario)
}

/// The same without a file: what would be written goes nowhere.
pub fn look(folder: &RunFolder, scenario: &Scenario) -> Result<Figures, AnalysisError> {
    read(folder, None, scenario)
}

fn read(
    folder: &RunFolder,
    exports: Option<&RunFolder>,
    scenario: &Scenario,
) -> Result<Figures, AnalysisError> {
    let mut reader = Reader::open(&folder.recording())?;
    let mut pass = Pass::new(exports, scenario)?;
    while let Some(message) = reader.next_message()? {
        pass.take(&message)?;
    }
    pass.finish(&reader)
}

/// The state of the one pass over a recording.
struct Pass {
    period_ns: u64,
    intervals: Intervals,
    longest_cycles: LongestCycles,
    tracking: Tracking,
    sequence: SequenceCheck,
    candump: CandumpLogs,
    events: EventLog,
    watch: Watch,
    responses: Responses,
    cycles: u64,
    freshness: Freshness,
    first_sample_ns: Option<u64>,
    last_sample_ns: u64,
    controller_skips: Skips,
    plant_skips: Skips,
    outage: OutageWatch,
    final_state: Option<Coded<ControllerState>>,
    bite_force_max_n: Option<f64>,
}

impl Pass {
    fn new(exports: Option<&RunFolder>, scenario: &Scenario) -> Result<Self, AnalysisError> {
        let reference = if scenario.can.is_virtual() { Reference::Truth } else { Reference::Estimate };
        Ok(Self {
            period_ns: scenario.period_ns(),
            intervals: Intervals::new(exports.map(RunFolder::histograms).as_deref(), scenario.period_ns())?,
            longest_cycles: LongestCycles::default(),
            tracking: Tracking::against(reference, scenario.period_ns()),
            sequence: SequenceCheck::default(),
            candump: CandumpLogs::new(exports.map(RunFolder::path), &scenario.can.interfaces),
            events: EventLog::create(exports.map_or_else(|| NOWHERE.into(), RunFolder::events))?,
            watch: Watch::on(scenario.can.rates().ok()),
            responses: Responses::on(scenario),
            cycles: 0,
            freshness: Freshness::default(),
            first_sample_ns: None,
            last_sample_ns: 0,
            controller_skips: Skips::default(),
            plant_skips: Skips::default(),
            outage: OutageWatch::default(),
            final_state: None,
            // On the robot nobody knows.
            bite_force_max_n: scenario.food.filter(|_| scenario.can.is_virtual()).map(|_| 0.0),
        })
    }

    fn take(&mut self, message: &Recorded) -> Result<(), AnalysisError> {
        self.sequence.take(message);
        match message {
            Recorded::Command(command) => self.command(command),
            Recorded::Reading(reading) => self.reading(reading),
            Recorded::State(state) => self.state(state),
            Recorded::Truth(truth) => self.truth(truth),
            Recorded::Frame(frame) => self.frame(frame)?,
            Recorded::Event(event) => self.event(event),
            Recorded::Machine(machine) => self.longest_cycles.machine(machine),
        }
        Ok(())
    }

    fn command(&mut self, command: &Command) {
        self.intervals.command(command);
        self.longest_cycles.command(command);
    }

    fn reading(&mut self, reading: &Reading) {
        self.intervals.reading(reading);
        self.longest_cycles.reading(reading);
        self.watch.reading(reading);
        self.outage.reading(reading);
        self.plant_skips.take(&Counters::from(reading), self.period_ns);
        self.first_sample_ns.get_or_insert(reading.sampled_ns);
        self.last_sample_ns = reading.sampled_ns;
    }

    fn state(&mut self, state: &State) {
        let is_fresh = self.freshness.take(state);
        self.intervals.state(state, is_fresh);
        self.longest_cycles.state(state, is_fresh);
        self.watch.state(state);
        self.outage.state(state);
        if is_fresh {
            self.tracking.solution(state);
        }
        self.cycles = self.cycles.max(state.seq);
        self.controller_skips.take(&Counters::from(state), self.period_ns);
        self.final_state = Some(state.controller_state.into());
    }

    fn truth(&mut self, truth: &Truth) {
        self.tracking.truth(truth);
        self.bite_force_max_n = self.bite_force_max_n.map(|most_n| most_n.max(truth.bite_force_n));
        self.watch.truth(truth);
    }

    fn frame(&mut self, frame: &FrameTap) -> Result<(), AnalysisError> {
        self.watch.frame(frame);
        self.responses.frame(frame)?;
        self.candump.write(frame)
    }

    fn event(&mut self, event: &Event) {
        self.events.write(event);
    }

    fn finish(self, reader: &Reader) -> Result<Figures, AnalysisError> {
        let (tracking, track) = self.tracking.finish();
        let duration_ns =
            self.last_sample_ns.saturating_sub(self.first_sample_ns.unwrap_or(self.last_sample_ns));
        let topics = self.sequence.finish();
        let missing_frames =
            topics.iter().find(|topic| topic.topic == FrameTap::TOPIC).map_or(0, |topic| topic.missing);
        Ok(Figures {
            cycles: self.cycles,
            duration_s: duration_ns as f64 / 1e9,
            suspicion: Suspicion::of(&[&self.controller_skips, &self.plant_skips]),
            controller_skips: self.controller_skips.figures(),
            plant_skips: self.plant_skips.figures(),
            readings: self.freshness.figures(),
            final_state: self.final_state,
            outage: self.outage.finish(self.period_ns),
            tracking,
            bite_force_max_n: self.bite_force_max_n,
            worst_cycles: self.longest_cycles.finish(),
            intervals: self.intervals.finish()?,
            topics,
            frames: self.candump.finish()?.iter().map(|logged| logged.frames).collect(),
            bus_response: self.responses.finish(missing_frames),
            events: self.events.finish()?,
            cut_short: reader.was_cut_short(),
            damage: reader.damage().to_vec(),
            track,
            over_time: self.watch.finish(),
        })
    }
}
