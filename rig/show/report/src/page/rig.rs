//! How the rig ran: latencies with their budgets, messages and buses, machine and scheduling.

use std::collections::BTreeMap;

use masseter_judge::{
    Band, BusResponse, Figures, IntervalFigures, ResponseFigures, TopicFigures, WorstCycle,
};
use masseter_page::{
    Across, Block, Cell, Chart, Column, Limit, Points, Scale, Section, Series, Style, Table, Tone,
};
use masseter_recording::{Manifest, Usage};
use masseter_runtime::{realtime::scheduling::Obtained, schedule::CycleSchedule};
use masseter_scenario::{MotionConfig, Scenario, wording::grouped};

use super::times::{limit, motion_s, plain, since_s};
use crate::table;
use crate::text::{microseconds, or_dash, us};

/// The least latency that a logarithmic axis shows, µs.
const LEAST_US: f64 = 0.01;

/// The intervals that are shown at first; a click on their names shows the others.
const SHOWN: [&str; 4] =
    ["plant wake-up corrected", "controller wake-up corrected", "controller cycle", "round trip"];

const SIMULATED: &str = "In simulated time no wake-up is late, and every interval follows from the model.";

const P999: &str = "p99.9 needs 10,000 samples. A skipped deadline has a sample only in the two wake-ups named corrected (for \
coordinated omission): the time until the wake-up that skipped it.";

const LONGEST: &str = "The longest cycles, from the plant's deadline to the command on the wire, or to the first later command \
where a newer one overtook it. The hop is the one furthest above its median. The last three columns are the kernel's counters \
between two samples, a tenth of a second apart: time that the hypervisor took (in steps of 10 ms), times that a loop lost its \
core, and page faults of both processes.";

pub(super) fn timing_section(manifest: &Manifest, figures: &Figures) -> Section {
    let (skips, readings) = (table::skips(figures), table::readings(&figures.readings));
    let skipped = format!("Skipped {skips}. Controller's {readings}.");
    let [percentiles, histogram] = distributions(&manifest.scenario, figures);
    let percentiles = Block::chart("percentiles", percentiles);
    let latencies = Block::table("latencies", latencies(&figures.intervals)).folded("Latencies in numbers");
    let worst = Block::table("worst", longest(figures));
    let blocks = if manifest.is_in_real_time() {
        vec![
            Block::chart("histogram", histogram),
            percentiles,
            latencies,
            Block::text("percentiles-in-words", P999),
            Block::text("skipped", skipped),
            wake_ups(figures),
            Block::text("worst-in-words", LONGEST),
            worst,
        ]
    } else {
        vec![
            Block::text("simulated", SIMULATED),
            percentiles.folded("Latency by percentile"),
            latencies,
            worst.folded("Longest cycles"),
        ]
    };
    Section::new("timing", "Timing", blocks)
}

/// Percentiles and histogram of every interval, with the cycle's budgets beside the percentiles.
fn distributions(scenario: &Scenario, figures: &Figures) -> [Chart; 2] {
    type PointsOf = fn(&IntervalFigures) -> Vec<(f64, f64)>;
    let chart = |title: &str, unit: &str, across, points: PointsOf| {
        let measured = figures.intervals.iter().filter(|interval| interval.max_ns > Some(0));
        let series = measured.map(|interval| Series {
            is_hidden: !SHOWN.contains(&interval.name),
            ..Series::new(interval.name, Style::Plain, Points::plain(&points(interval)))
        });
        let (series, otherwise) = (series.collect(), "No interval was measured.".to_owned());
        Chart { across, scale: Scale::Log, series, otherwise, ..Chart::over_time(title, unit) }
    };
    let percentiles = chart("Latency by percentile", "µs", Across::Percentile, |of| {
        of.curve.iter().map(|&(x, ns)| (x, in_us(ns as f64))).collect()
    });
    let histogram = chart("Latency histogram", "samples", Across::Duration, |of| {
        of.buckets.iter().map(|&(ns, n)| (in_us(ns as f64), n as f64)).collect()
    });
    [Chart { limits: budgets(scenario), height: 330, ..percentiles }, Chart { height: 240, ..histogram }]
}

/// What the time table leaves: the period, and from the controller's deadline to the latest command.
fn budgets(scenario: &Scenario) -> Vec<Limit> {
    let period_ns = scenario.period_ns();
    let mut budgets = vec![limit("budget: the period", &[period_ns as f64 / 1e3])];
    if let Ok(schedule) = CycleSchedule::new(scenario) {
        let controller_us = (schedule.command_by_ns - schedule.controller_at_ns) as f64 / 1e3;
        budgets.push(limit("budget: controller", &[controller_us]));
    }
    budgets
}

/// The latest wake-ups over time.
fn wake_ups(figures: &Figures) -> Block {
    let late = |(name, band): (&str, &Band)| {
        let late = band.highest().into_iter().map(|(at_s, late_ns)| (at_s, in_us(late_ns)));
        Series::new(name, Style::Plain, Points::over_time(&late.collect::<Vec<_>>()))
    };
    let chart = Chart {
        scale: Scale::Log,
        series: ["controller", "plant"].into_iter().zip(&figures.over_time.late_ns).map(late).collect(),
        ..Chart::over_time("Latest wake-up after its deadline", "µs")
    };
    Block::chart("jitter", chart)
}

fn in_us(ns: f64) -> f64 {
    (ns / 1e3).max(LEAST_US)
}

fn latencies(intervals: &[IntervalFigures]) -> Table {
    let numbers = Column::numbers(&["n", "p50, µs", "p99, µs", "p99.9, µs", "max, µs"]);
    Table::new("Latencies", [Column::texts(&["interval"]), numbers], intervals.iter().map(table::latency))
}

fn longest(figures: &Figures) -> Table {
    let row = |worst: &WorstCycle| {
        let count = |count: Option<u64>| or_dash(count, |count| count.to_string());
        let at_s = since_s(figures, worst.due_ns) - motion_s(figures).unwrap_or(0.0);
        [
            worst.cycle.to_string(),
            format!("{at_s:.3}"),
            microseconds(worst.total_ns),
            worst.hop.to_owned(),
            microseconds(worst.hop_ns),
            microseconds(worst.hop_p50_ns),
            microseconds(worst.stalled_ns),
            us(worst.around.stolen_ns),
            count(worst.around.involuntary_switches),
            count(worst.around.page_faults),
        ]
    };
    let of_hop = ["hop took, µs", "median, µs"];
    let of_machine = ["stalls while waiting, µs", "stolen, µs", "preempted", "page faults"];
    let columns = [
        Column::texts(&["cycle"]),
        Column::numbers(&["at, s of the motion", "took, µs"]),
        Column::texts(&["hop"]),
        Column::numbers(&of_hop),
        Column::numbers(&of_machine),
    ];
    Table::new("Longest cycles", columns, figures.worst_cycles.iter().map(row))
}

/// What stands in the place of all that the frames would show.
const WITHOUT_FRAMES: &str = "The CAN frames are not recorded (recording.frames = false): the run has no load of the buses, no \
     response times and no candump logs.";

pub(super) fn buses_section(figures: &Figures) -> Section {
    let response = &figures.bus_response;
    let mut blocks = match figures.frames {
        Some(_) => vec![
            Block::chart("buses", load(figures)),
            Block::table("responses", responses(&response.messages)).folded(responses_in_words(response)),
        ],
        None => vec![Block::text("buses", WITHOUT_FRAMES)],
    };
    if let Some(why) = response.unbounded.as_ref().filter(|_| figures.frames.is_some()) {
        blocks.push(Block::text("unbounded", format!("No bounds hold for this run: {why}.")));
    }
    blocks.push(Block::table("topics", topics(&figures.topics)).folded(topics_in_words(&figures.topics)));
    Section::new("messages", "Messages and buses", blocks)
}

fn responses_in_words(response: &BusResponse) -> String {
    let tightest = response.tightest().map_or_else(String::new, |message| {
        let (max, bound) = (us(message.max_ns), us(message.bound_ns));
        format!("; closest to its bound: {} on can{} with {max} of {bound} µs", message.message, message.bus)
    });
    format!(
        "Response times from the queueing to the end of a frame, beside the worst case by the plan{tightest}"
    )
}

fn topics_in_words(topics: &[TopicFigures]) -> String {
    let sum = |count: fn(&TopicFigures) -> u64| grouped(topics.iter().map(count).sum());
    format!("Messages: {} recorded, {} dropped", sum(|topic| topic.messages), sum(|topic| topic.missing))
}

/// Share of each bus in use.
fn load(figures: &Figures) -> Chart {
    let loads = figures.over_time.bus_load().enumerate();
    Chart {
        series: loads.map(|(bus, load)| plain(&format!("can{bus}"), &load, 100.0)).collect(),
        limits: vec![limit("full", &[100.0])],
        otherwise: "No frame was recorded.".to_owned(),
        ..Chart::over_time("Load of the buses", "%")
    }
}

fn responses(messages: &[ResponseFigures]) -> Table {
    let row = |message: &ResponseFigures| -> [Cell; 4] {
        let max = us(message.max_ns);
        let max = if message.exceeds() { Cell::Mark { mark: max, tone: Tone::Bad } } else { max.into() };
        let name = format!("can{} {}", message.bus, message.message);
        [name.into(), message.frames.to_string().into(), max, us(message.bound_ns).into()]
    };
    let columns = [Column::texts(&["message"]), Column::numbers(&["frames", "max, µs", "bound, µs"])];
    Table::new("Response times of the buses' messages", columns, messages.iter().map(row))
}

fn topics(topics: &[TopicFigures]) -> Table {
    let row = |topic: &TopicFigures| {
        [topic.topic.to_owned(), topic.messages.to_string(), topic.missing.to_string()]
    };
    let columns = [Column::texts(&["topic"]), Column::numbers(&["messages", "dropped"])];
    Table::new("Messages of the topics", columns, topics.iter().map(row))
}

pub(super) fn circumstances_section(manifest: &Manifest) -> Section {
    let Manifest { masseter, clock, machine, usage, .. } = manifest;
    let began = manifest.began.trim_end_matches('Z').replace('T', " ");
    let of_machine = format!("{}, {} cores, {}", machine.cpu, machine.cores, machine.kernel);
    let again = format!(
        "The same run again: `masseter run scenario.toml --clock {clock}` with the scenario of this folder."
    );
    let mut blocks = vec![
        Block::text("machine", format!("{began} UTC, masseter {masseter}, {clock} clock. {of_machine}.")),
        Block::text("again", again),
    ];
    if let MotionConfig::File(file) = &manifest.scenario.motion {
        blocks.push(Block::text("played", format!("Recording played: `{}`.", file.path.display())));
    }
    for (process, obtained) in &manifest.scheduling {
        blocks.push(Block::text(format!("scheduling-{process}"), scheduling(process, obtained)));
    }
    if !usage.processes.is_empty() {
        let stolen = "Stolen from the machine by its hypervisor, as far as it reports that";
        blocks.push(Block::table("usage", resources(&usage.processes)));
        blocks.push(Block::text("stolen", format!("{stolen}: {:.2} s.", usage.stolen_s)));
    }
    Section::new("circumstances", "Circumstances", blocks)
}

fn scheduling(process: &str, obtained: &Obtained) -> String {
    let core = obtained.core.map_or_else(|| "any core".to_owned(), |core| format!("core {core}"));
    let policy = obtained.fifo_priority.map(|priority| format!("SCHED_FIFO {priority}"));
    let policy = policy.unwrap_or_else(|| "ordinary scheduling".to_owned());
    let memory = if obtained.locked_memory { "locked" } else { "pageable" };
    let refusals = obtained.refusals.iter().map(|refusal| format!(" {refusal}"));
    format!("{process}: {core}, {policy}, {memory} memory.{}", refusals.collect::<String>())
}

fn resources(processes: &BTreeMap<String, Usage>) -> Table {
    let row = |(process, usage): (&String, &Usage)| {
        [
            process.clone(),
            format!("{:.1}", usage.share() * 100.0),
            usage.voluntary_switches.to_string(),
            usage.involuntary_switches.to_string(),
            usage.minor_faults.to_string(),
            usage.major_faults.to_string(),
        ]
    };
    let numbers =
        ["CPU, % of a core", "waits", "times its core was taken", "page faults, memory", "page faults, disk"];
    let columns = [Column::texts(&["process, in its steady state"]), Column::numbers(&numbers)];
    Table::new("Resources of the processes in their steady state", columns, processes.iter().map(row))
}
