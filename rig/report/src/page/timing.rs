//! Latencies with their budgets, wake-ups over time, and the longest cycles.

use masseter_analysis::{Curve, Figures, IntervalFigures, WorstCycle};
use masseter_page::{
    Across, Block, Cell, Chart, Column, Limit, Points, Scale, Section, Series, Style, Table,
};
use masseter_runtime::schedule::CycleSchedule;
use masseter_scenario::Scenario;

use super::charts::limit;
use super::times::{motion_s, since_s};
use crate::table;
use crate::text::{microseconds, or_dash};

/// The least latency that a logarithmic axis shows, µs.
const LEAST_US: f64 = 0.01;

const P999: &str = "p99.9 needs 10,000 samples. A skipped deadline has a sample only in the two wake-ups named corrected (for \
coordinated omission): the time until the wake-up that skipped it.";

const LONGEST: &str = "The longest cycles, from the plant's deadline to the command on the wire, or to the first later command \
where a newer one overtook it. The hop is the one furthest above its median. The last three columns are the kernel's counters \
between two samples, a tenth of a second apart: time that the hypervisor took (in steps of 10 ms), times that a loop lost its \
core, and page faults of both processes.";

pub(super) fn section(scenario: &Scenario, figures: &Figures) -> Section {
    let blocks = vec![
        Block::chart("percentiles", percentiles(scenario, figures)),
        Block::table("latencies", latencies(&figures.intervals)).folded("Latencies in numbers"),
        Block::text("percentiles-in-words", P999),
        Block::text("skipped", skipped(figures)),
        wake_ups(figures),
        Block::text("worst-in-words", LONGEST),
        Block::table("worst", longest(figures)),
    ];
    Section::new("timing", "Timing", blocks)
}

/// Percentiles of every interval, with the cycle's budgets.
fn percentiles(scenario: &Scenario, figures: &Figures) -> Chart {
    let measured = figures.intervals.iter().filter(|interval| interval.max_ns > Some(0));
    let series = |interval: &IntervalFigures| {
        let points: Vec<_> =
            interval.curve.iter().map(|&(x, value_ns)| (x, in_us(value_ns as f64))).collect();
        Series::new(interval.name, Style::Plain, Points::plain(&points))
    };
    Chart {
        across: Across::Percentile,
        scale: Scale::Log,
        series: measured.map(series).collect(),
        limits: budgets(scenario),
        height: 330,
        otherwise: "No interval was measured.".to_owned(),
        ..Chart::over_time("Latency by percentile", "µs")
    }
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

/// The latest wake-ups over time; words under virtual time, where no wake-up is late.
fn wake_ups(figures: &Figures) -> Block {
    let over_time = &figures.over_time;
    let curves = [("controller", &over_time.controller_late_ns), ("plant", &over_time.plant_late_ns)];
    let is_late = |curve: &Curve| curve.iter().any(|(_, late_ns)| *late_ns > 0.0);
    if !curves.iter().any(|(_, curve)| is_late(curve)) {
        return Block::text("jitter", "Under virtual time no wake-up is late.");
    }
    let late = |(name, curve): (&str, &Curve)| {
        let points: Vec<_> = curve.iter().map(|&(at_s, late_ns)| (at_s, in_us(late_ns))).collect();
        Series::new(name, Style::Plain, Points::over_time(&points))
    };
    let chart = Chart {
        scale: Scale::Log,
        series: curves.map(late).into(),
        ..Chart::over_time("Latest wake-up after its deadline", "µs")
    };
    Block::chart("jitter", chart)
}

fn in_us(ns: f64) -> f64 {
    (ns / 1e3).max(LEAST_US)
}

fn latencies(intervals: &[IntervalFigures]) -> Table {
    let row = |interval: &IntervalFigures| -> Vec<Cell> {
        let values = [interval.p50_ns, interval.p99_ns, interval.p999_ns, interval.max_ns].map(us);
        let words = [interval.name.to_owned(), interval.n.to_string()];
        words.into_iter().chain(values).map(Cell::from).collect()
    };
    let numbers = ["n", "p50, µs", "p99, µs", "p99.9, µs", "max, µs"].map(Column::number);
    Table {
        label: "Latencies".to_owned(),
        columns: [Column::text("interval")].into_iter().chain(numbers).collect(),
        rows: intervals.iter().map(row).collect(),
    }
}

fn skipped(figures: &Figures) -> String {
    let [controller, plant] = [&figures.controller_skips, &figures.plant_skips];
    format!(
        "Skipped cycles: controller {}, plant {}; stalls of the machine while waiting: controller {:.2} ms, plant {:.2} ms. \
         Controller's {}.",
        controller.skipped,
        plant.skipped,
        controller.stalled_ns as f64 / 1e6,
        plant.stalled_ns as f64 / 1e6,
        table::readings(&figures.readings)
    )
}

fn longest(figures: &Figures) -> Table {
    let row = |worst: &WorstCycle| -> Vec<Cell> {
        let count = |count: Option<u64>| or_dash(count, |count| count.to_string());
        let at_s = since_s(figures, worst.due_ns) - motion_s(figures);
        let cells = [
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
        ];
        cells.map(Cell::from).into()
    };
    let columns = vec![
        Column::text("cycle"),
        Column::number("at, s of the motion"),
        Column::number("took, µs"),
        Column::text("hop"),
        Column::number("hop took, µs"),
        Column::number("median, µs"),
        Column::number("stalls while waiting, µs"),
        Column::number("stolen, µs"),
        Column::number("preempted"),
        Column::number("page faults"),
    ];
    let rows = figures.worst_cycles.iter().map(row).collect();
    Table { label: "Longest cycles".to_owned(), columns, rows }
}

fn us(ns: Option<u64>) -> String {
    or_dash(ns, microseconds)
}
