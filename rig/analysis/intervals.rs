//! Measured intervals, each an HdrHistogram over every cycle of the run, and an interval log of it.
//!
//! No series is corrected for coordinated omission: skipped cycles have no samples, and are counted
//! beside the table instead.

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Duration;

use hdrhistogram::Histogram;
use hdrhistogram::serialization::interval_log::IntervalLogWriterBuilder;
use hdrhistogram::serialization::{Deserializer, Serializer, V2DeflateSerializer, V2Serializer};
use masseter_shared::clock::SECOND_NS;
use masseter_shared::messages::{Command, Reading, State};
use serde::Serialize;

use super::AnalysisError;
use super::join::ByCycle;
use super::noise::standard_error;

/// Below this many samples the 99.9th percentile rests on fewer than ten of them and is not given.
const SAMPLES_FOR_P999: u64 = 10_000;
/// Significant decimal digits of a histogram.
const DIGITS: u8 = 3;
/// One line of the interval log covers this much, ns.
const LOG_INTERVAL_NS: u64 = SECOND_NS;

/// One measured interval.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IntervalFigures {
    /// What is measured.
    pub name: &'static str,
    /// Samples.
    pub n: u64,
    /// Median, ns.
    pub p50_ns: u64,
    /// Standard error of the median, by its seconds, ns; none with less than three of them.
    pub p50_noise_ns: Option<f64>,
    /// 99th percentile, ns.
    pub p99_ns: u64,
    /// Standard error of the 99th percentile, by its seconds, ns.
    pub p99_noise_ns: Option<f64>,
    /// 99.9th percentile, ns; only with at least 10,000 samples.
    pub p999_ns: Option<u64>,
    /// Largest, ns.
    pub max_ns: u64,
    /// When the largest was, ns of the run's clock.
    pub max_at_ns: u64,
    /// The distribution, for plots: 1/(1 − quantile) and value in ns.
    #[serde(skip)]
    pub curve: Vec<(f64, u64)>,
}

/// Names of the intervals, in the order in which a cycle passes through them.
const NAMES: [&str; 11] = [
    "plant wake-up",
    "process data",
    "controller wake-up",
    "reading transport",
    "forward kinematics",
    "control",
    "controller cycle",
    "command transport",
    "command to wire",
    "sample to wire",
    "round trip",
];

#[derive(Debug, Clone, Copy)]
enum Interval {
    PlantWakeUp,
    ProcessData,
    ControllerWakeUp,
    ReadingTransport,
    ForwardKinematics,
    Control,
    ControllerCycle,
    CommandTransport,
    CommandToWire,
    SampleToWire,
    /// From SYNC to the reading's publication and from its reception to the command's: what both processes and
    /// the wires take, without the waits of the time table.
    RoundTrip,
}

#[derive(Debug, Clone, Copy)]
struct Sent {
    published_ns: u64,
    reading_cycle: u64,
}

/// All intervals of a run, and what is needed to join the messages they lie between.
pub(super) struct Intervals {
    series: Vec<Series>,
    readings_published: ByCycle<u64>,
    samples: ByCycle<u64>,
    /// From SYNC to the publication of the reading, ns.
    exchanges: ByCycle<u64>,
    /// When the controller received the reading of the same cycle.
    received: ByCycle<u64>,
    /// When the plant received the command.
    answered: ByCycle<u64>,
    commands: ByCycle<Sent>,
    last_answered: u64,
}

impl Intervals {
    pub(super) fn new(folder: &Path) -> Result<Self, AnalysisError> {
        fs::create_dir_all(folder)
            .map_err(|error| AnalysisError::Write { path: folder.to_owned(), error })?;
        Ok(Self {
            series: NAMES.iter().map(|name| Series::new(name, folder)).collect(),
            readings_published: ByCycle::default(),
            samples: ByCycle::default(),
            exchanges: ByCycle::default(),
            received: ByCycle::default(),
            answered: ByCycle::default(),
            commands: ByCycle::default(),
            last_answered: 0,
        })
    }

    fn add(&mut self, interval: Interval, from_ns: u64, to_ns: u64) {
        self.series[interval as usize].add(to_ns.saturating_sub(from_ns), to_ns);
    }

    pub(super) fn reading(&mut self, reading: &Reading) {
        self.add(Interval::PlantWakeUp, reading.due_ns, reading.woke_ns);
        if reading.complete_ns > 0 {
            self.add(Interval::ProcessData, reading.sampled_ns, reading.complete_ns);
        }
        self.readings_published.insert(reading.cycle, reading.published_ns);
        self.samples.insert(reading.cycle, reading.sampled_ns);
        self.exchanges.insert(reading.cycle, reading.published_ns.saturating_sub(reading.woke_ns));
        self.answer(reading);
    }

    /// What became of the command that a reading answers; once for each command.
    fn answer(&mut self, reading: &Reading) {
        let Some(sent) = self.commands.get(reading.answers_cycle) else { return };
        if reading.answers_cycle == self.last_answered {
            return;
        }
        self.last_answered = reading.answers_cycle;
        self.add(Interval::CommandTransport, sent.published_ns, reading.command_received_ns);
        self.answered.insert(reading.answers_cycle, reading.command_received_ns);
        self.round_trip(reading.answers_cycle);
        if reading.command_sent_ns == 0 {
            return;
        }
        self.add(Interval::CommandToWire, reading.command_received_ns, reading.command_sent_ns);
        if let Some(sampled_ns) = self.samples.get(sent.reading_cycle) {
            self.add(Interval::SampleToWire, sampled_ns, reading.command_sent_ns);
        }
    }

    pub(super) fn state(&mut self, state: &State) {
        self.add(Interval::ControllerWakeUp, state.due_ns, state.woke_ns);
        if state.reading_cycle != state.cycle {
            return;
        }
        self.received.insert(state.cycle, state.received_ns);
        self.round_trip(state.cycle);
        if let Some(published_ns) = self.readings_published.get(state.reading_cycle) {
            self.add(Interval::ReadingTransport, published_ns, state.received_ns);
        }
        self.add(Interval::ForwardKinematics, state.received_ns, state.solved_ns);
        self.add(Interval::Control, state.solved_ns, state.commanded_ns);
        if let Some(sent) = self.commands.get(state.cycle) {
            self.add(Interval::ControllerCycle, state.received_ns, sent.published_ns);
        }
    }

    /// Joins what plant and controller tell of a cycle, whichever is heard first.
    fn round_trip(&mut self, cycle: u64) {
        let (Some(from_ns), Some(to_ns)) = (self.received.get(cycle), self.answered.get(cycle)) else {
            return;
        };
        if let Some(exchange_ns) = self.exchanges.take(cycle) {
            self.add(Interval::RoundTrip, from_ns, to_ns + exchange_ns);
        }
    }

    pub(super) fn command(&mut self, command: &Command) {
        let sent = Sent { published_ns: command.published_ns, reading_cycle: command.reading_cycle };
        self.commands.insert(command.cycle, sent);
    }

    pub(super) fn finish(self) -> Result<Vec<IntervalFigures>, AnalysisError> {
        self.series.into_iter().map(Series::finish).collect()
    }
}

/// The distribution as HdrHistogram plots it; the largest value stands where its own share ends.
fn curve(total: &Histogram<u64>) -> Vec<(f64, u64)> {
    let points = total.iter_quantiles(5).map(|step| (step.quantile_iterated_to(), step.value_iterated_to()));
    let samples = total.len() as f64;
    points.map(|(quantile, value)| ((1.0 / (1.0 - quantile)).min(samples), value)).collect()
}

/// One interval: the whole run's histogram, and one for each second of it.
struct Series {
    name: &'static str,
    path: PathBuf,
    total: Histogram<u64>,
    max_at_ns: u64,
    second: Histogram<u64>,
    second_began_ns: u64,
    /// Past seconds, serialised: a hundredth of their size in memory.
    seconds: Vec<(u64, Vec<u8>)>,
    medians_ns: Vec<f64>,
    p99s_ns: Vec<f64>,
}

fn histogram() -> Histogram<u64> {
    Histogram::new(DIGITS).expect("three digits are allowed")
}

impl Series {
    fn new(name: &'static str, folder: &Path) -> Self {
        let path = folder.join(format!("{}.hlog", name.replace(' ', "-")));
        let (total, second) = (histogram(), histogram());
        Self {
            name,
            path,
            total,
            max_at_ns: 0,
            second,
            second_began_ns: 0,
            seconds: Vec::new(),
            medians_ns: Vec::new(),
            p99s_ns: Vec::new(),
        }
    }

    fn add(&mut self, value_ns: u64, at_ns: u64) {
        if value_ns > self.total.max() || self.total.is_empty() {
            self.max_at_ns = at_ns;
        }
        if at_ns >= self.second_began_ns + LOG_INTERVAL_NS {
            self.close_second();
            self.second_began_ns = at_ns;
        }
        for histogram in [&mut self.total, &mut self.second] {
            histogram.record(value_ns).expect("a histogram that resizes itself takes any value");
        }
    }

    fn close_second(&mut self) {
        if self.second.is_empty() {
            return;
        }
        let mut bytes = Vec::new();
        V2Serializer::new().serialize(&self.second, &mut bytes).expect("memory takes any histogram");
        self.seconds.push((self.second_began_ns, bytes));
        self.medians_ns.push(self.second.value_at_quantile(0.50) as f64);
        self.p99s_ns.push(self.second.value_at_quantile(0.99) as f64);
        self.second.reset();
    }

    fn finish(mut self) -> Result<IntervalFigures, AnalysisError> {
        self.close_second();
        self.write_log().map_err(|error| AnalysisError::Write { path: self.path.clone(), error })?;
        let total = &self.total;
        Ok(IntervalFigures {
            name: self.name,
            n: total.len(),
            p50_ns: total.value_at_quantile(0.50),
            p50_noise_ns: standard_error(&self.medians_ns),
            p99_ns: total.value_at_quantile(0.99),
            p99_noise_ns: standard_error(&self.p99s_ns),
            p999_ns: (total.len() >= SAMPLES_FOR_P999).then(|| total.value_at_quantile(0.999)),
            max_ns: total.max(),
            max_at_ns: self.max_at_ns,
            curve: curve(total),
        })
    }

    /// HdrHistogram V2 interval log: a line a second, times relative to the first sample.
    fn write_log(&self) -> std::io::Result<()> {
        let mut file = BufWriter::new(File::create(&self.path)?);
        let mut serializer = V2DeflateSerializer::new();
        let mut log = IntervalLogWriterBuilder::new()
            .add_comment(&format!("masseter: {}, ns", self.name))
            .with_max_value_divisor(1.0)
            .begin_log_with(&mut file, &mut serializer)?;
        let first_ns = self.seconds.first().map_or(0, |(start, _)| *start);
        for (start_ns, bytes) in &self.seconds {
            let second: Histogram<u64> =
                Deserializer::new().deserialize(&mut bytes.as_slice()).expect("serialised above");
            let start = Duration::from_nanos(start_ns - first_ns);
            log.write_histogram(&second, start, Duration::from_nanos(LOG_INTERVAL_NS), None)
                .map_err(|error| std::io::Error::other(format!("{error:?}")))?;
        }
        Ok(())
    }
}
