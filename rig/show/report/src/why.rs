//! Until when a failed run could still pass: the answer of `masseter why`, and its section of the page. Finds nothing itself.

use masseter_page::{Block, Cell, Chart, Column, Moment, MomentKind, Points, Section, Series, Style, Table};
use serde::Serialize;

/// Until when a failed run could still pass.
#[derive(Debug, Serialize)]
pub struct Why {
    /// The verdict of the run and its reason.
    pub verdict: String,
    /// What is taken away, in words.
    pub without: String,
    /// The check whose margin is followed; none of a safe stop.
    pub check: Option<String>,
    /// Unit of the margins; empty where there is none.
    pub margin_unit: String,
    /// From the run's begin on, without a gap: whether the rest passes if nothing acts from there on.
    pub intervals: Vec<Interval>,
    /// The last instant from which it passes.
    pub last_way_back: Instant,
    /// The signals that leave their nominal values first after that instant, the largest change first.
    pub left_first: Vec<Left>,
    /// The first report of a fault from that instant on.
    pub detection: Option<Detected>,
    /// Every instant that was looked at.
    pub looks: Vec<Look>,
}

/// An instant between two cycles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Instant {
    /// The number of the last cycle before.
    pub cycle: u64,
    /// Time of the SYNC after, from which nothing acts, s since the motion began; none before.
    pub motion_s: Option<f64>,
}

/// Instants with one result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Interval {
    /// The first of them.
    pub from_cycle: u64,
    /// The last of them.
    pub to_cycle: u64,
    /// The result.
    pub passes: bool,
}

/// A signal that left its nominal value.
#[derive(Debug, Serialize)]
pub struct Left {
    /// Its name.
    pub signal: String,
    /// Its unit; may be empty.
    pub unit: String,
    /// The cycle in which it did.
    pub cycle: u64,
    /// Without faults and stimuli from the last way back on.
    pub nominal: f64,
    /// In the run.
    pub found: f64,
}

/// A report of a fault.
#[derive(Debug, Serialize)]
pub struct Detected {
    /// Its cycle.
    pub cycle: u64,
    /// The event in words.
    pub event: String,
    /// From the last way back on, ms.
    pub after_ms: f64,
}

/// An instant that was looked at.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Look {
    /// The number of the last cycle before.
    pub cycle: u64,
    /// Whether the rest of the run passes.
    pub passes: bool,
    /// The margin of the check there.
    pub margin: Option<f64>,
}

impl Left {
    /// The change as a share of the nominal value.
    #[must_use]
    pub fn share(&self) -> f64 {
        (self.found - self.nominal).abs() / self.nominal.abs().max(f64::MIN_POSITIVE)
    }
}

/// The section of the page; times are those of SYNCs with this period, s.
pub(crate) fn why_section(why: &Why, period_s: f64) -> Section {
    let Why { without, check, margin_unit, last_way_back, left_first, detection, looks, intervals, .. } = why;
    let at_s = |cycle: u64| cycle as f64 * period_s;
    let last_s = at_s(last_way_back.cycle);
    let passes =
        format!("last way back: without {without} from here on, the run passes; a cycle later it fails");
    let report = detection.as_ref().map(|found| {
        [Cell::Time { at_s: at_s(found.cycle - 1) }, format!("first report: {}", found.event).into()]
    });
    let moments = [Some([Cell::Time { at_s: last_s }, passes.into()]), report];
    let way_back = Table::new(
        "Until when the run could pass",
        [Column::texts(&["at", "what"])],
        moments.into_iter().flatten(),
    );
    let numbers = Column::numbers(&["in the run", "nominal"]);
    let row = |left: &Left| -> [Cell; 3] {
        let [found, nominal] = [left.found, left.nominal].map(|value| format!("{value:.4} {}", left.unit));
        [left.signal.clone().into(), found.into(), nominal.into()]
    };
    let title = "Signals that leave their nominal values first after that instant";
    let left = Table::new(title, [Column::texts(&["signal"]), numbers], left_first.iter().map(row));
    let margins: Vec<_> = looks.iter().filter_map(|look| Some((at_s(look.cycle), look.margin?))).collect();
    let results: Vec<_> =
        looks.iter().map(|look| (at_s(look.cycle), f64::from(u8::from(look.passes)))).collect();
    let last = "last way back";
    let moments =
        vec![Moment { at_s: last_s, kind: MomentKind::Note, name: last.to_owned(), text: last.to_owned() }];
    let (title, points) = match check {
        Some(check) => (format!("Margin of '{check}' if nothing acts from this instant on"), margins),
        None => ("Result if nothing acts from this instant on: 1 passes, 0 fails".to_owned(), results),
    };
    let series = vec![Series::new("the rest of the run", Style::True, Points::plain(&points))];
    let chart = Chart { series, moments, ..Chart::over_time(title, margin_unit.as_str()) };
    let mut blocks =
        vec![Block::table("why", way_back), Block::table("why-left", left), Block::chart("why-looks", chart)];
    if intervals.len() > 2 {
        let row = |of: &Interval| -> [Cell; 3] {
            let word = if of.passes { "passes" } else { "fails" };
            [Cell::Time { at_s: at_s(of.from_cycle) }, Cell::Time { at_s: at_s(of.to_cycle) }, word.into()]
        };
        let columns = [Column::texts(&["nothing acts from", "to", "the run"])];
        blocks.push(Block::table(
            "why-intervals",
            Table::new("Every change of the result", columns, intervals.iter().map(row)),
        ));
    }
    Section::new("why", "Why", blocks)
}
